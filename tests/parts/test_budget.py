"""Shares of the variance, and ways to make it smaller, where both are known."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.parts.budget import PLACE, budget
from cmm_uq.parts.machine import unmodelled_errors
from cmm_uq.parts.of_temperature import Expansion, Surroundings
from cmm_uq.parts.placing import Pose, around
from cmm_uq.parts.plan import Characteristic, Plan
from cmm_uq.parts.reducing import mean_of_places, ways
from cmm_uq.parts.virtual import AtPose, Circumstances, Virtual
from tests.parts_drawn import POSE, block, machine, plane, spot

PAIR = Plan(
    (spot("one", [0, 0, 0]), spot("other", [300, 0, 0])), (Characteristic("apart", "distance", ("one", "other")),)
)


def test_shares_of_a_sum_are_those_of_its_variances() -> None:
    """Scale 10 ppm and temperature 0.5 K of steel over 300 mm, noise of 1 µm at both ends: 9, 2.976 and 2 µm²."""
    draws = 10.0 * np.random.default_rng(1).standard_normal((20_000, 1))
    part = Surroundings(Expansion(11.5e-6, u_temperature_k=0.5))
    found = budget(Virtual(PAIR, Circumstances(machine(["scale_x"], draws, 1.0), (POSE,), part)))
    parts = np.array([9.0, 2.0, (300 * 11.5e-6 * 0.5 * 1e3) ** 2])
    assert found.causes == ("machine: scale_x", "noise: reading", "temperature: part")
    assert found.u[0] * 1e3 == pytest.approx(np.sqrt(parts.sum()), rel=0.02)
    np.testing.assert_allclose(found.total[:, 0], parts / parts.sum(), atol=0.03)
    np.testing.assert_allclose(found.first[:, 0], parts / parts.sum(), atol=0.03)
    assert found.worst("apart") == "machine: scale_x"


def test_errors_that_cancel_have_negative_shares() -> None:
    """A diagonal of 45°: scale x and squareness of correlation −0.8 by their covariances with the sum."""
    diagonal = Plan((spot("o", [0, 0, 0]), spot("xy", [200, 200, 0])), (Characteristic("d", "distance", ("o", "xy")),))
    arcsec = 1 / 4.84813681
    V = np.array([[25.0, 0.8 * 25], [0.8 * 25, 25.0]])  # in ppm, and in seconds of as many microradians
    draws = np.random.default_rng(2).multivariate_normal([0, 0], V, 20_000) * [1.0, 0.5 * arcsec]
    found = budget(Virtual(diagonal, Circumstances(machine(["scale_x", "squareness_xy"], draws), (POSE,))))
    # half of the scale's share of x against half of S·y, which counts half here: −s + ½S, in units of L/2
    c = np.array([-1.0, 0.5])
    shares = c * (V @ c) / (c @ V @ c)
    assert found.factors == ("machine: scale_x", "machine: squareness_xy")
    np.testing.assert_allclose(found.within[:, 0], shares, atol=0.02)
    assert found.within[1, 0] < 0
    assert found.worst("d") == "machine: scale_x"


def test_a_position_has_more_in_total_than_alone() -> None:
    """Twice a radius of two independent normal parts: shares by quadrature over one part, of the mean and of the variance."""
    features, _ = block()
    plan = Plan(features, (Characteristic("position", "position", ("h1",), ("A", "B", "C")),))
    state = machine(unmodelled=tuple(u for u in unmodelled_errors([], {}) if u.effect.name.startswith("hysteresis")))
    found = budget(Virtual(plan, Circumstances(state, (POSE,))), 2**15)
    x, weights = np.polynomial.hermite_e.hermegauss(200)
    weights /= weights.sum()
    r = np.hypot(x[:, None], x)
    mean = r @ weights
    variance = 2 - (mean @ weights) ** 2
    alone = ((mean**2) @ weights - (mean @ weights) ** 2) / variance
    for axis in (0, 1):
        assert found.first[axis, 0] == pytest.approx(alone, abs=0.03)
        assert found.total[axis, 0] == pytest.approx(1 - alone, abs=0.03)
    np.testing.assert_allclose(found.total[2], 0, atol=1e-12)  # level play moves nothing


def test_the_place_on_the_table_is_a_cause() -> None:
    """A bow of the guideway errs by where the part lies: a place drawn anew changes what the same bow does."""
    bow = 20.0 * np.random.default_rng(3).standard_normal((2000, 1))
    features = (
        plane("A", [0, 0, 1], [0, 0, 0], [[100, 0, 0], [0, 50, 0]]),
        plane("B", [-1, 0, 0], [0, 0, 0], [[0, 50, 0], [0, 0, -20]]),
    )
    plan = Plan(features, (Characteristic("corner", "angle", ("A", "B")),))
    poses = around(Pose(np.eye(3), np.array([400.0, 200, -300])), np.array([150.0, 0, 0]), np.zeros(3), 12)
    found = budget(Virtual(plan, Circumstances(machine(["straightness_x_z"], bow), poses)), 4096)
    assert dict(zip(found.causes, found.total[:, 0], strict=True))[PLACE] > 0.2
    assert dict(zip(found.causes, found.first[:, 0], strict=True))[PLACE] == pytest.approx(0, abs=0.05)


def test_a_part_turned_round_loses_what_the_turn_reverses() -> None:
    """Squareness xy tilts the corner of a part by S, and by −S once it is turned by 90°; half a turn leaves it."""
    features = (
        plane("B", [0, -1, 0], [0, 0, -5], [[100, 0, 0], [0, 0, -20]]),
        plane("C", [-1, 0, 0], [0, 0, -5], [[0, 100, 0], [0, 0, -20]]),
    )
    plan = Plan(features, (Characteristic("corner", "angle", ("B", "C")),))
    state = machine(["squareness_xy"], 5.0 * np.random.default_rng(4).standard_normal((1000, 1)))
    quarter = Pose(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), POSE.translation_mm)
    places = [AtPose(plan, Circumstances(state), pose) for pose in (POSE, quarter)]
    errors = mean_of_places(places, np.random.default_rng(5), 2000)
    assert (
        errors.std() < 1e-3 * Virtual(plan, Circumstances(state, (POSE,))).errors(np.random.default_rng(5), 2000).std()
    )


def test_ways_say_what_they_change() -> None:
    """Noise alone: four readings halve u, and so nearly does nothing else but the mean of two measurements."""
    found = {way.name: way.u[0] for way in ways(PAIR, Circumstances(machine(noise_um=2.0), (POSE,)))}
    planned = found["as planned"]
    assert planned == pytest.approx(2e-3 * np.sqrt(2), rel=0.02)
    assert found["each point four times"] == pytest.approx(planned / 2, rel=0.02)
    assert found["styli qualified twice as well"] == pytest.approx(planned, rel=0.02)
    assert found["mean of two measurements, the part turned by 180° about Z between them"] == pytest.approx(
        planned / np.sqrt(2), rel=0.02
    )
