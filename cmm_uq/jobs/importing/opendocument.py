"""OpenDocument spreadsheets (.ods; ISO/IEC 26300): values as they were last computed, read as a stream.

``office:value`` holds a number to all its digits, whatever the cell shows. Repeated rows and columns are counted, not
unfolded, so that a file of a few bytes cannot become a table of millions of cells.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Sequence
from xml.etree.ElementTree import Element, ParseError

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import COLUMNS
from cmm_uq.base.messages import say
from cmm_uq.jobs.importing.archive import opened
from cmm_uq.jobs.importing.excel import check_row
from cmm_uq.jobs.importing.format import Format
from cmm_uq.jobs.importing.keys import ImportKeys
from cmm_uq.jobs.importing.sheet import Cell, Sheet
from cmm_uq.jobs.importing.xml_files import HOSTILE_FIX, local

_TABLE = "{urn:oasis:names:tc:opendocument:xmlns:table:1.0}"
_OFFICE = "{urn:oasis:names:tc:opendocument:xmlns:office:1.0}"
_NUMBERS = ("float", "currency", "percentage")


class OpenDocument(Format):
    """A spreadsheet."""

    name = "ods"
    title = say("OpenDocument spreadsheet")

    def recognises(self, head: bytes) -> bool:
        """See :meth:`Format.recognises`: its first member says so."""
        return b"mimetypeapplication/vnd.oasis.opendocument.spreadsheet" in head[:200]

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        """See :meth:`Format.read`."""
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
                check_row(cells, len(rows), f"{where}: {name} row {line + copy + 1}")
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
        if len(cells) + empty + repeated > COLUMNS.most:
            raise CmmUqError(f"has {len(cells) + empty + repeated} cells, {COLUMNS.most} are the most", where=place,
                             fix="Keep the columns that the job needs")  # fmt: skip
        cells += [""] * empty + [value] * repeated
        empty = 0
    return cells


def _value(element: Element) -> Cell:
    sort = element.get(f"{_OFFICE}value-type")
    if sort in _NUMBERS:
        return float(element.get(f"{_OFFICE}value", "nan"))
    for key in ("date-value", "time-value", "boolean-value"):
        if given := element.get(f"{_OFFICE}{key}"):
            return given
    return "\n".join("".join(part.itertext()) for part in element if local(part) == "p").strip()


def _count(element: Element, key: str) -> int:
    return max(1, int(element.get(f"{_TABLE}{key}", "1")))
