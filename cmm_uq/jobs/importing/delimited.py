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

COLUMNS_OF_TEXT = "  "  # two blanks or more between cells, so that single ones may stand in headings

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
        text = head_text(head)
        return bool(text.strip()) and _CONTROL.search(text) is None

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
    scores = {",": 0}
    for candidate in _TITLES:
        rows, lines = _rows(text, candidate, where, LINES_BEFORE)
        if candidate in text or candidate in _BLANKS:
            if header_of(Sheet("", rows, lines), keys, where, REFERENCES) is not None:
                return candidate
            scores[candidate] = max(
                (sum(understood(cell).column is not None for cell in row) for row in rows), default=0
            )
    return max(scores, key=lambda candidate: scores[candidate])


Rows = tuple[list[list[str]], list[int]]  # cells of every line, and their lines


def _rows(text: str, delimiter: str, where: str, most: int | None = None) -> Rows:
    """Of every line, or of the first ``most``."""
    if delimiter in _BLANKS:
        split, lines = _BLANKS[delimiter].split, lines_within(text, where)
        return _filled(islice(((i, split(line.strip())) for i, line in enumerate(lines, 1)), most), where)
    if '"' not in text:
        return _unquoted(text, delimiter, where, most)
    reader = csv.reader(lines_within(text, where), delimiter=delimiter, skipinitialspace=True)
    rows: Rows = ([], [])
    try:
        return _filled(islice(((reader.line_num, row) for row in reader), most), where, rows)
    except csv.Error as error:
        if most is not None:
            return rows
        raise CmmUqError(f"cells cannot be told apart: {error}", where=f"{where} line {reader.line_num}",
                         fix="Close every quotation mark on its own line, or leave them out") from None  # fmt: skip


def _unquoted(text: str, delimiter: str, where: str, most: int | None) -> Rows:
    """Of a text without quotation marks, as fast as it can be."""
    lines = text.splitlines() if most is None else text[: most * 200].splitlines()[:most]
    longest = max(map(len, lines), default=0)
    if len(lines) > LINES.most or longest > LINE.most:
        list(lines_within(text, where))
    rows = [line.split(delimiter) for line in lines]
    short = lines and longest <= CELL.most and len(lines) <= ROWS.most and max(map(len, rows)) <= COLUMNS.most
    if short and not _loose("\n".join(lines), delimiter):
        return rows, list(range(1, len(rows) + 1))
    return _filled(enumerate(rows, 1), where)


def _loose(text: str, delimiter: str) -> bool:
    """Whether some cell has blanks around it, some row an empty cell at its end, or some line nothing."""
    edges = [
        edge for blank in " \xa0" for edge in (f"\n{blank}", f"{blank}\n", f"{delimiter}{blank}", f"{blank}{delimiter}")
    ]
    return any(edge in f"\n{text}\n" for edge in ("\n\n", f"{delimiter}\n", *edges))


def _filled(counted: Iterable[tuple[int, list[str]]], where: str, filled: Rows | None = None) -> Rows:
    """Without empty cells at the ends of rows, and without empty rows; added to ``filled``."""
    rows, lines = filled or ([], [])
    for line, row in counted:
        cells = [cell.strip() for cell in row]
        while cells and not cells[-1]:
            cells.pop()
        if not cells:
            continue
        longest = max(map(len, cells))
        if len(cells) > COLUMNS.most or longest > CELL.most:
            what, limit = (f"a cell of {longest} characters", CELL)
            if len(cells) > COLUMNS.most:
                what, limit = f"{len(cells)} cells", COLUMNS
            fix = "Export the columns that are needed; close every quotation mark on its own line"
            raise CmmUqError(f"has {what}, {limit.most} are the most", where=f"{where} line {line}", fix=fix)
        rows.append(cells)
        lines.append(line)
    if len(rows) > ROWS.most + LINES_BEFORE:
        problem = f"has {len(rows)} rows, {ROWS.most} are the most"
        raise CmmUqError(problem, where=where, fix="Split or thin out the table")
    return rows, lines
