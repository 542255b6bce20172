"""Measured points of a part, and recordings of the other methods."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from cmm_uq.base.errors import CmmUqError, Gathered, suggestion
from cmm_uq.base.files.csv_table import Cells, cells_of, numbers
from cmm_uq.base.points import Floats, Ints
from cmm_uq.jobs.part.probed import Probed
from cmm_uq.jobs.part.tables import CalibratedPartFacts, OrientationsFacts, PartFile, Places

COLUMNS = ("feature", "point", "x_mm", "y_mm", "z_mm")
FAR_MM = 5.0  # from the nominal contact point: a measured one farther away is in another frame, unit or order
# by what the factor of points in another unit to those in mm is; a scale that is off by a hundredth is another matter
_IN_UNITS = {1 / 25.4: "in inches", 1e-3: "in metres", 25.4: "taken for inches once too often", 1e3: "in µm"}
_FIX = "Save it as CSV in UTF-8, with commas between the columns"


def measured_points(content: bytes, where: str, features: Sequence[Probed]) -> Floats:
    """(n, 3) measured points in the order of the plan's, mm."""
    cells = cells_of(content, where, _FIX)
    for name in COLUMNS:
        if name not in cells.header:
            raise CmmUqError(f"has no column {name!r}", where=where,
                             fix=f"Its columns are {', '.join(COLUMNS)}, with commas between them")  # fmt: skip
    short = next((i for i, row in enumerate(cells.rows) if len(row) != len(cells.header)), None)
    if short is not None:
        raise CmmUqError(f"has {len(cells.rows[short])} cells, and the header {len(cells.header)}",
                         where=f"{where} line {cells.lines[short]}", fix="Complete the row")  # fmt: skip
    place = [cells.header.index(name) for name in COLUMNS]
    number = np.column_stack([_column(cells, i, where) for i in place[1:]])
    names = [row[place[0]] for row in cells.rows]
    return in_order(names, number[:, 0], number[:, 1:], cells, where, features)


def _column(cells: Cells, i: int, where: str) -> Floats:
    return numbers(
        [row[i] for row in cells.rows],
        lambda row: f"{where} line {cells.lines[row]}, column {cells.header[i]}",
        "Give a number: every point of the plan is needed",
    )


def in_order(
    names: Sequence[str], point: Floats, xyz: Floats, cells: Cells, where: str, features: Sequence[Probed]
) -> Floats:
    """(n, 3) points in the order of the plan's, of rows that name feature and point."""
    known = {one.facts.name: one for one in features}
    rows: dict[tuple[str, int], int] = {}
    wrong = Gathered()
    for row, (name, index) in enumerate(zip(names, point.tolist(), strict=True)):
        at = f"{where} line {cells.lines[row]}"
        count = len(known[name].points) if name in known else 0
        if name not in known:
            wrong.add(CmmUqError(f"there is no feature {name!r}", where=at, fix=suggestion(name, known)))
        elif index != int(index) or not 1 <= index <= count:
            wrong.add(CmmUqError(f"{name!r} has no point {index:g}", where=at, fix=f"It has 1 to {count} by its plan"))
        elif (name, int(index)) in rows:
            wrong.add(
                CmmUqError(f"point {index:g} of {name!r} stands there twice", where=at, fix="Leave one of them out")
            )
        else:
            rows[name, int(index)] = row
            away = float(np.linalg.norm(xyz[row] - known[name].points[int(index) - 1]))
            if away > FAR_MM:
                wrong.add(CmmUqError(f"point {index:g} of {name!r} lies {away:.4g} mm from where it is planned", where=at,
                                     fix="Give it in mm in the frame of the part, in the order of the plan"))  # fmt: skip
    if wrong.problems:
        _refuse_another_unit(rows, xyz, known, where)
    wrong.refuse()
    for one in features:
        for index in range(1, len(one.points) + 1):
            if (one.facts.name, index) not in rows:
                raise CmmUqError(f"point {index} of {one.facts.name!r} is missing", where=where,
                                 fix=f"Give all of its {len(one.points)} points")  # fmt: skip
    wanted = [rows[one.facts.name, index] for one in features for index in range(1, len(one.points) + 1)]
    return np.asarray(xyz[wanted])


def _refuse_another_unit(
    rows: Mapping[tuple[str, int], int], xyz: Floats, known: Mapping[str, Probed], where: str
) -> None:
    """Say it once where all points are off by the factor of another unit, about the part's origin."""
    if not rows:
        return
    planned = np.array([known[name].points[index - 1] for name, index in rows])
    found = xyz[list(rows.values())]
    factor = float(np.sum(found * planned)) / (float(np.sum(planned**2)) or 1.0)
    unit = next((words for each, words in _IN_UNITS.items() if abs(factor / each - 1) < 0.01), None)
    if unit and np.linalg.norm(found / factor - planned, axis=1).max() <= FAR_MM:
        raise CmmUqError(f"the points are {factor:.4g} times those of the plan, as if they were {unit}", where=where,
                         fix="Give them in mm in the frame of the part")  # fmt: skip


_VALUES = ("value_mm", "value_deg")
_LARGEST = 1_000_000  # number of a cycle, orientation or repeat
ReadFile = Callable[[str], tuple[bytes, str]]  # bytes of a file that the job names, and its name in messages


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
        _check_calibrated(one, facts, places, wrong)
        with wrong.going_on():
            calibrated = _repeats(*read(one.file), "cycle", facts, features, [each.name for each in one.characteristic])
    if (two := facts.by_orientations) is not None:
        _check_tips(two, facts, places, wrong)
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


def _check_calibrated(one: CalibratedPartFacts, facts: PartFile, places: Places, wrong: Gathered) -> None:
    asked = {each.name: each for each in facts.characteristic}
    names = [each.name for each in one.characteristic]
    for i, each in enumerate(one.characteristic):
        where = places.of("by_calibrated_part", "characteristic")
        if each.name not in asked:
            wrong.add(
                CmmUqError(f"there is no characteristic {each.name!r}", where=where, fix=suggestion(each.name, asked))
            )
        elif each.name in names[:i]:
            wrong.add(CmmUqError(f"{each.name!r} stands there twice", where=where, fix="Give each characteristic once"))
        elif each.angle != (asked[each.name].asks.limits == "angles"):
            unit = "value_deg and u_arcsec" if not each.angle else "value_mm and u_um"
            wrong.add(CmmUqError(f"{each.name!r} is stated in the wrong unit", where=where, fix=f"Give {unit}"))


def _check_tips(one: OrientationsFacts, facts: PartFile, places: Places, wrong: Gathered) -> None:
    styli = [each.name for each in facts.stylus]
    seen: list[str] = []
    for probe in one.probe_standard:
        where = places.of("by_orientations", "probe_standard")
        if not probe.stylus and len(styli) > 1:
            said = f"there are {len(styli)} styli, and a probe_standard does not say which measured it"
            wrong.add(CmmUqError(said, where=where, fix=f"Give stylus = {styli[0]!r} or another"))
        elif probe.stylus and probe.stylus not in styli:
            wrong.add(
                CmmUqError(f"there is no stylus {probe.stylus!r}", where=where, fix=suggestion(probe.stylus, styli))
            )
        elif (name := probe.stylus or styli[0]) in seen:
            wrong.add(CmmUqError(f"the stylus {name!r} has two standards", where=where, fix="Give it one"))
        else:
            seen.append(name)


def _repeats(
    content: bytes, where: str, group: str, facts: PartFile, features: Sequence[Probed], needed: Sequence[str] | None
) -> Repeats:
    """Values or points by cycle or orientation.

    ``needed``: characteristics whose values must be there; ``None`` takes those that are.
    """
    cells = _cells(content, where)
    if "feature" in cells.header:
        return _of_points(cells, where, group, features)
    if "characteristic" not in cells.header:
        raise CmmUqError("has neither a column 'characteristic' nor 'feature'", where=where,
                         fix=f"Its columns are {group}, repeat, characteristic, value_mm, or {group}, repeat, "
                             f"{', '.join(COLUMNS)}")  # fmt: skip
    return _of_values(cells, where, group, facts, needed)


def _of_values(cells: Cells, where: str, group: str, facts: PartFile, needed: Sequence[str] | None) -> Repeats:
    asked = {one.name: one for one in facts.characteristic}
    keys = _keys(cells, where, group)
    names = _text(cells, "characteristic", where)
    found: dict[str, dict[tuple[int, int], float]] = {}
    wrong = Gathered()
    for row, (name, key) in enumerate(zip(names, keys, strict=True)):
        at = f"{where} line {cells.lines[row]}"
        if name not in asked:
            wrong.add(CmmUqError(f"there is no characteristic {name!r}", where=at, fix=suggestion(name, asked)))
            continue
        if key in found.setdefault(name, {}):
            told = f"{name!r} stands there twice for {group} {key[0]}, repeat {key[1]}"
            wrong.add(CmmUqError(told, where=at, fix="Number the repeats, or leave one of them out"))
            continue
        with wrong.going_on():
            found[name][key] = _value(cells, row, where, angle=asked[name].asks.limits == "angles")
    wrong.refuse()
    measured = sorted(set(keys))
    for name in needed if needed is not None else found:
        if lacking := [key for key in measured if key not in found.get(name, {})]:
            raise CmmUqError(f"{name!r} has no value for {group} {lacking[0][0]}, repeat {lacking[0][1]}", where=where,
                             fix="Give it for each measurement")  # fmt: skip
    values = {name: np.array([found[name][key] for key in measured])
              for name in asked if len(found.get(name, {})) == len(measured)}  # fmt: skip
    return Repeats(np.array([key[0] for key in measured], dtype=np.int64), values)


def _value(cells: Cells, row: int, where: str, *, angle: bool) -> float:
    """A value of a row, mm or rad."""
    column = _VALUES[angle]
    if column not in cells.header:
        raise CmmUqError(f"has no column {column!r}", where=where, fix=f"Give {'angles' if angle else 'lengths'} in it")
    at = f"{where} line {cells.lines[row]}, column {column}"
    value = float(numbers([cells.rows[row][cells.header.index(column)]], lambda _: at)[0])
    return float(np.radians(value)) if angle else value


def _of_points(cells: Cells, where: str, group: str, features: Sequence[Probed]) -> Repeats:
    keys = _keys(cells, where, group)
    names = _text(cells, "feature", where)
    number = np.column_stack([_column_of_by_readings(cells, name, where) for name in COLUMNS[1:]])
    measured = sorted(set(keys))
    found = []
    for key in measured:
        rows = [row for row, own in enumerate(keys) if own == key]
        part = Cells(cells.header, cells.header_line, [cells.rows[r] for r in rows], [cells.lines[r] for r in rows])
        its = f"{where}: {group} {key[0]}, repeat {key[1]}"
        found.append(in_order([names[r] for r in rows], number[rows, 0], number[rows, 1:], part, its, features))
    return Repeats(np.array([key[0] for key in measured], dtype=np.int64), {}, np.array(found))


def _standard(content: bytes, where: str, column: str, calibrated: float) -> StandardReadings:
    cells = _cells(content, where)
    keys = _keys(cells, where, "orientation")
    values = _column_of_by_readings(cells, column, where)
    wrong, seen = Gathered(), set[tuple[int, int]]()
    for row, (key, value) in enumerate(zip(keys, values.tolist(), strict=True)):
        at = f"{where} line {cells.lines[row]}"
        if key in seen:
            wrong.add(CmmUqError(f"orientation {key[0]}, repeat {key[1]} stands there twice", where=at,
                                 fix="Number the repeats"))  # fmt: skip
        seen.add(key)
        if abs(value - calibrated) > _FAR * calibrated:
            wrong.add(CmmUqError(f"{value:g} mm is not the standard of {calibrated:g} mm", where=at,
                                 fix="Give it in mm, as the machine read it"))  # fmt: skip
    wrong.refuse()
    found = StandardReadings(values, np.array([key[0] for key in keys], dtype=np.int64))
    _refuse_unequal(found, where)
    return found


_FAR = 0.01  # share of a standard's size beyond which a reading is of another one, or in another unit


def _refuse_unequal(one: Repeats | StandardReadings, where: str) -> None:
    names, counts = np.unique(one.group, return_counts=True)
    if len(names) < 2:
        raise CmmUqError("was measured in one orientation alone", where=where, fix="Measure in four, two at least")
    if counts.min() < 2:
        raise CmmUqError(f"orientation {names[np.argmin(counts)]} was measured once", where=where,
                         fix="Measure five times in each, twice at least")  # fmt: skip
    if counts.min() != counts.max():
        few, many = names[np.argmin(counts)], names[np.argmax(counts)]
        told = f"orientation {few} was measured {counts.min()} times, orientation {many} {counts.max()} times"
        raise CmmUqError(told, where=where, fix="Measure as often in each")


def _cells(content: bytes, where: str) -> Cells:
    cells = cells_of(content, where, _FIX)
    if not cells.rows:
        raise CmmUqError("has no rows", where=where, fix="Record the measurements")
    short = next((i for i, row in enumerate(cells.rows) if len(row) != len(cells.header)), None)
    if short is not None:
        raise CmmUqError(f"has {len(cells.rows[short])} cells, and the header {len(cells.header)}",
                         where=f"{where} line {cells.lines[short]}", fix="Complete the row")  # fmt: skip
    return cells


def _keys(cells: Cells, where: str, group: str) -> list[tuple[int, int]]:
    """Numbers of cycle or orientation and of repeat of each row; one repeat where there is no such column."""
    of = _whole(cells, group, where)
    repeat = _whole(cells, "repeat", where) if "repeat" in cells.header else [1] * len(of)
    return list(zip(of, repeat, strict=True))


def _whole(cells: Cells, name: str, where: str) -> list[int]:
    found = _column_of_by_readings(cells, name, where)
    for row, value in enumerate(found.tolist()):
        if value != int(value) or not 0 <= value <= _LARGEST:
            raise CmmUqError(f"{value:g} is no number of a {name}",
                             where=f"{where} line {cells.lines[row]}, column {name}", fix="Count from 1")  # fmt: skip
    return [int(value) for value in found.tolist()]


def _text(cells: Cells, name: str, where: str) -> list[str]:
    place = _place(cells, name, where)
    return [row[place] for row in cells.rows]


def _column_of_by_readings(cells: Cells, name: str, where: str) -> Floats:
    return numbers(_text(cells, name, where), lambda row: f"{where} line {cells.lines[row]}, column {name}")


def _place(cells: Cells, name: str, where: str) -> int:
    if name not in cells.header:
        raise CmmUqError(f"has no column {name!r}", where=where, fix=f"Give it; there are {', '.join(cells.header)}")
    return cells.header.index(name)
