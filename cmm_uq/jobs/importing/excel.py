"""Excel workbooks (.xlsx, .xlsm; ISO/IEC 29500), read by openpyxl: values as they were last computed, no formula, no macro."""

from __future__ import annotations

import datetime as dt
import io
import warnings
from collections.abc import Iterable, Sequence
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import CELL, COLUMNS, ROWS
from cmm_uq.base.messages import say
from cmm_uq.jobs.importing.archive import has, opened
from cmm_uq.jobs.importing.format import Format
from cmm_uq.jobs.importing.header import LINES_BEFORE
from cmm_uq.jobs.importing.keys import ImportKeys
from cmm_uq.jobs.importing.sheet import Cell, Sheet

_EMPTY_MOST = 5000
"""Empty rows in turn after which a sheet has ended."""


class Excel(Format):
    """A workbook."""

    name = "xlsx"
    title = say("Excel workbook")

    def recognises(self, head: bytes) -> bool:
        """See :meth:`Format.recognises`."""
        return has(head, "[Content_Types].xml", "xl/workbook.xml", "xl/worksheets", "_rels/.rels")

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        """See :meth:`Format.read`."""
        with opened(content, where) as archive:
            if not any(name.startswith("xl/") for name in archive.namelist()):
                raise CmmUqError("is an Office document, and no workbook", where=where, fix="Save the table as .xlsx")
        from openpyxl import load_workbook

        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of styles and extensions, which are not looked at
                book = load_workbook(io.BytesIO(content), read_only=True, data_only=True, keep_links=False)
                sheets = [
                    _sheet(one.title, _cells(one), where) for one in book.worksheets if one.sheet_state == "visible"
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


def _cells(sheet: Any) -> Iterable[Sequence[Any]]:
    sheet.reset_dimensions()
    found: Iterable[Sequence[Any]] = sheet.iter_rows(values_only=True)
    return found


def _sheet(name: str, found: Iterable[Sequence[Any]], where: str) -> Sheet:
    """A sheet of the cells of a workbook."""
    rows: list[list[Cell]] = []
    lines: list[int] = []
    for line, values in enumerate(found, 1):
        cells = [cell_of(value) for value in values]
        while cells and cells[-1] == "":
            cells.pop()
        if not cells:
            if line - (lines[-1] if lines else 0) > _EMPTY_MOST:
                break
            continue
        check_row(cells, len(rows), f"{where}: {name} row {line}")
        rows.append(cells)
        lines.append(line)
    return Sheet(name, rows, lines, spreadsheet=True)


def cell_of(value: Any) -> Cell:
    """A cell's value."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).upper()
    if isinstance(value, (int, float)):
        return float(value)
    if isinstance(value, (dt.date, dt.time)):
        return value.isoformat()
    return str(value).strip()


def check_row(cells: Sequence[Cell], rows: int, place: str) -> None:
    """Refuse what goes beyond the limits of a table.

    Raises
    ------
    CmmUqError : too many rows, too many cells, or a cell too long.
    """
    if len(cells) > COLUMNS.most:
        raise CmmUqError(f"has {len(cells)} cells, {COLUMNS.most} are the most", where=place,
                         fix="Keep the columns that the job needs")  # fmt: skip
    if rows >= ROWS.most + LINES_BEFORE:
        raise CmmUqError(f"goes on after {rows} rows: {ROWS.most} are the most", where=place,
                         fix="Split or thin out the table")  # fmt: skip
    longest = max((len(cell) for cell in cells if isinstance(cell, str)), default=0)
    if longest > CELL.most:
        raise CmmUqError(f"has a cell of {longest} characters, {CELL.most} are the most", where=place, fix="Shorten it")
