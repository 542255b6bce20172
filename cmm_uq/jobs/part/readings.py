"""Measured points of a part, and recordings of the other methods."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from cmm_uq.base.errors import CmmUqError, Gathered, suggestion
from cmm_uq.base.files.csv_table import GIVE, CsvTable, cells_of, numbers
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass, field
from cmm_uq.jobs.part.probed import Probed
from cmm_uq.jobs.part.tables import CalibratedPartFacts, OrientationsFacts, PartFile, Places

COLUMNS = ("feature", "point", "x_mm", "y_mm", "z_mm")
FAR_MM = 5.0  # from the nominal contact point: a measured one farther away is in another frame, unit or order
# by what the factor of points in another unit to those in mm is; a scale that is off by a hundredth is another matter
_IN_UNITS = {1 / 25.4: "in inches", 1e-3: "in metres", 25.4: "taken for inches once too often", 1e3: "in µm"}
_VALUES = ("value_mm", "value_deg")
_LARGEST = 1_000_000  # number of a cycle, orientation or repeat
_FAR = 0.01  # share of a standard's size beyond which a reading is of another one, or in another unit
ReadFile = Callable[[str], tuple[bytes, str]]  # bytes of a file that the job names, and its name in messages


class Recording(CsvTable):
    """A table as it was recorded."""

    @classmethod
    def of(cls, content: bytes, where: str, *, empty: bool = False) -> Recording:
        table = cls(**vars(cells_of(content, where, "Save it as CSV in UTF-8, with commas between the columns")))
        table.refuse_uneven()
        if not table.rows and not empty:
            raise CmmUqError("has no rows", where=where, fix="Record the measurements")
        return table

    def points(self, fix: str = GIVE) -> Floats:
        """(n, 4) number of each point, and its coordinates."""
        return np.column_stack([self.numbers(name, fix) for name in COLUMNS[1:]])

    def keys(self, group: str) -> list[tuple[int, int]]:
        """Numbers of cycle or orientation and of repeat of each row; one repeat where there is no such column."""
        found = {"repeat": [1.0] * len(self.rows)}
        for name in (group, *({"repeat"} & {*self.header})):
            found[name] = self.numbers(name).tolist()
            for row, value in enumerate(found[name]):
                if value != int(value) or not 0 <= value <= _LARGEST:
                    said = f"{value:g} is no number of a {name}"
                    raise CmmUqError(said, where=self.at(row, name), fix="Count from 1")
        return [(int(of), int(repeat)) for of, repeat in zip(found[group], found["repeat"], strict=True)]


def measured_points(content: bytes, where: str, features: Sequence[Probed]) -> Floats:
    """(n, 3) measured points in the order of the plan's, mm."""
    table = Recording.of(content, where, empty=True)
    for name in COLUMNS:
        table.texts(name, f"Its columns are {', '.join(COLUMNS)}, with commas between them")
    number = table.points("Give a number: every point of the plan is needed")
    return _in_order(table, list(range(len(number))), number, where, features)


def _in_order(table: Recording, some: Sequence[int], number: Floats, where: str, features: Sequence[Probed]) -> Floats:
    """(n, 3) points in the order of the plan's, of some rows, which name feature and point; ``number``: of all rows."""
    known, names = {one.facts.name: one for one in features}, table.texts("feature")
    rows: dict[tuple[str, int], int] = {}
    wrong = Gathered()
    for row in some:
        name, index, at = names[row], float(number[row, 0]), f"{where} line {table.lines[row]}"
        count = len(known[name].points) if name in known else 0
        if name not in known:
            wrong.tell(f"there is no feature {name!r}", where=at, fix=suggestion(name, known))
        elif index != int(index) or not 1 <= index <= count:
            wrong.tell(f"{name!r} has no point {index:g}", where=at, fix=f"It has 1 to {count} by its plan")
        elif (name, int(index)) in rows:
            wrong.tell(f"point {index:g} of {name!r} stands there twice", where=at, fix="Leave one of them out")
        else:
            rows[name, int(index)] = row
            away = float(np.linalg.norm(number[row, 1:] - known[name].points[int(index) - 1]))
            if away > FAR_MM:
                said = f"point {index:g} of {name!r} lies {away:.4g} mm from where it is planned"
                wrong.tell(said, where=at, fix="Give it in mm in the frame of the part, in the order of the plan")
    if wrong.problems and rows:
        planned = np.array([known[name].points[index - 1] for name, index in rows])
        _refuse_another_unit(planned, number[list(rows.values()), 1:], where)
    wrong.refuse()
    planned_rows = [(one.facts.name, index) for one in features for index in range(1, len(one.points) + 1)]
    for name, index in planned_rows:
        if (name, index) not in rows:
            fix = f"Give all of its {len(known[name].points)} points"
            raise CmmUqError(f"point {index} of {name!r} is missing", where=where, fix=fix)
    return np.asarray(number[[rows[key] for key in planned_rows], 1:])


def in_another_unit(factor: float) -> str | None:
    """The unit in which figures are that are so many times those in mm; ``None`` where the factor is of none."""
    return next((words for each, words in _IN_UNITS.items() if abs(factor / each - 1) < 0.01), None)


def _refuse_another_unit(planned: Floats, found: Floats, where: str) -> None:
    """Say it once where all points (n, 3) are off by the factor of another unit, about the part's origin."""
    factor = float(np.sum(found * planned)) / (float(np.sum(planned**2)) or 1.0)
    unit = in_another_unit(factor)
    if unit and np.linalg.norm(found / factor - planned, axis=1).max() <= FAR_MM:
        said = f"the points are {factor:.4g} times those of the plan, as if they were {unit}"
        raise CmmUqError(said, where=where, fix="Give them in mm in the frame of the part")


@dataclass(frozen=True, eq=False)
class Repeats:
    """A part measured n times: by values of characteristics or by points."""

    group: Ints  # (n,) number of the cycle or orientation of each
    values: Mapping[str, Floats]  # by characteristic, (n,) mm or rad; empty where points were recorded
    points: Floats | None = None  # (n, p, 3) in the order of the plan's; ``None`` where values were recorded


@dataclass(frozen=True, eq=False)
class StandardReadings:
    """A standard as it was measured: (n,) values in mm, and the orientation of each."""

    values: Floats
    group: Ints


@dataclass(frozen=True, eq=False)
class OtherReadings:
    """Recordings of the other methods; ``None`` where the job has none."""

    calibrated: Repeats | None = None
    orientations: Repeats | None = None
    length: StandardReadings | None = None
    tips: Mapping[str, StandardReadings] = field(default_factory=dict)


def other_readings(
    facts: PartFile, features: Sequence[Probed], places: Places, read: ReadFile, wrong: Gathered
) -> OtherReadings:
    """Read and check the recordings that ``[by_calibrated_part]`` and ``[by_orientations]`` name; problems are gathered."""
    calibrated = orientations = length = None
    tips: dict[str, StandardReadings] = {}
    if (one := facts.by_calibrated_part) is not None:
        _check_calibrated(one, facts, places.of("by_calibrated_part", "characteristic"), wrong)
        with wrong.going_on():
            calibrated = _repeats(*read(one.file), "cycle", facts, features, [each.name for each in one.characteristic])
    if (two := facts.by_orientations) is not None:
        _check_tips(two, facts, places.of("by_orientations", "probe_standard"), wrong)
        with wrong.going_on():
            orientations = _repeats(*read(two.file), "orientation", facts, features, None)
            _refuse_unequal(orientations, two.file)
        if two.length_standard is not None:
            with wrong.going_on():
                length = _standard(*read(two.length_standard.file), "length_mm", two.length_standard.length_mm)
        for probe in two.probe_standard:
            with wrong.going_on():
                stylus = probe.stylus or facts.stylus[0].name
                tips[stylus] = _standard(*read(probe.file), "diameter_mm", probe.diameter_mm)
    return OtherReadings(calibrated, orientations, length, tips)


def _check_calibrated(one: CalibratedPartFacts, facts: PartFile, where: str, wrong: Gathered) -> None:
    asked = {each.name: each for each in facts.characteristic}
    names = [each.name for each in one.characteristic]
    for i, each in enumerate(one.characteristic):
        if each.name not in asked:
            wrong.tell(f"there is no characteristic {each.name!r}", where=where, fix=suggestion(each.name, asked))
        elif each.name in names[:i]:
            wrong.tell(f"{each.name!r} stands there twice", where=where, fix="Give each characteristic once")
        elif each.angle != (asked[each.name].asks.limits == "angles"):
            fix = f"Give {'value_deg and u_arcsec' if not each.angle else 'value_mm and u_um'}"
            wrong.tell(f"{each.name!r} is stated in the wrong unit", where=where, fix=fix)


def _check_tips(one: OrientationsFacts, facts: PartFile, where: str, wrong: Gathered) -> None:
    styli, seen = [each.name for each in facts.stylus], set[str]()
    for probe in one.probe_standard:
        name = probe.stylus or styli[0]
        if not probe.stylus and len(styli) > 1:
            said = f"there are {len(styli)} styli, and a probe_standard does not say which measured it"
            wrong.tell(said, where=where, fix=f"Give stylus = {styli[0]!r} or another")
        elif name not in styli:
            wrong.tell(f"there is no stylus {name!r}", where=where, fix=suggestion(name, styli))
        elif name in seen:
            wrong.tell(f"the stylus {name!r} has two standards", where=where, fix="Give it one")
        else:
            seen.add(name)


def _repeats(
    content: bytes, where: str, group: str, facts: PartFile, features: Sequence[Probed], needed: Sequence[str] | None
) -> Repeats:
    """Values or points by cycle or orientation.

    ``needed``: characteristics whose values must be there; ``None`` takes those that are.
    """
    table = Recording.of(content, where)
    by_points = "feature" in table.header
    if not by_points and "characteristic" not in table.header:
        fix = f"Its columns are {group}, repeat, characteristic, value_mm, or {group}, repeat, {', '.join(COLUMNS)}"
        raise CmmUqError("has neither a column 'characteristic' nor 'feature'", where=where, fix=fix)
    keys = table.keys(group)
    measured = sorted(set(keys))
    number = np.array([key[0] for key in measured], dtype=np.int64)
    if not by_points:
        return Repeats(number, _values(table, keys, group, facts, needed))
    found, read = [], table.points()
    for key in measured:
        rows, its = [row for row, own in enumerate(keys) if own == key], f"{where}: {group} {key[0]}, repeat {key[1]}"
        found.append(_in_order(table, rows, read, its, features))
    return Repeats(number, {}, np.array(found))


def _values(
    table: Recording, keys: Sequence[tuple[int, int]], group: str, facts: PartFile, needed: Sequence[str] | None
) -> dict[str, Floats]:
    """(n,) by characteristic, mm or rad, in the order of the measurements."""
    asked = {one.name: one for one in facts.characteristic}
    found: dict[str, dict[tuple[int, int], float]] = {}
    wrong = Gathered()
    for row, (name, key) in enumerate(zip(table.texts("characteristic"), keys, strict=True)):
        if name not in asked:
            wrong.tell(f"there is no characteristic {name!r}", where=table.at(row), fix=suggestion(name, asked))
        elif key in found.setdefault(name, {}):
            told = f"{name!r} stands there twice for {group} {key[0]}, repeat {key[1]}"
            wrong.tell(told, where=table.at(row), fix="Number the repeats, or leave one of them out")
        else:
            with wrong.going_on():
                found[name][key] = _value(table, row, angle=asked[name].asks.limits == "angles")
    wrong.refuse()
    measured = sorted(set(keys))
    for name in needed if needed is not None else found:
        if lacking := [key for key in measured if key not in found.get(name, {})]:
            said = f"{name!r} has no value for {group} {lacking[0][0]}, repeat {lacking[0][1]}"
            raise CmmUqError(said, where=table.where, fix="Give it for each measurement")
    whole = (name for name in asked if len(found.get(name, {})) == len(measured))
    return {name: np.array([found[name][key] for key in measured]) for name in whole}


def _value(table: Recording, row: int, *, angle: bool) -> float:
    """A value of a row, mm or rad."""
    column = _VALUES[angle]
    if column not in table.header:
        fix = f"Give {'angles' if angle else 'lengths'} in it"
        raise CmmUqError(f"has no column {column!r}", where=table.where, fix=fix)
    text = table.rows[row][table.header.index(column)]
    value = float(numbers([text], lambda _: table.at(row, column))[0])
    return float(np.radians(value)) if angle else value


def _standard(content: bytes, where: str, column: str, calibrated: float) -> StandardReadings:
    table = Recording.of(content, where)
    keys, values = table.keys("orientation"), table.numbers(column)
    seen, wrong = set[tuple[int, int]](), Gathered()
    for row, (key, value) in enumerate(zip(keys, values.tolist(), strict=True)):
        if key in seen:
            said = f"orientation {key[0]}, repeat {key[1]} stands there twice"
            wrong.tell(said, where=table.at(row), fix="Number the repeats")
        seen.add(key)
        if abs(value - calibrated) > _FAR * calibrated:
            said = f"{value:g} mm is not the standard of {calibrated:g} mm"
            wrong.tell(said, where=table.at(row), fix="Give it in mm, as the machine read it")
    wrong.refuse()
    found = StandardReadings(values, np.array([key[0] for key in keys], dtype=np.int64))
    _refuse_unequal(found, where)
    return found


def _refuse_unequal(one: Repeats | StandardReadings, where: str) -> None:
    names, counts = np.unique(one.group, return_counts=True)
    few, many, least = names[np.argmin(counts)], names[np.argmax(counts)], counts.min()
    if len(names) < 2:
        raise CmmUqError("was measured in one orientation alone", where=where, fix="Measure in four, two at least")
    if least < 2:
        fix = "Measure five times in each, twice at least"
        raise CmmUqError(f"orientation {few} was measured once", where=where, fix=fix)
    if least != counts.max():
        told = f"orientation {few} was measured {least} times, orientation {many} {counts.max()} times"
        raise CmmUqError(told, where=where, fix="Measure as often in each")
