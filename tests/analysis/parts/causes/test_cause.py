"""Form, lobing, noise and errors that nobody modelled: what each does to a feature, known from elsewhere.

Random fields on many points: their components are those of the whole covariance.
"""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.analysis.machine.state import StatedNoise, coefficients_of, noise_of_draws, unmodelled_errors
from cmm_uq.analysis.parts.causes.cause import MANY, PointScatter, components, field_components
from cmm_uq.analysis.parts.causes.machine import DEGREES, directions, styli
from cmm_uq.analysis.parts.causes.surroundings import SurfaceForm, elapsed
from cmm_uq.analysis.parts.plan import PartCharacteristic, PartFeature, PartPose, Plan, Stylus
from cmm_uq.analysis.parts.virtual import AtPose, MeasurementConditions
from cmm_uq.machine.physics.catalogue import CATALOGUE, effects
from cmm_uq.maths.inference.draws import Draws
from tests.parts_drawn import POSE, UP, ball, bore, circle, machine, moving_part, plane, ring, spot


def drawn(plan: Plan, given: MeasurementConditions, n: int = 20_000, *, exact: bool = False) -> np.ndarray:
    at = AtPose(plan, given, POSE)
    return at.errors(at.drawn(np.random.default_rng(0), n), exact=exact)


def round_hole(count: int, *, whole: int = 0) -> PartFeature:
    if not whole:
        return circle("c", [0, 0, 0], 10.0, count, hole=False)
    surface, out = ring([0, 0, 0], 10.0, 0.0, whole, 0.001)
    return circle("c", [0, 0, 0], 10.0, count, hole=False, surface=surface, surface_normals=out)


@pytest.mark.parametrize(("count", "u"), [(3, 2 * 5e-3), (4, 0.0), (6, 0.0)])
def test_three_points_take_three_lobes_for_size(count: int, u: float) -> None:
    """A cosine of 3θ, its amplitude of standard deviation 5 µm, is the same at 120° steps, and no size to 4 or 6 points."""
    plan = Plan((round_hole(count, whole=90),), (PartCharacteristic("d", "size", ("c",)),))
    given = MeasurementConditions(machine(), forms=(SurfaceForm("c", ((3, 5.0),)),))
    assert drawn(plan, given).std() == pytest.approx(u, abs=1e-4)


def test_few_points_find_less_form_than_there_is() -> None:
    """The whole surface has the range of its cosine, 2·A; four points of two lobes see 2·A·|cos φ|, on average 2/π of it."""
    one = (PartCharacteristic("round", "roundness", ("c",)),)
    given = MeasurementConditions(machine(), forms=(SurfaceForm("c", ((2, 5.0),)),))
    found = drawn(Plan((round_hole(4, whole=180),), one), given, 4000)[:, 0]
    assert (found <= 2e-5).all()  # of 180 points the nearest to a crest is a degree away
    # the amplitude is Rayleigh's, of mean σ·√(π/2); the phase is any
    assert found.mean() == pytest.approx(2 * 5e-3 * np.sqrt(np.pi / 2) * (2 / np.pi - 1), rel=0.03)


def test_lobing_has_neither_size_nor_offset_and_the_variance_that_was_stated() -> None:
    """Seven rings at Chebyshev's heights (Abramowitz and Stegun 25.4.28) have the mean of every harmonic up to degree 7."""
    heights = np.array([0.883861700758, 0.529656775285, 0.323911810519])
    rings = [ring([0, 0, 0], np.sqrt(1 - z**2), z, 8)[0] for z in (*heights, 0.0, *-heights)]
    toward = np.vstack(rings)
    sphere = ball("b", [0, 0, 0], 10.0, toward)
    plan = Plan((sphere,), (PartCharacteristic("d", "size", ("b",)),), (Stylus("stylus", lobing_um=2.0),))
    at = AtPose(plan, MeasurementConditions(machine()), POSE)
    lobing = at.causes[-1]
    moved = lobing.moved(np.eye(len(lobing.factors)), slice(None))
    along = np.einsum("kni,ni->kn", moved, toward)
    np.testing.assert_allclose(np.sqrt((along**2).sum(axis=0)), 2e-3, rtol=1e-9)
    assert at.errors(at.drawn(np.random.default_rng(1), 500)).std() < 1e-9  # mm, of 2 µm


def test_a_random_field_has_its_covariance() -> None:
    kernel = np.exp(-0.5 * np.subtract.outer(np.arange(6.0), np.arange(6.0)) ** 2)
    shapes = components(kernel)
    np.testing.assert_allclose(shapes.T @ shapes, kernel, atol=1e-12)


def test_noise_keeps_to_the_axes_of_the_machine() -> None:
    """Noise of z alone is along the part's x where the part stands upright."""
    upright = PartPose(np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]]), np.array([300.0, 200, -300]))
    plan = Plan(
        (spot("one", [0, 0, 0]), spot("other", [100, 0, 0])), (PartCharacteristic("", "distance", ("one", "other")),)
    )
    given = MeasurementConditions(machine(noise=StatedNoise(np.array([0.0, 0.0, 2e-3]))), repeats=4)
    for pose, u in ((upright, 2e-3 * np.sqrt(2) / 2), (POSE, 0.0)):
        at = AtPose(plan, given, pose)
        assert at.errors(at.drawn(np.random.default_rng(0), 20_000)).std() == pytest.approx(u, rel=0.02, abs=1e-6)
        assert isinstance(at.causes[1], PointScatter)


def test_slow_noise_is_common_to_points_that_follow_each_other() -> None:
    """A difference over a time t has the variance 2σ²(1 − exp(−t/τ)) of an Ornstein–Uhlenbeck process."""
    points = (spot("one", [0, 0, 0]), spot("other", [100, 0, 0]))
    noise = StatedNoise(slow_mm=2e-3, slow_time_s=600.0)
    for seconds in (6.0, 600.0):
        plan = Plan(points, (PartCharacteristic("", "distance", ("one", "other")),), times_s=np.array([0.0, seconds]))
        u = drawn(plan, MeasurementConditions(machine(noise=noise))).std()
        assert u == pytest.approx(2e-3 * np.sqrt(2 * (1 - np.exp(-seconds / 600))), rel=0.02)


def test_what_was_not_modelled_is_as_large_as_its_calibration_would_not_have_shown() -> None:
    detected = {"rotation_x_y": 3.29, "straightness_x_y": 1000.0, "squareness_xy": None}
    found = {one.effect.name: one for one in unmodelled_errors(["scale_x"], detected)}
    assert found["rotation_x_y"].sd == pytest.approx([2.0], rel=1e-3)  # detected nine times of ten at 1.645 of these
    assert found["rotation_x_y"].bounded
    assert found["straightness_x_y"].sd == [CATALOGUE["straightness_x_y"].coefficients[0].prior_sd]
    assert not found["squareness_xy"].bounded
    assert "scale_x" not in found  # it was modelled
    assert not {"probe_radius", "artefact_sag", "thermal_scale_x"} & found.keys()  # other causes draw these


def test_an_error_with_a_period_has_one_period_a_draw() -> None:
    plan = Plan(
        (spot("one", [0, 0, 0]), spot("other", [31, 0, 0])), (PartCharacteristic("", "distance", ("one", "other")),)
    )
    state = machine(unmodelled=tuple(u for u in unmodelled_errors([], {}) if u.effect.name == "periodic_scale_x"))
    at = AtPose(plan, MeasurementConditions(state), POSE)
    coefficients = np.asarray(at.drawn(np.random.default_rng(0), 1000)[1]).reshape(1000, -1, 2)
    assert (np.count_nonzero(np.any(coefficients != 0, axis=2), axis=1) == 1).all()
    assert coefficients[coefficients != 0].std() == pytest.approx(10.0, rel=0.05)
    assert list(at.lacking) == []


def test_an_error_of_which_the_column_is_not_there_is_named() -> None:
    plan = Plan(
        (plane("A", [0, 0, 1], [0, 0, 0], [[100, 0, 0], [0, 100, 0]]),), (PartCharacteristic("", "flatness", ("A",)),)
    )
    at = AtPose(plan, MeasurementConditions(machine(unmodelled=unmodelled_errors([], {}))), POSE)
    assert at.lacking == {f"drift_{axis}": "time_s" for axis in "xyz"}


def test_a_posterior_becomes_coefficients_and_noise() -> None:
    """By name and in the order of the effects; amplitude and phase become cosine and sine."""
    array = np.array([[[2.0, np.pi / 6, 5.0, 1.0, 3.0]]])
    units = {"probe_lobing.amplitude_um": "µm", "probe_lobing.phase_rad": "rad", "scale_x.ppm": "ppm",
             "noise.coordinate_um": "µm", "noise.z_um": "µm"}  # fmt: skip
    flat = {name: values.ravel() for name, values in Draws(units, array).items()}
    found = coefficients_of(effects(["scale_x", "probe_lobing"]), flat)
    np.testing.assert_allclose(found, [[5.0, 2 * np.cos(np.pi / 6), 2 * np.sin(np.pi / 6)]])
    np.testing.assert_allclose(noise_of_draws(flat).usual_mm, [1e-3, 1e-3, 3e-3])


def test_the_reference_sphere_is_probed_at_25_points_of_its_upper_half() -> None:
    toward = directions()
    assert len(np.unique(toward.round(9), axis=0)) == 25
    np.testing.assert_allclose(np.linalg.norm(toward, axis=1), 1)
    assert toward[:, 2].min() >= -1e-12


@pytest.mark.parametrize(
    ("order", "times", "part"), [((0, 1, 2), (), 0.5), ((0, 2, 1), (), 1.0), ((), (0.0, 30.0, 120.0), 0.25)]
)
def test_what_is_probed_later_has_moved_farther(order: tuple[int, ...], times: tuple[float, ...], part: float) -> None:
    """Of three points the second is off by that part of the whole movement which is over when it is probed."""
    spots = (spot("a", [0, 0, 0]), spot("b", [100, 0, 0]), spot("c", [200, 0, 0]))
    plan = Plan(spots, (PartCharacteristic("", "distance", ("a", "b")),),
                order=np.array(order, dtype=np.int64), times_s=np.array(times))  # fmt: skip
    given = MeasurementConditions(machine(), further=(moving_part(plan, 4.0),))
    assert drawn(plan, given).std() == pytest.approx(4e-3 * part, rel=0.02)
    turned = moving_part(plan, 0.0, 1.0).moved(np.array([[0.0, 0, 0, 0, 0, 1.0]]), slice(None))[0]
    assert turned[-1, 1] == pytest.approx(100 * 4.848e-6 * elapsed(plan)[-1], rel=1e-3)


FACE = plane("A", UP, [0, 0, 0], [[120, 0, 0], [0, 80, 0]], (40, 30))


def test_components_of_a_field_on_many_points_add_up_to_its_covariance() -> None:
    """Second method: eigenvectors of the whole covariance. Of all variance two millionths are left out, and none is added."""
    form = SurfaceForm("A", field_um=1.0, correlation_mm=25.0)
    assert len(FACE.points) > MANY
    found, whole = form.components(FACE, FACE.points), form.kernel(FACE, FACE.points)
    assert len(found) < len(FACE.points) / 5
    left = np.trace(whole) - np.trace(found.T @ found)
    assert 0 <= left < 2e-6 * np.trace(whole)
    np.testing.assert_allclose(found.T @ found, whole, rtol=0, atol=1e-5 * whole.max())
    by_eigenvectors = components(whole)
    np.testing.assert_allclose(found.T @ found, by_eigenvectors.T @ by_eigenvectors, rtol=0, atol=1e-5 * whole.max())


def test_a_field_without_correlation_has_as_many_components_as_points() -> None:
    """Closed form: of a diagonal covariance the components are the standard deviations, a point each."""
    variances = np.linspace(1.0, 4.0, MANY + 1)
    found = field_components(lambda some: np.diag(variances)[some], variances)
    np.testing.assert_allclose(found.T @ found, np.diag(variances), atol=1e-12)
    assert found.shape == (MANY + 1, MANY + 1)


def test_lobing_on_many_points_has_no_more_components_than_its_spherical_harmonics() -> None:
    """Closed form: 2l + 1 harmonics of each degree l; pre-travel of one point has the whole variance."""
    feature = bore("bore", [10, 20, 0], 8.0, count=400)
    stylus = Stylus("stylus", np.zeros(3), 4.0, lobing_um=0.8)
    (cause,) = styli(Plan((feature,), (), (stylus,)), PartPose())
    assert len(cause.factors) <= sum(2 * degree + 1 for degree in DEGREES)
    shown = cause.moved(np.eye(len(cause.factors)), slice(None))
    np.testing.assert_allclose(np.sqrt(np.sum(shown**2, axis=(0, 2))), 0.8e-3, rtol=1e-7)
