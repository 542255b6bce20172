"""A digital calibration certificate (DCC), whole: results with methods, equipment and conditions, and administrative data."""

from __future__ import annotations

import datetime as dt
from typing import Annotated, ClassVar

from cmm_uq.jobs.dcc.administrative import (
    Attached,
    CalibrationLaboratory,
    Characters,
    Contact,
    CoreData,
    EquipmentClass,
    Hash,
    Identifications,
    Identified,
    Items,
    Latex,
    Location,
    Markup,
    Person,
    PrimitiveQuantity,
    Referring,
    RefTypeDefinition,
    Rich,
    Software,
    Somebody,
    Words,
)
from cmm_uq.jobs.dcc.fields import (
    BOOLEAN,
    BOOLEANS,
    COUNTRY,
    DATE,
    DATE_TIME,
    DATE_TIMES,
    NOT_EMPTY,
    STRING,
    Attribute,
    Child,
    Choice,
    Element,
    ForeignElements,
    Many,
    Simple,
    listed,
    one_of,
)
from cmm_uq.jobs.dcc.quantities import Complex, Constant, Hybrid, Lists, Real, RealList
from cmm_uq.jobs.dcc.tree import Node

CONFORMITIES = ("pass", "fail", "conditionalPass", "conditionalFail", "noPass", "noFail")
STATES = ("beforeAdjustment", "afterAdjustment", "beforeRepair", "afterRepair")

Strings = tuple[str, ...]


class Method(Identified):
    """A method that was used (``usedMethodType``)."""

    name: Annotated[Words, Child("name")]
    description: Annotated[Rich | None, Child("description")] = None
    norms: Annotated[Strings, Many("norm", NOT_EMPTY)] = ()
    references: Annotated[Strings, Many("reference", NOT_EMPTY)] = ()


Methods = Annotated[tuple[Method, ...], Many("usedMethod", within="usedMethods")]
UsedSoftware = Annotated[tuple[Software, ...], Many("software", within="usedSoftware")]


class Equipment(Identified):
    """A piece of equipment (``measuringEquipmentType``); its certificate is how the result is traceable."""

    name: Annotated[Words, Child("name")]
    equipment_class: Annotated[tuple[EquipmentClass, ...], Many("equipmentClass")] = ()
    description: Annotated[Rich | None, Child("description")] = None
    certificate: Annotated[Hash | None, Child("certificate")] = None
    manufacturer: Annotated[Somebody | None, Child("manufacturer")] = None
    model: Annotated[str | None, Child("model", NOT_EMPTY)] = None
    identifications: Identifications = ()
    quantities: Annotated[
        tuple[PrimitiveQuantity, ...], Many("measuringEquipmentQuantity", within="measuringEquipmentQuantities")
    ] = ()


class Equipments(Element):
    """The equipment, and what it has in common."""

    name: Annotated[Words | None, Child("name")] = None
    equipment_class: Annotated[tuple[EquipmentClass, ...], Many("equipmentClass")] = ()
    description: Annotated[Rich | None, Child("description")] = None
    owner: Annotated[Contact | None, Child("owner")] = None
    identifications: Identifications = ()
    equipment: Annotated[tuple[Equipment, ...], Many("measuringEquipment")]


class Data(Referring):
    """What a result or a condition says, in its order (``dataType``)."""

    parts: Annotated[
        tuple[Rich | Latex | Attached | Markup | DccQuantity | QuantityList, ...],
        Choice(("text", "formula", "byteData", "xml", "quantity", "list"), many=True),
    ]


class InfluenceCondition(Identified):
    """Something that influences (``conditionType``)."""

    name: Annotated[Words, Child("name")]
    description: Annotated[Rich | None, Child("description")] = None
    status: Annotated[str | None, Child("status", one_of(*STATES))] = None
    certificate: Annotated[Hash | None, Child("certificate")] = None
    data: Annotated[Data, Child("data")]


Conditions = Annotated[tuple[InfluenceCondition, ...], Many("influenceCondition", within="influenceConditions")]


class StatementMetadata(Referring):
    """A statement, or metadata of a measurement (``statementMetaDataType``)."""

    name: Annotated[Words | None, Child("name")] = None
    description: Annotated[Rich | None, Child("description")] = None
    countries: Annotated[Strings, Many("countryCodeISO3166_1", COUNTRY)] = ()
    convention: Annotated[str | None, Child("convention", NOT_EMPTY)] = None
    traceable: Annotated[bool | None, Child("traceable", BOOLEAN)] = None
    norms: Annotated[Strings, Many("norm", NOT_EMPTY)] = ()
    references: Annotated[Strings, Many("reference", NOT_EMPTY)] = ()
    declaration: Annotated[Rich | None, Child("declaration")] = None
    valid: Annotated[bool | None, Child("valid", BOOLEAN)] = None
    valid_list: Annotated[tuple[bool, ...], Child("validXMLList", BOOLEANS)] = ()
    date: Annotated[dt.date | None, Child("date", DATE)] = None
    period: Annotated[str | None, Child("period", STRING)] = None
    authority: Annotated[Contact | None, Child("respAuthority")] = None
    conformity: Annotated[str | None, Child("conformity", one_of(*CONFORMITIES))] = None
    conformity_list: Annotated[
        Strings, Child("conformityXMLList", listed(one_of(*CONFORMITIES), "states of conformity"))
    ] = ()
    data: Annotated[Data | None, Child("data")] = None
    non_si_definition: Annotated[str | None, Child("nonSIDefinition", NOT_EMPTY)] = None
    non_si_unit: Annotated[str | None, Child("nonSIUnit", NOT_EMPTY)] = None
    location: Annotated[Location | None, Child("location")] = None


Statements = Annotated[tuple[StatementMetadata, ...], Many("metaData", within="measurementMetaData")]


class RelativeUncertainty(Element):
    """Relative uncertainty of a quantity."""

    stated: Annotated[RealList | Real, Choice(("relativeUncertaintyXmlList", "relativeUncertaintySingle"))]


class DccQuantity(Referring):
    """A quantity (``quantityType``)."""

    name: Annotated[Words | None, Child("name")] = None
    description: Annotated[Rich | None, Child("description")] = None
    value: Annotated[
        Rich | Characters | Real | Lists | Hybrid | Complex | Constant | RealList,
        Choice((
            "noQuantity", "charsXMLList", "si:real", "si:list", "si:hybrid", "si:complex", "si:constant", "si:realListXMLList",
        )),
    ]  # fmt: skip
    relative_uncertainty: Annotated[RelativeUncertainty | None, Child("relativeUncertainty")] = None
    methods: Methods = ()
    software: UsedSoftware = ()
    equipment: Annotated[Equipments | None, Child("measuringEquipments")] = None
    conditions: Conditions = ()
    metadata: Statements = ()


class QuantityList(Referring):
    """Quantities that belong together, a table (``listType``)."""

    name: Annotated[Words | None, Child("name")] = None
    description: Annotated[Rich | None, Child("description")] = None
    time: Annotated[dt.datetime | None, Child("dateTime", DATE_TIME)] = None
    times: Annotated[tuple[dt.datetime, ...], Child("dateTimeXMLList", DATE_TIMES)] = ()
    parts: Annotated[tuple[QuantityList | DccQuantity, ...], Choice(("list", "quantity"), many=True)]
    methods: Methods = ()
    software: UsedSoftware = ()
    equipment: Annotated[Equipments | None, Child("measuringEquipments")] = None
    conditions: Conditions = ()
    metadata: Statements = ()


class DccResult(Referring):
    """A result."""

    name: Annotated[Words, Child("name")]
    description: Annotated[Rich | None, Child("description")] = None
    data: Annotated[Data, Child("data")]


class Measurement(Referring):
    """A measurement with its results (``measurementResultType``)."""

    name: Annotated[Words, Child("name")]
    description: Annotated[Rich | None, Child("description")] = None
    methods: Methods = ()
    software: UsedSoftware = ()
    equipment: Annotated[Equipments | None, Child("measuringEquipments")] = None
    conditions: Conditions = ()
    results: Annotated[tuple[DccResult, ...], Many("result", within="results")]
    metadata: Statements = ()


VERSION = "3.2.1"
"""Of the schema that is written."""


def _version(text: str) -> str:
    if not text.startswith("3."):
        raise ValueError(text)
    return text


class Administrative(Element):
    """Administrative data; its parts stand in any order."""

    UNORDERED: ClassVar[bool] = True

    software: Annotated[tuple[Software, ...], Many("software", within="dccSoftware")]
    ref_types: Annotated[tuple[RefTypeDefinition, ...], Many("refTypeDefinition", within="refTypeDefinitions")] = ()
    core: Annotated[CoreData, Child("coreData")]
    items: Annotated[Items, Child("items")]
    laboratory: Annotated[CalibrationLaboratory, Child("calibrationLaboratory")]
    persons: Annotated[tuple[Person, ...], Many("respPerson", within="respPersons")]
    customer: Annotated[Contact, Child("customer")]
    statements: Annotated[tuple[StatementMetadata, ...], Many("statement", within="statements")] = ()


class Comment(Element):
    """Whatever else is said, in XML of any kind."""

    nodes: Annotated[tuple[Node, ...], ForeignElements()] = ()


class Certificate(Element):
    """A certificate.

    version : of the schema.
    document : the human-readable copy.
    signatures : XML signatures (XAdES), as they stand: what they are worth is the business of ``cmm_uq.certificate.sign``.
    """

    version: Annotated[str, Attribute("schemaVersion", Simple("version 3 of the schema", _version))] = VERSION
    administrative: Annotated[Administrative, Child("administrativeData")]
    measurements: Annotated[tuple[Measurement, ...], Many("measurementResult", within="measurementResults")]
    comment: Annotated[Comment | None, Child("comment")] = None
    document: Annotated[Attached | None, Child("document")] = None
    signatures: Annotated[tuple[Node, ...], ForeignElements()] = ()
