"""Point clouds as CSV, a block of lines at a time: numbers alone, each checked where it stands."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.csv_table import column_problem
from cmm_uq.base.files.limits import COLUMNS, LINE
from cmm_uq.base.files.numbers import numbers
from cmm_uq.base.points import Floats

CHUNK = 2**20
"""Bytes read at a time, some 20 000 lines."""

_FIX = "Save the cloud as CSV in UTF-8: a line of names, then one line a point"


def csv_header(path: Path) -> tuple[str, ...]:
    """Names of the columns.

    Raises
    ------
    CmmUqError : there are none, or one is there twice.
    """
    with _opened(path) as file:
        return _header(file, path)[0]


def csv_length(path: Path) -> float:
    """Roughly how many points there are, from the length of the first lines."""
    with _opened(path) as file:
        head = file.read(2**16)
    return path.stat().st_size * max(head.count(b"\n"), 1) / max(len(head), 1)


def csv_blocks(path: Path, columns: Sequence[str], block: int) -> Iterator[Floats]:
    """Rows (b, k) of some columns, b ≤ ``block``; empty lines and those that begin with # are passed over.

    Raises
    ------
    CmmUqError : a column is missing, a line has another number of cells, or a cell is no number; with its line.
    """
    with _opened(path) as file:
        header, number = _header(file, path)
        missing = [name for name in columns if name not in header]
        if missing:
            raise CmmUqError(f"has no column {missing[0]}", where=str(path), fix=f"A cloud has {', '.join(columns)}")
        places = [header.index(name) for name in columns]
        for lines, first in _lines(file, path, number + 1):
            at = [first + i for i, line in enumerate(lines) if line and line[0] != "#"]
            given = lines if len(at) == len(lines) else [lines[i - first] for i in at]
            if given:
                values = _values(given, at, header, places, path)
                for start in range(0, len(values), block):
                    yield values[start : start + block]


@contextlib.contextmanager
def written_csv(path: Path, names: Sequence[str], mark: str) -> Iterator[Callable[[Floats], None]]:
    """Append rows to a CSV file: coordinates to 0.1 nm."""
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(f"{mark}{','.join(names)}\n")
        form = ",".join("%.7f" if name.endswith("_mm") else "%d" for name in names) + "\n"

        def write(rows: Floats) -> None:
            file.write(form * len(rows) % tuple(rows.ravel().tolist()))

        yield write


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    try:
        with path.open("rb") as file:
            yield file
    except OSError as error:
        raise CmmUqError(
            f"cannot be read: {error.strerror}", where=str(path), fix="Check the name of the cloud"
        ) from error


def _values(lines: list[str], at: list[int], header: Sequence[str], places: Sequence[int], path: Path) -> Floats:
    width = len(header)
    other = next((i for i, line in enumerate(lines) if line.count(",") != width - 1), None)
    if other is not None:
        raise CmmUqError(f"has {lines[other].count(',') + 1} cells where the header has {width}",
                         where=f"{path} line {at[other]}", fix="Complete the row")  # fmt: skip
    cells = ",".join(lines).split(",")
    if any(" " in line or "\t" in line for line in lines):
        cells = [cell.strip() for cell in cells]

    def column(place: int) -> Floats:
        return numbers(cells[place::width], lambda row: f"{path} line {at[row]}, column {header[place]}")

    return np.column_stack([column(place) for place in places])


def _header(file: BinaryIO, path: Path) -> tuple[tuple[str, ...], int]:
    """Names of the columns, and their line."""
    number = 0
    while line := _line(file, path, number + 1):
        number += 1
        text = line.removeprefix("\ufeff").strip()
        if text and not text.startswith("#"):
            break
    else:
        raise CmmUqError("has no rows", where=str(path), fix=_FIX)
    header = tuple(cell.strip() for cell in text.split(","))
    where = f"{path} line {number}"
    if len(header) > COLUMNS.most:
        raise CmmUqError(f"has {len(header)} cells, {COLUMNS.most} are the most", where=where, fix=_FIX)
    twice = next((name for name in header if header.count(name) > 1), None)
    if twice is not None:
        raise CmmUqError(f"column {twice!r} is there twice", where=where, fix="Keep one")
    if problem := next(filter(None, map(column_problem, header)), None):
        raise CmmUqError(problem, where=where, fix="Name it with letters, digits and _")
    return header, number


def _lines(file: BinaryIO, path: Path, number: int) -> Iterator[tuple[list[str], int]]:
    """Lines without the blanks around them, some at a time, and the number of the first; the first of all is ``number``."""
    rest = b""
    while chunk := file.read(CHUNK):
        whole, newline, rest = (rest + chunk).rpartition(b"\n")
        if newline:
            lines = _texts(whole.split(b"\n"), path, number)
            yield lines, number
            number += len(lines)
        _check_length(rest, path, number)
    if rest:
        yield _texts([rest], path, number), number


def _texts(lines: list[bytes], path: Path, number: int) -> list[str]:
    longest = max(lines, key=len)
    _check_length(longest, path, number + lines.index(longest))
    try:
        return [line.strip() for line in b"\n".join(lines).decode().split("\n")]
    except UnicodeDecodeError as error:
        before = error.object[: error.start].count(b"\n")
        raise CmmUqError("is not UTF-8 text", where=f"{path} line {number + before}", fix=_FIX) from None


def _check_length(line: bytes, path: Path, number: int) -> None:
    if len(line) > LINE.most:
        raise CmmUqError(f"the line is longer than {LINE.most} characters", where=f"{path} line {number}", fix=_FIX)


def _line(file: BinaryIO, path: Path, number: int) -> str:
    """The next line with its end; empty at the end of the file."""
    line = file.readline(LINE.most + 1)
    return f"{_texts([line.rstrip()], path, number)[0]}\n" if line else ""
