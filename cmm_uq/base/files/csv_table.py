"""Tables of CSV files, within their limits: the cells of each row with its line, tables of known columns, and the numbers.

A number is an optional sign, digits with an optional point, an optional exponent, and nothing else: Python's own reading takes
underscores, digits of every script, ``nan`` and ``infinity`` besides. Keys and columns in a unit that is not read are refused
by name with the conversion to the one that is.
"""

from __future__ import annotations

import csv
import io
import unicodedata
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from math import isfinite

import numpy as np

from cmm_uq.base.errors import CmmUqError, Gathered
from cmm_uq.base.files.limits import CELL, CELLS, COLUMN_NAME, COLUMNS, LINE, LINES, ROWS, Limit, text_of
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass

# sizes of a number in a table, other than 0: squares and sums of 10⁵ of them stay far within a double's range
SMALLEST, LARGEST = 1e-30, 1e15
# of what is written with these alone, ``float`` takes exactly the numbers of this module
_CHARACTERS = b"0123456789+-.eE"
GIVE = "Give a number"
GIVE_OR_REMOVE = "Give a number, or remove the column"  # of a column that need not be there
MEASURE = "Measure the point again, or leave out its measurement"  # of a coordinate
_SHOWN = 40


def number_problem(cell: str, fix: str = GIVE) -> tuple[str, str] | None:
    """Why a cell of a table is no number that can be used and what to do about it, or ``None``."""
    if not cell:
        return "no value", fix
    shown = repr(cell[:_SHOWN])
    try:
        value = float(cell)
    except ValueError:
        if "," in cell:
            fix = "Write it without groups of digits" if "." in cell else "Write decimals with a point"
        return f"{shown} is not a number", fix
    if not _plain(cell):
        if not isfinite(value):
            return f"{shown} is not a finite number", fix
        return f"{shown} is not a number", "Write it with digits 0 to 9 alone, a point and an exponent, as in 1.5e-3"
    if abs(value) > LARGEST:
        return f"{shown} is too large for a number here", f"{LARGEST:g} is the most: check its unit and its exponent"
    if abs(value) < SMALLEST and any(digit in cell.lower().partition("e")[0] for digit in "123456789"):
        return f"{shown} is too small for a number here", f"Write 0, or {SMALLEST:g} or more"
    return None


def _plain(text: str) -> bool:
    return text.isascii() and not text.encode().translate(None, _CHARACTERS)


def numbers(cells: Sequence[str], where: Callable[[int], str], fix: str = GIVE) -> Floats:
    """Values (n,) of the cells of a column."""
    try:
        values = np.array(list(map(float, cells)), dtype=np.float64)
    except ValueError:
        doubtful: Sequence[int] = range(len(cells))
    else:
        sizes = np.abs(values)
        # a zero may be a number that is too small to be told from it
        beyond = np.flatnonzero(~((sizes >= SMALLEST) & (sizes <= LARGEST))).tolist()
        doubtful = [i for i in beyond if cells[i] != "0"] if _plain("".join(cells)) else range(len(cells))
    wrong = Gathered()
    for i in doubtful:
        if problem := number_problem(cells[i], fix):
            wrong.tell(problem[0], where=where(i), fix=problem[1])
    wrong.refuse()
    return values


_PER_METRE = "{given} · L / 1000, with the length L in mm"
_BY_ENDING = (
    ("_um_per_m_k", "_per_k", "1e-6 · {given}"), ("_ppm_per_k", "_per_k", "1e-6 · {given}"),
    ("_per_f", "_per_k", "1.8 · {given}"), ("_um_per_m", "_um", _PER_METRE), ("_um_m", "_um", _PER_METRE),
    ("_ppm", "_um", _PER_METRE), ("_mm", "_um", "1000 · {given}"), ("_nm", "_um", "{given} / 1000"),
    ("_inch", "_um", "25400 · {given}"), ("_in", "_um", "25400 · {given}"), ("_mil", "_um", "25.4 · {given}"),
    ("_inch", "_mm", "25.4 · {given}"), ("_in", "_mm", "25.4 · {given}"), ("_mil", "_mm", "0.0254 · {given}"),
    ("_um", "_mm", "{given} / 1000"), ("_cm", "_mm", "10 · {given}"), ("_m", "_mm", "1000 · {given}"),
    ("_f", "_c", "({given} − 32) / 1.8"), ("_f", "_k", "{given} / 1.8"), ("_k", "_c", "{given} − 273.15"),
    ("_min", "_s", "60 · {given}"), ("_h", "_s", "3600 · {given}"), ("_kpa", "_hpa", "10 · {given}"),
    ("_pa", "_hpa", "{given} / 100"),
    ("_deg", "_arcsec", "3600 · {given}"),
)  # fmt: skip
_FREEDOM = ("dof", "nu", "nu_eff", "v_eff", "degrees_of_freedom", "freiheitsgrade")


def conversion(given: str, known: Collection[str]) -> str | None:
    """What to give instead of a key in another unit; ``None`` where it is none of a known one.

    An uncertainty u with ν degrees of freedom has a t distribution, whose standard deviation is u·√(ν/(ν − 2)) (JCGM
    101:2008, 6.4.9).
    """
    if given.startswith("U_") and (standard := f"u_{given[2:]}") in known:
        return f"Give {standard} = U/k, the standard uncertainty: U is k times as large"
    if given.casefold() in _FREEDOM and (standard := next((key for key in known if key.startswith("u_")), "")):
        return (
            f"Give {standard} = u · √(ν/(ν − 2)), the standard deviation of a t distribution with ν degrees of freedom"
        )
    for ending, wanted, formula in _BY_ENDING:
        key = given[: -len(ending)] + wanted
        if given.endswith(ending) and key in known:
            return f"Give {key} = {formula.format(given=given)}"
    return None


FORMULA = tuple("=+-@＝＋－＠")  # what makes a spreadsheet compute a cell instead of showing it


@dataclass(frozen=True)
class CsvTable:
    """A CSV file ``where``: the first row that is neither empty nor a comment names the columns; each row with its line."""

    where: str
    header: list[str]
    header_line: int
    rows: list[list[str]]
    lines: list[int]

    def at(self, row: int, column: str = "") -> str:
        return f"{self.where} line {self.lines[row]}{column and f', column {column}'}"

    def texts(self, column: str, fix: str = "") -> list[str]:
        """Cells of a column that must be there."""
        if column not in self.header:
            fix = fix or f"Give it; there are {', '.join(self.header)}"
            raise CmmUqError(f"has no column {column!r}", where=self.where, fix=fix)
        place = self.header.index(column)
        return [row[place] for row in self.rows]

    def numbers(self, column: str, fix: str = GIVE) -> Floats:
        return numbers(self.texts(column), lambda row: self.at(row, column), fix)

    def number(self, row: int, column: str) -> float:
        text = self.rows[row][self.header.index(column)]
        if problem := number_problem(text):
            said, fix = f"{column}: {problem[0]}", problem[1]
            if problem[0].endswith(("a number", "a finite number", "no value")):
                said, fix = f"{column} = {text!r} is no number", "Give a number with a decimal point"
            raise CmmUqError(said, where=self.at(row), fix=fix)
        return float(text)

    def refuse_uneven(self) -> None:
        """Every row must have a cell for each column."""
        for i, row in enumerate(self.rows):
            if len(row) != len(self.header):
                problem = f"has {len(row)} cells where the header has {len(self.header)}"
                raise CmmUqError(problem, where=self.at(i), fix="Complete the row")


def cells_of(content: bytes, where: str, fix: str, *, most_rows: Limit = ROWS, delimiter: str = ",") -> CsvTable:
    """Cells of a CSV file, without the blanks around them; rows may still differ in length.

    Empty rows, and those whose first cell begins with #, are passed over.
    """
    reader = csv.reader(lines_within(text_of(content, where, fix), where), delimiter=delimiter, skipinitialspace=True)
    found: list[list[str]] = []
    lines: list[int] = []
    count = 0
    try:
        for row in reader:
            cells = [cell.strip() for cell in row]
            if not any(cells) or cells[0].startswith("#"):
                continue
            count += len(cells)
            _check_row(cells, count, len(found), most_rows, where, reader.line_num)
            found.append(cells)
            lines.append(reader.line_num)
    except csv.Error as error:
        raise CmmUqError(f"is no CSV: {error}", where=f"{where} line {reader.line_num}",
                         fix="Close every quotation mark on its own line, or leave them out") from None  # fmt: skip
    return CsvTable(where, found[0], lines[0], found[1:], lines[1:]) if found else CsvTable(where, [], 0, [], [])


def column_problem(name: str) -> str | None:
    """Why a column cannot bear this name, or ``None``; names are written into new files as they are."""
    if name.startswith(FORMULA):
        return f"the column {name!r} begins as a formula does"
    if any(unicodedata.category(c)[0] == "C" for c in name):
        return f"the column {name!r} has a control character in its name"
    if len(name) > COLUMN_NAME.most:
        return f"the column {name[:20]!r} … has a name of {len(name)} characters: {COLUMN_NAME.most} are the most"
    return None


def _check_row(cells: list[str], count: int, rows: int, most_rows: Limit, file: str, line: int) -> None:
    longest = max(map(len, cells))
    if len(cells) > COLUMNS.most:
        problem, fix = f"has {len(cells)} cells, {COLUMNS.most} are the most", "Keep the columns that the job needs"
    elif rows > most_rows.most or count > CELLS.most:
        problem = f"the table goes on after {rows - 1} rows and {count - len(cells)} cells: more are not read"
        fix = f"{most_rows.most} rows and {CELLS.most} cells are the most: split or thin out the table"
    elif longest > CELL.most:
        problem = f"a cell has {longest} characters, {CELL.most} are the most"
        fix = "Shorten it; if it swallowed other rows, a quotation mark is not closed"
    else:
        return
    raise CmmUqError(problem, where=f"{file} line {line}", fix=fix)


def lines_within(text: str, where: str) -> Iterator[str]:
    """Lines of a table, none longer and no more of them than are read."""
    for number, line in enumerate(io.StringIO(text, newline=""), 1):
        if len(line) > LINE.most or number > LINES.most:
            raise CmmUqError(
                f"the line has {len(line)} characters, {LINE.most} are the most" if number <= LINES.most
                else f"has more than {LINES.most} lines",
                where=f"{where} line {number}", fix="Check that it is a table with one row a line",
            )  # fmt: skip
        yield line


def csv_table(content: bytes, where: str, required: Iterable[str], *, most_rows: Limit = ROWS) -> CsvTable:
    table = cells_of(content, where, "Save it as CSV in UTF-8", most_rows=most_rows)
    if not table.rows:
        fix = f"Give a header ({', '.join(required)}) and a row for each position"
        raise CmmUqError("has no rows", where=where, fix=fix)
    at = f"{where} line {table.header_line}"
    for column in required:
        if column not in table.header:
            raise CmmUqError(f"column {column} is missing", where=at, fix="Add it to the header")
    for name in table.header:
        if table.header.count(name) > 1:
            raise CmmUqError(f"column {name} is there twice", where=at, fix="Remove one of them")
    if problem := next(filter(None, map(column_problem, table.header)), None):
        raise CmmUqError(problem, where=at, fix="Name it with letters, digits and _")
    table.refuse_uneven()
    return table
