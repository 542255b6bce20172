"""Rates with exact intervals, probabilities by tenths, and the strength found in nine of ten."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy import stats

from cmm_uq.laboratory.proving.judgement import Rate, cases_to_decide, clopper_pearson, detection_curve, tenths


@pytest.mark.parametrize(("count", "of", "low", "high"), [
    (0, 10, 0.0, 0.308), (1, 10, 0.003, 0.445), (2, 10, 0.025, 0.556), (5, 10, 0.187, 0.813), (10, 10, 0.692, 1.0),
    (0, 20, 0.0, 0.168), (1, 20, 0.001, 0.249), (10, 20, 0.272, 0.728), (0, 50, 0.0, 0.071),
])  # fmt: skip
def test_intervals_are_those_of_the_printed_table(count: int, of: int, low: float, high: float) -> None:
    """To three decimals, as tables of the binomial have them; where all or none is counted, 0.025 to the power of 1/n."""
    assert Rate(count, of).interval == pytest.approx((low, high), abs=6e-4)


@given(st.integers(1, 300), st.data())
def test_each_end_is_where_what_was_counted_has_a_probability_of_one_in_forty(of: int, data: st.DataObject) -> None:
    count = data.draw(st.integers(0, of))
    low, high = clopper_pearson(count, of)
    assert count == 0 or stats.binom.sf(count - 1, of, low) == pytest.approx(0.025, rel=1e-6)
    assert count == of or stats.binom.cdf(count, of, high) == pytest.approx(0.025, rel=1e-6)


def test_what_comes_in_clusters_says_less() -> None:
    """Ten clusters that are all right or all wrong say as much as ten alone; single ones as much as they are, or less."""
    apart = Rate(8 * 6, 60)
    together = Rate.pooled([(6, 6)] * 8 + [(0, 6)] * 2)
    assert together.value == apart.value
    low, high = together.interval
    alone = clopper_pearson(0.8 * 9, 9)  # the variance of ten clusters has nine degrees of freedom
    assert (low, high) == pytest.approx(alone, abs=1e-12)
    assert low < apart.interval[0] < apart.interval[1] < high


def test_of_nothing_all_is_possible() -> None:
    assert Rate(0, 0).value is None
    assert Rate(0, 0).interval == (0.0, 1.0)
    assert Rate.pooled([]).interval == (0.0, 1.0)


def test_so_many_cases_without_one_show_that_a_rate_is_small() -> None:
    n = cases_to_decide(0.02)
    assert clopper_pearson(0, n)[1] <= 0.02 < clopper_pearson(0, n - 1)[1]


def test_probabilities_by_tenths() -> None:
    low, high = tenths([(0.55, True), (0.57, False), (0.999, True), (1.0, True)])
    assert (low.low, low.right.count, low.right.of, low.said) == (0.5, 1, 2, pytest.approx(0.56))
    assert (high.high, high.right.count, high.right.of) == (1.0, 2, 2)
    assert low.agrees
    assert not tenths([(0.95, False)] * 9)[0].agrees


def test_the_strength_found_in_nine_of_ten_is_that_of_many_draws() -> None:
    """m + ln 9/b of the curve that 900 draws were made of; its interval holds it, and narrows as one over √n."""
    random = np.random.default_rng(5)
    strength = random.uniform(3, 15, 900)
    found = random.random(900) < 1 / (1 + np.exp(-1.2 * (strength - 6.5)))
    wanted = 6.5 + np.log(9) / 1.2
    many, few = (detection_curve(strength[:n].tolist(), found[:n].tolist()) for n in (900, 100))
    assert many is not None
    assert few is not None
    assert many.often == pytest.approx(wanted, abs=0.6)
    assert many.interval[0] < wanted < many.interval[1]
    assert (few.interval[1] - few.interval[0]) / (many.interval[1] - many.interval[0]) == pytest.approx(3, rel=0.5)


def test_where_all_or_none_is_found_only_one_end_is_known() -> None:
    strength = np.linspace(3, 15, 40).tolist()
    every, none = detection_curve(strength, [True] * 40), detection_curve(strength, [False] * 40)
    assert every is not None
    assert none is not None
    assert every.interval[1] < 6
    assert none.interval[0] > 12
    assert none.interval[1] == np.inf
    assert detection_curve([5.0] * 7, [True] * 7) is None
