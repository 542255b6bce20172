"""Texts without separators: cells of lines by where they stand, or in turn where a head has as many."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import compress, pairwise

from cmm_uq.jobs.importing.lengths.places import said_in

_TOKEN, _PHRASE = re.compile(r"(?:(?![:=|]+(?=\s))\S+)"), re.compile(r"\S+(?: \S+)*")
_BETWEEN = re.compile(r"(?<=\s)[:|](?=\s)")  # columns
_POINT = re.compile("[.,]")
_WIDE = re.compile("[\u1100-\u115f\u2e80-\ua4cf\uac00-\ud7a3\uf900-\ufaff\ufe30-\ufe4f\uff00-\uff60\uffe0-\uffe6]")
_HELD = "\0"  # beside a character that is printed as wide as two
_NUMBER = re.compile(r"[±+-]?\d[\d.,]*(?:%|[eE][+-]?\d+)?|[±+-]?[.,]\d+")
_MIXED = re.compile(r"\s[±+-]?\d*[.,]\d|[\d.,]\s+[±+-]?\d")  # figures that one blank parts from others
_AXES = {*"XYZxyz"}


def in_columns(lines: Sequence[str]) -> Iterator[list[str]]:
    """Cells of lines by where they stand: columns are where figures stand below each other, heads go to the nearest."""
    lines = [_WIDE.sub(rf"\g<0>{_HELD}", line.expandtabs()) for line in lines]
    lines = [_BETWEEN.sub(" ", line) if len(_BETWEEN.findall(line)) > 1 else line for line in lines]
    tokens = [_row_of(line) for line in lines]
    spans: list[tuple[int, int]] = []  # where tokens stand, by the most common rows first
    alike: dict[tuple[bool, ...], list[tuple[int, int]]] = {}  # by where their figures are
    for own in filter(None, tokens):
        alike.setdefault(tuple(text[-1].isdigit() for *_, text in own), []).extend(span[:2] for span in own)
    sizes = {form: len(own) // len(form) for form, own in alike.items()}
    for form, rows in sorted(sizes.items(), key=lambda one: -one[1]):
        for start, end in _merged(alike[form]):
            over = [span for span in spans if start < span[1] and span[0] < end]
            if len(over) < 2 or 5 * rows > max(sizes.values()):  # else as the name of a summary does
                spans = [span for span in spans if span not in over]
                spans.append((min([start, *(a for a, _ in over)]), max([end, *(b for _, b in over)])))
    spans = _merged(spans)
    if (found := _in_turn(tokens, lines, len(spans))) is not None:
        yield from ([cell.replace(_HELD, "") for cell in cells] for cells in found)
        return
    for own, line in zip(tokens, lines, strict=True):
        phrases = own or [(m.start(), m.end(), m[0]) for m in _PHRASE.finditer(line)]
        if not own and len(phrases) < 2 and (not phrases or phrases[0][0] < 8):
            yield [line.strip().replace(_HELD, "")]
            continue
        if not own and len(phrases) == len(spans):
            yield [text.replace(_HELD, "") for _, _, text in phrases]
            continue
        cells = [""] * max(1, len(spans))
        for start, end, text in phrases:
            nearest = min(range(len(spans)), key=lambda k: abs(spans[k][1] - end), default=0)
            k = next((k for k, (a, b) in enumerate(spans) if a < end and start < b), nearest)
            cells[k] = f"{cells[k]} {text.replace(_HELD, '')}".strip()
        yield cells


def _in_turn(
    rows: Sequence[Sequence[tuple[int, int, str]]], lines: Sequence[str], columns: int
) -> list[list[str]] | None:
    """Cells of lines in turn, where rows and a head have as many phrases, or rows as many words and more than columns."""
    phrases = [_PHRASE.findall(line) for line in lines]
    heads = [[cell.strip() for cell in re.split("[,;]", line)] for line in lines]
    mixed = any(_MIXED.search(text) for row, own in zip(rows, phrases, strict=True) if row for text in own)
    for own, head in ((phrases, phrases), ([_TOKEN.findall(line) for line in lines], heads)):
        wide = {len(cells) for row, cells in zip(rows, own, strict=True) if row}
        named = any({len(head[k])} == wide and not rows[k] and any(rows[k + 1 : k + 3]) for k in range(len(rows)))
        if len(wide) == 1 and wide != {columns} and named and not (mixed and own is phrases):
            each = zip(rows, own, head, phrases, strict=True)
            return [cells if row else of if {len(of)} == wide else other for row, cells, of, other in each]
    return None


def _row_of(line: str) -> list[tuple[int, int, str]]:
    """Where the words of a row of figures stand, or its phrases, of which the last is a figure; none of another line."""
    for part in (_TOKEN, _PHRASE):
        own = [(m.start(), m.end(), m[0]) for m in part.finditer(line)]
        if _is_row([text for *_, text in own], line) and (part is _TOKEN or _NUMBER.fullmatch(own[-1][2])):
            return own
    return []


def _merged(spans: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
    """Spans in order, those that overlap together."""
    found: list[tuple[int, int]] = []
    for start, end in sorted(spans):
        if found and start < found[-1][1]:
            found[-1] = (found[-1][0], max(found[-1][1], end))
        else:
            found.append((start, end))
    return found


def _is_row(texts: Sequence[str], line: str) -> bool:
    """Whether a line is a row of figures: no place of a line, and no figures among words (``Mean 35.4339  Range 0.0006``)."""
    letters = [text for text in texts if text in _AXES]
    texts = [text for text in texts if text not in letters] if len(letters) == 1 < len(texts) else texts  # SPH1 X 12.5
    numbers = [_NUMBER.fullmatch(text) is not None for text in texts]
    n, printed = sum(numbers), any(_POINT.search(text) for text in texts)
    if 2 * n < len(texts) or not (n > 1 or (len(texts) <= 3 and n and printed)):
        return False
    if n > 2 and any(said_in([line], sign).whole for sign in ".,"):
        return False
    apart = n > 1 and not any(a and b for a, b in pairwise(numbers))
    return not apart or (numbers[0] and any(_POINT.search(text) for text in compress(texts, numbers)))
