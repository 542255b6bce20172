"""Tables of CSV files, within their limits: the cells of each row with its line, and tables of known columns."""

from __future__ import annotations

import csv
import io
import unicodedata
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.content import text_of
from cmm_uq.base.files.limits import CELL, CELLS, COLUMN_NAME, COLUMNS, LINE, LINES, ROWS, Limit
from cmm_uq.base.files.numbers import number_problem

FORMULA = tuple("=+-@＝＋－＠")  # what makes a spreadsheet compute a cell instead of showing it


@dataclass(frozen=True)
class Cells:
    """The rows of a CSV file: the first that is neither empty nor a comment names the columns, with its line; the others."""

    header: list[str]
    header_line: int
    rows: list[list[str]]
    lines: list[int]


def cells_of(content: bytes, where: str, fix: str, *, most_rows: Limit = ROWS, delimiter: str = ",") -> Cells:
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
    if not found:
        return Cells([], 0, [], [])
    return Cells(found[0], lines[0], found[1:], lines[1:])


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


@dataclass(frozen=True)
class CsvTable:
    """A header and its rows of text, each as long as the header, with the line of each in the file ``where``."""

    where: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]

    def number(self, row: int, column: str) -> float:
        """A finite number."""
        text = self.rows[row][self.header.index(column)]
        if problem := number_problem(text):
            plain = problem[0].endswith(("a number", "a finite number", "no value"))
            raise CmmUqError(
                f"{column} = {text!r} is no number" if plain else f"{column}: {problem[0]}", where=self.at(row),
                fix="Give a number with a decimal point" if plain else problem[1],
            )  # fmt: skip
        return float(text)

    def at(self, row: int) -> str:
        """File and line of a row."""
        return f"{self.where} line {self.lines[row]}"


def csv_table(content: bytes, where: str, required: Iterable[str], *, most_rows: Limit = ROWS) -> CsvTable:
    cells = cells_of(content, where, "Save it as CSV in UTF-8", most_rows=most_rows)
    header = tuple(cells.header)
    if not cells.rows:
        fix = f"Give a header ({', '.join(required)}) and a row for each position"
        raise CmmUqError("has no rows", where=where, fix=fix)
    at = f"{where} line {cells.header_line}"
    for column in required:
        if column not in header:
            raise CmmUqError(f"column {column} is missing", where=at, fix="Add it to the header")
    for name in header:
        if header.count(name) > 1:
            raise CmmUqError(f"column {name} is there twice", where=at, fix="Remove one of them")
    if problem := next(filter(None, map(column_problem, header)), None):
        raise CmmUqError(problem, where=at, fix="Name it with letters, digits and _")
    for line, row in zip(cells.lines, cells.rows, strict=True):
        if len(row) != len(header):
            problem = f"has {len(row)} cells, the header has {len(header)}"
            raise CmmUqError(problem, where=f"{where} line {line}", fix="Complete the row")
    return CsvTable(where, header, tuple(map(tuple, cells.rows)), tuple(cells.lines))
