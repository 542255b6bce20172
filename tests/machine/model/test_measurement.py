"""Forward and inverse are one model: what is simulated is found again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from tests.recordings import TRAVEL, bar_facts, bars

SIX = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")
VALUES = np.array([250.0, -90.0, 30.0, -173.0, -19.0, 210.0])


def simulated(points: Points, true_length: float, sigma: float = 0.0, seed: int = 0) -> Points:
    model = RecordingModel(Ballbar(bar_facts(), points), effects(SIX))
    random = np.random.default_rng(seed)
    return points.at(model.simulate(VALUES, np.array([true_length]), Noise(coordinate=sigma), random))


def estimated(points: Points, length: float | None = 400.0, sigma: float | None = 1e-3) -> RecordingModel:
    return RecordingModel(Ballbar(bar_facts(length), points), effects(SIX), sigma)


def test_a_recording_without_noise_gives_back_the_truth(ballbar_points: Points) -> None:
    """Also its second order: 210″ and 250 ppm move a length by 0.2 µm beyond the first."""
    found = estimated(simulated(ballbar_points, 400.0)).estimate().least_squares
    np.testing.assert_allclose(found.value[:6], VALUES, atol=1e-6)
    assert np.abs(found.residuals).max() < 1e-9


def test_the_machine_indicates_what_its_errors_correct_to_the_truth(ballbar_points: Points) -> None:
    model = estimated(ballbar_points)
    indicated = model.indicated(ballbar_points.xyz, VALUES)
    np.testing.assert_allclose(indicated + model.errors(indicated, VALUES), ballbar_points.xyz, atol=1e-9)


def test_an_uncalibrated_bar_leaves_one_common_scale_free(ballbar_points: Points) -> None:
    """The null space is exact: one ppm on every axis goes with one ppm of the bar, whatever the machine's errors are."""
    points = simulated(ballbar_points, 400.02, sigma=1e-3)
    found = estimated(points, length=None).estimate().least_squares
    assert found.rank == 6
    assert found.condition < 20
    expected = np.array([1, 1, 1, 0, 0, 0, found.value[6] * 1e-6])
    np.testing.assert_allclose(found.null_space[:, 0], expected, rtol=1e-9, atol=1e-9)
    assert found.determined.tolist() == [False] * 3 + [True] * 3 + [False]


def test_the_careless_fit_of_recorded_lengths_is_perfect_and_wrong(ballbar_points: Points) -> None:
    """With the recorded lengths in the design, the scale columns add up to the observation: no residual, scale −10⁶ ppm."""
    points = simulated(ballbar_points, 400.0, sigma=5e-3)
    ends = points.xyz.reshape(-1, 2, 3)
    d = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    squares = ((ends[:, 1] - ends[:, 0]) / d[:, None]) ** 2
    careless = np.linalg.lstsq(squares * d[:, None], -d, rcond=None)[0]
    np.testing.assert_allclose(careless, [-1, -1, -1], atol=1e-9)
    found = estimated(points, length=None).estimate().least_squares
    assert found.residual_sd == pytest.approx(5e-3 * np.sqrt(2), rel=0.5)


def test_differences_of_scales_are_determined_without_a_certificate(ballbar_points: Points) -> None:
    found = estimated(simulated(ballbar_points, 400.02), length=None).estimate().least_squares
    assert found.value[1] - found.value[0] == pytest.approx(-340.0, abs=0.05)
    np.testing.assert_allclose(found.value[3:6], VALUES[3:], atol=0.05)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_estimates_scatter_as_their_covariance_says(seed: int) -> None:
    """The squared deviation from the truth, weighted by the covariance, follows χ² with six degrees of freedom."""
    points = bars(np.random.default_rng(seed), 60, 400.0, Machine("m", "XYZ", TRAVEL))
    found = estimated(simulated(points, 400.0, sigma=1e-3, seed=seed + 1), 400.0).estimate().least_squares
    inverse = np.linalg.inv(found.covariance[:6, :6])
    deviation = found.value[:6] - VALUES
    assert deviation @ inverse @ deviation < 41.0  # a thousand such cases exceed it three times in 10⁴


@pytest.mark.long
def test_coverage_of_the_least_squares_interval_is_95_percent() -> None:
    points = bars(np.random.default_rng(7), 40, 400.0, Machine("m", "XYZ", TRAVEL))
    inside: list[Floats] = []
    for seed in range(300):
        found = estimated(simulated(points, 400.0, 1e-3, seed)).estimate().least_squares
        u = np.sqrt(np.diag(found.covariance))[:6]
        inside.append(np.abs(found.value[:6] - VALUES) < 1.96 * u)
    # The bar is exact here while its certificate says u = 0.5 µm, so scales are covered a little more often.
    assert 0.93 < np.mean(inside) < 0.985


def test_the_length_of_the_bar_carries_its_uncertainty_into_the_scales(ballbar_points: Points) -> None:
    facts = bar_facts(400.0, 4.0)
    model = RecordingModel(Ballbar(facts, simulated(ballbar_points, 400.0)), effects(SIX), 1e-9)
    found = model.estimate().least_squares
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance))[:3], 4e-3 / 400 * 1e6, rtol=1e-3)
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance))[3:6], 0, atol=2e-2)


def test_measurements_set_aside_do_not_count(ballbar_points: Points) -> None:
    points = simulated(ballbar_points, 400.0)
    spoiled = points.xyz.copy()
    spoiled[0] += 1.0
    used = np.arange(40) > 0
    model = RecordingModel(Ballbar(bar_facts(), points.at(spoiled)), effects(SIX), 1e-3, used)
    found = model.estimate().least_squares
    np.testing.assert_allclose(found.value[:6], VALUES, atol=1e-6)
    assert abs(model.residuals(found.value)[0]) > 0.1


def test_a_placing_is_off_by_the_same_in_all_its_repeats(ballbar_points: Points) -> None:
    twice = replace(
        ballbar_points,
        xyz=np.repeat(ballbar_points.xyz, 2, axis=0),
        measurement=np.repeat(ballbar_points.measurement, 2),
        point=np.repeat(ballbar_points.point, 2),
        repeat=np.tile([1, 2], len(ballbar_points)),
        lines=np.zeros(0, dtype=np.int64),
    )
    model = RecordingModel(Ballbar(bar_facts(), twice), effects([]))
    drawn = model.simulate(np.zeros(0), np.array([400.0]), Noise(placing=2e-3), np.random.default_rng(3)) - twice.xyz
    np.testing.assert_array_equal(drawn[::2], drawn[1::2])
    assert drawn.std() == pytest.approx(2e-3, rel=0.2)


def test_an_effect_with_a_period_needs_that_period(ballbar_points: Points) -> None:
    artefact = Ballbar(bar_facts(), ballbar_points)
    held = RecordingModel(artefact, effects(["periodic_scale_x"]), shapes={"periodic_scale_x": (40.0,)})
    assert held.estimate().least_squares.rank == 2


def test_a_period_is_not_estimated_here(ballbar_points: Points) -> None:
    with pytest.raises(CmmUqError, match="nonlinear parameter period_mm"):
        RecordingModel(Ballbar(bar_facts(), ballbar_points), effects(["periodic_scale_x"]))


def test_draws_of_one_effect_are_reported_beside_others_whose_shape_is_not_held(ballbar_points: Points) -> None:
    """The columns of a periodic error come before those of the squareness that is asked for."""
    named = effects(["periodic_scale_x", "squareness_xy"])
    model = RecordingModel(Ballbar(bar_facts(400.0), ballbar_points), named, shapes={"periodic_scale_x": (50.0,)})
    ((key, (values, _)),) = model.reported(np.array([[1.0, 2.0, 3.0, 4.0]]), ["squareness_xy"]).items()
    assert key == ("squareness_xy", "angle_arcsec")
    assert values.tolist() == [3.0]


def test_bars_between_places_that_have_nothing_to_do_with_each_other_are_no_machines() -> None:
    """Ends anywhere in the volume, of the certified length on average: what is well determined stays refused."""
    random = np.random.default_rng(1)
    twelve = bars(random, 12, 400.0, Machine("m", "XYZ", TRAVEL))
    ends = random.uniform(TRAVEL[:, 0], TRAVEL[:, 1], (24, 3))
    ends *= 400 / np.linalg.norm(ends[::2] - ends[1::2], axis=1).mean()
    six = ["scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx"]
    with pytest.raises(CmmUqError, match="they are no machine's"):
        RecordingModel(Ballbar(bar_facts(), twelve.at(ends)), effects(six)).estimate()
