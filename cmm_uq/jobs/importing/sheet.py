"""What a format makes of a file, rows of cells with the place of each, and what was recognised of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from cmm_uq.base.messages import Text, Verbatim, commas, say, semicolons

Cell = str | float
"""Text without the blanks around it, empty where there is nothing; or a number, of a format that keeps numbers."""


@dataclass(frozen=True)
class Fact:
    """Something that was recognised, by its key in results.json."""

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
        """Place of a row of the file, or of a cell below a heading, by their indices."""
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


Row = tuple[str, Sequence[Cell], int]  # sort of feature, its cells, its line


def sheets_of(
    rows: Sequence[Row],
    headings: Sequence[str],
    *,
    unit: str | None,
    decimal: str | None = None,
    facts: tuple[Fact, ...] = (),
) -> list[Sheet]:
    """A sheet for each sort of feature, without columns in which nothing stands."""
    sheets = []
    for sort in dict.fromkeys(sort for sort, _, _ in rows):
        lines = [line for of, _, line in rows if of == sort]
        columns = zip(headings, *(cells for of, cells, _ in rows if of == sort), strict=True)
        table = list(zip(*(column for column in columns if any(cell != "" for cell in column[1:])), strict=True))
        name = f"{sort}s" if sort else ""
        sheets.append(Sheet(name, table, [lines[0], *lines], listed=True, unit=unit, decimal=decimal, facts=facts))
    return sheets


@dataclass(frozen=True)
class Recognition:
    """How a file was read: names of file and format, headings by column of the recording, number of points."""

    file: str
    format: str
    title: Text
    facts: tuple[Fact, ...]
    columns: Mapping[str, str]
    points: int

    @property
    def unused(self) -> tuple[str, ...]:
        """Headings of columns that are not used, the first of them."""
        return tuple(
            name for fact in self.facts if fact.key == "not_used" for name in str.__str__(fact.value).split(", ")
        )

    @property
    def rows(self) -> list[tuple[Text, Text]]:
        """Everything, for a table."""
        columns = ((say("Column {name}", name=Verbatim(name)), Verbatim(text)) for name, text in self.columns.items())
        return [
            (say("File"), Verbatim(self.file)), (say("Format"), self.title),
            *((fact.label, fact.value) for fact in self.facts), *columns,
            (say("Rows read"), say("{points}", points=self.points)),
        ]  # fmt: skip

    @property
    def sentence(self) -> Text:
        """The same in one cell of a certificate."""
        taken = commas([say("{name} from {heading}", name=Verbatim(name), heading=Verbatim(heading))
                        for name, heading in self.columns.items()])  # fmt: skip
        facts = semicolons([say("{label:small}: {value}", label=fact.label, value=fact.value) for fact in self.facts])
        return say("read from {file} ({title}): {columns}; {facts}", file=Verbatim(self.file), title=self.title,
                   columns=taken, facts=facts)  # fmt: skip

    @property
    def data(self) -> dict[str, Any]:
        return {
            "file": self.file, "format": self.format, **{fact.key: str.__str__(fact.value) for fact in self.facts},
            "columns": dict(self.columns), "points": self.points,
        }  # fmt: skip
