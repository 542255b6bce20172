"""Mutations of a CSV: a cell, a column, or rows that hold something else, each of a content, another file and chance."""

from __future__ import annotations

import csv
import io
import random

from benchmarks.hostile.seeds import COLUMNS
from benchmarks.hostile.values import NUMBERS, WORDS, scalar


def cells(content: bytes, other: bytes, random_: random.Random) -> bytes:
    """One cell, or a column of cells, that holds something else."""
    rows = _rows(content)
    row, column = random_.randrange(len(rows)), random_.randrange(len(rows[0]))
    new = random_.choice((_cell(random_), _cell(random_), "", "-" + rows[row][column % len(rows[row])]))
    for each in rows[1:] if random_.random() < 0.15 else [rows[row]]:
        each[column % len(each)] = new
    return _text(rows)


def _cell(random_: random.Random) -> str:
    huge = random_.random() < 0.02
    return "9" * 140_000 if huge else str(random_.choice((random_.choice(NUMBERS), scalar(random_))))


def columns(content: bytes, other: bytes, random_: random.Random) -> bytes:
    """A column gone, twice, renamed, moved, added, scaled or constant."""
    rows = _rows(content)
    width = min(map(len, rows))
    change, at = (
        random_.choice(("gone", "twice", "rename", "swap", "add", "add", "scale", "scale", "shift")),
        random_.randrange(width),
    )
    if change == "rename":
        rows[0][at] = random_.choice((*WORDS[:60], *COLUMNS, rows[0][at].upper(), rows[0][at].replace("_mm", "_in")))
        return _text(rows)
    name, to = (
        random_.choice((*COLUMNS, "speed_mm_s", "nx", "approach_x", "reference_mm", "repeat")),
        random_.randrange(width),
    )
    factor, shift, new = (
        random_.choice((0, -1, 25.4, 1e3, 1e-12, 1e200, 1.0001)),
        random_.choice((1, 1e6, 1e300)),
        _cell(random_),
    )
    for i, row in enumerate(rows):
        if change == "gone":
            del row[at]
        elif change == "twice":
            row.insert(at, row[at])
        elif change == "swap":
            row[at], row[to] = row[to], row[at]
        elif change == "add":
            row.append(name if i == 0 else new if random_.random() < 0.5 else str(i))
        elif i:
            row[at] = _moved(row[at], factor, 0.0) if change == "scale" else _moved(row[at], 1.0, shift)
    return _text(rows)


def _moved(cell: str, factor: float, shift: float) -> str:
    try:
        return repr(float(cell) * factor + shift)
    except ValueError:
        return cell


def rows_changed(content: bytes, other: bytes, random_: random.Random) -> bytes:
    """Rows gone, twice, in another order, cut off, few, many, or all alike."""
    rows = _rows(content)
    header, body = rows[0], rows[1:] or [[""]]
    change, at = (
        random_.choice(("gone", "twice", "shuffle", "few", "many", "alike", "short", "long", "half")),
        random_.randrange(len(body)),
    )
    if change == "gone":
        del body[at : at + random_.choice((1, 1, 1, 2, 5))]
    elif change == "twice":
        body.insert(at, list(body[at]))
    elif change == "shuffle":
        random_.shuffle(body)
    elif change == "few":
        body = body[: random_.choice((0, 1, 2, 3, 4, 6))]
    elif change == "many":
        body = body * random_.choice((2, 3, 40)) if random_.random() < 0.9 else body * 500
    elif change == "alike":
        body = [[*row[:3], *body[at][3:]] for row in body]
    elif change == "half":
        body = body[::2]
    else:
        body[at] = body[at][:-1] if change == "short" else [*body[at], "1"]
    return _text([header, *body])


def _rows(content: bytes) -> list[list[str]]:
    rows = [row for row in csv.reader(io.StringIO(content.decode("utf-8-sig"), newline="")) if row]
    if not rows:
        raise ValueError("no rows")
    return rows


def _text(rows: list[list[str]]) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue().encode("utf-8", "replace")
