"""Positions of bars whose ends are whole millimetres, against a plan of three positions and two directions."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, strategies as st

from cmm_uq.analysis.conformity.plan_conditions import conditions, most_apart
from cmm_uq.analysis.conformity.plans import BarPlan
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.base.points import Machine, Points
from tests.recordings import TRAVEL, bar_facts

PLAN = BarPlan(3, ("parallel to X", "face diagonal +X +Y"), 10, 2.0, 10.0)
X = ((0, 0, 0), (300, 0, 0))
Y = ((0, 0, 0), (0, 300, 0))
XY = ((0, 0, 0), (180, 240, 0))
Bar = tuple[tuple[int, int, int], tuple[int, int, int]]


def moved(bar: Bar, x: int, y: int = 0) -> Bar:
    (a, b, c), (d, e, f) = bar
    return (a + x, b + y, c), (d + x, e + y, f)


def said(*bars: Bar, travel: np.ndarray = TRAVEL) -> tuple[list[str], list[str]]:
    """What the plan asks for and how much of it there is, and all that is missing."""
    number = np.repeat(np.arange(1, len(bars) + 1), 2)
    xyz = np.array(bars, dtype=np.float64).reshape(-1, 3)
    points = Points(xyz, number, np.tile([1, 2], len(bars)), np.ones_like(number), Machine("m", "XYZ", travel))
    found = conditions(PLAN, Ballbar(bar_facts(300.0), points), recorded=True)
    return [condition.what for condition in found], [text for condition in found for text in condition.missing]


def test_three_bars_in_both_directions_are_all_that_is_asked() -> None:
    assert said(X, XY, moved(X, 0, 100)) == (
        ["at least 3 positions of the bar: 3", "along the axes, and the face and space diagonals of the volume"],
        [],
    )


def test_what_is_missing_is_said_with_the_bars_that_do_not_count() -> None:
    """The second is 9 mm from the first, the fourth a copy of the third."""
    assert said(X, moved(X, 9), Y, Y) == (
        [
            "at least 3 positions of the bar: 2",
            "along the axes, and the face and space diagonals of the volume; missing: position along face diagonal +X +Y",
        ],
        [
            "1 of 3 positions: 2 distinct, measurement 2 is within 10 mm of 1, measurement 4 is a copy of 3",
            "position along face diagonal +X +Y",
        ],
    )


@pytest.mark.parametrize(("away", "distinct"), [(9, 1), (10, 2), (11, 2)])
def test_a_bar_ten_millimetres_from_another_is_a_further_position(away: int, distinct: int) -> None:
    what, _ = said(X, moved(X, 0, away))
    assert what[0].endswith(f": {distinct}")


def test_a_bar_turned_about_one_of_its_ends_is_in_another_place() -> None:
    what, _ = said(X, Y, XY)
    assert what[0].endswith(": 3")


def test_bars_that_do_not_count_are_named_by_what_they_are_of_in_the_order_of_those() -> None:
    """Copies of the second are 4, 5 and 6; the seventh and eighth, and the third, are near the first."""
    _, missing = said(X, Y, moved(X, 1), Y, Y, Y, moved(X, 2), moved(X, 3))
    assert missing[0] == (
        "1 of 3 positions: 2 distinct, measurements 3, 7, 8 are within 10 mm of 1, measurements 4 to 6 are copies of 2"
    )
    _, missing = said(X, moved(X, 1), X)
    assert missing[0] == (
        "2 of 3 positions: 1 distinct, measurement 3 is a copy of 1, measurement 2 is within 10 mm of 1"
    )


def test_the_number_of_positions_grows_with_the_longest_axis_over_the_shortest() -> None:
    travel = np.array([[0.0, 1001.0], [0.0, 500.0], [0.0, 500.0]])
    what, _ = said(X, XY, moved(X, 0, 100), travel=travel)
    assert what[0] == "at least 13 positions of the bar: 3"


def test_the_travel_of_two_axes_does_not_tell_how_many_positions_are_asked() -> None:
    travel = TRAVEL.copy()
    travel[1] = np.nan
    what, missing = said(X, XY, moved(X, 0, 100), travel=travel)
    assert what[0] == "at least 3 positions of the bar: 3"
    assert missing == [
        "the travel of all three axes ([machine] travel_mm), by whose proportions the number of positions goes"
    ]


def test_a_bar_between_two_others_does_not_take_the_place_of_both() -> None:
    """The first is 9 mm from the second and from the third, which are 18 mm apart: two positions, with it as without it."""
    with_it, _ = said(X, moved(X, 0, 9), moved(X, 0, -9))
    without, _ = said(moved(X, 0, 9), moved(X, 0, -9))
    assert with_it[0] == without[0] == "at least 3 positions of the bar: 2"


@pytest.mark.long
@given(st.integers(1, 8), st.data())
def test_no_other_set_of_bars_far_from_each_other_is_larger(count: int, data: st.DataObject) -> None:
    """By trying all sets."""
    pairs = data.draw(st.sets(st.sampled_from(list(combinations(range(8), 2)))))
    near = {i: {b if a == i else a for a, b in pairs if i in (a, b) and max(a, b) < count} for i in range(count)}
    chosen = most_apart(near)
    assert all(chosen.isdisjoint(near[i]) for i in chosen)
    sets = (set(c) for k in range(count + 1) for c in combinations(range(count), k))
    assert len(chosen) == max(len(each) for each in sets if all(each.isdisjoint(near[i]) for i in each))
