"""Cells of a CSV file with the line that each stands in, for tables that belong to a machine (error map, temperature log)."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable
from dataclasses import dataclass

from cmm_uq.errors import CmmUqError


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
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise CmmUqError(
                f"{column} = {text!r} is no number", where=self.at(row), fix="Give a number with a decimal point"
            )
        return value

    def at(self, row: int) -> str:
        """File and line of a row."""
        return f"{self.where} line {self.lines[row]}"


def csv_table(content: bytes, where: str, required: Iterable[str]) -> CsvTable:
    """Table of a CSV file.

    Raises
    ------
    CmmUqError : no text, no rows, a required column missing, a column named twice, or a row of another length.
    """
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise CmmUqError("is not UTF-8 text", where=f"{where} line {line}", fix="Save it as CSV in UTF-8") from None
    reader = csv.reader(io.StringIO(text, newline=""), skipinitialspace=True)
    found = [(reader.line_num, tuple(cell.strip() for cell in row)) for row in reader if any(c.strip() for c in row)]
    if len(found) < 2:
        raise CmmUqError(
            "has no rows", where=where, fix=f"Give a header ({', '.join(required)}) and a row for each position"
        )
    (_, header), *body = found
    for column in required:
        if column not in header:
            raise CmmUqError(
                f"column {column} is missing", where=f"{where} line {found[0][0]}", fix="Add it to the header"
            )
    twice = next((name for name in header if header.count(name) > 1), None)
    if twice is not None:
        raise CmmUqError(
            f"column {twice} is there twice", where=f"{where} line {found[0][0]}", fix="Remove one of them"
        )
    for line, row in body:
        if len(row) != len(header):
            raise CmmUqError(
                f"has {len(row)} cells, the header has {len(header)}",
                where=f"{where} line {line}",
                fix="Complete the row",
            )
    return CsvTable(where, header, tuple(row for _, row in body), tuple(line for line, _ in body))
