"""The file of a recording: a CSV with one row a point is read as it is, a file in any other format is imported.

Every cell is checked where it stands, so that a message can name line and column; any numeric column of another name than
those of a recording is kept as a covariate.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import partial
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError, Gathered, suggestion
from cmm_uq.base.files.csv_table import GIVE, GIVE_OR_REMOVE, MEASURE, cells_of, column_problem, numbers
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.jobs.columns import COORDINATES, LARGEST_NUMBER, REQUIRED, WHOLE, largest, misnamed
from cmm_uq.jobs.importing.format import ImportKeys, Recognition
from cmm_uq.jobs.machines import coordinates, required_columns, strange_column

# lengths between which nx, ny, nz are taken for a direction: rounded to three digits, or scaled
SHORTEST_NORMAL, LONGEST_NORMAL = 1e-3, 1e3


def read_recording(content: bytes, name: str, machine: Machine, without: Collection[str] = ()) -> Points:
    """Points of a recording in the project's own format, but for columns that it is to be read ``without``."""
    wrong, table = Gathered(), dict[str, Floats]()
    cells = cells_of(content, name, "Save the recording as CSV in UTF-8")
    header, whole = cells.header, [len(row) == len(cells.header) for row in cells.rows]
    for row, line in zip(cells.rows, cells.lines, strict=True):
        if len(row) != len(header):
            fix = "Complete the row; if it is the last one, the file was cut off: export it again"
            wrong.tell(f"has {len(row)} cells where the header has {len(header)}", where=f"{name} line {line}", fix=fix)
    if not cells.rows:
        raise CmmUqError("has no rows", where=name, fix="The first line names the columns, then one row a point")
    rows, lines = list(compress(cells.rows, whole)), list(compress(cells.lines, whole))
    with wrong.going_on():
        _check_header(header, name, needed := required_columns(machine, header), machine)
    if not set(needed) <= set(header):
        wrong.refuse()  # the cells of another table are another's
    for i, column in enumerate(header):
        fix = MEASURE if column in COORDINATES else GIVE if column in REQUIRED else GIVE_OR_REMOVE
        if column not in without:
            with wrong.going_on():
                table[column] = numbers([row[i] for row in rows], partial(_place, name, lines, column), fix)
    return points_of(table, lines, name, machine, wrong)


def _place(name: str, lines: Sequence[int], column: str, row: int) -> str:
    return f"{name} line {lines[row]}" + (f", column {column}" if column else "")


def points_of(
    table: Mapping[str, Floats], lines: Sequence[int], name: str, machine: Machine, wrong: Gathered | None = None
) -> Points:
    """Points of the columns of a recording, each (n,), the required ones among them."""
    wrong = wrong or Gathered()

    def refuse(bad: NDArray[np.bool_], problem: str, fix: str, column: str, of: Floats) -> None:
        if bad.any():
            row = int(np.argmax(bad))
            wrong.tell(problem.format(of[row]), where=_place(name, lines, column, row), fix=fix)

    for column, values in table.items():
        if column not in WHOLE:
            most = largest(column)
            refuse(np.abs(values) > most, "{:g} is more than anything that is measured",
                   f"{most:g} is the most: check its unit and its exponent", column, values)  # fmt: skip
    # normals are brought to unit length where they are used: a direction must be meant
    if all(f"n{axis}" in table for axis in "xyz"):
        length = np.sqrt(sum(table[f"n{axis}"] ** 2 for axis in "xyz"))
        bad = (length != 0) & ((length < SHORTEST_NORMAL) | (length > LONGEST_NORMAL))
        refuse(bad, "the normal nx, ny, nz has the length {:.3g}", "Give outward unit normals", "", length)
    for column in (one for one in WHOLE if one in table):
        values = table[column]
        refuse((values != np.round(values)) | (np.abs(values) > LARGEST_NUMBER), "{:g} is not a whole number",
               "Number measurements, points and repeats 1, 2, …", column, values)  # fmt: skip
    for column in (one for one in ("approach_x", "approach_y", "approach_z") if one in table):
        refuse(~np.isin(table[column], (-1, 0, 1)), "{:g} is no direction",
               "The direction of travel into the point is −1, 0 or +1", column, table[column])  # fmt: skip
    wrong.refuse()
    measurement, point, repeat = (table.get(column, np.ones(len(lines))).astype(np.int64) for column in WHOLE)
    seen: dict[tuple[int, int, int], int] = {}
    for key, line in zip(zip(*map(np.ndarray.tolist, (measurement, point, repeat)), strict=True), lines, strict=True):
        if key in seen:
            said = f"measurement {key[0]}, point {key[1]}, repeat {key[2]} is there twice"
            fix = "Number repeated measurements in a column repeat"
            raise CmmUqError(said, where=f"{name} lines {seen[key]} and {line}", fix=fix)
        seen[key] = line
    columns = {column: values for column, values in table.items() if column not in (*REQUIRED, "repeat")}
    xyz = coordinates(machine, table, lines, name)
    return Points(xyz, measurement, point, repeat, machine, columns, np.array(lines, dtype=np.int64))


def _check_header(header: Sequence[str], name: str, needed: Sequence[str], machine: Machine) -> None:
    where = f"{name} line 1"
    if len(header) == 1 and ";" in header[0]:
        raise CmmUqError("cells are separated by semicolons", where=where,
                         fix="Separate them by commas, with a decimal point in numbers")  # fmt: skip
    wrong = Gathered()
    for i, column in enumerate(header):
        if not column:
            wrong.tell(f"column {i + 1} has no name", where=where, fix="Name it, or remove it")
        elif column in header[:i]:
            wrong.tell(f"the column {column!r} is there twice", where=where, fix="Keep one")
        elif problem := column_problem(column):
            wrong.tell(problem, where=where, fix="Name it with letters, digits and _")
        elif wrong_name := misnamed(column, header) or strange_column(machine, column, header):
            wrong.tell(wrong_name[0], where=where, fix=wrong_name[1])
    for column in needed:
        alike = [one for one in header if one[:2] == column[:2]]
        if column not in header and not any(strange_column(machine, one, header) for one in alike):
            unread = " (of an axis that nobody reads, give one number in all rows)" * (column in COORDINATES)
            fix = f"{suggestion(column, set(header) - set(needed))}{unread}"
            wrong.tell(f"no column {column!r}", where=where, fix=fix)
    wrong.refuse()


def read_recording_file(
    content: bytes, where: str, machine: Machine, keys: ImportKeys, without: Collection[str] = ()
) -> tuple[Points, Recognition | None]:
    """Points of a recording, and how it was read where it is in another format than the project's own."""
    if not keys.asked and is_own(content):
        return read_recording(content, where, machine, without), None
    from cmm_uq.jobs.importing.recording import imported  # with all that understands what others wrote

    spans = machine.travel_mm[:, 1] - machine.travel_mm[:, 0]
    reach = float(np.linalg.norm(spans)) if np.all(np.isfinite(spans)) else None
    table = imported(content, where, keys, reach_mm=reach)
    return points_of(table.columns, table.lines.tolist(), where, machine), table.recognised


def is_own(content: bytes) -> bool:
    """Whether a recording is in the project's own format: empty, or a header that names one of its columns between commas."""
    return not content.strip() or any(name in REQUIRED for name in header(content))


def header(content: bytes) -> list[str]:
    """Names between commas in the first line that is no comment."""
    text = content[:16_384].decode("utf-8-sig", errors="replace")
    line = next((line for line in map(str.strip, text.splitlines()) if line and not line.startswith("#")), "")
    return [name.strip().strip('"') for name in line.split(",")]
