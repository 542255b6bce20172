"""Formats of files: the sheets that a file holds, what was recognised of it, all formats, and files that are never read."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from importlib import import_module
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, commas, say, semicolons
from cmm_uq.base.plugins import IMPORTS, Plugin, offered
from cmm_uq.jobs.importing.keys import ImportKeys

HEAD = 65_536  # bytes of a file by which it is recognised

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
    """A table with whatever stands around it."""

    name: str  # of the sheet, or of the sort of feature; empty where a file has only one
    # rows, lines: cells, in rows that may differ in length; the line of each row in the file
    rows: Sequence[Sequence[Cell]]
    lines: Sequence[int]
    spreadsheet: bool = False  # whether places are named as in a spreadsheet
    listed: bool = False  # whether the format made the table of a report of features: it has no header in the file
    unended: bool = False  # whether the last line of the file has no end, as where it was cut off
    unit: str | None = None  # of its lengths, where the format or the file says it
    decimal: str | None = None  # sign, where the format says it
    facts: tuple[Fact, ...] = ()  # recognised so far

    def at(self, where: str, row: int, column: int | None = None, heading: str = "") -> str:
        """Place of a row of the file, or of a cell below a heading, by their indices."""
        line = self.lines[row]
        if self.spreadsheet:
            return f"{where}: {self.name} {'row ' if column is None else letters(column)}{line}"
        return f"{where} line {line}" + (f", column {heading or column + 1}" if column is not None else "")


def letters(column: int) -> str:
    """Name of a spreadsheet's column by its index from 0: A to Z, then AA and on."""
    left, digit = divmod(column, 26)
    return (letters(left - 1) if left else "") + chr(ord("A") + digit)


Row = tuple[str, Sequence[Cell], int]  # sort of feature, its cells, its line


def sheets_of(rows: Sequence[Row], headings: Sequence[str], **of_all: Any) -> list[Sheet]:
    """A sheet for each sort of feature, without columns in which nothing stands; ``of_all``: what each of them has."""
    sheets = []
    for sort in dict.fromkeys(sort for sort, _, _ in rows):
        lines = [line for of, _, line in rows if of == sort]
        columns = zip(headings, *(cells for of, cells, _ in rows if of == sort), strict=True)
        table = list(zip(*(column for column in columns if any(cell != "" for cell in column[1:])), strict=True))
        name = f"{sort}s" if sort else ""
        sheets.append(Sheet(name, table, [lines[0], *lines], listed=True, **of_all))
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
        listed = (str.__str__(fact.value) for fact in self.facts if fact.key == "not_used")
        return tuple(name for names in listed for name in names.split(", "))

    @property
    def rows(self) -> list[tuple[Text, Text]]:
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


class Format(ABC):
    """A format; those of other packages are entry points of the group ``cmm_uq.imports``, of the format's name."""

    name: str  # of the entry point, and in results.json
    title: Text  # as printed

    @abstractmethod
    def recognises(self, head: bytes) -> bool:
        """Whether a file is of this format, by its first :data:`HEAD` bytes."""

    @abstractmethod
    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        """Sheets of a file, at least one; a ``CmmUqError`` where it is damaged, hostile, or holds nothing that can be read.

        ``where``: its name, for messages; ``keys``: what the job says beside.
        """


# by their first bytes
_UNREAD: tuple[tuple[bytes | tuple[bytes, ...], str, str], ...] = (
    (b"\xd0\xcf\x11\xe0", "is a workbook of the old kind (.xls), or one with a password",
     "Save it as .xlsx without a password"),
    (b"%PDF", "is a PDF, which has no table to be read", "Export the report as text, CSV or .xlsx"),
    (b"{\\rtf", "is a report in rich text (RTF)", "Print the report as plain text (.txt)"),
    (b"\x1f\x8b", "is compressed (gzip)", "Unpack it"),
    (b"7z\xbc\xaf", "is compressed (7z)", "Unpack it"),
    (b"Rar!", "is compressed (RAR)", "Unpack it"),
    ((b"\x89PNG", b"\xff\xd8\xff"), "is a picture", "Export the table itself, as CSV or .xlsx"),
    (b"SQLite format 3", "is a database", "Export the table as CSV or .xlsx"),
)  # fmt: skip
# Asked in this order, after those of other packages; a text that is none of them is a text table.
BUILT_IN = (
    *("tabular.Excel", "tabular.OpenDocument", "documents.Qif", "documents.Dcc"),
    *("reports.Calypso", "reports.Dmis", "reports.PcDmis", "reports.Ipp"),
)


def format_of(content: bytes, where: str) -> Format:
    head = content[:HEAD]
    for plugin in offered(IMPORTS, Plugin):
        outside = plugin.loaded(Format)  # type: ignore[type-abstract]
        if plugin.attempt(partial(outside.recognises, head)):
            return outside
    for name in BUILT_IN:
        if (own := _built_in(name)).recognises(head):
            return own
    for start, what, fix in _UNREAD:
        if head.startswith(start):
            raise CmmUqError(what, where=where, fix=fix)
    if head[:512].lstrip().lower().startswith((b"<!doctype html", b"<html")):
        raise CmmUqError("is a web page", where=where, fix="Export the table as CSV or .xlsx")
    if (text := _built_in("tabular.Delimited")).recognises(head):
        return text
    what = "is empty" if not content.strip() else "is no text, and no format of measurements that is known here"
    raise CmmUqError(what, where=where, fix="Export the recording as CSV, .xlsx or .ods")


@cache
def _built_in(name: str) -> Format:
    module, _, cls = name.partition(".")
    form: Format = getattr(import_module(f"cmm_uq.jobs.importing.{module}"), cls)()
    return form
