"""Joint regions of JCGM 102:2011 against closed forms of normal and uniform outputs."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.uncertainty.coverage import elliptical_factor, elliptical_region, rectangular_region, smallest_region
from cmm_uq.maths.uncertainty.distributions import normal, rectangular
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.monte_carlo import draw_outputs

N = 200_000


def pair(r: float) -> np.ndarray:
    inputs = {"a": normal(1.0, 2.0), "b": normal(-3.0, 0.5)}
    return draw_outputs(
        MeasurementModel(lambda a, b: {"a": a, "b": b}, inputs, ("a", "b"), {("a", "b"): r} if r else {}), N, seed=2
    )


def test_factors_of_normal_outputs() -> None:
    # JCGM 102 table 1: 1.96, 2.45, 2.80 for one, two and three outputs and 95 %
    assert [elliptical_factor(p) for p in (1, 2, 3)] == pytest.approx([1.95996, 2.44775, 2.79548], abs=5e-6)
    assert elliptical_factor(2, 0.99) == pytest.approx(np.sqrt(-2 * np.log(0.01)))


@pytest.mark.parametrize("r", [0.0, 0.9])
def test_the_ellipse_of_normal_draws_is_the_known_one(r: float) -> None:
    draws = pair(r)
    region = elliptical_region(draws)
    # standard error of the factor: √(p(1−p)/n) over the Rayleigh density at 2.4477
    error = np.sqrt(0.95 * 0.05 / N) / (2.4477 * 0.05)
    assert region.factor == pytest.approx(2.4477, abs=5 * error)
    away = draws - region.centre[:, None]
    inside = np.einsum("pn,pq,qn->n", away, np.linalg.inv(region.covariance), away) <= region.factor**2 * (1 + 1e-12)
    assert inside.mean() == pytest.approx(0.95, abs=1e-5)
    assert region.volume == pytest.approx(np.pi * 2.4477**2 * 2 * 0.5 * np.sqrt(1 - r * r), rel=0.02)


def test_the_smallest_region_of_normal_draws_is_that_ellipse() -> None:
    draws = pair(0.6)
    region = smallest_region(draws, cells=40)
    assert region.area == pytest.approx(elliptical_region(draws).volume, rel=0.05)


def test_the_smallest_region_of_a_uniform_square_is_most_of_the_square() -> None:
    inputs = {"a": rectangular(0.0, 1.0), "b": rectangular(0.0, 2.0)}
    draws = draw_outputs(MeasurementModel(lambda a, b: {"a": a, "b": b}, inputs, ("a", "b")), N, seed=3)
    assert smallest_region(draws, cells=20).area == pytest.approx(2 * 0.95, rel=0.02)
    assert elliptical_region(draws).volume > 2.0  # an ellipse wastes the corners


def test_the_rectangle_of_independent_normal_draws() -> None:
    # both within k u with probability 0.95: erf(k/√2)² = 0.95, k = 2.2365
    draws = pair(0.0)
    region = rectangular_region(draws)
    assert region.factor == pytest.approx(2.2365, abs=0.02)
    assert region.volume == pytest.approx(4 * region.factor**2 * 2 * 0.5, rel=0.02)


def test_impossible_regions_are_refused() -> None:
    a = np.random.default_rng(1).normal(size=1000)
    with pytest.raises(CmmUqError, match="depend on each other"):
        elliptical_region(np.array([a, 2 * a]))
    with pytest.raises(CmmUqError, match="more draws"):
        smallest_region(np.array([a, a**2]))
    with pytest.raises(CmmUqError, match="coverage probability"):
        elliptical_factor(2, 95)


def test_draws_are_those_of_the_simulation() -> None:
    from cmm_uq.maths.uncertainty.monte_carlo import simulate

    model = MeasurementModel(lambda a: a**2, {"a": normal(1.0, 2.0)})
    assert draw_outputs(model, 25_000, seed=9).mean() == pytest.approx(
        simulate(model, 25_000, seed=9).value[0], rel=1e-12
    )
