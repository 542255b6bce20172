"""Formats of files: the sheets that a file holds, what was recognised of it, all formats, and files that are never read.

Beside them what a job says beside the name of a file that is imported, and units as laboratories write them.
Factors of units are quotients of whole numbers, so that 1.5 inch is the double nearest to 38.1 mm.
"""

from __future__ import annotations

import re
import tomllib
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import cache, partial
from importlib import import_module
from itertools import zip_longest
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import COLUMNS
from cmm_uq.base.files.table import Column, JobTable, key
from cmm_uq.base.messages import Text, Verbatim, commas, say, semicolons
from cmm_uq.base.plugins import IMPORTS, Plugin, offered
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, replace


@dataclass(frozen=True)
class WrittenUnit:
    """A unit: ``value · up / down + offset`` in the unit of its sort of quantity (mm, °C, s, hPa, %)."""

    name: str
    sort: str
    up: int = 1
    down: int = 1
    offset: float = 0.0

    @property
    def metres(self) -> float:
        """One of it, a unit of length."""
        return float(Fraction(self.up, self.down * 1000))


LENGTH, TEMPERATURE, TIME, PRESSURE, SHARE = "length", "temperature", "time", "pressure", "share"

TABLES = tomllib.loads(Path(__file__).with_name("words.toml").read_text(encoding="utf-8"))
"""Words of headings, rows and reports, and units, as laboratories write them."""
_UNITS = [(WrittenUnit(name, *own), aliases) for name, (*own, aliases) in TABLES["units"].items()]
UNITS: Mapping[str, WrittenUnit] = {alias: unit for unit, aliases in _UNITS for alias in aliases.split(" ")}
LENGTHS = tuple(unit.name for unit, _ in _UNITS if unit.sort == LENGTH)
FAHRENHEIT = UNITS["°f"]

_ENDINGS = (("_mm_s", None), ("_mm", (LENGTH, 1)), ("_um", (LENGTH, 1000)), ("_c", (TEMPERATURE, 1)), ("_s", (TIME, 1)),
            ("_hpa", (PRESSURE, 1)), ("_pct", (SHARE, 1)))  # fmt: skip


def unit_named(text: str) -> WrittenUnit | None:
    """A unit as written, whatever its case where that says nothing; ``None`` where it is none."""
    return UNITS.get(text.strip().strip(".").strip().casefold())


def length_named(text: str) -> WrittenUnit | None:
    unit = unit_named(text)
    return unit if unit is not None and unit.sort == LENGTH else None


def sort_of(column: str) -> tuple[str, int] | None:
    """Sort of quantity of a recording's column, and how many of its units one of the sort's is; ``None`` without unit."""
    return next((sort for ending, sort in _ENDINGS if column.endswith(ending)), None)


def converted(values: Floats, unit: WrittenUnit, column: str) -> Floats:
    """Values (n,) as written in a column, in the unit of its name."""
    sort = sort_of(column)
    up = unit.up * (sort[1] if sort else 1)
    values = values * up if up != 1 else values
    values = values / unit.down if unit.down != 1 else values
    return values + unit.offset if unit.offset else values


_SUFFIX = re.compile(r"^([+-]?[\d.,' \u00a0\u202f]*\d[.,]?(?:[eE][+-]?\d+)?)\s*([^\d\s.,'+-][^\d]*)$")


def apart(cell: str) -> tuple[str, WrittenUnit] | None:
    """A number and the unit written after it in its cell; ``None`` where there is no unit."""
    match = _SUFFIX.match(cell)
    unit = unit_named(match[2]) if match else None
    return (match[1], unit) if match and unit else None


Source = str | Annotated[int, Field(ge=1, le=COLUMNS.most)]  # A column of the file: its heading, or its number from 1

# one, or several where a row holds several points, in their order
Sources = Source | Annotated[list[Source], Field(min_length=1, max_length=COLUMNS.most)]
DELIMITERS: Mapping[str, str] = {",": ",", ";": ";", "tab": "\t", "blank": " ", "|": "|"}


def sources_of(sources: Sources) -> list[Source]:
    return sources if isinstance(sources, list) else [sources]


WesternEncoding = Literal["utf-8", "utf-16", "latin-1", "cp1250", "cp1252", "cp1254", "cp850", "cp852"]
Encoding = Literal[WesternEncoding, "cp1251", "cp1253", "cp866", "cp932", "gb18030", "cp949", "big5"]


class FileKeys(JobTable):
    """Of any table that is imported; each is needed only where the file leaves it open."""

    columns: Annotated[dict[Column, Sources], Field(max_length=COLUMNS.most)] = {}
    """The file's columns by the recording's names, as `{ x_mm = "X" }`: a heading, a number from 1, or a list of them where a
    row holds several points."""
    unit: str | None = None
    """Unit of the file's lengths, as `"inch"`, where the file does not say it."""
    sheet: str | None = None
    """Which sheet of a workbook, or which sort of feature of a report (`"spheres"`), where there are several."""
    decimal: Literal[".", ","] | None = key(None, "The file's decimal sign, where its numbers can be read either way.")
    delimiter: Literal[",", ";", "tab", "blank", "|"] | None = None
    """What separates the cells of a text file, where that is not found."""
    encoding: Encoding | None = None
    """Encoding of a text file, where it is mistaken for another."""

    @field_validator("unit")
    @classmethod
    def _a_length(cls, unit: str | None) -> str | None:
        if unit is not None and length_named(unit) is None:
            raise ValueError(f"{unit!r} is no unit of length known here. Known: {', '.join(LENGTHS)}")
        return unit


_TRIPLE = r"\s*([-+−]?[\d.]+)\s*,\s*([-+−]?[\d.]+)\s*,\s*([-+−]?[\d.]+)\s*"
LINE_PLACE = rf"(?i:along\s+([-+−]?)([xyz])\s+from{_TRIPLE}|from{_TRIPLE}to{_TRIPLE})"


class ImportKeys(FileKeys):
    """Of a recording in another format than the project's own."""

    lines: Annotated[dict[str, str], Field(max_length=COLUMNS.most)] = {}
    """Where the lines of a table of lengths lie, by their names in the file, in mm: `{ 1 = "along X from 100,200,300" }`, or
    `"from 0,0,0 to 300,400,0"`, which gives a start and a direction."""

    points_per_measurement: Annotated[int, Field(ge=1, le=1_000_000)] | Literal["all"] | None = None
    """How many rows in turn are one measurement, where the file does not number them; `"all"` where they are one."""

    @field_validator("lines")
    @classmethod
    def _places(cls, lines: dict[str, str]) -> dict[str, str]:
        for name, place in lines.items():
            if not re.fullmatch(LINE_PLACE, place.strip()):
                raise ValueError(f'{place!r} says no place of line {name}: write "along X from 100,200,300"')
        return lines

    @property
    def asked(self) -> bool:
        """Whether anything is said, so that the file is to be imported whatever it looks like."""
        return any(getattr(self, name) not in (None, {}) for name in ImportKeys.model_fields)


class NotReadError(CmmUqError):
    """Words do not say what the columns of a file are, or what belongs together; its figures may."""


HEAD = 65_536  # bytes of a file by which it is recognised
SAME_PLACE = "same_place"  # key of a fact: of lines whose places are one
DCC = "digitalCalibrationCertificate"  # root of a digital one

Cell = str | float
"""Text without the blanks around it, empty where there is nothing; or a number, of a format that keeps numbers."""


@dataclass(frozen=True)
class Fact:
    """Something that was recognised, by its key in results.json."""

    key: str
    label: Text
    value: Text
    names: tuple[str, ...] = ()  # of what the value lists


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
    left_out: tuple[str, ...] = ()  # rows that are no figures of the table, each with its place and why

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
        sheets.append(Sheet(f"{sort}s" if sort else "", table, [lines[0], *lines], listed=True, **of_all))
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
    head: tuple[str, ...] = ()  # texts of the row that names the columns

    @property
    def unused(self) -> tuple[str, ...]:
        """Headings of columns that are not used."""
        return tuple(name for fact in self.facts if fact.key == "not_used" for name in fact.names)

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
    *("tabular.Excel", "tabular.OpenDocument", "documents.Qif", "documents.Dcc", "reports.Calypso"),
    *("lengths.q_das.Qdas", "reports.Dmis", "pcdmis.PcDmis", "reports.Ipp", "lines.Rtl"),
    *("documents.Html", "documents.Json", "documents.Xml"),
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
    if (text := _built_in("tabular.Delimited")).recognises(head):
        return text
    what = "is empty" if not content.strip() else "is no text, and no format of measurements that is known here"
    raise CmmUqError(what, where=where, fix="Export the recording as CSV, .xlsx or .ods")


@cache
def _built_in(name: str) -> Format:
    module, _, cls = name.rpartition(".")
    form: Format = getattr(import_module(f"cmm_uq.jobs.importing.{module}"), cls)()
    return form


def stacked(sheet: Sheet) -> Sheet:
    """Tables side by side, between which a column is empty and whose heads are alike, below each other."""
    for row in sheet.rows:
        halves = ((k, row[:k], row[k + 1 : 2 * k + 1]) for k in range(3, len(row) // 2 + 1) if row[k] == "")
        width = next((k for k, one, other in halves if one == other and all(one)), 0)
        beyond = [one for one in sheet.rows if len(one) > width and one[width] != ""] if width else []
        if not width or any(sum(cell != "" for cell in one) > 2 for one in beyond):
            continue
        starts = range(0, max(map(len, sheet.rows)), width + 1)
        parts = [(row[k : k + width], line) for k in starts for row, line in zip(sheet.rows, sheet.lines, strict=True)]
        filled = [(cells, line) for cells, line in parts if any(cell != "" for cell in cells)]
        return replace(sheet, rows=[cells for cells, _ in filled], lines=[line for _, line in filled])
    return sheet


def transposed(sheet: Sheet) -> Sheet | None:
    """The widest part of a sheet with its rows as columns, each below the text that stands alone above it."""
    wide = [i for i, row in enumerate(sheet.rows) if len(row) > 3]
    width = max((len(sheet.rows[i]) for i in wide), default=0)
    if not wide or len(wide) > 300 or width > 300:
        return None
    above = [next((row[0] for row in sheet.rows[i - 1 : i] if len(row) == 1), "") for i in wide]
    columns = [[*row] for row in zip_longest(*(sheet.rows[i] for i in wide), fillvalue="")]
    columns = [above, *columns] if any(above[1:]) else columns
    return replace(sheet, rows=columns, lines=[sheet.lines[wide[0]]] * len(columns), spreadsheet=False)
