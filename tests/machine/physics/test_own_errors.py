"""Faults of an artefact turn and move with it; the formulas are written out here a second time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special
from scipy.spatial.transform import Rotation
from scipy.stats import binom

from cmm_uq.artefacts import artefact_facts, artefact_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Points
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.physics.catalogue import EVERY, OWN, effects
from cmm_uq.machine.physics.effect import CommonSize, Effect
from cmm_uq.machine.physics.effects.own_errors import GEOMETRY
from tests.artefacts.constructions import MIDDLE, plate, recording, rings, spheres, step_gauge, swept
from tests.recordings import bar_facts, bars, with_columns

DRILLED = artefact_facts(kind="plate", nominal=True, cte_per_k=10e-6)
ATTITUDES = ((0.0, 0.0, 0.0), (0.0, 0.0, 90.0), (90.0, 0.0, 0.0), (180.0, 0.0, 0.0), (20.0, -30.0, 40.0))
PLATE = plate(ATTITUDES, pitch=110.0, side=3)
TURNS = [Rotation.from_euler("xyz", angles, degrees=True) for angles in ATTITUDES]


def of(name: str, artefact: Artefact | None = None) -> Effect:
    return (artefact or artefact_of(DRILLED, PLATE)).acting(EVERY[name])


def in_own_axes(e: Floats) -> Floats:
    """Displacements (5·9, 3) of the plate's points, turned back into its own axes, by set-up (5, 9, 3)."""
    return np.stack([turn.inv().apply(part) for turn, part in zip(TURNS, e.reshape(len(TURNS), -1, 3), strict=True)])


@pytest.mark.parametrize("name", GEOMETRY)
def test_in_its_reference_set_up_the_artefact_looks_like_the_machine_with_the_other_sign(name: str) -> None:
    """That is the one set-up of five that is not turned against the plate's axes."""
    first = PLATE.measurement == 1
    own, machine = of(f"artefact_{name}").basis(PLATE), EVERY[name].basis(PLATE)
    np.testing.assert_allclose(own[first], -machine[first], rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("name", ["artefact_pattern", *(f"artefact_{name}" for name in GEOMETRY)])
def test_what_is_wrong_with_the_plate_turns_with_it(name: str) -> None:
    effect = of(name)
    e = effect.basis(PLATE) @ np.random.default_rng(2).standard_normal(len(effect.coefficients))
    own = in_own_axes(e)
    np.testing.assert_allclose(own, np.broadcast_to(own[0], own.shape), rtol=0, atol=1e-9 * np.abs(e).max())


def test_a_plate_whose_side_is_too_long_is_found_too_long_in_every_attitude() -> None:
    """artefact_scale_x = 50 ppm: the true place is 50 ppm of x nearer than where it is indicated."""
    own = in_own_axes(of("artefact_scale_x").displacement(PLATE, {"ppm": 50.0}))
    x = PLATE.columns["reference_x_mm"][:9]
    np.testing.assert_allclose(np.ptp(own[:, :, 0] + 50e-6 * x, axis=1), 0.0, atol=1e-12)
    assert np.abs(own[:, :, 1:]).max() < 1e-12


def test_a_pattern_is_any_deviation_of_the_holes_that_is_no_shift_turn_or_scale_of_the_plate() -> None:
    """Coefficients of one size make deviations of one covariance: the identity less its part in those seven."""
    effect = of("artefact_pattern")
    own = -1e3 * np.stack([in_own_axes(column)[0].ravel() for column in np.moveaxis(effect.basis(PLATE), 2, 0)], axis=1)
    places = (PLATE.xyz - MIDDLE)[:9]
    A = np.column_stack([*(np.tile(axis, 9) for axis in np.eye(3)), *(np.cross(axis, places).ravel() for axis in np.eye(3)),
                         places.ravel()])  # fmt: skip
    assert own.shape == (27, 20)
    np.testing.assert_allclose(own @ own.T, np.eye(27) - A @ np.linalg.pinv(A), atol=1e-9)


def test_a_plate_bends_downwards_as_it_lies_whichever_side_is_up_and_not_at_all_upright() -> None:
    """8 µm in the middle, nothing at the corners, which are farthest from it: true = indicated + 8 µm upwards."""
    e = of("artefact_bending").displacement(PLATE, {"um": 8.0}).reshape(5, 9, 3)
    middle, corner = 4, 0
    np.testing.assert_allclose(e[[0, 1, 3], middle], np.tile([0, 0, 8e-3], (3, 1)), atol=1e-12)
    np.testing.assert_allclose(e[:, corner], 0.0, atol=1e-12)
    np.testing.assert_allclose(e[2], 0.0, atol=1e-12)
    normal = TURNS[4].apply([0.0, 0.0, 1.0])
    np.testing.assert_allclose(e[4, middle], 8e-3 * normal[2] * normal, atol=1e-12)


def test_a_fixture_bends_each_set_up_in_its_own_way() -> None:
    effect = of("artefact_fixture")
    one = np.zeros(len(effect.coefficients))
    one[3:6] = 7.0  # u², v² and uv of the second set-up
    e = (effect.basis(PLATE) @ one).reshape(5, 9, 3)
    assert np.abs(np.delete(e, 1, axis=0)).max() == 0
    corners = e[1][[0, 2, 6, 8], 2]
    # u² + v² is 1 in the corners; u·v is ½ in two of them, −½ in the others; the sign of one axis is as it may be
    np.testing.assert_allclose(np.sort(np.abs(corners)), 7e-3 * np.array([0.5, 0.5, 1.5, 1.5]), rtol=1e-9)


def test_a_warmer_artefact_is_longer_by_its_expansion() -> None:
    e = of("artefact_temperature").displacement(PLATE, {"k": 2.0})
    about = PLATE.xyz - np.repeat([PLATE.xyz[PLATE.measurement == m].mean(axis=0) for m in range(1, 6)], 9, axis=0)
    np.testing.assert_allclose(e, -20e-6 * about, atol=1e-15)


def test_a_warmer_bar_is_shorter_at_20_degrees_than_it_looks() -> None:
    points = bars(np.random.default_rng(1), 5, 300.0, PLATE.machine)
    e = of("artefact_temperature", artefact_of(bar_facts(300.0), points)).displacement(points, {"k": 3.0})
    ends = (points.xyz + e).reshape(-1, 2, 3)
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    np.testing.assert_allclose(
        length, 300.0 * (1 - 3 * 11.5e-6), rtol=1e-12, err_msg="steel, where the job states nothing"
    )


def test_temperatures_of_set_ups_are_those_about_their_mean() -> None:
    effect = of("artefact_set_up_temperature")
    coefficients, _ = effect.from_reported({"rms_k": 2.0})
    e = (effect.basis(PLATE) @ coefficients).reshape(5, 9, 3)
    about = PLATE.xyz.reshape(5, 9, 3) - PLATE.xyz.reshape(5, 9, 3).mean(axis=1, keepdims=True)
    kelvin = np.einsum("qni,qni->q", e, about) / np.einsum("qni,qni->q", about, about) / -10e-6
    np.testing.assert_allclose(e, -10e-6 * kelvin[:, None, None] * about, atol=1e-15)
    assert kelvin.mean() == pytest.approx(0.0, abs=1e-9)
    assert np.sqrt(np.mean(kelvin**2)) == pytest.approx(2.0)


def test_lobes_of_a_sphere_turn_with_it() -> None:
    points = spheres(2)
    turned = with_columns(points, turned_deg=np.where(points.measurement == 2, 40.0, 0.0))
    facts = artefact_facts(kind="sphere", length_mm=25.0, u_um=0.1, form_um=0.2)
    effect = of("artefact_lobing", artefact_of(facts, turned))
    e = effect.displacement(turned, {"amplitude_um": 0.5, "phase_rad": 0.3})
    n = np.column_stack([points.columns[f"n{a}"] for a in "xyz"])
    azimuth = np.arctan2(n[:, 1], n[:, 0]) - np.radians(turned.columns["turned_deg"])
    np.testing.assert_allclose(e, -0.5e-3 * np.cos(3 * azimuth + 0.3)[:, None] * n, atol=1e-15)
    lobing = EVERY["probe_lobing"].displacement(points, {"amplitude_um": 0.5, "phase_rad": 0.3})
    unturned = effect.displacement(points, {"amplitude_um": 0.5, "phase_rad": 0.3})
    np.testing.assert_allclose(unturned, -lobing, atol=1e-15, err_msg="unturned, it is the probe's with the other sign")


def test_harmonics_of_a_sphere_have_a_mean_square_of_one_and_no_part_of_size_and_place() -> None:
    """By Gauss–Legendre quadrature over the sphere, exact for these degrees."""
    z, weight = special.roots_legendre(12)
    azimuth = 2 * np.pi * np.arange(24) / 24
    Z, A = (grid.ravel() for grid in np.meshgrid(z, azimuth))
    W = np.tile(weight, 24) / 48
    s = np.sqrt(1 - Z**2)
    n = np.column_stack([s * np.cos(A), s * np.sin(A), Z])
    points = recording(MIDDLE + 12.5 * n, np.ones(len(n), dtype=int), np.arange(1, len(n) + 1),
                       nx=n[:, 0], ny=n[:, 1], nz=n[:, 2])  # fmt: skip
    effect = of("artefact_form", artefact_of(artefact_facts(kind="sphere"), points))
    heights = 1e3 * np.einsum("ni,nik->nk", n, effect.basis(points))
    assert heights.shape[1] == 5 + 7 + 9 + 11
    np.testing.assert_allclose(heights.T @ (W[:, None] * heights), np.eye(32), atol=1e-12)
    np.testing.assert_allclose(np.column_stack([np.ones(len(n)), n]).T @ (W[:, None] * heights), 0, atol=1e-12)


def test_lobes_of_a_ring_turn_with_it_and_have_a_mean_square_of_one() -> None:
    """A standing ring, axis along Y: angles from X towards −Z about it; two to six lobes written out."""
    turn = 2 * np.pi * (np.arange(48) % 24 + 0.4) / 24
    n = -np.column_stack([np.cos(turn), np.zeros(48), -np.sin(turn)])
    by = {f"n{a}": n[:, i] for i, a in enumerate("xyz")}
    points = recording(
        MIDDLE - 25.0 * n,
        np.repeat([1, 2], 24),
        np.tile(np.arange(24) + 1, 2),
        turned_deg=np.repeat([0.0, 40.0], 24),
        **by,
    )
    effect = of("artefact_roundness", artefact_of(artefact_facts(kind="ring", length_mm=50.0, form_um=0.4), points))
    assert effect.coefficients[0].prior_sd == pytest.approx(0.1 / np.sqrt(10))
    angle = np.arctan2(-n[:, 2] * -1.0, n[:, 0]) * -1.0 - np.radians(points.columns["turned_deg"])
    waves = [np.sqrt(2) * f(k * angle) for k in range(2, 7) for f in (np.cos, np.sin)]
    shown = -1e3 * np.einsum("ni,nik->nk", n, effect.basis(points))
    np.testing.assert_allclose(shown, np.column_stack(waves), atol=1e-12)
    np.testing.assert_allclose(shown[:24].T @ shown[:24] / 24, np.eye(10), atol=1e-12)


def test_a_gauges_pattern_goes_along_its_line() -> None:
    gauge = artefact_of(
        artefact_facts(kind="step_gauge"), points := step_gauge(faces=np.array([0.0, 100, 180, 300, 420]))
    )
    effect = of("artefact_pattern", gauge)
    assert len(effect.coefficients) == 3
    shown = gauge.project(points.xyz, effect.basis(points)).reshape(7, 5, 3)
    np.testing.assert_allclose(shown, np.broadcast_to(shown[0], shown.shape), atol=1e-12)
    places = np.column_stack([np.ones(5), [0.0, 100, 180, 300, 420]])
    np.testing.assert_allclose(1e6 * shown[0] @ shown[0].T, np.eye(5) - places @ np.linalg.pinv(places), atol=1e-9)


@pytest.mark.parametrize("name", [name for name, effect in OWN.items() if isinstance(effect, CommonSize)])
def test_a_truth_of_a_common_size_is_drawn_with_exactly_that_size_by_its_seed(name: str) -> None:
    own = {"artefact_form": ("sphere", spheres(2)), "artefact_roundness": ("ring", rings())}
    kind, points = own.get(name, ("", PLATE))
    artefact = artefact_of(artefact_facts(kind=kind) if kind else DRILLED, points)
    effect = of(name, artefact)
    size = effect.reported[0].name
    one, again, other = (effect.from_reported({size: 4.0, "seed": seed})[0] for seed in (1.0, 1.0, 2.0))
    assert float(effect.to_reported(one, np.zeros(0))[size]) == pytest.approx(4.0)
    np.testing.assert_array_equal(one, again)
    assert not np.allclose(one, other)
    with pytest.raises(CmmUqError, match="no whole number"):
        effect.from_reported({size: 4.0, "seed": 0.5})
    with pytest.raises(CmmUqError, match="no parameter 'rms'"):
        effect.from_reported({"rms": 4.0})
    with pytest.raises(CmmUqError, match=f"needs the parameter '{size}'"):
        effect.from_reported({})


@pytest.mark.long
@pytest.mark.parametrize("size", [0.3, 1.0, 4.0])
def test_the_interval_of_a_common_size_holds_it_whatever_noise_the_coefficients_have(size: float) -> None:
    """Sixty-eight errors of a known mean square, each estimated with noise of one: 100 recordings, binomial limit of 0.1 %."""
    random = np.random.default_rng(68)
    effect = of("artefact_pattern", artefact_of(DRILLED, plate(pitch=100.0, side=5)))
    held, means, j = 0, [], len(effect.coefficients)
    for _ in range(100):
        errors = effect.from_reported({"rms_um": size, "seed": random.integers(10**6)})[0]
        draws = errors + random.standard_normal(j) + random.standard_normal((2000, j))
        found = effect.to_reported(draws, np.zeros((2000, 0)))["rms_um"]
        lower, upper = np.quantile(found, [0.025, 0.975])
        held += bool(lower <= size <= upper)
        means.append(found.mean())
    assert held >= binom.ppf(1e-3, 100, 0.95)
    assert np.mean(means) == pytest.approx(size, abs=0.1)  # noise of one has not been added to it: not 1.04, 1.41, 4.12


@pytest.mark.parametrize(("facts", "points", "has"), [
    (bar_facts(), bars(np.random.default_rng(0), 4, 400.0, PLATE.machine), {"artefact_temperature"}),
    (artefact_facts(kind="bryan", length_mm=400.0, u_um=0.5), swept(), set()),
], ids=["ballbar", "bryan"])  # fmt: skip
def test_a_kind_has_only_the_faults_that_it_can_have(facts: object, points: Points, has: set[str]) -> None:
    artefact = artefact_of(facts, points)  # type: ignore[arg-type]
    assert set(artefact.faults) == has
    with pytest.raises(CmmUqError, match="has no artefact_pattern"):
        RecordingModel(artefact, effects(["artefact_pattern"]))


def test_a_certificate_leaves_less_than_a_drawing_and_is_rarely_thought_of() -> None:
    certified = artefact_of(artefact_facts(kind="plate", u_um=0.5), PLATE).faults["artefact_pattern"]
    drilled = of("artefact_pattern")
    assert certified.prior_weight == pytest.approx(0.3)
    assert drilled.prior_weight == pytest.approx(2.0)
    assert certified.mostly * certified.coefficients[0].prior_sd == pytest.approx(1.5), "three standard uncertainties"
    assert drilled.mostly == 1
