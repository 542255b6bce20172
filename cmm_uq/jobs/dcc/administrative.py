"""Texts and administrative data of a DCC: software, identifications, the item, the laboratory, the customer."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from typing import Annotated, ClassVar

from cmm_uq.jobs.dcc.fields import (
    BOOLEAN,
    BYTES,
    COUNTRY,
    DATE,
    LANGUAGE,
    NAME,
    NAMES,
    NOT_EMPTY,
    STRING,
    STRINGS,
    Attribute,
    Child,
    Choice,
    Content,
    Element,
    ForeignElements,
    Many,
    one_of,
)
from cmm_uq.jobs.dcc.quantities import Complex, Constant, Hybrid, Real, RealList
from cmm_uq.jobs.dcc.tree import Node

Id = Annotated[str | None, Attribute("id", NAME)]
RefId = Annotated[tuple[str, ...], Attribute("refId", NAMES)]
RefType = Annotated[tuple[str, ...], Attribute("refType", STRINGS)]


class Identified(Element):
    """With an id, and what it is by the vocabularies of good practice."""

    id: Id = None
    ref_type: RefType = ()


class Referring(Identified):
    """That may refer to others by their ids."""

    ref_id: RefId = ()


class LanguageText(Element, kw_only=False):
    """A text in a language (``stringWithLangType``)."""

    text: Annotated[str, Content(STRING)]
    language: Annotated[str | None, Attribute("lang", LANGUAGE)] = None
    id: Id = None
    ref_id: RefId = ()
    ref_type: RefType = ()


class Words(Element, kw_only=False):
    """The same text in its languages (``textType``)."""

    contents: Annotated[tuple[LanguageText, ...], Many("content")]
    id: Id = None

    def __str__(self) -> str:
        return text_of(self.contents)


class Latex(Element, kw_only=False):
    """A formula (``formulaType``), as LaTeX or MathML."""

    latex: Annotated[str | None, Child("latex", STRING)] = None
    mathml: Annotated[Markup | None, Child("mathml")] = None
    id: Id = None
    ref_id: RefId = ()
    ref_type: RefType = ()


class Markup(Element, kw_only=False):
    """XML of another namespace (``xmlType``)."""

    nodes: Annotated[tuple[Node, ...], ForeignElements()] = ()
    id: Id = None
    ref_id: RefId = ()
    ref_type: RefType = ()


class Attached(Referring):
    """A file (``byteDataType``)."""

    name: Annotated[Words | None, Child("name")] = None
    description: Annotated[Rich | None, Child("description")] = None
    file_name: Annotated[str, Child("fileName", NOT_EMPTY)]
    mime_type: Annotated[str, Child("mimeType", NOT_EMPTY)]
    data: Annotated[bytes, Child("dataBase64", BYTES)]


class Rich(Element, kw_only=False):
    """A text with what belongs to it (``richContentType``)."""

    name: Annotated[Words | None, Child("name")] = None
    contents: Annotated[
        tuple[LanguageText | Attached | Latex, ...], Choice(("content", "file", "formula"), many=True)
    ] = ()
    id: Id = None
    ref_id: RefId = ()
    ref_type: RefType = ()

    def __str__(self) -> str:
        return text_of(tuple(part for part in self.contents if isinstance(part, LanguageText)))


def text_of(contents: tuple[LanguageText, ...], language: str = "en") -> str:
    """A text in a language, else without one, else the first; several of one language are paragraphs."""
    for wanted in (language, None, contents[0].language if contents else None):
        found = [part.text for part in contents if part.language == wanted]
        if found:
            return "\n".join(found)
    return ""


def words(texts: str | Mapping[str, str]) -> Words:
    """A text, or a text by language."""
    return Words(_said(texts))


def rich(*texts: str | Mapping[str, str], files: tuple[Attached, ...] = (), formulas: tuple[str, ...] = ()) -> Rich:
    """Paragraphs, each a text or a text by language, with files and formulas (LaTeX)."""
    paragraphs = tuple(part for text in texts for part in _said(text))
    return Rich(contents=(*paragraphs, *files, *(Latex(latex) for latex in formulas)))


def _said(texts: str | Mapping[str, str]) -> tuple[LanguageText, ...]:
    if isinstance(texts, str):
        return (LanguageText(texts),)
    return tuple(LanguageText(text, language) for language, text in texts.items())


SOFTWARE_TYPES = ("application", "bios", "driver", "editor", "firmware", "library", "os", "other")
ISSUERS = ("manufacturer", "calibrationLaboratory", "customer", "owner", "other")
LOCATIONS = ("laboratory", "customer", "laboratoryBranch", "customerBranch", "other")
CHANGES = ("amended", "substituted")

Flag = bool | None
String = Annotated[str | None, Child("value", NOT_EMPTY)]


class Software(Identified):
    """A program (``softwareType``)."""

    name: Annotated[Words, Child("name")]
    release: Annotated[str, Child("release", NOT_EMPTY)]
    type: Annotated[str | None, Child("type", one_of(*SOFTWARE_TYPES))] = None
    description: Annotated[Rich | None, Child("description")] = None


class RefTypeDefinition(Element):
    """Where a family of ``refType`` is defined."""

    name: Annotated[Words, Child("name")]
    description: Annotated[Rich | None, Child("description")] = None
    namespace: Annotated[str, Child("namespace", NOT_EMPTY)]
    link: Annotated[str, Child("link", NOT_EMPTY)]
    release: Annotated[str | None, Child("release", NOT_EMPTY)] = None
    value: String = None
    procedure: Annotated[str | None, Child("procedure", NOT_EMPTY)] = None
    ref_type: RefType = ()


class IdentificationNumber(Identified):
    """A serial number, an inventory number, ... with who issued it."""

    issuer: Annotated[str, Child("issuer", one_of(*ISSUERS))]
    value: Annotated[str, Child("value", NOT_EMPTY)]
    name: Annotated[Words | None, Child("name")] = None


Identifications = Annotated[tuple[IdentificationNumber, ...], Many("identification", within="identifications")]


class Coordinates(Referring):
    """A place by coordinates."""

    system: Annotated[str, Child("positionCoordinateSystem", NOT_EMPTY)]
    reference: Annotated[str | None, Child("reference", NOT_EMPTY)] = None
    declaration: Annotated[Rich | None, Child("declaration")] = None
    first: Annotated[Real, Child("positionCoordinate1")]
    second: Annotated[Real, Child("positionCoordinate2")]
    third: Annotated[Real | None, Child("positionCoordinate3")] = None


class Location(Element):
    """An address (``locationType``), whose parts stand in any order."""

    UNORDERED: ClassVar[bool] = True

    city: Annotated[tuple[str, ...], Many("city", NOT_EMPTY)] = ()
    country: Annotated[tuple[str, ...], Many("countryCode", COUNTRY)] = ()
    post_code: Annotated[tuple[str, ...], Many("postCode", NOT_EMPTY)] = ()
    post_office_box: Annotated[tuple[str, ...], Many("postOfficeBox", NOT_EMPTY)] = ()
    state: Annotated[tuple[str, ...], Many("state", NOT_EMPTY)] = ()
    street: Annotated[tuple[str, ...], Many("street", NOT_EMPTY)] = ()
    street_number: Annotated[tuple[str, ...], Many("streetNo", NOT_EMPTY)] = ()
    further: Annotated[tuple[Rich, ...], Many("further")] = ()
    coordinates: Annotated[tuple[Coordinates, ...], Many("positionCoordinates")] = ()


class Somebody(Referring):
    """Somebody, perhaps without an address (``contactNotStrictType``)."""

    name: Annotated[Words, Child("name")]
    email: Annotated[str | None, Child("eMail", NOT_EMPTY)] = None
    phone: Annotated[str | None, Child("phone", NOT_EMPTY)] = None
    fax: Annotated[str | None, Child("fax", NOT_EMPTY)] = None
    location: Annotated[Location | None, Child("location")] = None
    description: Annotated[Attached | None, Child("descriptionData")] = None


class Contact(Somebody):
    """Somebody with an address (``contactType``)."""

    location: Annotated[Location, Child("location")]


class Hash(Identified):
    """Another document, with its hash (``hashType``)."""

    referral: Annotated[Words, Child("referral")]
    referral_id: Annotated[str, Child("referralID", NOT_EMPTY)]
    procedure: Annotated[str, Child("procedure", NOT_EMPTY)]
    value: Annotated[str, Child("value", NOT_EMPTY)]
    description: Annotated[Rich | None, Child("description")] = None
    in_validity_range: Annotated[Flag, Child("inValidityRange", BOOLEAN)] = None
    traceable: Annotated[Flag, Child("traceable", BOOLEAN)] = None
    linked: Annotated[Hash | None, Child("linkedReport")] = None


class EquipmentClass(Identified):
    """A class of equipment by some classification."""

    reference: Annotated[str, Child("reference", NOT_EMPTY)]
    class_id: Annotated[str, Child("classID", NOT_EMPTY)]


class Characters(Element, kw_only=False):
    """Words in place of a quantity."""

    words: Annotated[tuple[str, ...], Content(STRINGS)]


class PrimitiveQuantity(Referring):
    """A quantity of an item or of equipment (``primitiveQuantityType``)."""

    name: Annotated[Words | None, Child("name")] = None
    description: Annotated[Rich | None, Child("description")] = None
    value: Annotated[
        Rich | Characters | Real | Hybrid | Complex | Constant | RealList,
        Choice(
            ("noQuantity", "charsXMLList", "si:real", "si:hybrid", "si:complex", "si:constant", "si:realListXMLList")
        ),
    ]


class Item(Identified):
    """What is calibrated."""

    name: Annotated[Words, Child("name")]
    equipment_class: Annotated[tuple[EquipmentClass, ...], Many("equipmentClass")] = ()
    description: Annotated[Rich | None, Child("description")] = None
    software: Annotated[tuple[Software, ...], Many("software", within="installedSoftwares")] = ()
    manufacturer: Annotated[Somebody | None, Child("manufacturer")] = None
    model: Annotated[str | None, Child("model", NOT_EMPTY)] = None
    identifications: Identifications
    quantities: Annotated[tuple[PrimitiveQuantity, ...], Many("itemQuantity", within="itemQuantities")] = ()


class Items(Element):
    """The items, and what they have in common."""

    name: Annotated[Words | None, Child("name")] = None
    equipment_class: Annotated[tuple[EquipmentClass, ...], Many("equipmentClass")] = ()
    description: Annotated[Rich | None, Child("description")] = None
    owner: Annotated[Contact | None, Child("owner")] = None
    manufacturer: Annotated[Somebody | None, Child("manufacturer")] = None
    identifications: Identifications = ()
    items: Annotated[tuple[Item, ...], Many("item")]


class PerformanceLocation(Referring):
    """Where it was calibrated."""

    place: Annotated[str, Content(one_of(*LOCATIONS))]


class ReplacedReport(Identified):
    """A certificate that this one amends or substitutes."""

    change: Annotated[str, Child("typeOfChange", one_of(*CHANGES))]
    identifier: Annotated[str, Child("replacedUniqueIdentifier", NOT_EMPTY)]


class CoreData(Element):
    """Identifier, languages and dates."""

    country: Annotated[str, Child("countryCodeISO3166_1", COUNTRY)]
    languages: Annotated[tuple[str, ...], Many("usedLangCodeISO639_1", LANGUAGE)]
    mandatory_languages: Annotated[tuple[str, ...], Many("mandatoryLangCodeISO639_1", LANGUAGE)]
    identifier: Annotated[str, Child("uniqueIdentifier", NOT_EMPTY)]
    identifications: Identifications = ()
    received: Annotated[dt.date | None, Child("receiptDate", DATE)] = None
    begin: Annotated[dt.date, Child("beginPerformanceDate", DATE)]
    end: Annotated[dt.date, Child("endPerformanceDate", DATE)]
    location: Annotated[PerformanceLocation, Child("performanceLocation")]
    issued: Annotated[dt.date | None, Child("issueDate", DATE)] = None
    replaced: Annotated[ReplacedReport | None, Child("reportAmendedSubstituted")] = None
    previous: Annotated[Hash | None, Child("previousReport")] = None


class CalibrationLaboratory(Element):
    """The calibration laboratory."""

    code: Annotated[str | None, Child("calibrationLaboratoryCode", NOT_EMPTY)] = None
    contact: Annotated[Contact, Child("contact")]
    seal: Annotated[Flag, Child("cryptElectronicSeal", BOOLEAN)] = None
    signature: Annotated[Flag, Child("cryptElectronicSignature", BOOLEAN)] = None
    time_stamp: Annotated[Flag, Child("cryptElectronicTimeStamp", BOOLEAN)] = None


class Person(Identified):
    """Somebody responsible (``respPersonType``)."""

    person: Annotated[Somebody, Child("person")]
    description: Annotated[Rich | None, Child("description")] = None
    role: Annotated[str | None, Child("role", NOT_EMPTY)] = None
    main_signer: Annotated[Flag, Child("mainSigner", BOOLEAN)] = None
    seal: Annotated[Flag, Child("cryptElectronicSeal", BOOLEAN)] = None
    signature: Annotated[Flag, Child("cryptElectronicSignature", BOOLEAN)] = None
    time_stamp: Annotated[Flag, Child("cryptElectronicTimeStamp", BOOLEAN)] = None
