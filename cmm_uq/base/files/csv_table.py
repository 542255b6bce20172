"""Cells of a CSV file with the line that each stands in, for tables that belong to a machine (error map, temperature log)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.cells import cells_of, column_problem
from cmm_uq.base.files.limits import ROWS, Limit
from cmm_uq.base.files.numbers import number_problem


@dataclass(frozen=True)
class CsvTable:
    """A header and its rows.

    Parameters
    ----------
    where : the file's name, for messages.
    header : column names, without the blanks around them.
    rows : cells as text, each row as long as the header.
    lines : line of each row in the file.
    """

    where: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]

    def number(self, row: int, column: str) -> float:
        """A finite number.

        Raises
        ------
        CmmUqError : the cell is something else.
        """
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
    """Table of a CSV file.

    Raises
    ------
    CmmUqError : no text, no rows, a required column missing, a column named twice, a row of another length, or beyond the
        limits of a table.
    """
    cells = cells_of(content, where, "Save it as CSV in UTF-8", most_rows=most_rows)
    header = tuple(cells.header)
    if not cells.rows:
        raise CmmUqError(
            "has no rows", where=where, fix=f"Give a header ({', '.join(required)}) and a row for each position"
        )
    at = f"{where} line {cells.header_line}"
    for column in required:
        if column not in header:
            raise CmmUqError(f"column {column} is missing", where=at, fix="Add it to the header")
    twice = next((name for name in header if header.count(name) > 1), None)
    if twice is not None:
        raise CmmUqError(f"column {twice} is there twice", where=at, fix="Remove one of them")
    if problem := next(filter(None, map(column_problem, header)), None):
        raise CmmUqError(problem, where=at, fix="Name it with letters, digits and _")
    for line, row in zip(cells.lines, cells.rows, strict=True):
        if len(row) != len(header):
            raise CmmUqError(
                f"has {len(row)} cells, the header has {len(header)}",
                where=f"{where} line {line}",
                fix="Complete the row",
            )
    return CsvTable(where, header, tuple(map(tuple, cells.rows)), tuple(cells.lines))
