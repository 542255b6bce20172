"""Administrative data of a DCC: software, identifications, the item, the laboratory, the customer."""

from __future__ import annotations

import datetime as dt
from typing import Annotated, ClassVar

from cmm_uq.jobs.dcc.fields import Child, Choice, Content, Many, Part
from cmm_uq.jobs.dcc.quantities import Complex, Constant, Hybrid, Real, RealList
from cmm_uq.jobs.dcc.simple import BOOLEAN, COUNTRY, DATE, LANGUAGE, NOT_EMPTY, STRINGS, one_of
from cmm_uq.jobs.dcc.texts import Attached, Id, RefId, RefType, Rich, Words

SOFTWARE_TYPES = ("application", "bios", "driver", "editor", "firmware", "library", "os", "other")
ISSUERS = ("manufacturer", "calibrationLaboratory", "customer", "owner", "other")
LOCATIONS = ("laboratory", "customer", "laboratoryBranch", "customerBranch", "other")
CHANGES = ("amended", "substituted")

Flag = bool | None
String = Annotated[str | None, Child("value", NOT_EMPTY)]


class Software(Part):
    """A program (``softwareType``)."""

    name: Annotated[Words, Child("name")]
    release: Annotated[str, Child("release", NOT_EMPTY)]
    type: Annotated[str | None, Child("type", one_of(*SOFTWARE_TYPES))] = None
    description: Annotated[Rich | None, Child("description")] = None
    id: Id = None
    ref_type: RefType = ()


class RefTypeDefinition(Part):
    """Where a family of ``refType`` is defined."""

    name: Annotated[Words, Child("name")]
    description: Annotated[Rich | None, Child("description")] = None
    namespace: Annotated[str, Child("namespace", NOT_EMPTY)]
    link: Annotated[str, Child("link", NOT_EMPTY)]
    release: Annotated[str | None, Child("release", NOT_EMPTY)] = None
    value: String = None
    procedure: Annotated[str | None, Child("procedure", NOT_EMPTY)] = None
    ref_type: RefType = ()


class Identification(Part):
    """A serial number, an inventory number, ... with who issued it."""

    issuer: Annotated[str, Child("issuer", one_of(*ISSUERS))]
    value: Annotated[str, Child("value", NOT_EMPTY)]
    name: Annotated[Words | None, Child("name")] = None
    id: Id = None
    ref_type: RefType = ()


Identifications = Annotated[tuple[Identification, ...], Many("identification", within="identifications")]


class Coordinates(Part):
    """A place by coordinates."""

    system: Annotated[str, Child("positionCoordinateSystem", NOT_EMPTY)]
    reference: Annotated[str | None, Child("reference", NOT_EMPTY)] = None
    declaration: Annotated[Rich | None, Child("declaration")] = None
    first: Annotated[Real, Child("positionCoordinate1")]
    second: Annotated[Real, Child("positionCoordinate2")]
    third: Annotated[Real | None, Child("positionCoordinate3")] = None
    id: Id = None
    ref_id: RefId = ()
    ref_type: RefType = ()


class Location(Part):
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


class Somebody(Part):
    """Somebody, perhaps without an address (``contactNotStrictType``)."""

    name: Annotated[Words, Child("name")]
    email: Annotated[str | None, Child("eMail", NOT_EMPTY)] = None
    phone: Annotated[str | None, Child("phone", NOT_EMPTY)] = None
    fax: Annotated[str | None, Child("fax", NOT_EMPTY)] = None
    location: Annotated[Location | None, Child("location")] = None
    description: Annotated[Attached | None, Child("descriptionData")] = None
    id: Id = None
    ref_id: RefId = ()
    ref_type: RefType = ()


class Contact(Somebody):
    """Somebody with an address (``contactType``)."""

    location: Annotated[Location, Child("location")]


class Hash(Part):
    """Another document, with its hash (``hashType``)."""

    referral: Annotated[Words, Child("referral")]
    referral_id: Annotated[str, Child("referralID", NOT_EMPTY)]
    procedure: Annotated[str, Child("procedure", NOT_EMPTY)]
    value: Annotated[str, Child("value", NOT_EMPTY)]
    description: Annotated[Rich | None, Child("description")] = None
    in_validity_range: Annotated[Flag, Child("inValidityRange", BOOLEAN)] = None
    traceable: Annotated[Flag, Child("traceable", BOOLEAN)] = None
    linked: Annotated[Hash | None, Child("linkedReport")] = None
    id: Id = None
    ref_type: RefType = ()


class EquipmentClass(Part):
    """A class of equipment by some classification."""

    reference: Annotated[str, Child("reference", NOT_EMPTY)]
    class_id: Annotated[str, Child("classID", NOT_EMPTY)]
    id: Id = None
    ref_type: RefType = ()


class Characters(Part, kw_only=False):
    """Words in place of a quantity."""

    words: Annotated[tuple[str, ...], Content(STRINGS)]


class PrimitiveQuantity(Part):
    """A quantity of an item or of equipment (``primitiveQuantityType``)."""

    name: Annotated[Words | None, Child("name")] = None
    description: Annotated[Rich | None, Child("description")] = None
    value: Annotated[
        Rich | Characters | Real | Hybrid | Complex | Constant | RealList,
        Choice(
            ("noQuantity", "charsXMLList", "si:real", "si:hybrid", "si:complex", "si:constant", "si:realListXMLList")
        ),
    ]
    id: Id = None
    ref_id: RefId = ()
    ref_type: RefType = ()


class Item(Part):
    """What is calibrated."""

    name: Annotated[Words, Child("name")]
    equipment_class: Annotated[tuple[EquipmentClass, ...], Many("equipmentClass")] = ()
    description: Annotated[Rich | None, Child("description")] = None
    software: Annotated[tuple[Software, ...], Many("software", within="installedSoftwares")] = ()
    manufacturer: Annotated[Somebody | None, Child("manufacturer")] = None
    model: Annotated[str | None, Child("model", NOT_EMPTY)] = None
    identifications: Identifications
    quantities: Annotated[tuple[PrimitiveQuantity, ...], Many("itemQuantity", within="itemQuantities")] = ()
    id: Id = None
    ref_type: RefType = ()


class Items(Part):
    """The items, and what they have in common."""

    name: Annotated[Words | None, Child("name")] = None
    equipment_class: Annotated[tuple[EquipmentClass, ...], Many("equipmentClass")] = ()
    description: Annotated[Rich | None, Child("description")] = None
    owner: Annotated[Contact | None, Child("owner")] = None
    manufacturer: Annotated[Somebody | None, Child("manufacturer")] = None
    identifications: Identifications = ()
    items: Annotated[tuple[Item, ...], Many("item")]


class PerformanceLocation(Part):
    """Where it was calibrated."""

    place: Annotated[str, Content(one_of(*LOCATIONS))]
    id: Id = None
    ref_id: RefId = ()
    ref_type: RefType = ()


class Replaced(Part):
    """A certificate that this one amends or substitutes."""

    change: Annotated[str, Child("typeOfChange", one_of(*CHANGES))]
    identifier: Annotated[str, Child("replacedUniqueIdentifier", NOT_EMPTY)]
    id: Id = None
    ref_type: RefType = ()


class CoreData(Part):
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
    replaced: Annotated[Replaced | None, Child("reportAmendedSubstituted")] = None
    previous: Annotated[Hash | None, Child("previousReport")] = None


class Laboratory(Part):
    """The calibration laboratory."""

    code: Annotated[str | None, Child("calibrationLaboratoryCode", NOT_EMPTY)] = None
    contact: Annotated[Contact, Child("contact")]
    seal: Annotated[Flag, Child("cryptElectronicSeal", BOOLEAN)] = None
    signature: Annotated[Flag, Child("cryptElectronicSignature", BOOLEAN)] = None
    time_stamp: Annotated[Flag, Child("cryptElectronicTimeStamp", BOOLEAN)] = None


class Person(Part):
    """Somebody responsible (``respPersonType``)."""

    person: Annotated[Somebody, Child("person")]
    description: Annotated[Rich | None, Child("description")] = None
    role: Annotated[str | None, Child("role", NOT_EMPTY)] = None
    main_signer: Annotated[Flag, Child("mainSigner", BOOLEAN)] = None
    seal: Annotated[Flag, Child("cryptElectronicSeal", BOOLEAN)] = None
    signature: Annotated[Flag, Child("cryptElectronicSignature", BOOLEAN)] = None
    time_stamp: Annotated[Flag, Child("cryptElectronicTimeStamp", BOOLEAN)] = None
    id: Id = None
    ref_type: RefType = ()
