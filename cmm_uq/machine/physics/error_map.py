"""Error maps: the six errors of each carriage along its travel, as CSV or as service contractors hand them over.

Inside, displacements are mm and rotations rad, true = indicated + e. Files carry µm and arc seconds. A contractor's text
has a table for each axis (Harris 2004 appendix B): its position, the linear error, two straightnesses and three rotations;
a line of axis letters above the table says along or about which axis each of them is. The squareness is printed as 90° less
the angle between the axes, with the sign opposite to the project's, and is turned here. Repeated headings and stray marks
are passed over.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.csv_table import csv_table, number_problem
from cmm_uq.base.files.limits import LINE, MAP_BYTES, MAP_ROWS, content_of
from cmm_uq.base.points import AXES, Floats, Machine
from cmm_uq.base.units import ARCSECOND, MICROMETRE
from cmm_uq.base.values import dataclass, field, replace

if TYPE_CHECKING:
    from cmm_uq.machine.physics.map_interpolation import MapCovariance

COLUMNS = ("dx_um", "dy_um", "dz_um", "rx_arcsec", "ry_arcsec", "rz_arcsec")
UNITS = np.array([MICROMETRE] * 3 + [ARCSECOND] * 3)  # unit of each column, in mm and rad
PAIRS = ("xy", "yz", "zx")  # of axes, in the order of every squareness
FINE_UM, STEP_UM = 0.5, 0.01  # A map with no displacement above the one and some below the other was not written in µm


@dataclass(frozen=True, eq=False)
class AxisErrors:
    positions: Floats  # (m,) scale readings, mm, increasing
    errors: Floats  # (m, 6) displacements along x, y, z in mm and rotations about x, y, z in rad

    @property
    def span(self) -> tuple[float, float]:
        return float(self.positions[0]), float(self.positions[-1])


@dataclass(frozen=True, eq=False)
class ErrorMap:
    """Errors of carriages x, y, z, and the squareness of the axes, at one temperature."""

    axes: tuple[AxisErrors, AxisErrors, AxisErrors]  # carriages x, y, z
    squareness: Floats = field(default_factory=lambda: np.zeros(3))  # (3,) Sxy, Syz, Szx, rad
    temperature: float = 20.0  # at which it was taken, °C
    source: str = ""  # where it comes from
    sha256: str = ""  # of the file, where it comes from one
    covariance: MapCovariance | None = None  # of its figures; ``None`` where nobody states it

    def with_squareness_arcsec(self, xy: float, yz: float, zx: float) -> ErrorMap:
        """The map with squareness errors in ″, in the project's sign: e_x = −Sxy·y, e_y = −Syz·z, e_x = −Szx·z."""
        return replace(self, squareness=ARCSECOND * np.array([xy, yz, zx]))

    @property
    def squareness_arcsec(self) -> dict[str, float]:
        """Sxy, Syz, Szx in ″ by their pair of axes, as they were stated."""
        return {pair: round(float(s) / ARCSECOND, 9) for pair, s in zip(PAIRS, self.squareness, strict=True)}

    def covers(self, machine: Machine) -> None:
        for axis, carriage, (low, high) in zip(AXES, self.axes, machine.travel_mm, strict=True):
            first, last = carriage.span
            if first > low or last < high:
                ratio, fix = (last - first) / (high - low), "Map the whole travel, or give the travel that is used"
                for factor, unit in ((1e-3, "m"), (1e3, "µm"), (1 / 25.4, "inches")):
                    if abs(ratio / factor - 1) < 0.2:
                        fix = f"The positions seem to be in {unit}: convert them to mm"
                problem = f"axis {axis} is mapped from {first:g} to {last:g} mm, the travel is {low:g} to {high:g} mm"
                raise CmmUqError(problem, where=self.source or None, fix=fix)


def read_error_map(path: Path, *, temperature: float = 20.0, units_checked: bool = True) -> ErrorMap:
    """Error map from a CSV file; see :func:`parse_error_map`."""
    content = content_of(path, MAP_BYTES, "Check the name of the map")
    return parse_error_map(content, str(path), temperature=temperature, units_checked=units_checked)


def parse_error_map(content: bytes, where: str, *, temperature: float = 20.0, units_checked: bool = True) -> ErrorMap:
    """Error map from the content of a CSV file with ``axis, position_mm`` and :data:`COLUMNS`.

    ``content``: of the file, UTF-8. ``temperature``: at which the map was taken, °C. ``units_checked``: refuse numbers that
    cannot be µm and arc seconds.
    """
    table = csv_table(content, where, ("axis", "position_mm", *COLUMNS), most_rows=MAP_ROWS)
    unknown = [name for name in table.header if name not in ("axis", "position_mm", *COLUMNS)]
    if unknown:
        fix = f"Known: axis, position_mm, {', '.join(COLUMNS)}"
        raise CmmUqError(f"unknown column {unknown[0]!r}", where=where, fix=fix)
    rows_of: dict[str, list[int]] = {axis: [] for axis in AXES}
    for row in range(len(table.rows)):
        axis = table.rows[row][table.header.index("axis")].lower()
        if axis not in rows_of:
            raise CmmUqError(f"axis {axis!r}", where=table.at(row), fix="The moving carriage is x, y or z")
        rows_of[axis].append(row)
    carriages = []
    for axis, rows in rows_of.items():
        positions = [table.number(row, "position_mm") for row in rows]
        check_positions(axis, positions, [table.at(row) for row in rows], where)
        values = np.array([[table.number(row, column) for column in COLUMNS] for row in rows])
        carriages.append(AxisErrors(np.array(positions), values * UNITS))
    if units_checked:
        check_units(carriages, where)
    x, y, z = carriages
    return ErrorMap((x, y, z), temperature=temperature, source=where, sha256=hashlib.sha256(content).hexdigest())


def error_map_csv(error_map: ErrorMap) -> str:
    """The carriages' errors as CSV; squareness and temperature belong to the job that names the file."""
    lines = [",".join(("axis", "position_mm", *COLUMNS))]
    for axis, carriage in zip(AXES, error_map.axes, strict=True):
        for position, errors in zip(carriage.positions, carriage.errors / UNITS, strict=True):
            lines.append(",".join([axis, f"{position:.12g}", *(f"{value:.12g}" for value in errors)]))
    return "\n".join(lines) + "\n"


def write_error_map(error_map: ErrorMap, path: Path) -> None:
    path.write_text(error_map_csv(error_map), encoding="utf-8")


def check_positions(axis: str, positions: Sequence[float], places: Sequence[str], where: str) -> None:
    if len(positions) < 2:
        raise CmmUqError(f"axis {axis} has {len(positions)} positions", where=where, fix="An axis needs two or more")
    seen = set(positions[:1])
    for (before, here), place in zip(pairwise(positions), places[1:], strict=True):
        if here in seen:
            raise CmmUqError(f"axis {axis}: position {here:g} mm is there twice", where=place, fix="Remove one")
        if here < before:
            fix = "Sort the positions of each axis, lowest first"
            raise CmmUqError(f"axis {axis}: position {here:g} mm comes after {before:g} mm", where=place, fix=fix)
        seen.add(here)


def check_units(carriages: Sequence[AxisErrors], where: str) -> None:
    displacements = np.abs(np.concatenate([c.errors[:, :3].ravel() for c in carriages])) / MICROMETRE
    rotations = np.abs(np.concatenate([c.errors[:, 3:].ravel() for c in carriages])) / ARCSECOND
    moved, turned, problem = displacements.max(), rotations.max(), None
    if 0 < moved < FINE_UM and displacements[displacements > 0].min() < STEP_UM:
        problem = f"the largest displacement is {moved:.3g} µm: the map seems to be in mm, 1000 times off"
    elif moved > 20_000:
        problem = f"a displacement of {moved:.3g} µm: the map is not in µm"
    elif 0 < turned < 1e-3:
        problem = f"the largest rotation is {turned:.3g}″: the map seems to be in rad or mm/m"
    elif turned > 3600:
        problem = f"a rotation of {turned:.3g}″: the map is not in arc seconds"
    if problem is not None:
        raise CmmUqError(problem, where=where, fix="Convert displacements to µm and rotations to arc seconds")


_TABLE = re.compile(r"map data:\s*([xyz])[\s-]*axis", re.IGNORECASE)
_SQUARENESS = re.compile(r"\b(xy|yz|zx|xz)\s*:\s*(\S+)", re.IGNORECASE)
_LETTERS = re.compile(r"[xyz](?:\s+[xyz]){6}", re.IGNORECASE)
_STRAY = str.maketrans(dict.fromkeys("□•·■", " "))
# columns after the position as appendix B has them: linear, straightness twice, rotation three times
_ORDER = {"x": "xyzyzx", "y": "yzxxzy", "z": "zxyxyz"}


@dataclass
class _Reading:
    axis: str = ""
    columns: dict[str, str] = field(default_factory=lambda: dict(_ORDER))
    rows: dict[str, list[tuple[list[float], str]]] = field(default_factory=lambda: {axis: [] for axis in AXES})
    squareness: dict[str, float] = field(default_factory=dict)


def read_error_map_text(path: Path, *, temperature: float = 20.0) -> ErrorMap:
    """Error map and squareness from a contractor's text file.

    ``temperature``: at which it was taken, °C; the file does not say.
    """
    content = content_of(path, MAP_BYTES, "Check the name of the map")
    return parse_error_map_text(content, str(path), temperature=temperature)


def parse_error_map_text(content: bytes, where: str, *, temperature: float = 20.0) -> ErrorMap:
    reading = _Reading()
    lines = content.decode("utf-8-sig", errors="replace").splitlines()
    if len(lines) > MAP_ROWS.most or len(max(lines, key=len, default="")) > LINE.most:
        fix = f"{MAP_ROWS.most} lines of {LINE.most} characters are the most of an error map"
        raise CmmUqError(f"has {len(lines)} lines of up to {len(max(lines, key=len))} characters", where=where, fix=fix)
    for number, line in enumerate(lines, 1):
        _read_line(reading, line.translate(_STRAY).strip(), f"{where} line {number}")
    carriages = [_carriage_of_error_map_text(reading, axis, where) for axis in AXES]
    check_units(carriages, where)
    if missing := [pair for pair in PAIRS if pair not in reading.squareness]:
        problem = f"the squareness {missing[0].upper()} is missing"
        raise CmmUqError(problem, where=where, fix="Add a line such as  XY: 0.0")
    x, y, z = carriages
    found = ErrorMap((x, y, z), temperature=temperature, source=where, sha256=hashlib.sha256(content).hexdigest())
    # contractors print 90° less the angle; the project's S is the angle less 90°
    return found.with_squareness_arcsec(*(-reading.squareness[pair] for pair in PAIRS))


def tables_of(text: str) -> list[str]:
    """Axes of the tables in a contractor's text, in their order; empty where it is none."""
    found = (_TABLE.search(line) for line in text.splitlines() if not line.lstrip().startswith("#"))
    return [match[1].lower() for match in found if match]


def error_map_text(error_map: ErrorMap, *, name: str = "errors.txt") -> str:
    lines = [f"File Name: {name}", "", "Axis Parameters:", "Axis\tMin Position\tMax Position\tPoints"]
    for axis, carriage in zip(AXES, error_map.axes, strict=True):
        low, high = carriage.span
        lines.append(f"{axis.upper()}\t{low:g}\t{high:g}\t{len(carriage.positions)}")
    lines.append("Squareness Parameters:")
    for pair, angle in zip(PAIRS, error_map.squareness, strict=True):
        lines.append(f"{pair.upper()}: {-angle / ARCSECOND:.12g}")
    for axis, carriage in zip(AXES, error_map.axes, strict=True):
        order = _ORDER[axis]
        lines += ["", f"Map Data: {axis.upper()} Axis", "", "\t".join((axis + order).upper())]
        lines.append("Position\tLinear\tStraight\tStraight\tRotation\tRotation\tRotation")
        for position, errors in zip(carriage.positions, carriage.errors / UNITS, strict=True):
            values = [errors[i] for i in _places(order)]
            lines.append("\t".join([f"{position:.12g}", *(f"{value:.12g}" for value in values)]))
    return "\n".join(lines) + "\n"


def _read_line(reading: _Reading, line: str, where: str) -> None:
    if table := _TABLE.search(line):
        reading.axis = table[1].lower()
    elif reading.axis and _LETTERS.fullmatch(line):
        letters = "".join(line.split()).lower()
        if letters[:2] != 2 * reading.axis or sorted(letters[1:4]) != list(AXES) or sorted(letters[4:]) != list(AXES):
            fix = (
                "They are the axis itself, then each axis once for displacements (linear first) and once for rotations"
            )
            problem = f"axis letters {' '.join(letters.upper())} are no heading of axis {reading.axis}"
            raise CmmUqError(problem, where=where, fix=fix)
        reading.columns[reading.axis] = letters[1:]
    elif reading.axis and re.match(r"[-+.\d]", line):
        reading.rows[reading.axis].append((_numbers(line, where), where))
    elif not reading.axis and (pair := _SQUARENESS.search(line)):
        name = "zx" if pair[1].lower() == "xz" else pair[1].lower()
        reading.squareness[name] = _numbers(pair[2], where, 1)[0]


def _numbers(text: str, where: str, wanted: int = 7) -> list[float]:
    cells = text.split()
    values = [] if any(map(number_problem, cells)) else [float(cell) for cell in cells]
    if len(values) != wanted:
        problem = f"{text!r} is not {'a number' if wanted == 1 else f'{wanted} numbers'}"
        raise CmmUqError(problem, where=where, fix="Position, three displacements, three rotations")
    return values


def _places(order: str) -> list[int]:
    """Column of (dx, dy, dz, rx, ry, rz) that each column of the text means."""
    return [AXES.index(a) for a in order[:3]] + [3 + AXES.index(a) for a in order[3:]]


def _carriage_of_error_map_text(reading: _Reading, axis: str, where: str) -> AxisErrors:
    rows = reading.rows[axis]
    if not rows:
        raise CmmUqError(f"no table of axis {axis}", where=where, fix=f"It begins with  Map Data: {axis.upper()} Axis")
    positions = [values[0] for values, _ in rows]
    check_positions(axis, positions, [place for _, place in rows], where)
    errors: Floats = np.empty((len(rows), 6))
    errors[:, _places(reading.columns[axis])] = [values[1:] for values, _ in rows]
    return AxisErrors(np.array(positions), errors * UNITS)


_FORMS = (
    f"A CSV begins with axis,position_mm,{','.join(COLUMNS)}; a text has a table under  Map Data: X Axis  for each axis"
)


def parse_map_file(content: bytes, where: str, *, temperature: float = 20.0) -> tuple[ErrorMap, bool]:
    """Error map from the content of a file, and whether the file states the squareness.

    ``content``: of the file, UTF-8. ``temperature``: at which the map was taken, °C.
    """
    text = content.decode("utf-8-sig", errors="replace")
    header = next((line for line in text.splitlines() if line.strip(" ,\t") and not line.lstrip().startswith("#")), "")
    csv, tables = "," in header, tables_of(text)
    if tables and csv:
        raise CmmUqError("begins as a CSV and has tables under “Map Data” as a text", where=where, fix=_FORMS)
    if tables:
        return parse_error_map_text(content, where, temperature=temperature), True
    if text.strip() and not csv:
        raise CmmUqError("is no error map in either form that is read", where=where, fix=_FORMS)
    return parse_error_map(content, where, temperature=temperature), False
