"""Results in the Quality Information Framework (QIF 3.0).

Every value that a standard decides on is a characteristic with a unit of its own: its definition is the standard's
characteristic, its nominal 0 with the limits, its measurement the value with the combined standard uncertainty. So is an error
factor whose tolerance the job gives; QIF knows no characteristic without limits, and other factors are attributes of the
measurement. A decision that QIF has no word for stands in its own; what is not determined is left out.
"""

from __future__ import annotations

import uuid
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from cmm_uq.base.units import UNITS, Unit, printed_unit
from cmm_uq.base.values import dataclass, field
from cmm_uq.jobs.reports import ReportResults
from cmm_uq.jobs.verdicts import Verdicts

SPACE = "http://qifstandards.org/xsd/qif3"
VERSION = "3.0.0"
_STATUS = {"pass": "PASS", "fail": "FAIL"}  # outcomes that QIF has a word for; others are said in their own
_DOCUMENTS = uuid.UUID("6f1a7c60-3f0e-5e1b-9f7d-0b1c5d2f4a10")
"""Name space of the identifiers of documents: the same results have the same identifier."""


@dataclass(frozen=True)
class QifValue:
    """A value with its limits, of both signs."""

    definition: str  # standard and characteristic, or an effect's parameter
    item: str  # where it was measured
    value: float
    u: float | None
    limit: float | None
    unit: Unit
    outcome: str  # of the decision


@dataclass
class _Numbered:
    """Elements with identifiers that no other of the document has."""

    last: int = 0
    lists: dict[str, list[Element]] = field(default_factory=dict)

    def add(self, kind: str) -> Element:
        """A new characteristic's definition, nominal, item or measurement."""
        self.last += 1
        made = Element(f"UserDefinedUnitCharacteristic{kind}", {"id": str(self.last)})
        self.lists.setdefault(kind, []).append(made)
        return made


def qif(results: ReportResults) -> bytes:
    values, numbered = (*_tested(results), *_factors(results)), _Numbered()
    limited = [one for one in values if one.limit is not None]
    alike: dict[tuple[str, float, Unit], list[QifValue]] = {}
    for one in limited:
        alike.setdefault((one.definition, one.limit or 0.0, one.unit), []).append(one)
    for kind, of_kind in alike.items():
        _characteristic(numbered, *kind, of_kind)
    root = Element("QIFDocument", {"xmlns": SPACE, "versionQIF": VERSION, "idMax": str(numbered.last + 2)})
    job, version = results.job, results.software.version
    _text(root, "QPId", str(uuid.uuid5(_DOCUMENTS, f"{job.id} {sorted(job.inputs_sha256.items())} {version}")))
    described = f"{job.machine}, job {job.id} of {job.date}, recording {job.origin}, by cmm-uq {version}"
    _text(SubElement(root, "Header"), "Description", described)
    # its own standard, which the names of characteristics are by
    standard = SubElement(
        SubElement(root, "StandardsDefinitions", {"n": "1"}), "Standard", {"id": str(numbered.last + 1)}
    )
    _text(SubElement(standard, "Organization"), "StandardsOrganizationEnum", "ISO")
    _text(standard, "Designator", "ISO 23952")
    _text(standard, "Year", "2020")
    _units(SubElement(root, "FileUnits"), {one.unit for one in limited})
    if limited:
        aspects = SubElement(root, "Characteristics")
        _text(aspects, "FormalStandardId", standard.attrib["id"])
        for aspect in ("Definition", "Nominal", "Item"):
            _listed(aspects, f"Characteristic{aspect}s", numbered.lists[aspect])
    sets = SubElement(SubElement(root, "Results"), "MeasurementResultsSet", {"n": "1"})
    measurement = SubElement(sets, "MeasurementResults", {"id": str(numbered.last + 2)})
    _attributes(measurement, results, [one for one in values if one.limit is None])
    if limited:
        held = SubElement(measurement, "MeasuredCharacteristics")
        _listed(held, "CharacteristicMeasurements", numbered.lists["Measurement"])
    # of anything between, an incomplete test among them, QIF can only say that it is not known
    whole = _STATUS.get(_verdicts(results).overall, "UNKNOWN")
    _text(SubElement(measurement, "InspectionStatus"), "InspectionStatusEnum", whole)
    indent(root)
    content = tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{content}\n'.encode()


def _tested(results: ReportResults) -> Iterator[QifValue]:
    for statement in results.conformity:
        named = " ".join(filter(None, (statement.standard, statement.characteristic)))
        for one in statement.errors:
            place = "" if one.measurement is None else f"measurement {one.measurement}, repeat {one.repeat}"
            length = "" if one.length_mm is None else f"{one.length_mm:.10g} mm"
            item = ", ".join(filter(None, (place, length, one.position)))
            yield QifValue(named, item, one.error_um, one.u_um, one.limit_um, UNITS["µm"], one.outcome)


def _factors(results: ReportResults) -> Iterator[QifValue]:
    free = {name for combination in results.identifiability.undetermined for name in combination}
    limited = {one.name: one for one in _verdicts(results) if not one.by}
    for effect, parameters in results.estimates.items():
        for name, one in parameters.items():
            unit, verdict = printed_unit(name), limited.get(f"{effect}.{name}")
            if f"{effect}.{name}" not in free and isinstance(unit, Unit):
                yield QifValue(f"{effect}.{name}", effect, one.value, one.u, verdict.limit if verdict else None, unit,
                            verdict.outcome if verdict else "")  # fmt: skip


def _verdicts(results: ReportResults) -> Verdicts:
    return Verdicts.of_results(results.model_dump())


def _characteristic(numbered: _Numbered, named: str, limit: float, unit: Unit, values: list[QifValue]) -> None:
    """Definition and nominal of one characteristic, and an item with a measurement of each value."""
    definition = numbered.add("Definition")
    _text(definition, "Name", named)
    nominal = numbered.add("Nominal")
    _text(nominal, "CharacteristicDefinitionId", definition.attrib["id"])
    _text(nominal, "Name", named)
    for tag, at in (("TargetValue", 0.0), ("MaxValue", limit), ("MinValue", -limit)):
        _text(nominal, tag, _number(at), {"unitName": unit.qif})
    _text(nominal, "DefinedAsLimit", "true")
    for one in values:
        item = numbered.add("Item")
        _text(item, "Name", one.item or named)
        _text(item, "CharacteristicNominalId", nominal.attrib["id"])
        measured = numbered.add("Measurement")
        known = one.outcome in _STATUS
        _text(SubElement(measured, "Status"), "CharacteristicStatusEnum" if known else "OtherCharacteristicStatus",
              _STATUS.get(one.outcome, one.outcome or "not decided"))  # fmt: skip
        _text(measured, "CharacteristicItemId", item.attrib["id"])
        u = {} if one.u is None else {"combinedUncertainty": _number(one.u)}
        _text(measured, "Value", _number(one.value), {**u, "unitName": unit.qif})


def _units(parent: Element, units: set[Unit]) -> None:
    primary = SubElement(parent, "PrimaryUnits")
    length = SubElement(primary, "LinearUnit")
    _text(length, "SIUnitName", "meter")
    _text(length, "UnitName", "millimeter")
    _text(SubElement(length, "UnitConversion"), "Factor", "0.001")
    if units:
        own = SubElement(parent, "UserDefinedUnits", {"n": str(len(units))})
        for unit in sorted(units):
            one = SubElement(own, "UserDefinedUnit")
            _text(one, "WhatIsMeasured", f"{_number(unit.si)} of the coherent SI unit")
            _text(one, "UnitName", unit.qif)


def _attributes(parent: Element, results: ReportResults, values: Sequence[QifValue]) -> None:
    """Origin and decisions in words, and error factors without a tolerance."""
    said = [("origin of the recording", results.job.origin)]
    said += [(f"decision by {one.called}" if one.by else f"decision on {one.name} by its tolerance", one.outcome)
             for one in _verdicts(results)]  # fmt: skip
    figures = [(f"{one.definition} ({one.unit.qif})", one.value) for one in values]
    figures += [(f"u of {one.definition} ({one.unit.qif})", one.u) for one in values if one.u is not None]
    held = SubElement(parent, "Attributes", {"n": str(len(said) + len(figures))})
    for name, text in said:
        SubElement(held, "AttributeStr", {"name": name, "value": text})
    for name, value in figures:
        SubElement(held, "AttributeD1", {"name": name, "value": _number(value)})


def _listed(parent: Element, tag: str, elements: list[Element]) -> None:
    SubElement(parent, tag, {"n": str(len(elements))}).extend(elements)


def _text(parent: Element, tag: str, text: str, attributes: Mapping[str, str] | None = None) -> None:
    SubElement(parent, tag, dict(attributes or {})).text = text


def _number(value: float) -> str:
    """Without an exponent, which a decimal of XML has not, with all digits that results.json has."""
    text = format(Decimal(repr(float(value))), "f")
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text in ("", "-0") else text
