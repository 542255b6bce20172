"""Numbers of text files: an optional sign, digits with an optional point, an optional exponent, and nothing else.

Python's own reading takes underscores, digits of every script, ``nan`` and ``infinity`` besides. Keys and columns in a unit
that is not read are refused by name with the conversion to the one that is.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from math import isfinite

import numpy as np

from cmm_uq.base.errors import CmmUqError, Gathered
from cmm_uq.base.points import Floats

SMALLEST, LARGEST = 1e-30, 1e15
"""Sizes of a number in a table, other than 0: squares and sums of 10⁵ of them stay far within a double's range."""

_CHARACTERS = b"0123456789+-.eE"
"""Of what is written with these alone, ``float`` takes exactly the numbers of this module."""

GIVE = "Give a number"
GIVE_OR_REMOVE = "Give a number, or remove the column"  # of a column that need not be there
MEASURE = "Measure the point again, or leave out its measurement"  # of a coordinate
_SHOWN = 40


def number_problem(cell: str, fix: str = GIVE) -> tuple[str, str] | None:
    """Why a cell of a table is no number that can be used and what to do about it, or ``None``."""
    if not cell:
        return "no value", fix
    shown = repr(cell[:_SHOWN])
    try:
        value = float(cell)
    except ValueError:
        if "," in cell:
            fix = "Write it without groups of digits" if "." in cell else "Write decimals with a point"
        return f"{shown} is not a number", fix
    if not _plain(cell):
        if not isfinite(value):
            return f"{shown} is not a finite number", fix
        return f"{shown} is not a number", "Write it with digits 0 to 9 alone, a point and an exponent, as in 1.5e-3"
    if abs(value) > LARGEST:
        return f"{shown} is too large for a number here", f"{LARGEST:g} is the most: check its unit and its exponent"
    if abs(value) < SMALLEST and any(digit in cell.lower().partition("e")[0] for digit in "123456789"):
        return f"{shown} is too small for a number here", f"Write 0, or {SMALLEST:g} or more"
    return None


def _plain(text: str) -> bool:
    return text.isascii() and not text.encode().translate(None, _CHARACTERS)


def numbers(cells: Sequence[str], where: Callable[[int], str], fix: str = GIVE) -> Floats:
    """Values (n,) of the cells of a column."""
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


_PER_METRE = "{given} · L / 1000, with the length L in mm"
_BY_ENDING = (
    ("_um_per_m_k", "_per_k", "1e-6 · {given}"), ("_ppm_per_k", "_per_k", "1e-6 · {given}"),
    ("_per_f", "_per_k", "1.8 · {given}"), ("_um_per_m", "_um", _PER_METRE), ("_um_m", "_um", _PER_METRE),
    ("_ppm", "_um", _PER_METRE), ("_mm", "_um", "1000 · {given}"), ("_nm", "_um", "{given} / 1000"),
    ("_inch", "_um", "25400 · {given}"), ("_in", "_um", "25400 · {given}"), ("_mil", "_um", "25.4 · {given}"),
    ("_inch", "_mm", "25.4 · {given}"), ("_in", "_mm", "25.4 · {given}"), ("_mil", "_mm", "0.0254 · {given}"),
    ("_um", "_mm", "{given} / 1000"), ("_cm", "_mm", "10 · {given}"), ("_m", "_mm", "1000 · {given}"),
    ("_f", "_c", "({given} − 32) / 1.8"), ("_f", "_k", "{given} / 1.8"), ("_k", "_c", "{given} − 273.15"),
    ("_min", "_s", "60 · {given}"), ("_h", "_s", "3600 · {given}"), ("_kpa", "_hpa", "10 · {given}"),
    ("_pa", "_hpa", "{given} / 100"),
    ("_deg", "_arcsec", "3600 · {given}"),
)  # fmt: skip
_FREEDOM = ("dof", "nu", "nu_eff", "v_eff", "degrees_of_freedom", "freiheitsgrade")


def conversion(given: str, known: Collection[str]) -> str | None:
    """What to give instead of a key in another unit; ``None`` where it is none of a known one.

    An uncertainty u with ν degrees of freedom has a t distribution, whose standard deviation is u·√(ν/(ν − 2)) (JCGM
    101:2008, 6.4.9).
    """
    if given.startswith("U_") and (standard := f"u_{given[2:]}") in known:
        return f"Give {standard} = U/k, the standard uncertainty: U is k times as large"
    if given.casefold() in _FREEDOM and (standard := next((key for key in known if key.startswith("u_")), "")):
        return (
            f"Give {standard} = u · √(ν/(ν − 2)), the standard deviation of a t distribution with ν degrees of freedom"
        )
    for ending, wanted, formula in _BY_ENDING:
        key = given[: -len(ending)] + wanted
        if given.endswith(ending) and key in known:
            return f"Give {key} = {formula.format(given=given)}"
    return None
