"""Values of a part from a report of another program: of characteristics, and of the features that it measured.

Read are results of QIF, text reports of PC-DMIS, actual features of DMIS, and CSV; each number with its unit, the step of its
last printed digit and the line on which it stands. Names are those of the report: a characteristic or feature of the job is
found by ``reported_as``, else by its own name.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TypeVar
from xml.etree.ElementTree import Element

import numpy as np

from cmm_uq.base.errors import CmmUqError, Gathered, suggestion
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import AXES, Floats
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.jobs.importing.cells.encodings import begins_with, local, report_lines, root_of
from cmm_uq.jobs.importing.documents import child, three
from cmm_uq.jobs.importing.format import HEAD, length_named
from cmm_uq.jobs.importing.pcdmis import Dimension, PcDmis, dimensions, figure_of, step_of
from cmm_uq.jobs.importing.reports import ACTUAL, DMIS_UNIT, Dmis, one_unit, statements
from cmm_uq.jobs.part.drawing import NotUnderstoodError, QifUnits, text, whole_text
from cmm_uq.jobs.part.qif import ASSOCIATIONS, WHATS
from cmm_uq.jobs.part.readings import Recording
from cmm_uq.jobs.part.tables import PartFile, Places

_COLUMNS = ("characteristic", "value_mm", "value_deg", "feature", "x_mm", "y_mm", "z_mm", "i", "j", "k", "diameter_mm")
# numbers of an actual feature of DMIS: its place, then its direction, then its diameter, as it has them
_NUMBERS_DMIS: Mapping[str, int] = {"SPHERE": 4, "CIRCLE": 7, "CYLNDR": 7, "POINT": 6, "PLANE": 6}
_Of = TypeVar("_Of")


@dataclass(frozen=True)
class ReportedValue:
    """A value as the report states it."""

    value: float  # mm or degrees
    angle: bool
    step: float  # of the last printed digit, mm or degrees
    where: str  # file and line


@dataclass(frozen=True, eq=False)
class ReportedFeature:
    """A feature as the report states it, in its coordinates."""

    where: str
    step: float = math.inf  # of the last digit of its lengths, mm
    point: Floats | None = None  # (3,) mm
    direction: Floats | None = None  # (3,) of length one
    diameter_mm: float | None = None
    association: str = ""  # as the report says; empty where it does not


@dataclass(frozen=True, eq=False)
class Reported:
    """What a report says of the job's characteristics and features, by their names in the job."""

    file: str
    program: Text
    values: Mapping[str, ReportedValue]
    features: Mapping[str, ReportedFeature]
    # once they are settled: standard uncertainties by the last printed digit of values, mm and rad, and names of those
    # characteristics that follow from features
    rounding: Mapping[str, float] = field(default_factory=dict)
    derived: tuple[str, ...] = ()


@dataclass
class _Contents:
    """All that a report holds, by its own names; what cannot be read is refused where it is asked for."""

    program: Text
    values: dict[str, list[Callable[[], ReportedValue]]] = field(default_factory=dict)
    features: dict[str, list[Callable[[], ReportedFeature]]] = field(default_factory=dict)
    only_known: bool = False  # whether every name must be one of the job
    padded: bool = False  # whether zeros at the end of a number are printed


def reported_values(content: bytes, where: str, file: str, facts: PartFile, places: Places) -> Reported:
    """What the report says of the job; names that lead nowhere are refused, and a report that says nothing of it."""
    contents, wrong = _read(content, where), Gathered()
    values, features = dict[str, ReportedValue](), dict[str, ReportedFeature]()
    for i, one in enumerate(facts.characteristic):
        at = places.of("characteristic", "reported_as", i) if one.reported_as else ""
        name = one.reported_as or one.name
        if len(contents.values.get(name, ())) > 1:  # of several kinds, as the diameter and the position of one call-out
            kinds = [f"{name}.{sort}" for sort, what in WHATS.items() if what == one.what]
            name = next((kind for kind in kinds if kind in contents.values), name)
        for found in _asked(name, contents.values, "value", at, where, wrong):
            values[one.name] = found
            if found.angle != (one.asks.limits == "angles"):
                sort = "an angle" if found.angle else "a length"
                said = f"{one.reported_as or one.name!r} is {sort}, and the job asks for {one.what}"
                wrong.tell(said, where=found.where, fix="Name another value by reported_as")
    for i, feature in enumerate(facts.feature):
        at = places.of("feature", "reported_as", i) if feature.reported_as else ""
        name = feature.reported_as or feature.name
        for known in _asked(name, contents.features, "feature", at, where, wrong):
            features[feature.name] = known
            if known.association and known.association != feature.association:
                said = f"{feature.name!r} was associated by {known.association}, and by the job it is by {feature.association}"
                fix = f"Give association = {known.association!r}, or have it evaluated as the drawing says"
                wrong.tell(said, where=known.where, fix=fix)
    every = [*contents.values, *contents.features]
    own = [one.reported_as or one.name for one in facts.characteristic]
    own += [one.reported_as or one.name for one in facts.feature]
    for name in [name for name in every if contents.only_known and name not in own]:
        said = f"there is no characteristic or feature {name!r} in the job"
        wrong.tell(said, where=where, fix=suggestion(name, own))
    wrong.refuse()
    if not values and not features:
        said = f"has none of the job's characteristics or features; it has {', '.join(every[:12]) or 'nothing'}"
        raise CmmUqError(said, where=where, fix='Name them in the job: reported_as = "…"')
    whole = Reported(file, contents.program, values, features)
    return whole if contents.padded else _printed_alike(whole)


def _printed_alike(given: Reported) -> Reported:
    """With the step of the finest length, and angle, for all: zeros at the end are left out."""
    steps = {angle: [one.step for one in given.values.values() if one.angle == angle] for angle in (False, True)}
    steps[False] += [one.step for one in given.features.values()]
    finest = {angle: min(own, default=math.inf) for angle, own in steps.items()}
    values = {name: replace(one, step=finest[one.angle]) for name, one in given.values.items()}
    features = {name: replace(one, step=finest[False]) for name, one in given.features.items()}
    return replace(given, values=values, features=features)


def _asked(
    name: str, held: Mapping[str, Sequence[Callable[[], _Of]]], what: str, at: str, where: str, wrong: Gathered
) -> list[_Of]:
    """What the report holds by a name, nothing or one; wrong is anything else, and nothing by what is named ``at`` a key."""
    found = held.get(name, ())
    if at and not found:
        wrong.tell(f"{where} has no {what} {name!r}", where=at, fix=suggestion(name, held))
    if len(found) > 1:
        said = f"has {len(found)} {what}s {name!r}, and which of them is of this part is not known"
        wrong.tell(said, where=where, fix="Give the report of one part, or name another by reported_as")
    if len(found) == 1:
        with wrong.going_on():
            return [found[0]()]
    return []


def _read(content: bytes, where: str) -> _Contents:
    head = content[:HEAD]
    if begins_with(head, "QIFDocument"):
        return _of_qif(content, where)
    for known, read in ((PcDmis(), _of_pcdmis), (Dmis(), _of_dmis)):
        if known.recognises(head):
            return read(report_lines(content, where)[0], where)
    return _of_csv(content, where)


def _number(written: str, where: str) -> float:
    try:
        value = figure_of(written)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        said = f"has {written[:40]!r} where a number belongs" if written else "has no value where one belongs"
        raise CmmUqError(said, where=where, fix="Export the report again, with every value")
    return value


def _value(written: str, factor: float, where: str, *, angle: bool = False) -> ReportedValue:
    """``factor``: mm or degrees of its unit."""
    return ReportedValue(factor * _number(written, where), angle, factor * step_of(written), where)


def _feature(
    where: str, factor: float, point: Sequence[str] = (), direction: Sequence[str] = (), diameter: str = "",
    association: str = "",
) -> ReportedFeature:  # fmt: skip
    """Of what is written; ``factor``: mm of its unit."""
    lengths = [*point, *([diameter] if diameter else [])]
    numbers = [factor * _number(each, where) for each in lengths]
    along = np.array([_number(each, where) for each in direction])
    length = float(np.linalg.norm(along)) if len(along) else 0.0
    if len(along) and not length:
        raise CmmUqError("has a direction of no length", where=where, fix="Export the report again")
    return ReportedFeature(
        where, min((factor * step_of(each) for each in lengths), default=math.inf),
        np.array(numbers[:3]) if point else None, along / length if length else None, numbers[-1] if diameter else None,
        association,
    )  # fmt: skip


def _millimetres(unit: str, where: str) -> float:
    found = length_named(unit)
    if found is None:
        problem = f"the unit {unit!r} is no length" if unit else "does not say its unit of length"
        raise CmmUqError(problem, where=where, fix="Export the report with its unit, as mm or inch")
    return float(found.up / found.down)


def _of_pcdmis(lines: Sequence[str], where: str) -> _Contents:
    """Rows of dimensions as ``LOC1.D``, a dimension of one row by its own name too; locations as features, of as many rows."""
    found, located = _Contents(say("PC-DMIS text report"), padded=True), dict[str, list[Dimension]]()
    for one in dimensions(lines, where):
        for axis in one.rows:
            read = partial(_row, one, axis)
            found.values.setdefault(f"{one.name}.{axis}", []).append(read)
            if len(one.rows) == 1:
                found.values.setdefault(one.name, []).append(read)
        if one.rows and (of := one.location_of) is not None:
            own = located.setdefault(of[1], [])
            further = own and own[-1].unit == one.unit and not own[-1].rows.keys() & one.rows.keys()
            own[-1:] = [replace(one, rows={**own[-1].rows, **one.rows})] if further else [*own[-1:], one]
    found.features.update({name: [partial(_location, one) for one in own] for name, own in located.items()})
    return found


def _row(one: Dimension, axis: str) -> ReportedValue:
    written, where = one.measured(axis), one.rows[axis][2]
    if axis != "A" and one.at_material_condition(axis):
        said = f"{one.name}.{axis} holds at a material condition, which is not modelled"
        fix = "Have it evaluated regardless of size (RFS), or leave the characteristic out"
        raise CmmUqError(said, where=where, fix=fix)
    factor = 1.0 if axis == "A" else _millimetres(one.unit, where) * (2 if axis == "R" else 1)
    return _value(written, factor, where, angle=axis == "A")


def _location(one: Dimension) -> ReportedFeature:
    """Of a location with X, Y and Z; else its diameter alone."""
    where, axes = next(iter(one.rows.values()))[2], [axis.upper() for axis in AXES]
    point = [one.measured(axis) for axis in axes] if set(axes) <= set(one.rows) else ()
    diameter = one.measured("D") if "D" in one.rows else ""
    return _feature(where, _millimetres(one.unit, where), point, diameter=diameter)


def _of_dmis(lines: Sequence[str], where: str) -> _Contents:
    """Actual features, ``FA(BORE)=FEAT/CYLNDR,INNER,CART,x,y,z,i,j,k,d``."""
    found, unit = _Contents(say("DMIS output (ISO 22093)")), ""
    for line, statement in statements(lines, where):
        at = f"{where} line {line}"
        if match := DMIS_UNIT.match(statement):
            unit = one_unit(unit or None, match[1], at)
        elif (match := ACTUAL.match(statement)) and (sort := match["sort"].upper()) in _NUMBERS_DMIS:
            words = [word.strip() for word in match["rest"].split(",")]
            found.features.setdefault(match["name"].strip(), []).append(partial(_actual, sort, words, unit, at))
    return found


def _actual(sort: str, words: Sequence[str], unit: str, where: str) -> ReportedFeature:
    numbers, needed = [word for word in words if not word[:1].isalpha()], _NUMBERS_DMIS[sort]
    if "CART" not in map(str.upper, words) or len(numbers) < needed:
        fix = "Put it out with CART; if it is the last one, the file was cut off"
        raise CmmUqError(f"is no {sort} in CART with {needed} numbers", where=where, fix=fix)
    direction, diameter = numbers[3:6] if needed >= 6 else (), numbers[needed - 1] if needed in (4, 7) else ""
    return _feature(where, _millimetres(unit, where), numbers[:3], direction, diameter)


def _of_qif(content: bytes, where: str) -> _Contents:
    """Measured characteristics by the name of their item, with their kind as ``10.Diameter``, or else its designator."""
    root = root_of(content, where)
    found, units = _Contents(say("QIF results")), QifUnits(root, where)
    by_id = {element.get("id", ""): element for element in root.iter() if element.get("id")}
    designated: dict[str, list[Callable[[], ReportedValue]]] = {}
    for element in root.iter():
        tag, at = local(element), f"{where}: {local(element)} id {element.get('id', '')}"
        characteristic = tag.endswith("CharacteristicMeasurement")
        if not characteristic and not tag.endswith("FeatureMeasurement"):
            continue
        item = by_id.get(child(element, "CharacteristicItemId" if characteristic else "FeatureItemId"))
        if item is None:
            continue
        if characteristic:
            read = partial(_measured_characteristic, element, units, at, angle=tag.startswith("Angle"))
            name = child(item, "Name") or f"characteristic {item.get('id', '')}"
            for key in (name, f"{name}.{tag.removesuffix('CharacteristicMeasurement')}"):
                found.values.setdefault(key, []).append(read)
            if (designator := _within(item, "Designator")) != name:
                designated.setdefault(designator, []).append(read)
        else:
            name = child(item, "FeatureName") or f"feature {item.get('id', '')}"
            nominal = by_id.get(child(item, "FeatureNominalId"))
            said = None if nominal is None else nominal.find("{*}SubstituteFeatureAlgorithm")
            how = ASSOCIATIONS.get(whole_text(said), "")
            found.features.setdefault(name, []).append(partial(_measured_feature, element, units, how, at))
    found.values.update({name: own for name, own in designated.items() if name and name not in found.values})
    return found


def _within(element: Element, name: str) -> str:
    """Text of the first element of this name anywhere in another."""
    return (element.findtext(f".//{{*}}{name}") or "").strip()


def _measured_characteristic(element: Element, units: QifUnits, where: str, *, angle: bool) -> ReportedValue:
    inner = element.find("{*}Value")
    if inner is None:
        status = _within(element, "CharacteristicStatusEnum") or "no status"
        raise CmmUqError(f"has no Value ({status})", where=where, fix="Measure it, or leave the characteristic out")
    return _value(text(inner), _factor(inner, units, where, angle=angle), where, angle=angle)


def _factor(element: Element, units: QifUnits, where: str, *, angle: bool = False) -> float:
    """What one of its unit is, mm or degrees."""
    one = Element(element.tag, element.attrib)
    one.text = "1"
    try:
        return units.degrees(one) if angle else units.mm(one)
    except NotUnderstoodError as error:
        raise CmmUqError(str(error), where=where, fix="Export the results with FileUnits") from None


def _measured_feature(element: Element, units: QifUnits, association: str, where: str) -> ReportedFeature:
    axis, diameter = element.find("{*}Axis"), element.find("{*}Diameter")
    of, place = (element, "Location") if axis is None else (axis, "AxisPoint")
    point, direction = of.find(f"{{*}}{place}"), child(of, "Direction") or child(of, "Normal")
    factors = {_factor(each, units, where) for each in (point, diameter) if each is not None}
    if len(factors) > 1:
        raise CmmUqError("has its place and its diameter in two units", where=where, fix="Export it in one unit")
    return _feature(
        where, factors.pop() if factors else 1.0, () if point is None else three(text(point), where),
        three(direction, where) if direction else (), "" if diameter is None else text(diameter), association,
    )  # fmt: skip


def _of_csv(content: bytes, where: str) -> _Contents:
    """Rows of ``characteristic`` with ``value_mm`` or ``value_deg``, or of ``feature`` with its place and diameter."""
    table, found = Recording.of(content, where), _Contents(Verbatim("CSV"), only_known=True)
    header = table.header
    strange = [name for name in header if name not in _COLUMNS]
    if strange or not {"characteristic", "feature"} & set(header):
        said = f"has a column {strange[0]!r}" if strange else "has neither a column 'characteristic' nor 'feature'"
        raise CmmUqError(said, where=where, fix=f"Its columns are some of {', '.join(_COLUMNS)}")
    for row, line in enumerate(table.rows):
        cells, at = {**dict.fromkeys(_COLUMNS, ""), **dict(zip(header, line, strict=True))}, table.at(row)
        name, length, angle, feature, *placed, diameter = (cells[column] for column in _COLUMNS)
        if bool(name) == bool(feature) or bool(length and angle):
            said = "is not of one characteristic with value_mm or value_deg, or of one feature"
            raise CmmUqError(said, where=at, fix="Give each a row of its own")
        if name:
            found.values.setdefault(name, []).append(partial(_value, length or angle, 1.0, at, angle=bool(angle)))
            continue
        point, along = (own if any(own) else () for own in (placed[:3], placed[3:]))
        found.features.setdefault(feature, []).append(partial(_feature, at, 1.0, point, along, diameter))
    return found
