"""Files that are tables already: text with anything between the cells (CSV and its kin), and workbooks.

The delimiter of a text is the one by which a line names the columns of a recording: a header read with a wrong one names none.
Workbooks are those of Excel (ISO/IEC 29500, read by openpyxl) and of OpenDocument (ISO/IEC 26300), values as they were last
computed; of OpenDocument ``office:value`` holds a number to all its digits, whatever the cell shows. Repeated rows and columns
are counted, not unfolded, so that a file of a few bytes cannot become a table of millions of cells.
"""

from __future__ import annotations

import csv
import datetime as dt
import io
import re
import warnings
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from typing import Any
from xml.etree.ElementTree import Element, ParseError

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.csv_table import lines_within
from cmm_uq.base.files.limits import CELL, COLUMNS, LINE, LINES, ROWS, UNPACKED
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.values import replace
from cmm_uq.jobs.importing.cells.encodings import HOSTILE_FIX, decoded, head_text, local
from cmm_uq.jobs.importing.cells.fixed_columns import in_columns
from cmm_uq.jobs.importing.format import DELIMITERS, Cell, Fact, Format, ImportKeys, Sheet
from cmm_uq.jobs.importing.header import LINES_BEFORE, REFERENCES, header_of, text_of, understood
from cmm_uq.jobs.importing.reports import in_pairs
from cmm_uq.jobs.importing.roles import said

_BLANK = " "  # cells of a text without separators, by where they stand
_TITLES: dict[str, Text] = {
    ",": say("comma"), ";": say("semicolon"), "\t": say("tab"), "|": say("bar"), _BLANK: say("blanks"),
}  # fmt: skip
_LINES = re.compile(r"\s*[\r\n]\s*")  # of a heading in a cell
_NEARLY = 0.6  # of lines with figures
_KNOWN = 2  # headings that are understood, by which another separator than single blanks is taken
_NUMBER = re.compile(rb'\br="(\d+)"')
_HIDDEN_ROW = re.compile(rb'<row\b(?=[^>]*\bhidden="(?:1|true)")[^>]*>')
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f]")
Rows = tuple[list[list[Any]], list[int]]  # cells of every line, and their lines


class Delimited(Format):
    name = "text"
    title = say("text table (CSV)")

    def recognises(self, head: bytes) -> bool:
        text = head_text(head)
        return bool(text.strip()) and _CONTROL.search(text) is None

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        text, encoding = decoded(content, where, keys.encoding)
        delimiter = _delimiter(text, where, keys)
        ended = text.endswith(("\n", "\r"))
        return [Sheet("", *_rows(text, delimiter, where), unended=not ended, facts=_facts(encoding, delimiter))]


def _delimiter(text: str, where: str, keys: ImportKeys) -> str:
    if keys.delimiter is not None:
        return DELIMITERS[keys.delimiter]
    scores = {",": 0}
    for candidate in _TITLES:
        rows, lines = _rows(text, candidate, where, LINES_BEFORE)
        if candidate in text:
            try:
                if header_of(Sheet("", rows, lines), keys, where, REFERENCES) is not None:
                    return candidate
            except CmmUqError:  # two columns of one name
                return candidate
            known = (sum(bool(understood(cell).column or said(cell)) for cell in row) for row in rows)
            scores[candidate] = max(known, default=0)
    if max(score for candidate, score in scores.items() if candidate != " ") >= _KNOWN:
        scores.pop(" ", None)  # a heading of several words has more of them, cut apart
    return max(scores, key=lambda candidate: scores[candidate])


def _rows(text: str, delimiter: str, where: str, most: int | None = None) -> Rows:
    """Of every line, or of the first ``most``."""
    if delimiter == _BLANK:
        return _filled(enumerate(in_columns(list(islice(lines_within(text, where), most))), 1), f"{where} line")
    if '"' not in text:
        return _unquoted(text, delimiter, where, most)
    reader = csv.reader(lines_within(text, where), delimiter=delimiter, skipinitialspace=True)
    rows: Rows = ([], [])
    try:
        return _filled(islice(((reader.line_num, row) for row in reader), most), f"{where} line", rows)
    except csv.Error as error:
        if most is not None:
            return rows
        raise CmmUqError(f"cells cannot be told apart: {error}", where=f"{where} line {reader.line_num}",
                         fix="Close every quotation mark on its own line, or leave them out") from None  # fmt: skip


def alternatives(content: bytes, where: str, keys: ImportKeys) -> Iterator[list[Sheet]]:
    """A text cut into cells by each separator that it has, in turn."""
    text, encoding = decoded(content, where, keys.encoding)
    figured = [line for line in text.splitlines()[:LINES_BEFORE] if any(map(str.isdigit, line))]
    for candidate in _TITLES if keys.delimiter is None else (DELIMITERS[keys.delimiter],):
        # a sign that stands as often in nearly all lines parts their cells, and blanks are of texts
        regular = any(_regular(figured, sign) for sign in ("\t", ";", "|")) if candidate == _BLANK else False
        if candidate in text and (not regular or keys.delimiter is not None):
            yield [Sheet("", *_rows(text, candidate, where), facts=_facts(encoding, candidate))]
    if (rows := in_pairs(text)) is not None and keys.delimiter is None:
        yield [Sheet("", *_filled(rows, f"{where} line"), facts=_facts(encoding, _BLANK)[:1])]


def _regular(lines: Sequence[str], sign: str) -> bool:
    counts = Counter(line.count(sign) for line in lines)
    most, number = counts.most_common(1)[0] if counts else (0, 0)
    return most > 1 and number >= _NEARLY * len(lines)


def _facts(encoding: str, delimiter: str) -> tuple[Fact, ...]:
    between = Fact("delimiter", say("Between cells"), _TITLES[delimiter])
    return Fact("encoding", say("Encoding"), Verbatim(encoding)), between


def _unquoted(text: str, delimiter: str, where: str, most: int | None) -> Rows:
    """Of a text without quotation marks, as fast as it can be: cells are looked at one by one where some are loose."""
    lines = text.splitlines() if most is None else text[: most * 200].splitlines()[:most]
    longest = max(map(len, lines), default=0)
    if len(lines) > LINES.most or longest > LINE.most:
        list(lines_within(text, where))
    rows = [line.split(delimiter) for line in lines]
    if lines and longest <= CELL.most and len(lines) <= ROWS.most and max(map(len, rows)) <= COLUMNS.most:
        # blanks around a cell, an empty cell at the end of a row, a line with nothing in it
        loose = [f"\n{blank}" for blank in " \xa0"] + [f"{blank}\n" for blank in " \xa0"] + ["\n\n", f"{delimiter}\n"]
        loose += [edge for blank in " \xa0" for edge in (delimiter + blank, blank + delimiter)]
        joined = "\n".join(["", *lines, ""])
        if not any(edge in joined for edge in loose):
            return rows, list(range(1, len(rows) + 1))
    return _filled(enumerate(rows, 1), f"{where} line")


def _filled(counted: Iterable[tuple[int, Sequence[Any]]], where: str, filled: Rows | None = None) -> Rows:
    """Rows that are not empty, without empty cells at their ends, none beyond the limits of a table; added to ``filled``.

    ``where`` : what the number of a row follows in messages.
    """
    rows, lines = filled or ([], [])
    for line, row in counted:
        cells = _without_end([cell.strip() if isinstance(cell, str) else cell for cell in row])
        if not cells:
            continue
        _check_width(len(cells), f"{where} {line}")
        longest = max((len(cell) for cell in cells if isinstance(cell, str)), default=0)
        problem, fix = "", "Shorten it, and close every quotation mark on its own line"
        if longest > CELL.most:
            problem = f"has a cell of {longest} characters, {CELL.most} are the most"
        elif len(rows) >= ROWS.most + LINES_BEFORE:
            problem, fix = f"goes on after {len(rows)} rows: {ROWS.most} are the most", "Split or thin out the table"
        if problem:
            raise CmmUqError(problem, where=f"{where} {line}", fix=fix)
        rows.append(cells)
        lines.append(line)
    return rows, lines


def _without_end(cells: list[Any]) -> list[Any]:
    while cells and cells[-1] == "":
        cells.pop()
    return cells


_PROLOG = 65_536  # bytes of a part in which its root begins
_MEMBERS = 2000
_EMPTY_MOST = 5000  # empty rows in turn after which a sheet has ended
_TABLE = "{urn:oasis:names:tc:opendocument:xmlns:table:1.0}"
_OFFICE = "{urn:oasis:names:tc:opendocument:xmlns:office:1.0}"


def _opened(content: bytes, where: str) -> zipfile.ZipFile:
    """A ZIP archive that can be read, and whose XML declares no document type, and with it entities."""
    try:
        archive = zipfile.ZipFile(io.BytesIO(content))
        members = archive.infolist()
    except (zipfile.BadZipFile, ValueError, NotImplementedError, OSError):
        raise CmmUqError("is a damaged workbook: the end of the file is missing or spoiled", where=where,
                         fix="Copy or export it again") from None  # fmt: skip
    size = sum(member.file_size for member in members)
    if size > UNPACKED.most or len(members) > _MEMBERS:
        problem = f"holds {size} bytes in {len(members)} parts once it is unpacked: {UNPACKED.most} are the most"
        fix = "Save the sheet of the recording as a workbook of its own, or as CSV"
        raise CmmUqError(problem, where=where, fix=fix)
    if any(member.flag_bits & 1 for member in members):
        raise CmmUqError("is encrypted", where=where, fix="Save it without a password")
    for name in archive.namelist():
        if name.endswith((".xml", ".rels")):
            try:
                with archive.open(name) as part:
                    head = head_text(part.read(_PROLOG))
            except (zipfile.BadZipFile, zlib.error, OSError, EOFError, NotImplementedError):
                raise CmmUqError(f"is a damaged workbook: its part {name!r} is spoiled", where=where,
                                 fix="Copy or export it again") from None  # fmt: skip
            # the root must be found where it must begin
            if "<!DOCTYPE" in head or (re.search(r"<[A-Za-z]", head) is None and len(head) >= _PROLOG // 2):
                raise CmmUqError(f"declares entities or a document type (in {name!r})", where=where, fix=HOSTILE_FIX)
    return archive


def _sheet(name: str, counted: Iterable[tuple[int, list[Cell]]], where: str) -> Sheet:
    return Sheet(name, *_filled(counted, f"{where}: {name} row"), spreadsheet=True)


def _check_width(width: int, place: str) -> None:
    if width > COLUMNS.most:
        problem, fix = f"has {width} cells, {COLUMNS.most} are the most", "Keep the columns that the job needs"
        raise CmmUqError(problem, where=place, fix=fix)


class Excel(Format):
    name = "xlsx"
    title = say("Excel workbook")

    def recognises(self, head: bytes) -> bool:
        members = (b"[Content_Types].xml", b"xl/workbook.xml", b"xl/worksheets", b"_rels/.rels")
        return head.startswith(b"PK\x03\x04") and any(name in head for name in members)

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        with _opened(content, where) as archive:
            if not any(name.startswith("xl/") for name in archive.namelist()):
                raise CmmUqError("is an Office document, and no workbook", where=where, fix="Save the table as .xlsx")
        from openpyxl import load_workbook

        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of styles and extensions, which are not looked at
                book = load_workbook(io.BytesIO(content), read_only=True, data_only=True, keep_links=False)
                visible = (sheet for sheet in book.worksheets if sheet.sheet_state == "visible")
                sheets = [
                    _without_hidden(_sheet(sheet.title, _excel_rows(sheet), where), sheet, content) for sheet in visible
                ]
                book.close()
        except CmmUqError:
            raise
        except Exception as error:  # the library has as many as there are ways to spoil a workbook
            raise CmmUqError(f"is a damaged workbook: {type(error).__name__}: {error}", where=where,
                             fix="Open and save it again, or export it as CSV") from None  # fmt: skip
        if not sheets:
            raise CmmUqError("has no visible sheet", where=where, fix="Show the sheet of the recording")
        return sheets


def _excel_rows(sheet: Any) -> Iterator[tuple[int, list[Cell]]]:
    last = 0
    sheet.reset_dimensions()
    for line, values in enumerate(sheet.iter_rows(values_only=True), 1):
        if cells := _without_end([_excel_cell(value) for value in values]):
            last = line
            yield line, cells
        elif line - last > _EMPTY_MOST:
            break


def _without_hidden(sheet: Sheet, of: Any, content: bytes) -> Sheet:
    """Without the rows that the workbook hides, as those of measurements that are void; each is told."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        hidden = {int(n) for tag in _HIDDEN_ROW.findall(archive.read(of._worksheet_path)) for n in _NUMBER.findall(tag)}
    each = [*zip(sheet.rows, sheet.lines, strict=True)]
    left = tuple(
        f"{sheet.name} row {line}: {' '.join(map(text_of, row))[:40]!r}, hidden" for row, line in each if line in hidden
    )
    kept = [one for one in each if one[1] not in hidden]
    rows, lines = [row for row, _ in kept], [line for _, line in kept]
    return replace(sheet, rows=rows, lines=lines, left_out=left) if left else sheet


def _excel_cell(value: Any) -> Cell:
    if isinstance(value, bool):
        return str(value).upper()
    if isinstance(value, (int, float)):
        return float(value)
    if isinstance(value, (dt.date, dt.time)):
        return value.isoformat()
    return "" if value is None else _LINES.sub(" ", str(value)).strip()


class OpenDocument(Format):
    name = "ods"
    title = say("OpenDocument spreadsheet")

    def recognises(self, head: bytes) -> bool:
        return b"mimetypeapplication/vnd.oasis.opendocument.spreadsheet" in head[:200]

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        from defusedxml.common import DefusedXmlException
        from defusedxml.ElementTree import iterparse

        with _opened(content, where) as archive:
            try:
                with archive.open("content.xml") as file:
                    events = iter(iterparse(file, ("start", "end"), forbid_dtd=True))
                    names = (each.get(f"{_TABLE}name", "") for of, each in events if (of, each.tag) == _BEGINS)
                    sheets = [_sheet(name, _ods_rows(events, f"{where}: {name}"), where) for name in names]
            except DefusedXmlException:
                raise CmmUqError("declares entities or a document type", where=where, fix=HOSTILE_FIX) from None
            except (KeyError, ParseError, zipfile.BadZipFile, OSError, EOFError, ValueError) as error:
                raise CmmUqError(f"is a damaged spreadsheet: {error}", where=where,
                                 fix="Open and save it again, or export it as CSV") from None  # fmt: skip
        if not sheets:
            raise CmmUqError("has no sheet", where=where, fix="Export the sheet of the recording")
        return sheets


_BEGINS, _ENDS, _ROW = ("start", f"{_TABLE}table"), ("end", f"{_TABLE}table"), ("end", f"{_TABLE}table-row")


def _ods_rows(events: Iterator[tuple[str, Element]], place: str) -> Iterator[tuple[int, list[Cell]]]:
    """Rows of a table up to its end."""
    line = 1
    for event, element in events:
        if (event, element.tag) == _ROW:
            repeated, cells = _count(element, "number-rows-repeated"), _ods_cells(element, f"{place} row {line}")
            yield from ((line + copy, cells) for copy in range(repeated if cells else 0))
            line += repeated
            element.clear()
        elif (event, element.tag) == _ENDS:
            element.clear()
            break


def _ods_cells(row: Element, place: str) -> list[Cell]:
    """Cells of a row, without the empty ones at its end."""
    cells: list[Cell] = []
    empty = 0
    for element in row:
        if local(element) not in ("table-cell", "covered-table-cell"):
            continue
        repeated, value = _count(element, "number-columns-repeated"), _ods_value(element)
        if value == "":
            empty += repeated
            continue
        _check_width(len(cells) + empty + repeated, place)
        cells += [""] * empty + [value] * repeated
        empty = 0
    return cells


def _ods_value(element: Element) -> Cell:
    if element.get(f"{_OFFICE}value-type") in ("float", "currency", "percentage"):
        return float(element.get(f"{_OFFICE}value", "nan"))
    for key in ("date-value", "time-value", "boolean-value"):
        if text := element.get(f"{_OFFICE}{key}"):
            return text
    return " ".join("".join(part.itertext()) for part in element if local(part) == "p").strip()


def _count(element: Element, key: str) -> int:
    return max(1, int(element.get(f"{_TABLE}{key}", "1")))
