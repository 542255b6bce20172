"""Tables that are no points, lengths or runs: what they are is said, and what to do with them here."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import PurePath

from cmm_uq.jobs.importing.blocks import DATED
from cmm_uq.jobs.importing.cells.encodings import is_number
from cmm_uq.jobs.importing.format import NotReadError, Sheet
from cmm_uq.jobs.importing.header import plain_words
from cmm_uq.jobs.importing.lengths.circles import in_words

_FEWEST = 4  # rows of a record
_HOT = 60.0  # °C, that no laboratory reaches
_CELSIUS = re.compile(r"°\s?[CF]\b|[\[(]\s?[CF]\s?[\])]|℃")
_PROBING = re.compile(r"(?<![A-Za-z])(?:P_?[FSL]T[UMEN]|P_?(?:Form|Size|Dia)\.?\w*|P_?[FS]\.Sph|T_?[HL][PN])(?![a-z])")
_RESULTS = 2  # names of characteristics


def other_kind(sheets: Sequence[Sheet], where: str) -> NotReadError | None:
    """The error for a record of temperatures, squarenesses, or results of probing; ``None`` of another table."""
    rows = [row for sheet in sheets for row in sheet.rows]
    texts = [
        PurePath(where).name,
        *(cell for row in rows for cell in row if isinstance(cell, str) and not is_number(cell)),
    ]
    figured = [row for row in rows if any(is_number(cell) for cell in row if cell != "")]
    dated = [row for row in figured if any(isinstance(cell, str) and DATED.search(cell) for cell in row)]
    numbers = [float(str(cell).replace(",", ".")) for row in dated for cell in row[1:] if _plain(str(cell))]
    warm = _names(texts, "warmth") or any(map(_CELSIUS.search, texts))
    if warm and len(dated) >= max(_FEWEST, 0.6 * len(figured)) and max(map(abs, numbers), default=_HOT) < _HOT:
        what = "is a record of temperatures by time, with no measured points or lengths"
        fix = "Write them beside the points of a recording, as temp_x_c, temp_artefact_c … (docs/reference/columns.md)"
        return NotReadError(what, where=where, fix=fix)
    if _names(texts, "squareness"):
        what = "holds squarenesses, and no measured points or lengths"
        fix = "Read the square as runs along both legs, with reading_um and square (docs/artefacts/axis-runs.md)"
        return NotReadError(what, where=where, fix=fix)
    results = {name for cell in texts for name in _PROBING.findall(cell)}
    if len(results) >= _RESULTS and len(figured) <= 10 * len(results):
        what = f"holds results of a probing test ({', '.join(sorted(results)[:3])}), and none of its points"
        fix = "Export the coordinates of every probed point: x_mm, y_mm and z_mm"
        return NotReadError(what, where=where, fix=fix)
    return None


def _plain(text: str) -> bool:
    return re.fullmatch(r"[+-]?\d+[.,]\d+", text.strip()) is not None


def _names(texts: Sequence[str], table: str) -> bool:
    return any(in_words(" ".join(plain_words(text)), "others", table) for text in texts)
