"""Error maps as service contractors hand them over: a text file with a table for each axis (Harris 2004 appendix B).

The columns of an axis are its position, the linear error, two straightnesses and three rotations; a line of axis letters
above the table says along or about which axis each of them is. Displacements are µm, angles arc seconds. The squareness
is printed as 90° less the angle between the axes, with the sign opposite to the project's, and is turned here. Scanned
copies repeat the headings at every page and carry stray marks; both are passed over.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.content import content_of
from cmm_uq.base.files.limits import LINE, MAP_BYTES, MAP_ROWS
from cmm_uq.base.files.numbers import number_problem
from cmm_uq.base.points import AXES, Floats
from cmm_uq.base.units import ARCSECOND
from cmm_uq.machine.physics.error_map import UNITS, AxisErrors, ErrorMap, check_positions, check_units

_TABLE = re.compile(r"map data:\s*([xyz])[\s-]*axis", re.IGNORECASE)
_SQUARENESS = re.compile(r"\b(xy|yz|zx|xz)\s*:\s*(\S+)", re.IGNORECASE)
_LETTERS = re.compile(r"[xyz](?:\s+[xyz]){6}", re.IGNORECASE)
_STRAY = str.maketrans(dict.fromkeys("□•·■", " "))
_ORDER = {"x": "xyzyzx", "y": "yzxxzy", "z": "zxyxyz"}
"""Columns after the position as appendix B has them: linear, straightness twice, rotation three times."""


@dataclass
class _Reading:
    """What has been read so far."""

    axis: str = ""
    columns: dict[str, str] = field(default_factory=lambda: dict(_ORDER))
    rows: dict[str, list[tuple[list[float], str]]] = field(default_factory=lambda: {axis: [] for axis in AXES})
    squareness: dict[str, float] = field(default_factory=dict)


def read_error_map_text(path: Path, *, temperature: float = 20.0) -> ErrorMap:
    """Error map and squareness from a contractor's text file.

    Parameters
    ----------
    temperature : at which it was taken, °C; the file does not say.

    Raises
    ------
    CmmUqError : what is wrong, with its line.
    """
    content = content_of(path, MAP_BYTES, "Check the name of the map")
    return parse_error_map_text(content, str(path), temperature=temperature)


def parse_error_map_text(content: bytes, where: str, *, temperature: float = 20.0) -> ErrorMap:
    """Error map and squareness from the content of a contractor's text file; see :func:`read_error_map_text`.

    Raises
    ------
    CmmUqError : the text is too long, incomplete, or not in µm and arc seconds.
    """
    reading = _Reading()
    lines = content.decode("utf-8-sig", errors="replace").splitlines()
    if len(lines) > MAP_ROWS.most or len(max(lines, key=len, default="")) > LINE.most:
        raise CmmUqError(
            f"has {len(lines)} lines of up to {len(max(lines, key=len))} characters", where=where,
            fix=f"{MAP_ROWS.most} lines of {LINE.most} characters are the most of an error map",
        )  # fmt: skip
    for number, line in enumerate(lines, 1):
        _read_line(reading, line.translate(_STRAY).strip(), f"{where} line {number}")
    carriages = [_carriage(reading, axis, where) for axis in AXES]
    check_units(carriages, where)
    missing = [pair for pair in ("xy", "yz", "zx") if pair not in reading.squareness]
    if missing:
        raise CmmUqError(
            f"the squareness {missing[0].upper()} is missing", where=where, fix="Add a line such as  XY: 0.0"
        )
    x, y, z = carriages
    found = ErrorMap((x, y, z), temperature=temperature, source=where, sha256=hashlib.sha256(content).hexdigest())
    # contractors print 90° less the angle; the project's S is the angle less 90°
    return found.with_squareness_arcsec(*(-reading.squareness[pair] for pair in ("xy", "yz", "zx")))


def tables_of(text: str) -> list[str]:
    """Axes of the tables in a contractor's text, in their order; empty where it is none."""
    found = (_TABLE.search(line) for line in text.splitlines() if not line.lstrip().startswith("#"))
    return [match[1].lower() for match in found if match]


def error_map_text(error_map: ErrorMap, *, name: str = "errors.txt") -> str:
    """Contractor's text of a map, as :func:`read_error_map_text` reads it."""
    lines = [f"File Name: {name}", "", "Axis Parameters:", "Axis\tMin Position\tMax Position\tPoints"]
    for axis, carriage in zip(AXES, error_map.axes, strict=True):
        low, high = carriage.span
        lines.append(f"{axis.upper()}\t{low:g}\t{high:g}\t{len(carriage.positions)}")
    lines.append("Squareness Parameters:")
    for pair, angle in zip(("XY", "YZ", "ZX"), error_map.squareness, strict=True):
        lines.append(f"{pair}: {-angle / ARCSECOND:.12g}")
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
        _check_letters(letters, reading.axis, where)
        reading.columns[reading.axis] = letters[1:]
    elif reading.axis and re.match(r"[-+.\d]", line):
        reading.rows[reading.axis].append((_numbers(line, where), where))
    elif not reading.axis and (pair := _SQUARENESS.search(line)):
        name = "zx" if pair[1].lower() == "xz" else pair[1].lower()
        reading.squareness[name] = _numbers(pair[2], where, 1)[0]


def _check_letters(letters: str, axis: str, where: str) -> None:
    if letters[:2] != 2 * axis or sorted(letters[1:4]) != list(AXES) or sorted(letters[4:]) != list(AXES):
        raise CmmUqError(
            f"axis letters {' '.join(letters.upper())} are no heading of axis {axis}",
            where=where,
            fix="They are the axis itself, then each axis once for displacements (linear first) and once for rotations",
        )


def _numbers(text: str, where: str, wanted: int = 7) -> list[float]:
    cells = text.split()
    values = [] if any(map(number_problem, cells)) else [float(cell) for cell in cells]
    if len(values) != wanted:
        raise CmmUqError(
            f"{text!r} is not {'a number' if wanted == 1 else f'{wanted} numbers'}",
            where=where,
            fix="Position, three displacements, three rotations",
        )
    return values


def _places(order: str) -> list[int]:
    """Column of (dx, dy, dz, rx, ry, rz) that each column of the text means."""
    return [AXES.index(a) for a in order[:3]] + [3 + AXES.index(a) for a in order[3:]]


def _carriage(reading: _Reading, axis: str, where: str) -> AxisErrors:
    rows = reading.rows[axis]
    if not rows:
        raise CmmUqError(f"no table of axis {axis}", where=where, fix=f"It begins with  Map Data: {axis.upper()} Axis")
    positions = [values[0] for values, _ in rows]
    check_positions(axis, positions, [place for _, place in rows], where)
    errors: Floats = np.empty((len(rows), 6))
    errors[:, _places(reading.columns[axis])] = [values[1:] for values, _ in rows]
    return AxisErrors(np.array(positions), errors * UNITS)
