"""A trend's picture: round figures, places in the order of the values, no line across an adjustment."""

from __future__ import annotations

import datetime as dt
import re
from decimal import Decimal
from itertools import pairwise

import pytest
from hypothesis import given, strategies as st

from cmm_uq.app.serve.application import _environment
from cmm_uq.app.serve.trends import BOTTOM, HEIGHT, RIGHT, TOP, WIDTH, TrendPicture, new_years, ticks
from cmm_uq.laboratory.records.listing import CourseValue

DAY = dt.date(2020, 1, 1).toordinal()
FINITE = st.floats(-1e6, 1e6, allow_nan=False)


def trend(
    values: list[float],
    *,
    parted: tuple[bool, ...] = (),
    adjusted: tuple[int, ...] = (),
    limit: float | None = None,
    u: float = 0.1,
) -> TrendPicture:
    since = [dt.date.fromordinal(1 + sum(parted[:i])) for i in range(len(values))]
    days = [dt.date.fromordinal(DAY + 365 * i) for i in range(len(values))]
    stated = [
        CourseValue(1, day, value, value - u, value + u, limit, False, adjustment)
        for day, value, adjustment in zip(days, values, since, strict=True)
    ]
    return TrendPicture(stated, adjusted, limit)


def picture(of: TrendPicture) -> str:
    return str(_environment().get_template("trend.html").module.trend(of, "<b>"))


def marks(svg: str) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in re.findall(r'<circle class="\w+" cx="([\d.]+)" cy="([\d.]+)"', svg)]


def joined(svg: str) -> list[int]:
    found = re.search(r'class="line" d="M([^"]*)"', svg)
    assert found is not None
    return [piece.count("L") + 1 for piece in found[1].split("M")]


@given(low=FINITE, span=st.floats(1e-6, 1e6))
def test_ticks_are_round_inside_and_few(low: float, span: float) -> None:
    values, texts = ticks(low, low + span)
    assert 1 <= len(values) <= 4
    assert all(low - 1e-9 * span <= value <= low + span * (1 + 1e-9) for value in values)
    assert [float(text.replace("−", "-")) for text in texts] == pytest.approx(
        values, abs=1e-9 * max(1.0, abs(low) + span)
    )
    exact = [Decimal(text.replace("−", "-")) for text in texts]
    assert {(b - a).normalize().as_tuple().digits for a, b in pairwise(exact)} <= {(1,), (2,), (5,)}
    assert len({b - a for a, b in pairwise(exact)}) <= 1


@given(values=st.lists(st.floats(-1e3, 1e3).map(lambda value: round(value, 3)), min_size=1, max_size=30))
def test_higher_values_stand_higher_and_later_ones_further_right(values: list[float]) -> None:
    found = marks(picture(trend(values)))
    assert len(found) == len(values)
    assert [x for x, _ in found] == sorted(x for x, _ in found)
    assert all(0 < x <= WIDTH - RIGHT and TOP <= y <= HEIGHT - BOTTOM for x, y in found)
    by_value = [y for _, (_, y) in sorted(zip(values, found, strict=True), key=lambda one: (one[0], -one[1][1]))]
    assert by_value == sorted(by_value, reverse=True)


def test_the_line_is_broken_at_an_adjustment_and_nowhere_else() -> None:
    values = [1.0, 2.0, 3.0, 1.0, 1.1]
    assert joined(picture(trend(values))) == [5]
    assert joined(picture(trend(values, parted=(False, False, True, False)))) == [3, 2]
    assert joined(picture(trend(values, parted=(True, True, True, True)))) == [1, 1, 1, 1, 1]


def test_a_limit_is_drawn_where_the_values_come_near_it() -> None:
    """At a fifth of the limit: 8 ppm is out of sight of 1.4 ppm and in sight of 1.6 ppm."""
    assert trend([1.4], limit=8.0).limits == []
    assert trend([1.5], limit=8.0).limits == [8.0]
    assert trend([-1.6], limit=8.0).limits == [-8.0]
    assert trend([-1.6, 1.6], limit=8.0).limits == [8.0, -8.0]
    assert picture(trend([-1.6, 1.6], limit=8.0)).count('class="limit" d=') == 2


def test_years_are_marked_where_they_begin() -> None:
    first, last = dt.date(2019, 6, 1).toordinal(), dt.date(2022, 1, 1).toordinal()
    assert [(dt.date.fromordinal(day).isoformat(), year) for day, year in new_years(first, last)] == [
        ("2020-01-01", 2020), ("2021-01-01", 2021), ("2022-01-01", 2022)]  # fmt: skip
    assert len(new_years(dt.date(1900, 1, 1).toordinal(), last)) <= 9
    assert new_years(dt.date(2020, 2, 1).toordinal(), dt.date(2020, 12, 31).toordinal()) == []


def test_words_beside_a_picture_cannot_be_elements() -> None:
    assert "<b>" not in picture(trend([8.0], limit=8.0, adjusted=(DAY,)))
