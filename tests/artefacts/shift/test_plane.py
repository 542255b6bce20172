"""Two axes from a plate: what is found of known errors, what the table leaves, and what stays open."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from cmm_uq.artefacts.shift.integration import KnownSpan
from cmm_uq.artefacts.shift.placed_plate import placed_plate
from cmm_uq.artefacts.shift.plane import PlaneEstimate, estimate_plane, plane_correction_table
from cmm_uq.artefacts.shift.plane_model import FreeInPlane, free_in_plane, plane_model
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import AXES, Floats
from cmm_uq.machine.physics.compensation import compensate_points, machine_compensation
from cmm_uq.machine.physics.effects.rigid_body import SCALE
from cmm_uq.machine.physics.kinematics import exact, first_order
from cmm_uq.machine.physics.map_interpolation import ErrorMaps
from cmm_uq.maths.inference.ensembles import run_ensembles
from tests.artefacts.shift.placed import GRID, SHIFTED, TURNED, bent, none, read

DIAGONAL = KnownSpan(0, 15, float(np.linalg.norm(GRID[15])), 0.3e-3)
NOISE = 0.5e-3


def free(placings: tuple[tuple[float, float, float], ...], known: KnownSpan | None = None) -> FreeInPlane:
    plate = placed_plate(read(none, "xy", "XYZ", placings), "xy")
    return free_in_plane(plate, plane_model(plate, known, "XYZ", 1e-4))


@pytest.fixture(scope="module")
def estimate() -> PlaneEstimate:
    return estimate_plane(placed_plate(read(bent, "xy", "XYZ", TURNED, NOISE), "xy"), DIAGONAL)


def true_along(estimate: PlaneEstimate, which: int) -> Floats:
    """e (m, 2) of the machine along one axis through the middle of what was read."""
    x = estimate.positions[which]
    readings = np.tile(estimate.plate.middle, (len(x), 1))
    readings[:, which] = x
    errors, squareness = bent(readings)
    return first_order(readings, errors, squareness)[:, :2]


@pytest.mark.long
def test_the_chains_converge(estimate: PlaneEstimate) -> None:
    assert estimate.chains.converged


@pytest.mark.long
def test_linearity_with_its_scale_is_the_machines_error_along_the_middle(estimate: PlaneEstimate) -> None:
    for which, curve in enumerate(estimate.linearity):
        true = true_along(estimate, which)[:, which]
        assert np.all(np.abs(curve.error - (true - true[0]))[1:] < 4 * curve.u[1:])


def test_straightness_is_the_machines_error_across_about_the_line_through_its_ends(estimate: PlaneEstimate) -> None:
    for which, curve in enumerate(estimate.straightness):
        true = true_along(estimate, which)[:, 1 - which]
        true = true - true[0]
        true -= true[-1] * (curve.position - curve.position[0]) / np.ptp(curve.position)
        assert np.all(np.abs(curve.error - true)[1:-1] < 4 * curve.u[1:-1])


def test_yaw_is_the_x_carriages_rotation_about_z(estimate: PlaneEstimate) -> None:
    curve = estimate.rotations[0]
    true = bent(np.column_stack([curve.position, 0 * curve.position, 0 * curve.position]))[0][:, 0, 5]
    assert np.all(np.abs(curve.error - (true - true.mean())) < 4 * curve.u)
    assert 1 not in estimate.rotations  # in the chain XYZ carriage y carries nothing of the plane


def test_squareness_is_that_of_the_end_lines_on_average_over_the_yaw(estimate: PlaneEstimate) -> None:
    x, y = estimate.positions
    along_x, along_y = true_along(estimate, 0), true_along(estimate, 1)
    yaw = bent(np.column_stack([x, 0 * x, 0 * x]))[0][:, 0, 5]
    middle = bent(estimate.plate.middle[None])[0][0, 0, 5]
    S = -(along_x[-1, 1] - along_x[0, 1]) / np.ptp(x) - (along_y[-1, 0] - along_y[0, 0]) / np.ptp(y)
    S += yaw.mean() - middle  # along y through the middle the error has the yaw of the middle
    assert abs(estimate.squareness.mean() - S) < 4 * estimate.squareness.std()


def test_the_plate_is_found_to_its_uncertainty(estimate: PlaneEstimate) -> None:
    """A square grid of 100 mm: the by-product, from readings with errors of 20 µm."""
    mean, u = estimate.balls.mean(axis=0), estimate.balls.std(axis=0)
    fitted = mean - mean.mean(axis=0)
    true = GRID - GRID.mean(axis=0)
    turn = np.angle(np.sum((true @ [1, -1j]) * (fitted @ [1, 1j])))
    laid = fitted @ np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    assert np.abs(laid - true).max() < 4 * u.max()
    assert np.abs(laid - true).max() < 1.5e-3


def test_what_is_left_is_the_noise(estimate: PlaneEstimate) -> None:
    before, after = estimate.residuals
    assert np.sqrt(np.mean(after**2)) < 1.2 * NOISE < np.sqrt(np.mean(before**2))
    assert abs(estimate.sigma.mean() - NOISE) < 4 * estimate.sigma.std()


@pytest.fixture
def for_means(monkeypatch: pytest.MonkeyPatch) -> None:
    """128 walkers of 100 steps: what is held to a bound is a mean. Scatter and convergence are those of :func:`estimate`."""
    monkeypatch.setattr("cmm_uq.maths.inference.ensembles.MOST_STEPS", 100)
    short = partial(run_ensembles, steps_at_once=100)
    monkeypatch.setattr(
        "cmm_uq.artefacts.shift.smooth.run_ensembles",
        lambda *given, effective_samples, steps_at_once: short(*given, effective_samples=effective_samples),
    )


@pytest.mark.long
@pytest.mark.usefixtures("for_means")
@pytest.mark.parametrize(("plane", "chain"), [("xy", "YXZ"), ("zx", "XYZ"), ("xy", "XFYZ")])
def test_compensated_by_the_table_the_machine_measures_the_plate_rightly(plane: str, chain: str) -> None:
    """Another road to the same errors: the error map's own kinematics, on distances that no placing was part of."""
    points = read(bent, plane, chain, TURNED, 0.1e-3)
    plate = placed_plate(points, plane)
    estimate = estimate_plane(plate, DIAGONAL, chain=chain)
    elsewhere = read(bent, plane, chain, [(210.0, 155.0, 8.0), (515.0, 195.0, 98.0)])
    table = plane_correction_table(estimate, points.machine)
    compensated = compensate_points(elsewhere, machine_compensation(elsewhere, ErrorMaps([table])))
    axes = [AXES.index(a) for a in plane]
    for placing in (1, 2):
        off = [distances_off(p.xyz[p.measurement == placing][:, axes]) for p in (elsewhere, compensated)]
        assert off[1] < 0.001
        assert off[1] < off[0] / 8


@pytest.mark.long
@pytest.mark.usefixtures("for_means")
@pytest.mark.parametrize("degrees", [0.5, 1.0, 3.0])
def test_axes_far_out_of_square_are_found_exactly(degrees: float) -> None:
    """By the exact kinematics: the cosine of 3° is 1370 ppm along Y, which is no error of its scale."""

    def leaning(readings: Floats) -> tuple[Floats, Floats]:
        errors = np.zeros((len(readings), 3, 6))
        errors[:, 0, 0], errors[:, 1, 1] = 20e-6 * readings[:, 0], -15e-6 * readings[:, 1]
        return errors, np.radians([degrees, 0.0, 0.0])

    points = read(leaning, "xy", "XYZ", TURNED, 0.1e-3, kinematics=exact)
    found = estimate_plane(placed_plate(points, "xy"), DIAGONAL)
    for draws, true in ((found.squareness, np.radians(degrees)), (found.scales[0], 20e-6), (found.scales[1], -15e-6)):
        assert abs(draws.mean() - true) < 4 * draws.std()
        assert draws.std() < 10e-6


def distances_off(found: Floats) -> float:
    """Largest error of the distance of any two balls, mm."""
    off = np.abs(found @ [1, 1j] - (found @ [1, 1j])[:, None]) - np.abs(GRID @ [1, 1j] - (GRID @ [1, 1j])[:, None])
    return float(np.abs(off).max())


def test_a_plate_that_is_only_shifted_leaves_scales_and_squareness_free() -> None:
    assert free(SHIFTED).combinations == (("scale_x",), ("scale_y",), ("squareness_xy",))


def test_turned_by_180_degrees_it_still_does() -> None:
    found = free((*SHIFTED, (450.0, 450.0, 180.0)))
    assert {"scale_x", "scale_y", "squareness_xy"} <= found.names


def test_turned_by_90_degrees_only_the_common_scale_is_left() -> None:
    assert free(TURNED).combinations == (("scale_x", "scale_y"),)


def test_a_known_length_gives_the_common_scale() -> None:
    found = free(TURNED, DIAGONAL)
    assert found.combinations == ()
    assert found.determines(SCALE)


def test_shifted_along_x_alone_an_arc_with_its_yaw_looks_like_turned_placings() -> None:
    """e_y = c·x², yaw 2·c·x: the plate follows a curved guide as a rigid body; of y nothing is seen at all."""
    found = free((*SHIFTED[:2], (250.0, 150.0, 0.0)))
    assert ("straightness_x_y", "rotation_x_z") in found.combinations
    assert {"linearity_y", "straightness_y_x"} <= found.names
    assert "linearity_x" not in found.names


def test_shifted_along_both_axes_the_arc_is_seen() -> None:
    assert not {"straightness_x_y", "rotation_x_z", "linearity_y", "straightness_y_x"} & free(SHIFTED).names


def test_three_balls_in_two_placings_tell_nothing_of_the_machine() -> None:
    """12 coordinates, less 6 of the balls and 3 of the second placing."""
    points = read(none, "xy", "XYZ", SHIFTED[:2], balls=GRID[[0, 3, 12]])
    with pytest.raises(CmmUqError, match="leave 3 coordinates to compare") as caught:
        estimate_plane(placed_plate(points, "xy"))
    assert "one more placing" in str(caught.value.fix)


def test_shifts_along_an_axis_have_a_period_that_no_placing_shows_unless_one_is_turned() -> None:
    assert free((*SHIFTED, (250.0, 190.0, 0.0))).periods == pytest.approx((20.0, 40.0))
    assert free(TURNED).periods == (None, None)
