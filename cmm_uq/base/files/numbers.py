"""Numbers of text files: an optional sign, digits with an optional point, an optional exponent, and nothing else.

Python's own reading takes underscores, digits of every script, ``nan`` and ``infinity`` besides.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isfinite

import numpy as np

from cmm_uq.base.errors import CmmUqError, Gathered
from cmm_uq.base.points import Floats

SMALLEST, LARGEST = 1e-30, 1e15
"""Sizes of a number in a table, other than 0: squares and sums of 10⁵ of them stay far within a double's range."""

_CHARACTERS = b"0123456789+-.eE"
"""Of what is written with these alone, ``float`` takes exactly the numbers of this module."""

GIVE = "Give a number"
GIVE_OR_REMOVE = "Give a number, or remove the column"
"""Of a column that need not be there."""
MEASURE = "Measure the point again, or leave out its measurement"
"""Of a coordinate."""

_SHOWN = 40


def number_problem(cell: str, fix: str = GIVE) -> tuple[str, str] | None:
    """Why a cell of a table is no number that can be used and what to do about it, or ``None``.

    Parameters
    ----------
    cell : as text, without blanks around it.
    fix : what to do where there is no number.
    """
    if not cell:
        return "no value", fix
    shown = repr(cell[:_SHOWN])
    try:
        value = float(cell)
    except ValueError:
        if "," in cell:
            fix = "Write it without groups of digits" if "." in cell else "Write decimals with a point"
        return f"{shown} is not a number", fix
    if _plain(cell):
        return _size_problem(cell, value, shown)
    if not isfinite(value):
        return f"{shown} is not a finite number", fix
    return f"{shown} is not a number", "Write it with digits 0 to 9 alone, a point and an exponent, as in 1.5e-3"


def _plain(text: str) -> bool:
    return text.isascii() and not text.encode().translate(None, _CHARACTERS)


def _size_problem(cell: str, value: float, shown: str) -> tuple[str, str] | None:
    if abs(value) > LARGEST:
        return f"{shown} is too large for a number here", f"{LARGEST:g} is the most: check its unit and its exponent"
    if abs(value) < SMALLEST and any(digit in cell.lower().partition("e")[0] for digit in "123456789"):
        return f"{shown} is too small for a number here", f"Write 0, or {SMALLEST:g} or more"
    return None


def numbers(cells: Sequence[str], where: Callable[[int], str], fix: str = GIVE) -> Floats:
    """Values (n,) of the cells of a column.

    Parameters
    ----------
    cells : as text, without blanks around them.
    where : place of a cell by its index, for messages.
    fix : what to do where there is no number.

    Raises
    ------
    CmmUqError : a cell is no number, or one beyond :data:`SMALLEST` and :data:`LARGEST`; every such cell.
    """
    try:
        values = np.array(list(map(float, cells)), dtype=np.float64)
    except ValueError:
        doubtful: Sequence[int] = range(len(cells))
    else:
        sizes = np.abs(values)
        # a zero may be a number that is too small to be told from it
        beyond = np.flatnonzero(~((sizes >= SMALLEST) & (sizes <= LARGEST))).tolist()
        doubtful = [i for i in beyond if cells[i] != "0"] if _plain("".join(cells)) else range(len(cells))
    wrong = Gathered()
    for i in doubtful:
        if problem := number_problem(cells[i], fix):
            wrong.add(CmmUqError(problem[0], where=where(i), fix=problem[1]))
    wrong.refuse()
    return values
