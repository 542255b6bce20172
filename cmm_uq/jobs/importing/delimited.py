"""Text tables: CSV and its kin, with commas, semicolons, tabs, bars or blanks between cells.

The delimiter is the one by which a line names the columns of a recording: a header read with a wrong one names none.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Sequence
from itertools import islice

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.csv_table import lines_within
from cmm_uq.base.files.limits import CELL, COLUMNS, LINE, LINES, ROWS
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.jobs.importing.encodings import decoded, head_text
from cmm_uq.jobs.importing.format import Format
from cmm_uq.jobs.importing.header import LINES_BEFORE, REFERENCES, header_of
from cmm_uq.jobs.importing.keys import DELIMITERS, ImportKeys
from cmm_uq.jobs.importing.sheet import Fact, Sheet
from cmm_uq.jobs.importing.vocabulary import understood

COLUMNS_OF_TEXT = "  "
"""Two blanks or more between cells, so that single ones may stand in headings."""

_TITLES: dict[str, Text] = {
    ",": say("comma"), ";": say("semicolon"), "\t": say("tab"), "|": say("bar"), " ": say("blanks"),
    COLUMNS_OF_TEXT: say("two blanks or more"),
}  # fmt: skip
_BLANKS = {" ": re.compile(r"\s+"), COLUMNS_OF_TEXT: re.compile(r"\s{2,}|\t")}
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f]")


class Delimited(Format):
    """Any text."""

    name = "text"
    title = say("text table (CSV)")

    def recognises(self, head: bytes) -> bool:
        """See :meth:`Format.recognises`: whatever has no control characters."""
        text = head_text(head)
        return bool(text.strip()) and len(_CONTROL.findall(text)) == 0

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        text, encoding = decoded(content, where, keys.encoding)
        delimiter = _delimiter(text, where, keys)
        rows, lines = _rows(text, delimiter, where)
        facts = (
            Fact("encoding", say("Encoding"), Verbatim(encoding)),
            Fact("delimiter", say("Between cells"), _TITLES[delimiter]),
        )
        return [Sheet("", rows, lines, unended=not text.endswith(("\n", "\r")), facts=facts)]


def _delimiter(text: str, where: str, keys: ImportKeys) -> str:
    if keys.delimiter is not None:
        return DELIMITERS[keys.delimiter]
    scores = {}
    for candidate in _TITLES:
        rows, lines = _rows(text, candidate, where, LINES_BEFORE)
        sheet = Sheet("", rows, lines)
        if candidate in text or candidate in _BLANKS:
            if header_of(sheet, keys, where, REFERENCES) is not None:
                return candidate
            scores[candidate] = max(
                (sum(understood(cell).column is not None for cell in row) for row in rows), default=0
            )
    best = max(scores, key=lambda one: scores[one])
    return best if scores[best] else ","


def _rows(text: str, delimiter: str, where: str, most: int | None = None) -> tuple[list[list[str]], list[int]]:
    """Cells of every line, or of the first ``most``, and their lines."""
    rows: list[list[str]] = []
    lines: list[int] = []
    if '"' not in text and delimiter not in _BLANKS:
        return _split(text, delimiter, where, most)
    taken = lines_within(text, where)
    if delimiter in _BLANKS:
        split = _BLANKS[delimiter].split
        cut: Iterable[tuple[int, list[str]]] = ((i, split(line.strip())) for i, line in enumerate(taken, 1))
        return _kept(cut if most is None else islice(cut, most), rows, lines, where)
    reader = csv.reader(taken, delimiter=delimiter, skipinitialspace=True)
    counted = ((reader.line_num, row) for row in reader)
    try:
        return _kept(counted if most is None else islice(counted, most), rows, lines, where)
    except csv.Error as error:
        if most is not None:
            return rows, lines
        raise CmmUqError(f"cells cannot be told apart: {error}", where=f"{where} line {reader.line_num}",
                         fix="Close every quotation mark on its own line, or leave them out") from None  # fmt: skip


def _split(text: str, delimiter: str, where: str, most: int | None) -> tuple[list[list[str]], list[int]]:
    """The same of a text without quotation marks, as fast as it can be."""
    every = text.splitlines() if most is None else text[: most * 200].splitlines()[:most]
    if len(every) > LINES.most or (every and len(max(every, key=len)) > LINE.most):
        list(lines_within(text, where))
    rows = [line.split(delimiter) for line in every]
    short = every and len(max(every, key=len)) <= CELL.most and len(every) <= ROWS.most
    if short and not _loose("\n".join(every), delimiter) and max(set(map(len, rows))) <= COLUMNS.most:
        return rows, list(range(1, len(rows) + 1))
    return _kept(enumerate(rows, 1), [], [], where)


def _loose(text: str, delimiter: str) -> bool:
    """Whether some cell has blanks around it, some row an empty cell at its end, or some line nothing."""
    edges = [f"\n{blank}" for blank in " \xa0"] + [f"{blank}\n" for blank in " \xa0"]
    edges += [f"{delimiter}{blank}" for blank in " \xa0\n"] + [f"{blank}{delimiter}" for blank in " \xa0"]
    return any(edge in f"\n{text}\n" for edge in ("\n\n", *edges))


def _kept(
    counted: Iterable[tuple[int, list[str]]], rows: list[list[str]], lines: list[int], where: str
) -> tuple[list[list[str]], list[int]]:
    for line, row in counted:
        cells = [cell.strip() for cell in row]
        while cells and not cells[-1]:
            cells.pop()
        if not cells:
            continue
        if len(cells) > COLUMNS.most or len(max(cells, key=len)) > CELL.most:
            what = (
                f"{len(cells)} cells"
                if len(cells) > COLUMNS.most
                else f"a cell of {len(max(cells, key=len))} characters"
            )
            limit = COLUMNS if len(cells) > COLUMNS.most else CELL
            raise CmmUqError(f"has {what}, {limit.most} are the most", where=f"{where} line {line}",
                             fix="Export the columns that are needed; close every quotation mark on its own line")  # fmt: skip
        rows.append(cells)
        lines.append(line)
    if len(rows) > ROWS.most + LINES_BEFORE:
        raise CmmUqError(
            f"has {len(rows)} rows, {ROWS.most} are the most", where=where, fix="Split or thin out the table"
        )
    return rows, lines
