"""A number is a sign, digits, a point and an exponent; everything else is refused where it stands."""

from __future__ import annotations

import re
from decimal import Decimal

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.numbers import LARGEST, SMALLEST, number_problem, numbers

GRAMMAR = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
"""Written down anew, without a look at the code."""

WRITTEN = st.from_regex(GRAMMAR, fullmatch=True).filter(lambda text: len(text) < 60)


def meant(cell: str) -> Decimal | None:
    """What an independent reading makes of it, within the limits."""
    if not GRAMMAR.fullmatch(cell):
        return None
    exponent = int(re.split("[eE]", cell)[1]) if re.search("[eE]", cell) else 0
    if abs(exponent) > 10_000:
        return Decimal(0) if not re.search("[1-9]", re.split("[eE]", cell)[0]) else None
    value = Decimal(cell)
    return value if value == 0 or Decimal(SMALLEST) <= abs(value) <= Decimal(LARGEST) else None


def place(row: int) -> str:
    return f"row {row}"


@given(st.one_of(WRITTEN, st.text("0123456789+-.eE_ xnaif١²", max_size=12), st.text(max_size=8)))
@example("-2_11.1357")
@example("1e-400")
@example("0e-400")
@example("1e15")
@example("1.0000001e15")
@example("0x10")
@example("1e5")
@example("٣")
@example("infinity")
@example("nan")
@example("")
def test_a_cell_is_read_exactly_as_the_grammar_says(cell: str) -> None:
    expected = meant(cell)
    assert (number_problem(cell) is None) == (expected is not None)
    if expected is None:
        with pytest.raises(CmmUqError, match=r"^row 1: "):
            numbers(["1", cell], place)
    else:
        assert numbers(["1", cell], place)[1] == float(expected)


@given(st.lists(WRITTEN, max_size=30))
def test_a_column_is_read_as_its_cells_are(cells: list[str]) -> None:
    bad = [i for i, cell in enumerate(cells) if meant(cell) is None]
    if bad:
        with pytest.raises(CmmUqError, match=rf"^row {bad[0]}: "):
            numbers(cells, place)
    else:
        assert numbers(cells, place).tolist() == [float(meant(cell) or 0) for cell in cells]


@pytest.mark.parametrize(
    ("cell", "says"),
    [
        ("", "no value"),
        ("NaN", "'NaN' is not a finite number"),
        ("2,5", "'2,5' is not a number. Write decimals with a point"),
        ("1,234.5", "'1,234.5' is not a number. Write it without groups of digits"),
        ("1_0", "'1_0' is not a number. Write it with digits 0 to 9"),
        ("1e16", "'1e16' is too large"),
        ("-1e400", "'-1e400' is too large"),
        ("1e-31", "'1e-31' is too small"),
    ],
)
def test_the_refusal_says_what_to_write(cell: str, says: str) -> None:
    with pytest.raises(CmmUqError, match=re.escape(says)):
        numbers([cell], place)
