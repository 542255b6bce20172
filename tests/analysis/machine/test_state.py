"""The machine on the day of a part's measurement: drift since its calibration, and its noise in the order of probing."""

from __future__ import annotations

from datetime import date

import numpy as np
import pytest

from cmm_uq.analysis.machine.state import StatedNoise, aged, at_points, unmodelled_errors
from cmm_uq.analysis.parts.causes.surroundings import Expansion, Surroundings
from cmm_uq.analysis.parts.plan import PartCharacteristic, Plan
from cmm_uq.analysis.parts.virtual import AtPose, MeasurementConditions
from tests.parts_drawn import POSE, machine, spot

APART = (PartCharacteristic("apart", "distance", ("one", "other")),)
PAIR = Plan((spot("one", [0, 0, 0]), spot("other", [300, 0, 0])), APART)


def errors(plan: Plan, given: MeasurementConditions, n: int = 20_000) -> np.ndarray:
    at = AtPose(plan, given, POSE)
    return at.errors(at.drawn(np.random.default_rng(0), n))[:, 0]


def test_what_a_scale_may_have_drifted_by_is_drawn_with_it() -> None:
    """3 ppm of the calibration and 4 ppm since then are 5 ppm of 300 mm."""
    draws = 3.0 * np.random.default_rng(1).standard_normal((10_000, 1))
    state = machine(["scale_x"], draws, calibrated=date(2026, 1, 1))
    asked = []

    def change(name: str, days: float) -> float:
        asked.append((name, days))
        return 4.0

    now = aged(state, date(2026, 4, 11), change)
    assert asked == [("scale_x.ppm", 100.0)]
    assert (now.age_days, now.drift_unknown) == (100, ())
    assert errors(PAIR, MeasurementConditions(now)).std() == pytest.approx(300 * 5e-6, rel=0.02)


def test_a_drift_that_nobody_knows_is_named() -> None:
    names = ["scale_x", "squareness_xy", "probe_lobing"]
    state = machine(names, np.zeros((2, 4)), calibrated=date(2026, 1, 1))
    of_scale = aged(state, date(2026, 4, 11), lambda name, days: 1.0 if name == "scale_x.ppm" else None)
    assert of_scale.drift_unknown == ("squareness_xy", "probe_lobing")
    np.testing.assert_allclose(of_scale.drift, [1.0, 0, 0, 0])
    of_lobing = aged(state, date(2026, 4, 11), lambda name, days: 2.0 if name == "probe_lobing.amplitude_um" else None)
    np.testing.assert_allclose(of_lobing.drift, [0.0, 0, 2, 2])
    assert aged(state, date(2026, 4, 11)).drift_unknown == tuple(names)
    assert aged(state, date(2026, 1, 1)).drift_unknown == ()
    assert machine(names, np.zeros((2, 4))).age_days is None


def test_a_warm_scale_that_was_calibrated_warm_reads_right() -> None:
    """Steel scales at 23 °C that nobody compensates: their certificate of 23 °C has their expansion, one of 20 °C has not."""
    warm = Expansion(10e-6, 0.0, 23.0, corrected=False)
    for at_c, error in ((None, -300 * 10e-6 * 3), (20.0, -300 * 10e-6 * 3), (23.0, 0.0), (22.0, -300 * 10e-6)):
        given = MeasurementConditions(machine(temperature_c=at_c), surroundings=Surroundings(scales=(warm,) * 3))
        assert errors(PAIR, given, 2)[0] == pytest.approx(error, abs=1e-8)


def test_a_coefficient_of_expansion_is_uncertain_by_the_distance_from_the_calibration() -> None:
    """u(α)·ΔT·L with ΔT = 24 − 22 K."""
    scale = Expansion(10e-6, 1e-6, 24.0)
    given = MeasurementConditions(machine(temperature_c=22.0), surroundings=Surroundings(scales=(scale,) * 3))
    assert errors(PAIR, given).std() == pytest.approx(300 * 1e-6 * 2, rel=0.02)


def test_what_is_probed_later_is_warmer() -> None:
    """α·u·L/2: the ends of a part, by its middle, are 150 mm away, and only the second is warm; so is a scale, at 600 mm."""
    part = Surroundings(Expansion(10e-6), u_drift_k=0.5)
    assert errors(PAIR, MeasurementConditions(machine(), surroundings=part)).std() == pytest.approx(
        150 * 10e-6 * 0.5, rel=0.02
    )
    scales = Surroundings(scales=(Expansion(10e-6), Expansion(), Expansion()), u_drift_k=0.5)
    assert errors(PAIR, MeasurementConditions(machine(), surroundings=scales)).std() == pytest.approx(
        600 * 10e-6 * 0.5, rel=0.02
    )
    turned = Plan(PAIR.features, APART, order=np.array([1, 0]))
    assert errors(turned, MeasurementConditions(machine(), surroundings=scales)).std() == pytest.approx(
        300 * 10e-6 * 0.5, rel=0.02
    )


def test_the_wander_of_readings_is_the_mean_over_its_draws() -> None:
    """Half of the draws return within 100 s, half walk: σ²·exp(−t/τ) and 2σ²·t/T."""
    noise = StatedNoise(slow_mm=np.array([2e-3, 4e-3]), slow_time_s=np.array([100.0, np.inf]), walked_s=1000.0)
    kernel = noise.slow_kernel(np.array([50.0, 250.0, 100.0]))
    returning = 4e-6 * np.exp(-np.array([[0, 2, 0.5], [2, 0, 1.5], [0.5, 1.5, 0]]))
    walk = 2 * 16e-6 / 1000 * np.array([[0, 0, 0], [0, 200, 50], [0, 50, 50]])
    np.testing.assert_allclose(kernel, (returning + walk) / 2, rtol=1e-12)
    many = StatedNoise(slow_mm=np.tile([1e-3, 0.0], 5000), slow_time_s=np.full(10_000, 60.0))
    np.testing.assert_allclose(many.slow_kernel(np.array([0.0, 60.0])), 0.5e-6 * np.exp([[0, -1], [-1, 0]]), rtol=1e-9)


@pytest.mark.parametrize(("longest", "first", "u"), [(600.0, 0, 0.5), (600.0, 1, 0.5), (0.0, 0, np.sqrt(2))])
def test_noise_that_grows(longest: float, first: int, u: float) -> None:
    """3 µm at 600 mm are 1.5 µm 300 mm from the first point; where nobody knows at what length, 3 µm at both."""
    order = np.array([first, 1 - first])
    plan = Plan(PAIR.features, APART, order=order)
    noise = StatedNoise(growth_mm=3e-3, longest_mm=longest)
    assert errors(plan, MeasurementConditions(machine(noise=noise))).std() == pytest.approx(3e-3 * u, rel=0.02)


def test_an_offset_of_a_set_up_is_as_its_draws_are() -> None:
    """Absent in three of four draws: a mixture with the variance of all, and many errors of zero."""
    noise = StatedNoise(placing_mm=np.array([0.0, 0.0, 0.0, 4e-3]))
    found = errors(PAIR, MeasurementConditions(machine(noise=noise), repeats=9))
    assert found.std() == pytest.approx(4e-3 * np.sqrt(2) / 2, rel=0.03)
    assert np.mean(np.abs(found) < 1e-9) == pytest.approx(0.75, abs=0.01)


def test_what_goes_by_a_column_that_the_part_has_not_is_not_drawn_but_named() -> None:
    """A drift with the time of the calibration's day: with times it takes part, without it is as if not modelled."""
    draws = np.random.default_rng(2).standard_normal((5000, 2)) * [3.0, 2.0]
    state = machine(["scale_x", "drift_x"], draws)
    assert at_points(state, {"time_s"}) is state
    left = at_points(state, ())
    assert [effect.name for effect in left.effects] == ["scale_x"]
    assert np.array_equal(left.draws, draws[:, :1])
    assert [(one.effect.name, round(float(one.sd[0]), 1)) for one in left.unmodelled] == [("drift_x", 2.0)]
    at = AtPose(PAIR, MeasurementConditions(left), POSE)
    assert at.lacking == {"drift_x": "time_s"}
    assert errors(PAIR, MeasurementConditions(left)).std() == pytest.approx(300 * 3e-6, rel=0.05)


def test_a_machine_of_three_straight_axes_has_no_errors_of_a_table() -> None:
    """Its part reports said of sixteen of them that they cannot be drawn without a column ``c_deg``."""
    assert not [one.effect.name for one in unmodelled_errors([], {}) if "_deg" in "".join(one.effect.columns)]
