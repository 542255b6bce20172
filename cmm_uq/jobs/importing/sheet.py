"""What a format makes of a file: rows of cells, with the place of each for messages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cmm_uq.base.messages import Text

Cell = str | float
"""Text without the blanks around it, empty where there is nothing; or a number, of a format that keeps numbers."""


@dataclass(frozen=True)
class Fact:
    """Something that was recognised.

    Parameters
    ----------
    key : in results.json.
    label, value : as printed.
    """

    key: str
    label: Text
    value: Text


@dataclass(frozen=True, eq=False)
class Sheet:
    """A table with whatever stands around it.

    Parameters
    ----------
    name : of the sheet, or of the sort of feature; empty where a file has only one.
    rows : cells; rows may differ in length.
    lines : of each row in the file.
    spreadsheet : whether places are named as in a spreadsheet.
    listed : whether the format made the table of a report of features: it has no header in the file.
    unended : whether the last line of the file has no end, as where it was cut off.
    unit : of its lengths, where the format or the file says it.
    decimal : sign, where the format says it.
    facts : recognised so far.
    """

    name: str
    rows: Sequence[Sequence[Cell]]
    lines: Sequence[int]
    spreadsheet: bool = False
    listed: bool = False
    unended: bool = False
    unit: str | None = None
    decimal: str | None = None
    facts: tuple[Fact, ...] = ()

    def at(self, where: str, row: int, column: int | None = None, heading: str = "") -> str:
        """Place of a row, or of a cell, by their indices.

        Parameters
        ----------
        where : the file.
        heading : of the column.
        """
        line = self.lines[row]
        if self.spreadsheet:
            return f"{where}: {self.name} {'row ' if column is None else letters(column)}{line}"
        return f"{where} line {line}" + (f", column {heading or column + 1}" if column is not None else "")


def letters(column: int) -> str:
    """Name of a spreadsheet's column by its index from 0: A to Z, then AA and on."""
    name, left = "", column + 1
    while left:
        left, digit = divmod(left - 1, 26)
        name = chr(ord("A") + digit) + name
    return name
