"""What is stated of a zone is what a width can be: not below zero, in value, interval and probability.

Distances of measured points from their features where they are known; positive is out of the material.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from cmm_uq.analysis.conformity.limits import Limits
from cmm_uq.analysis.parts.characteristics import never_negative
from cmm_uq.analysis.parts.plan import Nominal, PartCharacteristic, PartFeature, Plan
from cmm_uq.analysis.parts.result import StatedCharacteristic, conforming, deviations_of, stated, within_bounds
from cmm_uq.maths.uncertainty.propagation import Source, simulate
from tests.parts_drawn import UP, block, circle, plane, spot

PLAN = Plan(
    (circle("hole", [0, 0, 0], 20.0, 8), spot("o", [0, 0, 0])),
    (
        PartCharacteristic("zone", "roundness", ("hole",), upper=1.5),
        PartCharacteristic("size", "size", ("hole",), upper=1.5),
    ),
)
# errors of 0.25 on average, in standard deviations.
DRAWS = np.random.default_rng(11).standard_normal((200_000, 1)) + 0.25
ERRORS = np.repeat(DRAWS, 2, axis=1)


def of(value: float) -> tuple[StatedCharacteristic, ...]:
    """What is stated of a zone and a size of the same value, measured 0.25 above it."""
    blocks = iter(np.split(ERRORS.T, 20, axis=1))
    simulated = simulate(Source(["zone", "size"], lambda random, n: next(blocks).copy()), len(ERRORS))
    return stated(simulated, np.full(2, value + 0.25), PLAN, ERRORS)


@pytest.mark.parametrize(
    ("value", "low", "high"),
    [
        (-1.0, 0.0, float(stats.truncnorm(1.0, np.inf, -1.0, 1.0).ppf(0.95))),
        (0.0, 0.0, 1.96),
        (1.0, 0.0, 2.96),
        (2.5, 0.761, 4.46),
        (4.5, 4.5 - 1.96, 4.5 + 1.96),
    ],
)
def test_the_interval_of_a_zone_is_the_unified_one(value: float, low: float, high: float) -> None:
    """Feldman and Cousins' of a mean that is not negative (by their belt, ``test_unified``); of what was
    measured below zero the one whose upper end leaves 5 % of a normal distribution that is cut at zero (scipy's)."""
    zone, size = of(value)
    reach = max(1.96, high - max(0.0, value), 0.5 * (high - low)) if low == 0 else max(1.96, 0.5 * (high - low))
    assert zone.interval == pytest.approx((low, high), abs=0.03)
    assert zone.value == pytest.approx(max(0.0, value), abs=0.01)
    # to the end of an interval that begins at zero, no less than that of the measurement
    assert (zone.U, zone.k, size.U) == pytest.approx((reach, reach, 1.96), abs=0.04)
    assert size.interval == pytest.approx((value - 1.96, value + 1.96), abs=0.06)
    assert size.value == pytest.approx(value, abs=0.01)


def test_a_zone_far_below_zero_is_zero_and_no_smaller_than_its_error_may_be() -> None:
    """With none of 200 000 draws possible it ends where 95 % of all lie, on the other side of zero."""
    zone, _ = of(-6.0)
    assert (zone.value, zone.interval[0]) == (0.0, 0.0)
    assert zone.interval[1] == pytest.approx(6.0 + 1.645, abs=0.05)
    assert (zone.U, zone.k) == pytest.approx((zone.interval[1], zone.interval[1] / zone.u))


def test_the_value_of_a_zone_is_as_often_too_large_as_too_small() -> None:
    """Errors of an exponential distribution of mean one: ln 2 in the middle. A size is less their mean."""
    errors = np.repeat(np.random.default_rng(1).exponential(size=(200_000, 1)), 2, axis=1)
    simulated = simulate(Source(["zone", "size"], lambda random, n: errors[:n].T.copy()), 1000)
    zone, size = stated(simulated, np.full(2, 5.0), PLAN, errors)
    assert zone.value == pytest.approx(5 - np.log(2), abs=0.01)
    assert size.value == pytest.approx(4.0, abs=0.1)


@pytest.mark.parametrize("value", [-0.5, 0.0, 1.0, 2.0])
def test_a_zone_conforms_with_the_probability_given_that_it_is_not_negative(value: float) -> None:
    """A normal distribution cut at zero again; of the size the whole of it. A decision has the same probability."""
    cut, whole = stats.truncnorm(-value, np.inf, value, 1.0).cdf(1.5), stats.norm(value).cdf(1.5)
    each, together = conforming(PLAN, ERRORS, np.full(2, value + 0.25))
    np.testing.assert_allclose(each, [cut, whole], atol=0.004)
    assert together == pytest.approx(cut, abs=0.004)  # both err alike, and the zone's draws are those that are possible
    for zone, expected in ((True, cut), (False, whole)):
        inside, outside = Limits(None, 1.5, DRAWS[:, 0] - DRAWS.mean(), zone).knowing(value)
        assert (inside, outside) == pytest.approx((expected, 1 - expected), abs=0.004)


def test_widths_are_zones_and_what_has_a_sign_or_a_size_is_none() -> None:
    _, characteristics = block()
    features, _ = block()
    zones = never_negative(Plan(features, characteristics)).tolist()
    assert dict(zip((one.what for one in characteristics), zones, strict=True)) == {
        one.what: one.what not in ("size", "distance", "angle", "x", "y", "z") for one in characteristics
    }


def test_all_limits_are_never_kept_more_often_than_one_of_them() -> None:
    """Two zones with the opposite errors: what is possible of both at once is near zero, of each alone it is not."""
    errors = np.hstack([DRAWS - 0.25, 0.25 - DRAWS])
    plan = Plan(
        PLAN.features, tuple(PartCharacteristic(name, "roundness", ("hole",), upper=0.5) for name in ("a", "b"))
    )
    each, together = conforming(plan, errors, np.array([0.1, 0.1]))
    cut = stats.truncnorm(-0.1, np.inf, 0.1, 1.0).cdf(0.5)
    np.testing.assert_allclose(each, cut, atol=0.004)
    assert together == min(each)


def test_a_zone_of_which_hardly_a_draw_is_possible_is_as_large_as_its_error() -> None:
    """Three standard deviations below zero, as a decision has it too (:class:`Limits`)."""
    each, _ = conforming(PLAN, ERRORS, np.full(2, -3.0 + 0.25))
    assert each[0] == pytest.approx(stats.norm.cdf(1.5, 3.0) - stats.norm.cdf(-1.5, 3.0), abs=0.004)
    assert each[0] == pytest.approx(Limits(None, 1.5, DRAWS[:, 0] - DRAWS.mean(), zone=True).within(-3.0), abs=0.004)


X = np.array([1.0, 0, 0])


@pytest.mark.parametrize("hole", [True, False])
def test_lobes_of_a_circle(hole: bool) -> None:
    """Three lobes of 5 µm out of the material of a shaft, or of a hole, where that is towards the axis."""
    feature = circle("c", [10.0, 20.0, 0.0], 15.0, 24, hole=hole)
    lobes = 5e-3 * np.cos(3 * 2 * np.pi * np.arange(24) / 24)
    found = deviations_of(Plan((feature,), ()), feature.points + lobes[:, None] * feature.normals)
    np.testing.assert_allclose(found, lobes, atol=1e-8)


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_plane_in_either_sense(sense: float) -> None:
    """A saddle, to which a plane through its middle is the least-squares one, on a plane that leans and is shifted."""
    feature = plane("A", sense * UP, [-30.0, -30.0, 0.0], [[60.0, 0, 0], [0, 60.0, 0]])
    x, y = feature.points[:, 0], feature.points[:, 1]
    saddle = 4e-3 * x * y / 900
    moved = feature.points + np.outer(saddle * sense + 1e-5 * x + 0.01, UP)
    np.testing.assert_allclose(deviations_of(Plan((feature,), ()), moved), saddle, atol=1e-9)


def test_a_line_on_a_surface() -> None:
    at = np.linspace(-40, 40, 9)
    points, normals = np.outer(at, X), np.tile([0.0, 1.0, 0.0], (9, 1))
    feature = PartFeature("l", "line", points, normals, "stylus", Nominal(np.zeros(3), X))
    bow = 3e-3 * ((at / 40) ** 2 - np.mean((at / 40) ** 2))
    moved = points + (bow + 2e-5 * at + 0.2)[:, None] * normals + np.outer(at, [0, 0, 1e-4])
    np.testing.assert_allclose(deviations_of(Plan((feature,), ()), moved), bow, atol=1e-8)


def test_features_that_their_points_just_determine_have_none() -> None:
    three = circle("c", [0.0, 0.0, 0.0], 10.0, 3)
    plan = Plan((spot("p", [1.0, 2.0, 3.0]), three, replace(circle("d", [0.0, 50.0, 0.0], 10.0, 8))), ())
    found = deviations_of(plan, plan.points)
    assert np.isnan(found[:4]).all()
    np.testing.assert_allclose(found[4:], 0, atol=1e-9)


@pytest.mark.parametrize(
    ("together", "each", "told"),
    [
        (0.90, (0.99, 0.98), 0.97),  # no less than what both leave: 1 − 0.01 − 0.02
        (0.99, (0.99, 0.98), 0.98),  # no more than the least
        (0.975, (0.99, 0.98), 0.975),
        (-0.1, (0.3, 0.4), 0.0),  # both together leave nothing: a probability all the same
    ],
)
def test_a_joint_probability_lies_between_the_bounds_of_frechet(
    together: float, each: tuple[float, ...], told: float
) -> None:
    assert within_bounds(together, np.array(each)) == pytest.approx(told, abs=1e-12)
