"""A digital calibration certificate (DCC), whole: results with methods, equipment and conditions, and administrative data."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from typing import Annotated

from cmm_uq.jobs.dcc import fields as xml
from cmm_uq.jobs.dcc.quantities import Complex, Constant, Hybrid, Lists, Real, RealList, Strings, Time
from cmm_uq.jobs.dcc.tree import Node

VERSION = "3.2.1"  # of the schema that is written
ISSUER = xml.one_of("manufacturer", "calibrationLaboratory", "customer", "owner", "other")
PLACE = xml.one_of("laboratory", "customer", "laboratoryBranch", "customerBranch", "other")
SOFTWARE_TYPE = xml.one_of("application", "bios", "driver", "editor", "firmware", "library", "os", "other")
STATE = xml.one_of("beforeAdjustment", "afterAdjustment", "beforeRepair", "afterRepair")
CONFORMITY = xml.one_of(
    "pass", "fail", "conditionalPass", "conditionalFail", "noPass", "noFail", plural="states of conformity"
)
RefType = Annotated[Strings, xml.Attribute("refType", xml.listed(xml.NOT_EMPTY))]


class WithId(xml.Element):
    id: Annotated[str | None, xml.Attribute("id", xml.NAME)] = None


class Identified(WithId):  # by the vocabularies of good practice, ref_type
    ref_type: RefType = ()


class Referring(Identified):  # to others by their ids
    ref_id: Annotated[Strings, xml.Attribute("refId", xml.listed(xml.NAME))] = ()


class Described(Referring):
    name: Words | None = None
    description: Rich | None = None


class LanguageText(Referring, kw_only=False):  # stringWithLangType
    text: Annotated[str, xml.Content(xml.STRING)]
    language: Annotated[str | None, xml.Attribute("lang", xml.LANGUAGE)] = None


class Words(WithId, kw_only=False):  # textType: the same text in its languages
    contents: Annotated[tuple[LanguageText, ...], xml.Child("content")]

    def __str__(self) -> str:
        return text_of(self.contents)


class Latex(Referring, kw_only=False):  # formulaType
    latex: Annotated[str | None, xml.Child(simple=xml.STRING)] = None
    mathml: Markup | None = None


class Markup(Referring, kw_only=False):  # xmlType
    nodes: Annotated[tuple[Node, ...], xml.ForeignElements()] = ()


class Attached(Described):  # byteDataType
    file_name: str
    mime_type: str
    data: Annotated[bytes, xml.Child("dataBase64")]


class Rich(Referring, kw_only=False):  # richContentType
    name: Words | None = None
    contents: Annotated[tuple[LanguageText | Attached | Latex, ...], xml.Child(("content", "file", "formula"))] = ()

    def __str__(self) -> str:
        return text_of(tuple(part for part in self.contents if isinstance(part, LanguageText)))


class Software(Identified):  # softwareType
    name: Words
    release: str
    type: Annotated[str | None, xml.Child(simple=SOFTWARE_TYPE)] = None
    description: Rich | None = None


class RefTypeDefinition(xml.Element):
    name: Words
    description: Rich | None = None
    namespace: str
    link: str
    release: str | None = None
    value: str | None = None
    procedure: str | None = None
    ref_type: RefType = ()


class IdentificationNumber(Identified):
    issuer: Annotated[str, xml.Child(simple=ISSUER)]
    value: str
    name: Words | None = None


Identifications = Annotated[tuple[IdentificationNumber, ...], xml.Child("identification", within="identifications")]


class Coordinates(Referring):
    system: Annotated[str, xml.Child("positionCoordinateSystem")]
    reference: str | None = None
    declaration: Rich | None = None
    first: Annotated[Real, xml.Child("positionCoordinate1")]
    second: Annotated[Real, xml.Child("positionCoordinate2")]
    third: Annotated[Real | None, xml.Child("positionCoordinate3")] = None


class Location(xml.Element, unordered=True):  # locationType
    city: Annotated[Strings, xml.Child(many=True)] = ()
    country: Annotated[Strings, xml.Child("countryCode", xml.COUNTRY, many=True)] = ()
    post_code: Annotated[Strings, xml.Child(many=True)] = ()
    post_office_box: Annotated[Strings, xml.Child(many=True)] = ()
    state: Annotated[Strings, xml.Child(many=True)] = ()
    street: Annotated[Strings, xml.Child(many=True)] = ()
    street_number: Annotated[Strings, xml.Child("streetNo", many=True)] = ()
    further: tuple[Rich, ...] = ()
    coordinates: Annotated[tuple[Coordinates, ...], xml.Child("positionCoordinates")] = ()


class Somebody(Referring):  # contactNotStrictType: perhaps without an address
    name: Words
    email: Annotated[str | None, xml.Child("eMail")] = None
    phone: str | None = None
    fax: str | None = None
    location: Location | None = None
    description: Annotated[Attached | None, xml.Child("descriptionData")] = None


class Contact(Somebody):  # contactType
    location: Location


class Hash(Identified):  # hashType
    referral: Words
    referral_id: Annotated[str, xml.Child("referralID")]
    procedure: str
    value: str
    description: Rich | None = None
    in_validity_range: bool | None = None
    traceable: bool | None = None
    linked: Annotated[Hash | None, xml.Child("linkedReport")] = None


class EquipmentClass(Identified):
    reference: str
    class_id: Annotated[str, xml.Child("classID")]


class Characters(xml.Element, kw_only=False):
    words: Annotated[Strings, xml.Content(xml.listed(xml.NOT_EMPTY))]


class PrimitiveQuantity(Described):  # primitiveQuantityType
    value: Annotated[
        Rich | Characters | Real | Hybrid | Complex | Constant | RealList,
        xml.Child(
            ("noQuantity", "charsXMLList", "si:real", "si:hybrid", "si:complex", "si:constant", "si:realListXMLList")
        ),
    ]


class Item(Identified):
    name: Words
    equipment_class: tuple[EquipmentClass, ...] = ()
    description: Rich | None = None
    software: Annotated[tuple[Software, ...], xml.Child(within="installedSoftwares")] = ()
    manufacturer: Somebody | None = None
    model: str | None = None
    identifications: Identifications
    quantities: Annotated[tuple[PrimitiveQuantity, ...], xml.Child("itemQuantity", within="itemQuantities")] = ()


class Items(xml.Element):
    name: Words | None = None
    equipment_class: tuple[EquipmentClass, ...] = ()
    description: Rich | None = None
    owner: Contact | None = None
    manufacturer: Somebody | None = None
    identifications: Identifications = ()
    items: Annotated[tuple[Item, ...], xml.Child("item")]


class PerformanceLocation(Referring):
    place: Annotated[str, xml.Content(PLACE)]


class ReplacedReport(Identified):
    change: Annotated[str, xml.Child("typeOfChange", xml.one_of("amended", "substituted"))]
    identifier: Annotated[str, xml.Child("replacedUniqueIdentifier")]


class CoreData(xml.Element):
    country: Annotated[str, xml.Child("countryCodeISO3166_1", xml.COUNTRY)]
    languages: Annotated[Strings, xml.Child("usedLangCodeISO639_1", xml.LANGUAGE, many=True)]
    mandatory_languages: Annotated[Strings, xml.Child("mandatoryLangCodeISO639_1", xml.LANGUAGE, many=True)]
    identifier: Annotated[str, xml.Child("uniqueIdentifier")]
    identifications: Identifications = ()
    received: Annotated[dt.date | None, xml.Child("receiptDate")] = None
    begin: Annotated[dt.date, xml.Child("beginPerformanceDate")]
    end: Annotated[dt.date, xml.Child("endPerformanceDate")]
    location: Annotated[PerformanceLocation, xml.Child("performanceLocation")]
    issued: Annotated[dt.date | None, xml.Child("issueDate")] = None
    replaced: Annotated[ReplacedReport | None, xml.Child("reportAmendedSubstituted")] = None
    previous: Annotated[Hash | None, xml.Child("previousReport")] = None


class CalibrationLaboratory(xml.Element):
    code: Annotated[str | None, xml.Child("calibrationLaboratoryCode")] = None
    contact: Contact
    seal: Annotated[bool | None, xml.Child("cryptElectronicSeal")] = None
    signature: Annotated[bool | None, xml.Child("cryptElectronicSignature")] = None
    time_stamp: Annotated[bool | None, xml.Child("cryptElectronicTimeStamp")] = None


class Person(Identified):  # respPersonType
    person: Somebody
    description: Rich | None = None
    role: str | None = None
    main_signer: bool | None = None
    seal: Annotated[bool | None, xml.Child("cryptElectronicSeal")] = None
    signature: Annotated[bool | None, xml.Child("cryptElectronicSignature")] = None
    time_stamp: Annotated[bool | None, xml.Child("cryptElectronicTimeStamp")] = None


class Method(Identified):  # usedMethodType
    name: Words
    description: Rich | None = None
    norms: Annotated[Strings, xml.Child("norm", many=True)] = ()
    references: Annotated[Strings, xml.Child("reference", many=True)] = ()


Methods = Annotated[tuple[Method, ...], xml.Child("usedMethod", within="usedMethods")]
UsedSoftware = Annotated[tuple[Software, ...], xml.Child("software", within="usedSoftware")]


class Equipment(Identified):  # measuringEquipmentType: its certificate is how the result is traceable
    name: Words
    equipment_class: tuple[EquipmentClass, ...] = ()
    description: Rich | None = None
    certificate: Hash | None = None
    manufacturer: Somebody | None = None
    model: str | None = None
    identifications: Identifications = ()
    quantities: Annotated[
        tuple[PrimitiveQuantity, ...], xml.Child("measuringEquipmentQuantity", within="measuringEquipmentQuantities")
    ] = ()


class Equipments(xml.Element):
    name: Words | None = None
    equipment_class: tuple[EquipmentClass, ...] = ()
    description: Rich | None = None
    owner: Contact | None = None
    identifications: Identifications = ()
    equipment: Annotated[tuple[Equipment, ...], xml.Child("measuringEquipment")]


class Data(Referring):  # dataType: what a result or a condition says, in its order
    parts: Annotated[
        tuple[Rich | Latex | Attached | Markup | DccQuantity | QuantityList, ...],
        xml.Child(("text", "formula", "byteData", "xml", "quantity", "list")),
    ]


class InfluenceCondition(Identified):  # conditionType
    name: Words
    description: Rich | None = None
    status: Annotated[str | None, xml.Child(simple=STATE)] = None
    certificate: Hash | None = None
    data: Data


Conditions = Annotated[tuple[InfluenceCondition, ...], xml.Child("influenceCondition", within="influenceConditions")]


class StatementMetadata(Described):  # statementMetaDataType
    countries: Annotated[Strings, xml.Child("countryCodeISO3166_1", xml.COUNTRY, many=True)] = ()
    convention: str | None = None
    traceable: bool | None = None
    norms: Annotated[Strings, xml.Child("norm", many=True)] = ()
    references: Annotated[Strings, xml.Child("reference", many=True)] = ()
    declaration: Rich | None = None
    valid: bool | None = None
    valid_list: Annotated[tuple[bool, ...], xml.Child("validXMLList")] = ()
    date: dt.date | None = None
    period: Annotated[str | None, xml.Child(simple=xml.STRING)] = None
    authority: Annotated[Contact | None, xml.Child("respAuthority")] = None
    conformity: Annotated[str | None, xml.Child(simple=CONFORMITY)] = None
    conformity_list: Annotated[Strings, xml.Child("conformityXMLList", CONFORMITY)] = ()
    data: Data | None = None
    non_si_definition: Annotated[str | None, xml.Child("nonSIDefinition")] = None
    non_si_unit: Annotated[str | None, xml.Child("nonSIUnit")] = None
    location: Location | None = None


Statements = Annotated[tuple[StatementMetadata, ...], xml.Child("metaData", within="measurementMetaData")]


class RelativeUncertainty(xml.Element):
    stated: Annotated[RealList | Real, xml.Child(("relativeUncertaintyXmlList", "relativeUncertaintySingle"))]


class DccQuantity(Described):  # quantityType
    value: Annotated[
        Rich | Characters | Real | Lists | Hybrid | Complex | Constant | RealList,
        xml.Child((
            "noQuantity", "charsXMLList", "si:real", "si:list", "si:hybrid", "si:complex", "si:constant", "si:realListXMLList",
        )),
    ]  # fmt: skip
    relative_uncertainty: RelativeUncertainty | None = None
    methods: Methods = ()
    software: UsedSoftware = ()
    equipment: Annotated[Equipments | None, xml.Child("measuringEquipments")] = None
    conditions: Conditions = ()
    metadata: Statements = ()


class QuantityList(Described):  # listType: quantities that belong together, a table
    time: Time = None
    times: Annotated[tuple[dt.datetime, ...], xml.Child("dateTimeXMLList")] = ()
    parts: Annotated[tuple[QuantityList | DccQuantity, ...], xml.Child(("list", "quantity"))]
    methods: Methods = ()
    software: UsedSoftware = ()
    equipment: Annotated[Equipments | None, xml.Child("measuringEquipments")] = None
    conditions: Conditions = ()
    metadata: Statements = ()


class DccResult(Referring):
    name: Words
    description: Rich | None = None
    data: Data


class Measurement(Referring):  # measurementResultType
    name: Words
    description: Rich | None = None
    methods: Methods = ()
    software: UsedSoftware = ()
    equipment: Annotated[Equipments | None, xml.Child("measuringEquipments")] = None
    conditions: Conditions = ()
    results: Annotated[tuple[DccResult, ...], xml.Child("result", within="results")]
    metadata: Statements = ()


class Administrative(xml.Element, unordered=True):
    software: Annotated[tuple[Software, ...], xml.Child(within="dccSoftware")]
    ref_types: Annotated[
        tuple[RefTypeDefinition, ...], xml.Child("refTypeDefinition", within="refTypeDefinitions")
    ] = ()
    core: Annotated[CoreData, xml.Child("coreData")]
    items: Items
    laboratory: Annotated[CalibrationLaboratory, xml.Child("calibrationLaboratory")]
    persons: Annotated[tuple[Person, ...], xml.Child("respPerson", within="respPersons")]
    customer: Contact
    statements: Annotated[tuple[StatementMetadata, ...], xml.Child("statement", within="statements")] = ()


class Comment(xml.Element):
    nodes: Annotated[tuple[Node, ...], xml.ForeignElements()] = ()


class Certificate(xml.Element):
    version: Annotated[str, xml.Attribute("schemaVersion", xml.matching("version 3 of the schema", r"3\.[\s\S]*"))] = (
        VERSION
    )
    administrative: Annotated[Administrative, xml.Child("administrativeData")]
    measurements: Annotated[tuple[Measurement, ...], xml.Child("measurementResult", within="measurementResults")]
    comment: Comment | None = None
    document: Attached | None = None
    # XAdES, as they stand: what they are worth is the business of cmm_uq.certificate.sign
    signatures: Annotated[tuple[Node, ...], xml.ForeignElements()] = ()


def text_of(contents: tuple[LanguageText, ...], language: str = "en") -> str:
    """A text in a language, else without one, else the first; several of one language are paragraphs."""
    languages = (language, None, contents[0].language if contents else None)
    texts = ([part.text for part in contents if part.language == wanted] for wanted in languages)
    return "\n".join(next(filter(None, texts), []))


def words(texts: str | Mapping[str, str]) -> Words:
    """A text, or a text by language."""
    return Words(_said(texts))


def rich(*texts: str | Mapping[str, str], files: tuple[Attached, ...] = (), formulas: Strings = ()) -> Rich:
    """Paragraphs, each a text or a text by language, with files and formulas (LaTeX)."""
    paragraphs = tuple(part for text in texts for part in _said(text))
    return Rich(contents=(*paragraphs, *files, *(Latex(latex) for latex in formulas)))


def _said(texts: str | Mapping[str, str]) -> tuple[LanguageText, ...]:
    if isinstance(texts, str):
        return (LanguageText(texts),)
    return tuple(LanguageText(text, language) for language, text in texts.items())
