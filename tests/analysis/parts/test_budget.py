"""Shares of the variance, and ways to make it smaller, where both are known.

Errors of points where they are known: scales, expansion, and motions that all points have in common.
"""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.analysis.machine.state import unmodelled_errors
from cmm_uq.analysis.parts.budget import PLACE, point_errors, variance_shares
from cmm_uq.analysis.parts.causes.surroundings import Expansion, Surroundings, of_points, reproducibility
from cmm_uq.analysis.parts.plan import PartCharacteristic, PartPose, Plan, Stylus, around
from cmm_uq.analysis.parts.virtual import AtPose, MeasurementConditions, Virtual
from cmm_uq.analysis.parts.ways import mean_of_places, ways
from cmm_uq.base.errors import CmmUqError
from tests.parts_drawn import POSE, block, circle, machine, plane, spot

PAIR = Plan(
    (spot("one", [0, 0, 0]), spot("other", [300, 0, 0])), (PartCharacteristic("apart", "distance", ("one", "other")),)
)


def test_shares_of_a_sum_are_those_of_its_variances() -> None:
    """Scale 10 ppm and temperature 0.5 K of steel over 300 mm, noise of 1 µm at both ends: 9, 2.976 and 2 µm²."""
    draws = 10.0 * np.random.default_rng(1).standard_normal((20_000, 1))
    part = Surroundings(Expansion(11.5e-6, u_temperature_k=0.5))
    found = variance_shares(Virtual(PAIR, MeasurementConditions(machine(["scale_x"], draws, 1.0), (POSE,), part)))
    parts = np.array([9.0, 2.0, (300 * 11.5e-6 * 0.5 * 1e3) ** 2])
    assert found.causes == ("machine: scale_x", "noise: reading", "temperature: part")
    assert found.u[0] * 1e3 == pytest.approx(np.sqrt(parts.sum()), rel=0.02)
    np.testing.assert_allclose(found.total[:, 0], parts / parts.sum(), atol=0.03)
    np.testing.assert_allclose(found.first[:, 0], parts / parts.sum(), atol=0.03)
    assert found.worst("apart") == "machine: scale_x"


def test_what_the_calibration_did_not_see_is_told_with_its_share() -> None:
    """A bow that was not modelled beside a scale that was left free and noise of which nothing need be told."""
    free = 50.0 * np.random.default_rng(6).standard_normal((4000, 1))
    bow = tuple(u for u in unmodelled_errors([], {}) if u.effect.name == "straightness_x_y")
    diagonal = Plan(
        (spot("o", [0, 0, 0]), spot("xy", [100, 100, 0])), (PartCharacteristic("d", "distance", ("o", "xy")),)
    )
    state = machine(["scale_x"], free, 5.0, prior_share={"scale_x": 0.99}, unmodelled=bow)
    virtual = Virtual(diagonal, MeasurementConditions(state, (POSE,)))
    told = variance_shares(virtual).told("d", virtual.named)
    why = {line: words for line, _, words in told}
    assert why.keys() == {"machine: scale_x", "machine: straightness_x_y"}
    assert why["machine: scale_x"] == "the calibration left it to what physics allows"
    assert why["machine: straightness_x_y"].startswith("the calibration did not model it")
    assert told[0][1] >= told[1][1]


@pytest.mark.parametrize("correlation", [0.8, -0.6, 0.999])
def test_shares_of_tied_errors_are_what_knowing_one_alone_would_take_away(correlation: float) -> None:
    """A diagonal of 45°, −s + ½S in units of L/2: the square of each one's correlation with the sum, never more than all."""
    diagonal = Plan(
        (spot("o", [0, 0, 0]), spot("xy", [200, 200, 0])), (PartCharacteristic("d", "distance", ("o", "xy")),)
    )
    arcsec = 1 / 4.84813681
    V = 25.0 * np.array([[1.0, correlation], [correlation, 1.0]])  # in ppm, and in seconds of as many microradians
    draws = np.random.default_rng(2).multivariate_normal([0, 0], V, 20_000) * [1.0, 0.5 * arcsec]
    found = variance_shares(
        Virtual(diagonal, MeasurementConditions(machine(["scale_x", "squareness_xy"], draws), (POSE,)))
    )
    c = np.array([-1.0, 0.5])  # −s·x² and S·x·y over the diagonal, S drawn half as large
    shares = (V @ c) ** 2 / np.diagonal(V) / (c @ V @ c)
    assert found.factors == ("machine: scale_x", "machine: squareness_xy")
    np.testing.assert_allclose(found.within[:, 0], shares, atol=0.03)
    assert (found.within <= 1).all()
    assert [found.share(line, 0) for line in found.factors] == found.within[:, 0].tolist()


def test_a_position_has_more_in_total_than_alone() -> None:
    """Twice a radius of two independent normal parts: shares by quadrature over one part, of the mean and of the variance."""
    features, _ = block()
    plan = Plan(features, (PartCharacteristic("position", "position", ("h1",), ("A", "B", "C")),))
    state = machine(unmodelled=tuple(u for u in unmodelled_errors([], {}) if u.effect.name.startswith("hysteresis")))
    found = variance_shares(Virtual(plan, MeasurementConditions(state, (POSE,))), 2**15)
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
    plan = Plan(features, (PartCharacteristic("corner", "angle", ("A", "B")),))
    poses = around(PartPose(np.eye(3), np.array([400.0, 200, -300])), np.array([150.0, 0, 0]), np.zeros(3), 12)
    found = variance_shares(Virtual(plan, MeasurementConditions(machine(["straightness_x_z"], bow), poses)), 4096)
    assert dict(zip(found.causes, found.total[:, 0], strict=True))[PLACE] > 0.2
    assert dict(zip(found.causes, found.first[:, 0], strict=True))[PLACE] == pytest.approx(0, abs=0.05)


def test_a_part_turned_round_loses_what_the_turn_reverses() -> None:
    """Squareness xy tilts the corner of a part by S, and by −S once it is turned by 90°; half a turn leaves it."""
    features = (
        plane("B", [0, -1, 0], [0, 0, -5], [[100, 0, 0], [0, 0, -20]]),
        plane("C", [-1, 0, 0], [0, 0, -5], [[0, 100, 0], [0, 0, -20]]),
    )
    plan = Plan(features, (PartCharacteristic("corner", "angle", ("B", "C")),))
    state = machine(["squareness_xy"], 5.0 * np.random.default_rng(4).standard_normal((1000, 1)))
    quarter = PartPose(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), POSE.translation_mm)
    places = [AtPose(plan, MeasurementConditions(state), pose) for pose in (POSE, quarter)]
    errors = mean_of_places(places, np.random.default_rng(5), 2000)
    assert (
        errors.std()
        < 1e-3 * Virtual(plan, MeasurementConditions(state, (POSE,))).errors(np.random.default_rng(5), 2000).std()
    )


def test_ways_say_what_they_change() -> None:
    """Noise alone: four readings halve u, and so nearly does nothing else but the mean of two measurements."""
    found = {str(way.name): way.u[0] for way in ways(PAIR, MeasurementConditions(machine(noise_um=2.0), (POSE,)))}
    planned = found["as planned"]
    anew = "mean of four measurements, the part set up anew in its place each time"
    assert found[anew] == pytest.approx(planned / 2, rel=0.02)
    assert found["mean of four measurements, the part turned by 90° about Z each time"] == pytest.approx(
        planned / 2, rel=0.02
    )
    assert not any(name.startswith("part moved") for name in found)  # noise is the same everywhere
    assert "twice the points in every feature" not in found
    assert planned == pytest.approx(2e-3 * np.sqrt(2), rel=0.02)
    assert found["each point four times"] == pytest.approx(planned / 2, rel=0.02)
    assert found["styli qualified twice as well"] == pytest.approx(planned, rel=0.02)
    assert found["mean of two measurements, the part turned by 180° about Z between them"] == pytest.approx(
        planned / np.sqrt(2), rel=0.02
    )


def test_a_part_goes_where_the_guideway_is_straightest() -> None:
    """A bow is z = b·(2x/900 − 1)², level in the middle of the travel: there a corner of two faces errs least."""
    bow = 20.0 * np.random.default_rng(3).standard_normal((2000, 1))
    features = (
        plane("A", [0, 0, 1], [0, 0, 0], [[100, 0, 0], [0, 50, 0]]),
        plane("B", [-1, 0, 0], [0, 0, 0], [[0, 50, 0], [0, 0, -20]]),
    )
    plan = Plan(features, (PartCharacteristic("corner", "angle", ("A", "B")),))
    given = MeasurementConditions(
        machine(["straightness_x_z"], bow), (PartPose(np.eye(3), np.array([100.0, 200, -300])),)
    )
    found = {str(way.name): way.u[0] for way in ways(plan, given, 2000)}
    (moved,) = [name for name in found if name.startswith("part moved by +300 mm along X")]
    assert found[moved] < 0.01 * found["as planned"]


def test_twice_the_points_halve_the_variance_of_noise() -> None:
    """Of a diameter by eight points, and by sixteen."""

    def of(count: int) -> tuple[Plan, MeasurementConditions]:
        plan = Plan((circle("c", [0, 0, 0], 10.0, count),), (PartCharacteristic("d", "size", ("c",)),))
        return plan, MeasurementConditions(machine(noise_um=2.0), (POSE,))

    found = {str(way.name): way.u[0] for way in ways(*of(8), doubled=lambda: of(16))}
    assert found["as planned"] == pytest.approx(2 * 2e-3 / np.sqrt(8), rel=0.02)
    assert found["twice the points in every feature"] == pytest.approx(2 * 2e-3 / np.sqrt(16), rel=0.02)


@pytest.mark.parametrize("large", [1000, 45])
def test_what_reading_more_often_brings_does_not_depend_on_how_many_points_are_compared(
    large: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A diameter: 0.5 µm of the tip, and as much of the mean of all points, which is half of it read four times."""
    for module in ("virtual", "causes.cause"):
        monkeypatch.setattr(f"cmm_uq.analysis.parts.{module}.LARGE", large)
    count = 120
    styli = (Stylus("stylus", u_diameter_um=0.5),)
    plan = Plan((circle("c", [0, 0, 0], 20.0, count),), (PartCharacteristic("d", "size", ("c",)),), styli=styli)
    given = MeasurementConditions(machine(noise_um=0.25 * np.sqrt(count)), (POSE,))
    found = {str(way.name): way for way in ways(plan, given)}
    assert found["as planned"].u[0] * 1e3 == pytest.approx(np.sqrt(0.25 + 0.25), rel=0.02)
    assert found["each point four times"].u[0] * 1e3 == pytest.approx(np.sqrt(0.25 + 0.0625), rel=0.02)
    assert found["styli qualified twice as well"].u[0] * 1e3 == pytest.approx(np.sqrt(0.0625 + 0.25), rel=0.02)
    assert (found["as planned"].known(inferred=False) > 0.04) == (count >= 2 * large)


def test_operators_scatter_by_what_is_stated_and_anew_in_each_set_up() -> None:
    """3 µm of the distance, and 1 µm of each point: √(3² + 2·1²), however often each point is read; half of it in the mean of
    four set-ups. Of the other characteristic the points alone."""
    other = PartCharacteristic("other", "distance", ("two", "three"))
    plan = Plan(
        (*PAIR.features, spot("two", [0, 100, 0]), spot("three", [200, 100, 0])), (*PAIR.characteristics, other)
    )
    (name,) = (one.name for one in PAIR.characteristics)
    causes = (reproducibility(plan, {name: 3e-3}), of_points(plan, 1.0))
    given = MeasurementConditions(machine(), (POSE,), repeats=16, further=causes)
    found = {str(way.name): way.u for way in ways(plan, given)}
    assert found["as planned"] == pytest.approx([np.sqrt(11) * 1e-3, np.sqrt(2) * 1e-3], rel=0.02)
    anew = found["mean of four measurements, the part set up anew in its place each time"]
    assert anew == pytest.approx(found["as planned"] / 2, rel=0.02)
    shares = variance_shares(Virtual(plan, given), 4096)
    at = shares.causes.index(f"operator: reproducibility of {name}")
    assert shares.first[at] == pytest.approx([9 / 11, 0.0], abs=0.03)
    with pytest.raises(CmmUqError, match="there is no characteristic 'lenght'"):
        reproducibility(plan, {"lenght": 1.0})


ENDS = Plan(
    (spot("one", [0, 0, 0]), spot("other", [300, 0, 0])), (PartCharacteristic("apart", "distance", ("one", "other")),)
)
TURNED = PartPose(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([400.0, 100.0, -300.0]))


@pytest.mark.parametrize(("scale", "pose"), [("scale_x", POSE), ("scale_y", TURNED)])
def test_a_scale_stretches_the_part_about_its_middle(scale: str, pose: PartPose) -> None:
    """10 ppm of 300 mm are 3 µm, half at either end and against each other; in the frame of the part along its x."""
    draws = 10.0 * np.random.default_rng(1).standard_normal((4000, 1))
    found = point_errors(Virtual(ENDS, MeasurementConditions(machine([scale], draws), (pose,))))
    u = 1e3 * np.sqrt(np.einsum("nii->ni", found.covariance))
    np.testing.assert_allclose(u, [[1.5, 0, 0], [1.5, 0, 0]], atol=0.06)
    np.testing.assert_allclose(found.mean, 0, atol=2e-4)


def test_readings_keep_what_is_not_common() -> None:
    """Noise of 2 µm in x of both ends: √2 µm is left of each about their mean; in y and z a shift and a turn take all."""
    found = point_errors(Virtual(ENDS, MeasurementConditions(machine(noise_um=2.0), (POSE,))))
    u = 1e3 * np.sqrt(np.einsum("nii->ni", found.covariance.clip(0)))
    np.testing.assert_allclose(u, [[np.sqrt(2), 0, 0]] * 2, atol=0.07)


def test_a_warm_part_that_is_not_corrected_is_found_larger() -> None:
    """Steel at 25 °C over 300 mm: 11.5e-6 · 5 · 300 mm = 17.25 µm, outwards at either end."""
    warm = Surroundings(Expansion(11.5e-6, temperature_c=25.0, corrected=False))
    found = point_errors(Virtual(ENDS, MeasurementConditions(machine(), (POSE,), warm)), 10)
    np.testing.assert_allclose(1e3 * found.mean, [[-8.625, 0, 0], [8.625, 0, 0]], atol=1e-9)
    np.testing.assert_allclose(found.covariance, 0, atol=1e-15)


def test_where_the_part_was_measured_is_no_error_of_it() -> None:
    measured = ENDS.points + np.array([[0.0, 0, 0], [0.05, 0.02, 0]])
    found = point_errors(Virtual(ENDS, MeasurementConditions(machine(), (POSE,), measured=measured)), 10)
    np.testing.assert_allclose(found.mean, 0, atol=1e-12)
