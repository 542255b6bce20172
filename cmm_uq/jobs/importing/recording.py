"""Reads a recording: a CSV with one row a point.

Every cell is checked where it stands, so that a message can name line and column. What a column of a known name must
look like is listed here once; any other numeric column is kept as a covariate.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import compress
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError, Gathered, suggestion
from cmm_uq.base.files.csv_table import cells_of, column_problem
from cmm_uq.base.files.numbers import GIVE, GIVE_OR_REMOVE, LARGEST, MEASURE, conversion, numbers
from cmm_uq.base.files.table import LONGEST_MM
from cmm_uq.base.points import Floats, Machine, Points

COORDINATES = ("x_mm", "y_mm", "z_mm")
REQUIRED = ("measurement", "point", *COORDINATES)
OPTIONAL = (
    "repeat", "reference_mm", "reference_u_um", "reference_U_um", "approach_x", "approach_y", "approach_z",
    "reference_x_mm", "reference_y_mm", "reference_z_mm", "reference_u_x_um", "reference_u_y_um", "reference_u_z_um",
    "nx", "ny", "nz", "time_s", "temp_x_c", "temp_y_c", "temp_z_c", "temp_artefact_c",
    "temp_table_top_c", "temp_table_bottom_c", "temp_air_c", "pressure_hpa", "humidity_pct", "speed_mm_s", "gamma_deg",
    "tip_x_mm", "tip_y_mm", "tip_z_mm", "radius_mm", "fit_rms_um", "n_points",
)  # fmt: skip
WHOLE = ("measurement", "point", "repeat")
QUANTITIES: Mapping[str, str] = MappingProxyType(
    {re.sub(r"_(mm|um|c|s|hpa|pct|deg|mm_s)$", "", name): name for name in (*REQUIRED, *OPTIONAL)}
)
LARGEST_NUMBER = 1e9  # of a measurement, point or repeat

LARGEST_OF: Mapping[str, float] = MappingProxyType({"_mm": LONGEST_MM, "_um": 1e9, "_c": 1e5, "_pct": 1e6, "_deg": 1e6})
"""By the ending of a column's name: far beyond any recording in its unit, so that a mistaken unit is still told as one."""

SHORTEST_NORMAL, LONGEST_NORMAL = 1e-3, 1e3
"""Lengths between which nx, ny, nz are taken for a direction: rounded to three digits, or scaled."""

OTHER_UNITS = re.compile(
    r"_(m|cm|um|µm|mm|nm|in|inch|mil|k|f|c|min|ms|h|s|pa|kpa|hpa|mbar|mmhg|rad|deg|arcsec|pct|percent)$"
)


def read_recording(content: bytes, name: str, machine: Machine, without: Collection[str] = ()) -> Points:
    wrong, table = Gathered(), dict[str, Floats]()
    header, rows, lines = _table(content, name, wrong)
    with wrong.going_on():
        _check_header(header, name)
    if not set(REQUIRED) <= set(header):
        wrong.refuse()  # the cells of another table are another's

    def column_of(i: int) -> Floats:
        fix = MEASURE if header[i] in COORDINATES else GIVE if header[i] in REQUIRED else GIVE_OR_REMOVE
        return numbers([row[i] for row in rows], lambda row: f"{name} line {lines[row]}, column {header[i]}", fix)

    for i, column in enumerate(header):
        if column in without:
            continue
        with wrong.going_on():
            table[column] = column_of(i)
    return points_of(table, lines, name, machine, wrong)


def points_of(
    table: Mapping[str, Floats], lines: Sequence[int], name: str, machine: Machine, wrong: Gathered | None = None
) -> Points:
    """Points of the columns of a recording, each (n,), those of :data:`REQUIRED` among them."""
    wrong = wrong or Gathered()

    def refuse(bad: NDArray[np.bool_], problem: Callable[[float], str], fix: str, column: str, of: Floats) -> None:
        if bad.any():
            row = int(np.argmax(bad))
            at = f"{name} line {lines[row]}" + (f", column {column}" if column else "")
            wrong.add(CmmUqError(problem(of[row]), where=at, fix=fix))

    for column, values in table.items():
        if column not in WHOLE:
            most = largest(column)
            refuse(np.abs(values) > most, "{:g} is more than anything that is measured".format,
                   f"{most:g} is the most: check its unit and its exponent", column, values)  # fmt: skip
    # normals are brought to unit length where they are used: a direction must be meant
    if all(f"n{axis}" in table for axis in "xyz"):
        length = np.sqrt(sum(table[f"n{axis}"] ** 2 for axis in "xyz"))
        refuse((length != 0) & ((length < SHORTEST_NORMAL) | (length > LONGEST_NORMAL)),
               "the normal nx, ny, nz has the length {:.3g}".format, "Give outward unit normals", "", length)  # fmt: skip
    for column in WHOLE:
        values = table.get(column, np.zeros(0))
        refuse((values != np.round(values)) | (np.abs(values) > LARGEST_NUMBER), "{:g} is not a whole number".format,
               "Number measurements, points and repeats 1, 2, …", column, values)  # fmt: skip
    for column in ("approach_x", "approach_y", "approach_z"):
        values = table.get(column, np.zeros(0))
        refuse(~np.isin(values, (-1, 0, 1)), "{:g} is no direction".format,
               "The direction of travel into the point is −1, 0 or +1", column, values)  # fmt: skip
    wrong.refuse()
    number = {column: table.get(column, np.ones(len(lines))).astype(np.int64) for column in WHOLE}
    points = Points(
        np.column_stack([table["x_mm"], table["y_mm"], table["z_mm"]]),
        number["measurement"], number["point"], number["repeat"], machine,
        {column: values for column, values in table.items() if column not in (*REQUIRED, "repeat")},
        np.array(lines, dtype=np.int64),
    )  # fmt: skip
    _check_unique(points, name)
    return points


def _table(content: bytes, name: str, wrong: Gathered) -> tuple[list[str], list[list[str]], list[int]]:
    """Header, complete rows and their lines; rows of another length are gathered."""
    cells = cells_of(content, name, "Save the recording as CSV in UTF-8")
    whole = [len(row) == len(cells.header) for row in cells.rows]
    for row, line in zip(cells.rows, cells.lines, strict=True):
        if len(row) != len(cells.header):
            wrong.add(CmmUqError(
                f"has {len(row)} cells where the header has {len(cells.header)}", where=f"{name} line {line}",
                fix="Complete the row; if it is the last one, the file was cut off: export it again",
            ))  # fmt: skip
    if not cells.rows:
        raise CmmUqError("has no rows", where=name, fix="The first line names the columns, then one row a point")
    return cells.header, list(compress(cells.rows, whole)), list(compress(cells.lines, whole))


def _check_header(header: Sequence[str], name: str) -> None:
    where = f"{name} line 1"
    if len(header) == 1 and ";" in header[0]:
        raise CmmUqError("cells are separated by semicolons", where=where,
                         fix="Separate them by commas, with a decimal point in numbers")  # fmt: skip
    wrong = Gathered()
    for i, column in enumerate(header):
        if not column:
            wrong.add(CmmUqError(f"column {i + 1} has no name", where=where, fix="Name it, or remove it"))
        elif column in header[:i]:
            wrong.add(CmmUqError(f"the column {column!r} is there twice", where=where, fix="Keep one"))
        elif problem := column_problem(column):
            wrong.add(CmmUqError(problem, where=where, fix="Name it with letters, digits and _"))
    for column in header:
        known = QUANTITIES.get(OTHER_UNITS.sub("", column))
        if known and column not in (*REQUIRED, *OPTIONAL):
            fix = conversion(column, [known]) or f"Convert it and name it {known}, or say unit under [recording]"
            wrong.add(CmmUqError(f"the column {column!r} is not in the unit of {known!r}", where=where, fix=fix))
    for column in REQUIRED:
        if column not in header:
            unread = " (of an axis that nobody reads, give one number in all rows)" * column.endswith("_mm")
            wrong.add(CmmUqError(f"no column {column!r}", where=where, fix=f"{suggestion(column, header)}{unread}"))
    wrong.refuse()


def largest(column: str) -> float:
    """Largest number, either way, that a column of this name may hold; that of every number where its name says nothing."""
    if column in WHOLE:
        return LARGEST_NUMBER
    return next((most for ending, most in LARGEST_OF.items() if column.endswith(ending)), LARGEST)


def _check_unique(points: Points, name: str) -> None:
    seen: dict[tuple[int, int, int], int] = {}
    keys = zip(points.measurement.tolist(), points.point.tolist(), points.repeat.tolist(), strict=True)
    for key, line in zip(keys, points.lines.tolist(), strict=True):
        if key in seen:
            raise CmmUqError(
                f"measurement {key[0]}, point {key[1]}, repeat {key[2]} is there twice",
                where=f"{name} lines {seen[key]} and {line}", fix="Number repeated measurements in a column repeat",
            )  # fmt: skip
        seen[key] = line
