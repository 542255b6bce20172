r"""The elements of a digital calibration certificate (DCC 3.2.1) and of its quantities (D-SI 2.1), as one table.

Of D-SI 2.2 only what it says anew of uncertainty is read: ``measurementUncertaintyUnivariate`` of a value and of a list; those
classes end in MU. A class stands in a line: its fields in the order of the schema, those of its base before them, ``id``,
``ref_id`` and ``ref_type`` behind all others. A field is an element of its name in camelCase, or of the tags behind ``=``: one
of several, in an element that they stand in together (``identifications/identification``). ``@`` is an attribute, ``=.`` the
text of the element itself, ``=*`` elements of other namespaces. Then what it holds, a class or a simple type: ``?`` may be
left out, ``*`` many times or never, ``+`` once or more; ``decimal[]`` is a list in one element. ``!``: elements in any order.

Every class is an attribute of this module. Classes are made without :mod:`dataclasses`, which would take longer to make them
than it takes to write a certificate. Numbers are :class:`~decimal.Decimal`, so that a certificate keeps the digits it was
printed with; units are in D-SI, ``\micro\metre``.
"""

from __future__ import annotations

import datetime as dt
import math
import re
from base64 import b64decode, b64encode
from collections.abc import Callable, Mapping
from decimal import Decimal, InvalidOperation
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NoReturn, Self

from cmm_uq.base.files.limits import NUMERAL
from cmm_uq.base.values import dataclass

VERSION = "3.2.1"  # of the schema that is written
_MU = "factor=coverageFactor factor; probability=coverageProbability probability; distribution string?"
_MUS = "factors=coverageFactorXMLList factor[]; probabilities=coverageProbabilityXMLList probability[]"
_MUS = f"{_MUS}; distributions=distributionXMLList string[]?"
_ENDS = "low=intervalMin decimal; high=intervalMax decimal; probability=coverageProbability probability; distribution string?"
_REGION = "region=ellipsoidalRegion|rectangularRegion EllipsoidalRegion|RectangularRegion?"
_VALUE = "label string?; value decimal; unit string; time=dateTime datetime?"
_LIST = "label string?; time=dateTime datetime?"

D_SI = f"""
Expanded: uncertainty uncertainty; {_MU}
Interval: standard=standardUnc uncertainty; {_ENDS}
StandardMU: standard=valueStandardMU uncertainty; distribution string?
ExpandedMU: uncertainty=valueExpandedMU uncertainty; {_MU}
IntervalMU(Interval): standard=valueStandardMU uncertainty
Univariate: stated=standardMU|expandedMU|coverageIntervalMU StandardMU|ExpandedMU|IntervalMU
Real: {_VALUE};
  uncertainty=expandedUnc|coverageInterval|measurementUncertaintyUnivariate Expanded|Interval|Univariate?
Constant: {_VALUE}; uncertainty uncertainty?; distribution string?
CovarianceElement: value decimal; unit string
CovarianceColumn: covariances=covariance CovarianceElement+
EllipsoidalRegion: columns=covarianceMatrix/column CovarianceColumn+; {_MU}
RectangularRegion(EllipsoidalRegion):
Complex: label string?; real=valueReal decimal?; imaginary=valueImag decimal?; magnitude=valueMagnitude decimal?;
  phase=valuePhase decimal?; unit string?; phase_unit=unitPhase string?; time=dateTime datetime?; {_REGION}
ExpandedList: uncertainties=uncertaintyXMLList uncertainty[]; {_MUS}
IntervalList: standards=standardUncXMLList uncertainty[]; lows=intervalMinXMLList decimal[];
  highs=intervalMaxXMLList decimal[]; probabilities=coverageProbabilityXMLList probability[];
  distributions=distributionXMLList string[]?
ExpandedListMU: uncertainties=valueExpandedMUXMLList uncertainty[]; {_MUS}
StandardListMU: standards=valueStandardMUXMLList uncertainty[]; distributions=distributionXMLList string[]?
UnivariateList: stated=standardMUXMLList|expandedMUXMLList StandardListMU|ExpandedListMU
RealList: labels=labelXMLList string[]?; values=valueXMLList decimal[]; units=unitXMLList string[];
  times=dateTimeXMLList datetime[]?;
  uncertainty=expandedUncXMLList|coverageIntervalXMLList|measurementUncertaintyUnivariateXMLList
  ExpandedList|IntervalList|UnivariateList?;
  region=ellipsoidalRegionXMLList|rectangularRegionXMLList EllipsoidalRegion|RectangularRegion?
ListUncertainty: stated=expandedUnc|coverageInterval Expanded|Interval
RealInList: label string?; value decimal; unit string?; time=dateTime datetime?;
  uncertainty=expandedUnc|coverageInterval Expanded|Interval?
Reals: {_LIST}; unit=listUnit string?; uncertainty=listUnivariateUnc ListUncertainty?; values=real RealInList+; {_REGION}
Bivariate: {_REGION}
Complexes: {_LIST}; unit=listUnit string?; phase_unit=listUnitPhase string?; uncertainty=listBivariateUnc Bivariate?;
  values=complex Complex+; {_REGION}
Lists: {_LIST}; lists=realList|complexList|list Reals|Complexes|Lists+
Hybrid: values=real|complex|list|realList|realListXMLList|complexList|constant
  Real|Complex|Lists|Reals|RealList|Complexes|Constant+
"""

_NUMBERS = "identifications=identifications/identification IdentificationNumber"
_CLASSES = "equipment_class EquipmentClass*; description Rich?"
_SEALS = "seal=cryptElectronicSeal bool?; signature=cryptElectronicSignature bool?; time_stamp=cryptElectronicTimeStamp bool?"
_NORMS = "norms=norm text*; references=reference text*"
_OBTAINED = (
    "methods=usedMethods/usedMethod Method*; software=usedSoftware/software Software*; equipment=measuringEquipments "
    "Equipments?; conditions=influenceConditions/influenceCondition InfluenceCondition*"
)
_STATED = "metadata=measurementMetaData/metaData StatementMetadata*"

DCC = f"""
WithId: @id name?
Identified(WithId): @ref_type=refType text[]?
Referring(Identified): @ref_id=refId name[]?
Described(Referring): name Words?; description Rich?
LanguageText(Referring): text=. string; @language=lang language?
Words(WithId): contents=content LanguageText+
Latex(Referring): latex string?; mathml Markup?
Markup(Referring): nodes=*
Attached(Described): file_name text; mime_type text; data=dataBase64 bytes
Rich(Referring): name Words?; contents=content|file|formula LanguageText|Attached|Latex*
Software(Identified): name Words; release text; type software_type?; description Rich?
RefTypeDefinition: name Words; description Rich?; namespace text; link text; release text?; value text?; procedure text?;
  @ref_type=refType text[]?
IdentificationNumber(Identified): issuer issuer; value text; name Words?
Coordinates(Referring): system=positionCoordinateSystem text; reference text?; declaration Rich?;
  first=positionCoordinate1 Real; second=positionCoordinate2 Real; third=positionCoordinate3 Real?
Location!: city text*; country=countryCode country*; post_code text*; post_office_box text*; state text*; street text*;
  street_number=streetNo text*; further Rich*; coordinates=positionCoordinates Coordinates*
Somebody(Referring): name Words; email=eMail text?; phone text?; fax text?; location Location?;
  description=descriptionData Attached?
Contact(Somebody): location Location
Hash(Identified): referral Words; referral_id=referralID text; procedure text; value text; description Rich?;
  in_validity_range bool?; traceable bool?; linked=linkedReport Hash?
EquipmentClass(Identified): reference text; class_id=classID text
Characters: words=. text[]
PrimitiveQuantity(Described): value=noQuantity|charsXMLList|si:real|si:hybrid|si:complex|si:constant|si:realListXMLList
  Rich|Characters|Real|Hybrid|Complex|Constant|RealList
Item(Identified): name Words; {_CLASSES}; software=installedSoftwares/software Software*; manufacturer Somebody?; model text?;
  {_NUMBERS}+; quantities=itemQuantities/itemQuantity PrimitiveQuantity*
Items: name Words?; {_CLASSES}; owner Contact?; manufacturer Somebody?; {_NUMBERS}*; items=item Item+
PerformanceLocation(Referring): place=. place
ReplacedReport(Identified): change=typeOfChange change; identifier=replacedUniqueIdentifier text
CoreData: country=countryCodeISO3166_1 country; languages=usedLangCodeISO639_1 language+;
  mandatory_languages=mandatoryLangCodeISO639_1 language+; identifier=uniqueIdentifier text; {_NUMBERS}*;
  received=receiptDate date?; begin=beginPerformanceDate date; end=endPerformanceDate date;
  location=performanceLocation PerformanceLocation; issued=issueDate date?; replaced=reportAmendedSubstituted ReplacedReport?;
  previous=previousReport Hash?
CalibrationLaboratory: code=calibrationLaboratoryCode text?; contact Contact; {_SEALS}
Person(Identified): person Somebody; description Rich?; role text?; main_signer bool?; {_SEALS}
Method(Identified): name Words; description Rich?; {_NORMS}
Equipment(Identified): name Words; {_CLASSES}; certificate Hash?; manufacturer Somebody?; model text?; {_NUMBERS}*;
  quantities=measuringEquipmentQuantities/measuringEquipmentQuantity PrimitiveQuantity*
Equipments: name Words?; {_CLASSES}; owner Contact?; {_NUMBERS}*; equipment=measuringEquipment Equipment+
Data(Referring): parts=text|formula|byteData|xml|quantity|list Rich|Latex|Attached|Markup|DccQuantity|QuantityList+
InfluenceCondition(Identified): name Words; description Rich?; status state?; certificate Hash?; data Data
StatementMetadata(Described): countries=countryCodeISO3166_1 country*; convention text?; traceable bool?; {_NORMS};
  declaration Rich?; valid bool?; valid_list=validXMLList bool[]?; date date?; period string?;
  authority=respAuthority Contact?; conformity conformity?; conformity_list=conformityXMLList conformity[]?; data Data?;
  non_si_definition=nonSIDefinition text?; non_si_unit=nonSIUnit text?; location Location?
RelativeUncertainty: stated=relativeUncertaintyXmlList|relativeUncertaintySingle RealList|Real
DccQuantity(Described): value=noQuantity|charsXMLList|si:real|si:list|si:hybrid|si:complex|si:constant|si:realListXMLList
  Rich|Characters|Real|Lists|Hybrid|Complex|Constant|RealList;
  relative_uncertainty RelativeUncertainty?; {_OBTAINED}; {_STATED}
QuantityList(Described): time=dateTime datetime?; times=dateTimeXMLList datetime[]?; parts=list|quantity
  QuantityList|DccQuantity+; {_OBTAINED}; {_STATED}
DccResult(Referring): name Words; description Rich?; data Data
Measurement(Referring): name Words; description Rich?; {_OBTAINED}; results=results/result DccResult+; {_STATED}
Administrative!: software=dccSoftware/software Software+; ref_types=refTypeDefinitions/refTypeDefinition RefTypeDefinition*;
  core=coreData CoreData; items Items; laboratory=calibrationLaboratory CalibrationLaboratory; persons=respPersons/respPerson
  Person+; customer Contact; statements=statements/statement StatementMetadata*
Comment: nodes=*
Certificate: @version=schemaVersion version?{VERSION}; administrative=administrativeData Administrative;
  measurements=measurementResults/measurementResult Measurement+; comment Comment?; document Attached?; signatures=*
"""  # the signatures are XAdES, as they stand: what they are worth is the business of cmm_uq.certificate.sign


@dataclass(frozen=True, eq=False)
class Simple:
    """What the text of an element or an attribute may be: ``what`` follows "is not", ``read`` raises ValueError."""

    what: str
    plural: str
    read: Callable[[str], Any]
    write: Callable[[Any], str] = str


def _matching(what: str, pattern: str, plural: str = "") -> Simple:
    form = re.compile(pattern)

    def read(text: str) -> str:
        if form.fullmatch(text) is None:
            raise ValueError(text)
        return text

    return Simple(what, plural, read)


def _one_of(*words: str, plural: str = "") -> Simple:
    return _matching(f"one of {', '.join(words)}", "|".join(words), plural)


def _listed(simple: Simple) -> Simple:
    """A list of them, with spaces between."""
    return Simple(
        f"a list of {simple.plural}", "", lambda text: tuple(simple.read(part) for part in text.split()),
        lambda values: " ".join(simple.write(value) for value in values),
    )  # fmt: skip


def _number(what: str, plural: str, pattern: str, form: str = "") -> Simple:
    number = re.compile(pattern)

    def read(text: str) -> Decimal:
        text = text.strip()
        try:
            value = Decimal(text) if len(text) <= NUMERAL.most and number.fullmatch(text) else Decimal("NaN")
        except InvalidOperation:
            raise ValueError(text) from None
        if not math.isfinite(float(value)):
            raise ValueError(text)
        return value

    return Simple(what, plural, read, lambda value: format(value, form))


_BOOLEANS = {"true": True, "1": True, "false": False, "0": False}
_UNSIGNED = r"((\d*\.\d+)|(\d+\.\d*)|(\d+\.?))([Ee][-+]?\d+)?"
_SIMPLE: Mapping[str, Simple] = {
    "string": Simple("a text", "words", str),
    "text": _matching("a text without spaces at its ends", r"\S(?s:.*\S)?", "words"),
    "country": _matching("a country of ISO 3166-1, two capital letters", "[A-Z]{2}"),
    "language": _matching("a language of ISO 639-1, two small letters", "[a-z]{2}"),
    "name": _matching("a name that XML takes as an id", r"[^\W\d][\w.\-]*", "ids"),
    "version": _matching("version 3 of the schema", r"3\.[\s\S]*"),
    "decimal": _number("a number", "numbers", rf"[-+]?{_UNSIGNED}"),
    "uncertainty": _number("a number, 0 or more", "numbers, 0 or more", rf"\+?{_UNSIGNED}"),
    "factor": _number(
        "a coverage factor, 1 or more", "coverage factors, 1 or more", r"\+?(([1-9]\d*\.\d*)|([1-9]\d*))", "f"
    ),
    "probability": _number("a probability", "probabilities", r"\+?((0(\.\d*)?)|(1(\.0*)?))", "f"),
    "bool": Simple("true or false", "true and false", lambda text: _BOOLEANS[text.strip()], lambda value: str(value).lower()),
    "bytes": Simple("base64", "", lambda text: b64decode("".join(text.split()), validate=True),
                    lambda data: b64encode(data).decode()),
    "date": Simple("a date", "", lambda text: dt.date.fromisoformat(text.strip()[:10]), dt.date.isoformat),
    "datetime": Simple("a date with time", "dates with times", lambda text: dt.datetime.fromisoformat(text.strip()),
                       dt.datetime.isoformat),
    "issuer": _one_of("manufacturer", "calibrationLaboratory", "customer", "owner", "other"),
    "place": _one_of("laboratory", "customer", "laboratoryBranch", "customerBranch", "other"),
    "change": _one_of("amended", "substituted"),
    "software_type": _one_of("application", "bios", "driver", "editor", "firmware", "library", "os", "other"),
    "state": _one_of("beforeAdjustment", "afterAdjustment", "beforeRepair", "afterRepair"),
    "conformity": _one_of("pass", "fail", "conditionalPass", "conditionalFail", "noPass", "noFail",
                          plural="states of conformity"),
}  # fmt: skip
_MISSING = object()  # in place of a default


@dataclass(frozen=True)
class Field:
    """A field of a class: ``tags`` of its elements with the class of each, ``outer`` of the element that they stand in."""

    name: str
    kind: Literal["attribute", "element", "content", "foreign"]
    tags: Mapping[str, str]
    outer: tuple[str, ...]
    within: bool
    simple: Simple | None
    repeated: bool
    default: Any

    @property
    def required(self) -> bool:
        return self.default is _MISSING

    @property
    def tag(self) -> str:
        return next(iter(self.tags))


class Element:
    """A frozen record of a certificate; ``UNORDERED``: whether its elements have no order."""

    FIELDS: ClassVar[Mapping[str, Field]]
    UNORDERED: ClassVar[bool]

    def __init__(self, *positional: Any, **named: Any) -> None:
        values = {name: field.default for name, field in self.FIELDS.items()}
        values |= dict(zip(self.FIELDS, positional, strict=False)) | named
        lacking = [name for name, value in values.items() if value is _MISSING]
        if lacking or len(values) > len(self.FIELDS):
            unknown = values.keys() - self.FIELDS.keys()
            raise TypeError(f"{type(self).__name__} takes no {sorted(unknown)} and needs {lacking}")
        self.__dict__.update(values)

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        raise AttributeError(f"{type(self).__name__} is frozen")

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self.__dict__ == other.__dict__

    def __hash__(self) -> int:
        return hash((type(self), *self.__dict__.values()))

    def __repr__(self) -> str:
        changed = (f"{name}={v!r}" for name, v in self.__dict__.items() if v != self.FIELDS[name].default)
        return f"{type(self).__name__}({', '.join(changed)})"

    def __str__(self) -> str:
        """Of texts in several languages, that in English, else without a language, else the first; paragraphs in lines."""
        if "contents" not in self.FIELDS:
            return repr(self)
        parts = [part for part in self.contents if type(part).__name__ == "LanguageText"]
        texts = (
            [part.text for part in parts if part.language == language]
            for language in ("en", None, *(part.language for part in parts[:1]))
        )
        return "\n".join(next(filter(None, texts), []))

    def with_changes(self, **changes: Any) -> Self:
        return type(self)(**{**self.__dict__, **changes})


def _field(text: str, space: str) -> Field:
    match = re.fullmatch(r"(@?)(\w+)(?:=(\S+))?\s*([\w|]*)(\[\])?([?*+]?)(\S*)", text)
    if match is None:
        raise ValueError(text)
    at, name, tag, types, many, count, stated = match.groups()
    head, *rest = name.split("_")
    tag = tag or head + "".join(word.capitalize() for word in rest)
    if tag == "*":
        return Field(name, "foreign", {}, (), False, None, False, ())
    simple = _SIMPLE.get(types)
    simple = _listed(simple) if simple is not None and many else simple
    default = _MISSING if count in ("", "+") else () if many or count == "*" else stated or None
    if at or tag == ".":
        return Field(name, "attribute" if at else "content", {tag: ""}, (), False, simple, False, default)
    outer, _, inner = tag.rpartition("/")
    tags = [each if ":" in each else f"{space}:{each}" for each in inner.split("|")]
    classes = [""] if simple else types.split("|")
    within = (f"{space}:{outer}",) if outer else tuple(tags)
    places = dict(zip(tags, classes, strict=True))
    return Field(name, "element", places, within, bool(outer), simple, count in ("+", "*"), default)


def _classes() -> dict[str, type[Element]]:
    classes: dict[str, type[Element]] = {"": Element}
    Element.FIELDS = {}
    last = ("id", "ref_id", "ref_type")
    for space, table in (("si", D_SI), ("dcc", DCC)):
        for row in re.split(r"\n(?! )", table.strip()):
            name, _, fields = row.partition(":")
            name, _, base = name.rstrip(")!").partition("(")
            own = [_field(" ".join(each.split()), space) for each in fields.split(";") if each.strip()]
            every = {**classes[base].FIELDS, **{field.name: field for field in own}}
            ordered = {key: field for key, field in every.items() if key not in last}
            ordered |= {key: every[key] for key in last if key in every}
            kinds = {"FIELDS": ordered, "UNORDERED": "!" in row.partition(":")[0], "__module__": __name__}
            classes[name] = type(name, (classes[base],), kinds)
    return classes


CLASSES: Mapping[str, type[Element]] = _classes()


def __getattr__(name: str) -> Any:
    if name not in CLASSES:
        raise AttributeError(name)
    return CLASSES[name]
