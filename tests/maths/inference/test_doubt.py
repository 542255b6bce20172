"""What all observations err by together, carried into estimates: against closed forms and draws of the errors themselves."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.messages import say
from cmm_uq.base.units import unit
from cmm_uq.maths.inference.doubt import Cause, Doubt, gain
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown
from cmm_uq.maths.uncertainty.quantity import Quantity

LENGTHS = np.tile([100.0, 200.0, 300.0, 400.0, 500.0], 4)
SET_UP = np.repeat([1, 2, 3, 4], 5)


def cause(sd: float = 2e-6) -> Cause:
    return Cause.of_blocks(say("temperature of the artefact"), sd * LENGTHS, SET_UP)


def scale_model() -> LinearModel:
    """One scale in ppm of twenty lengths, of which nothing is known beforehand."""
    unknowns = (Unknown(("scale", "ppm"), unit("ppm"), 0.0, np.inf, 10.0),)
    return LinearModel(np.zeros(20), 1e-6 * LENGTHS[:, None], unknowns, np.zeros((20, 0)), np.ones(20), None)


def test_a_common_relative_error_is_the_scale_s_and_one_of_each_set_up_averages_out() -> None:
    weights = gain(scale_model(), 1e-3)
    common, apart = cause().carried(weights)
    assert common == pytest.approx(np.array([[2.0]]))
    assert np.sum(apart**2) == pytest.approx(2.0**2 / 4)
    assert Doubt.of([cause()], weights).variance(np.ones(1)) == pytest.approx(4.0)


def test_of_a_difference_of_two_set_ups_the_errors_of_each_stand() -> None:
    weights = np.zeros((2, 20))
    weights[0, 4], weights[1, 9] = 1e6 / 500, 1e6 / 500  # ppm, each of the longest length of a set-up
    doubt = Doubt.of([cause()], weights)
    assert doubt.covariance() == pytest.approx(np.full((2, 2), 4.0))
    assert doubt.variance(np.array([1.0, -1.0])) == pytest.approx(8.0)


def test_two_causes_add_the_larger_of_each() -> None:
    """Of a difference a temperature counts apart; a coefficient of expansion, which is one, cancels."""
    weights = np.zeros((1, 20))
    weights[0, 4], weights[0, 9] = 1.0, -1.0
    expansion = Cause(say("expansion coefficient of the artefact"), (3e-6 * LENGTHS)[:, None])
    assert Doubt.of([cause(), expansion], weights).variance(np.ones(1)) == pytest.approx(2 * (2e-6 * 500) ** 2)
    weights[0, 9] = 1.0
    sums = Doubt.of([cause(), expansion], weights).variance(np.ones(1))
    assert sums == pytest.approx((2e-6 * 1000) ** 2 + (3e-6 * 1000) ** 2)


def test_widened_draws_have_the_mean_they_had_and_the_variance_of_both() -> None:
    draws = np.random.default_rng(5).normal([1.0, -3.0], [0.5, 0.1], (40_000, 2))
    doubt = Doubt(((np.array([[2.0], [0.0]]), np.array([[1.0, 1.0], [0.3, -0.4]])),))
    wide = doubt.widened(draws, 0)
    assert wide.mean(axis=0) == pytest.approx(draws.mean(axis=0), abs=1e-12)
    assert wide.var(axis=0) == pytest.approx([0.25 + 4, 0.01 + 0.25], rel=0.03)


@pytest.mark.parametrize("apart", [False, True])
def test_errors_are_drawn_as_they_are_carried(apart: bool) -> None:
    weights = gain(scale_model(), 1e-3)
    drawn = cause().drawn((4000,), np.random.default_rng(1), apart=apart) @ weights[0]
    assert drawn.var() == pytest.approx(np.sum(cause().carried(weights)[apart] ** 2), rel=0.1)


def test_the_gain_is_that_of_least_squares_without_the_placing() -> None:
    """An offset of each set-up goes into its placing, and into no scale."""
    placing = (SET_UP[:, None] == np.array([1, 2, 3, 4])).astype(float)
    model = scale_model()
    model = LinearModel(model.observed, model.design, model.unknowns, placing, model.noise_scale, None)
    weights = gain(model, 1e-3)
    assert weights @ placing == pytest.approx(np.zeros((1, 4)), abs=1e-6)
    assert weights @ (1e-6 * LENGTHS) == pytest.approx(np.ones(1))


def test_a_combination_by_itself_is_no_less_in_doubt() -> None:
    doubt = Doubt(((np.array([[2.0], [2.0]]), np.array([[1.0, 0.0], [0.0, 1.0]])),))
    narrow = Quantity(0.0, 1.0, (-2.0, 2.0), unit("ppm"))
    wide = doubt.larger(narrow, np.array([1.0, -1.0]))
    assert wide.u == pytest.approx(np.sqrt(1 + 2))
    assert wide.interval95[1] == pytest.approx(2 * np.sqrt(3))
    assert doubt.larger(narrow, np.array([1.0, 0.0])) == narrow
