"""Workbooks: Excel (ISO/IEC 29500, read by openpyxl) and OpenDocument (ISO/IEC 26300), values as they were last computed.

Of OpenDocument ``office:value`` holds a number to all its digits, whatever the cell shows. Repeated rows and columns are
counted, not unfolded, so that a file of a few bytes cannot become a table of millions of cells.
"""

from __future__ import annotations

import datetime as dt
import io
import re
import warnings
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from typing import Any
from xml.etree.ElementTree import Element, ParseError

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import CELL, COLUMNS, ROWS, UNPACKED
from cmm_uq.base.messages import say
from cmm_uq.jobs.importing.encodings import HOSTILE_FIX, head_text, local
from cmm_uq.jobs.importing.format import Format
from cmm_uq.jobs.importing.header import LINES_BEFORE
from cmm_uq.jobs.importing.keys import ImportKeys
from cmm_uq.jobs.importing.sheet import Cell, Sheet

_PROLOG = 65_536  # bytes of a part in which its root begins
_MEMBERS = 2000
_EMPTY_MOST = 5000  # empty rows in turn after which a sheet has ended
_TABLE = "{urn:oasis:names:tc:opendocument:xmlns:table:1.0}"
_OFFICE = "{urn:oasis:names:tc:opendocument:xmlns:office:1.0}"


def opened(content: bytes, where: str) -> zipfile.ZipFile:
    """A ZIP archive that can be read."""
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
            _refuse_entities(archive, name, where)
    return archive


def _refuse_entities(archive: zipfile.ZipFile, name: str, where: str) -> None:
    """Refuse XML that declares a document type, and with it entities, or whose root is not found where it must begin."""
    try:
        with archive.open(name) as member:
            head = head_text(member.read(_PROLOG))
    except (zipfile.BadZipFile, zlib.error, OSError, EOFError, NotImplementedError):
        raise CmmUqError(f"is a damaged workbook: its part {name!r} is spoiled", where=where,
                         fix="Copy or export it again") from None  # fmt: skip
    if "<!DOCTYPE" in head or (re.search(r"<[A-Za-z]", head) is None and len(head) >= _PROLOG // 2):
        raise CmmUqError(f"declares entities or a document type (in {name!r})", where=where, fix=HOSTILE_FIX)


class Excel(Format):
    """A workbook."""

    name = "xlsx"
    title = say("Excel workbook")

    def recognises(self, head: bytes) -> bool:
        members = (b"[Content_Types].xml", b"xl/workbook.xml", b"xl/worksheets", b"_rels/.rels")
        return head.startswith(b"PK\x03\x04") and any(name in head for name in members)

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        with opened(content, where) as archive:
            if not any(name.startswith("xl/") for name in archive.namelist()):
                raise CmmUqError("is an Office document, and no workbook", where=where, fix="Save the table as .xlsx")
        from openpyxl import load_workbook

        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of styles and extensions, which are not looked at
                book = load_workbook(io.BytesIO(content), read_only=True, data_only=True, keep_links=False)
                sheets = [_sheet(sheet, where) for sheet in book.worksheets if sheet.sheet_state == "visible"]
                book.close()
        except CmmUqError:
            raise
        except Exception as error:  # the library has as many as there are ways to spoil a workbook
            raise CmmUqError(f"is a damaged workbook: {type(error).__name__}: {error}", where=where,
                             fix="Open and save it again, or export it as CSV") from None  # fmt: skip
        if not sheets:
            raise CmmUqError("has no visible sheet", where=where, fix="Show the sheet of the recording")
        return sheets


def _sheet(sheet: Any, where: str) -> Sheet:
    rows: list[list[Cell]] = []
    lines: list[int] = []
    sheet.reset_dimensions()
    for line, values in enumerate(sheet.iter_rows(values_only=True), 1):
        cells = [_cell(value) for value in values]
        while cells and cells[-1] == "":
            cells.pop()
        if cells:
            _check_row(cells, len(rows), f"{where}: {sheet.title} row {line}")
            rows.append(cells)
            lines.append(line)
        elif line - (lines[-1] if lines else 0) > _EMPTY_MOST:
            break
    return Sheet(sheet.title, rows, lines, spreadsheet=True)


def _cell(value: Any) -> Cell:
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).upper()
    if isinstance(value, (int, float)):
        return float(value)
    if isinstance(value, (dt.date, dt.time)):
        return value.isoformat()
    return str(value).strip()


def _check_row(cells: Sequence[Cell], rows: int, place: str) -> None:
    """Refuse what goes beyond the limits of a table."""
    if len(cells) > COLUMNS.most:
        raise CmmUqError(f"has {len(cells)} cells, {COLUMNS.most} are the most", where=place,
                         fix="Keep the columns that the job needs")  # fmt: skip
    if rows >= ROWS.most + LINES_BEFORE:
        raise CmmUqError(f"goes on after {rows} rows: {ROWS.most} are the most", where=place,
                         fix="Split or thin out the table")  # fmt: skip
    longest = max((len(cell) for cell in cells if isinstance(cell, str)), default=0)
    if longest > CELL.most:
        raise CmmUqError(f"has a cell of {longest} characters, {CELL.most} are the most", where=place, fix="Shorten it")


class OpenDocument(Format):
    """A spreadsheet."""

    name = "ods"
    title = say("OpenDocument spreadsheet")

    def recognises(self, head: bytes) -> bool:
        return b"mimetypeapplication/vnd.oasis.opendocument.spreadsheet" in head[:200]

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        from defusedxml.common import DefusedXmlException
        from defusedxml.ElementTree import iterparse

        with opened(content, where) as archive:
            try:
                with archive.open("content.xml") as file:
                    sheets = list(_sheets(iterparse(file, ("start", "end"), forbid_dtd=True), where))
            except DefusedXmlException:
                raise CmmUqError("declares entities or a document type", where=where, fix=HOSTILE_FIX) from None
            except (KeyError, ParseError, zipfile.BadZipFile, OSError, EOFError, ValueError) as error:
                raise CmmUqError(f"is a damaged spreadsheet: {error}", where=where,
                                 fix="Open and save it again, or export it as CSV") from None  # fmt: skip
        if not sheets:
            raise CmmUqError("has no sheet", where=where, fix="Export the sheet of the recording")
        return sheets


def _sheets(events: Iterator[tuple[str, Element]], where: str) -> Iterator[Sheet]:
    name, line = "", 0
    rows: list[list[Cell]] = []
    lines: list[int] = []
    for event, element in events:
        if event == "start" and element.tag == f"{_TABLE}table":
            name, line, rows, lines = element.get(f"{_TABLE}name", ""), 0, [], []
        elif event == "end" and element.tag == f"{_TABLE}table-row":
            repeated = _count(element, "number-rows-repeated")
            cells = _cells(element, f"{where}: {name} row {line + 1}")
            for copy in range(repeated if cells else 0):
                _check_row(cells, len(rows), f"{where}: {name} row {line + copy + 1}")
                rows.append(cells)
                lines.append(line + copy + 1)
            line += repeated
            element.clear()
        elif event == "end" and element.tag == f"{_TABLE}table":
            yield Sheet(name, rows, lines, spreadsheet=True)
            element.clear()


def _cells(row: Element, place: str) -> list[Cell]:
    """Cells of a row, without the empty ones at its end."""
    cells: list[Cell] = []
    empty = 0
    for element in row:
        if local(element) not in ("table-cell", "covered-table-cell"):
            continue
        repeated, value = _count(element, "number-columns-repeated"), _value(element)
        if value == "":
            empty += repeated
            continue
        width = len(cells) + empty + repeated
        if width > COLUMNS.most:
            raise CmmUqError(f"has {width} cells, {COLUMNS.most} are the most", where=place,
                             fix="Keep the columns that the job needs")  # fmt: skip
        cells += [""] * empty + [value] * repeated
        empty = 0
    return cells


def _value(element: Element) -> Cell:
    if element.get(f"{_OFFICE}value-type") in ("float", "currency", "percentage"):
        return float(element.get(f"{_OFFICE}value", "nan"))
    for key in ("date-value", "time-value", "boolean-value"):
        if text := element.get(f"{_OFFICE}{key}"):
            return text
    return "\n".join("".join(part.itertext()) for part in element if local(part) == "p").strip()


def _count(element: Element, key: str) -> int:
    return max(1, int(element.get(f"{_TABLE}{key}", "1")))
