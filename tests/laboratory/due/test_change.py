"""What a value changed by: the artefact's part, common to both, against a second computation and by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.stats import norm

from cmm_uq.laboratory.due.checks import ComparedValue, ValueChange, change, each_of

PART = st.floats(0, 0.999)
U = st.floats(1e-3, 1e3)


def test_the_same_artefact_cancels_by_hand() -> None:
    """0.25 + 0.25 − 2·0.16 = 0.18."""
    found = change(ComparedValue(1.0, 0.5, 0.4, "BB-7"), ComparedValue(2.5, 0.5, 0.4, "BB-7"))
    assert (found.value, found.u) == (1.5, pytest.approx(math.sqrt(0.18)))


def test_another_artefact_does_not_nor_does_an_unknown_one() -> None:
    for one, other in (("BB-7", "BB-8"), ("", "")):
        found = change(ComparedValue(1.0, 0.5, 0.4, one), ComparedValue(2.5, 0.5, 0.4, other))
        assert found.u == pytest.approx(math.sqrt(0.5))


@settings(deadline=None)
@given(U, U, PART, PART)
def test_it_is_the_difference_of_two_sums_with_a_common_term(u1: float, u2: float, p1: float, p2: float) -> None:
    """x = r₁ + p₁u₁·a and y = r₂ + p₂u₂·a: the variance of y − x as a quadratic form of independent r₁, r₂, a."""
    own = u1 * math.sqrt(1 - p1**2), u2 * math.sqrt(1 - p2**2)
    weights = np.array([-own[0], own[1], p2 * u2 - p1 * u1])  # of r₁, r₂, a
    found = change(ComparedValue(0, u1, p1 * u1, "A"), ComparedValue(0, u2, p2 * u2, "A"))
    assert found.u == pytest.approx(float(np.linalg.norm(weights)), rel=1e-6, abs=1e-9 * max(u1, u2))


def test_an_uncertainty_that_is_all_the_artefacts_does_not_vanish() -> None:
    """As a test uncertainty: how the machine repeats is not stated, and a change by a thousandth means nothing."""
    found = change(ComparedValue(60.0, 7.0, 7.0, "BB-7"), ComparedValue(60.001, 7.0, 7.0, "BB-7"))
    assert found.u == pytest.approx(7 * math.sqrt(2))
    assert not found.significant(1)


def test_a_chance_is_two_sided() -> None:
    assert ValueChange(-1.96, 1.0).chance == pytest.approx(0.05, abs=1e-4)
    assert ValueChange(0.0, 0.0).chance == 1
    assert ValueChange(1e-9, 0.0).chance == 0


@pytest.mark.parametrize("count", [1, 2, 13, 200])
def test_of_many_changes_none_is_significant_with_a_probability_of_95_percent(count: int) -> None:
    assert (1 - each_of(count, 0.05)) ** count == pytest.approx(0.95)


def test_what_is_significant_alone_need_not_be_among_thirteen() -> None:
    found = ValueChange(2.5, 1.0)
    assert 2 * norm.sf(2.5) == pytest.approx(found.chance)
    assert found.significant(1)
    assert not found.significant(13)
