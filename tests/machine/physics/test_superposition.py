"""Axes that lean far: squares and products of squarenesses, and theirs with scale errors and rotations.

The machine of every check is built here from its unit vectors alone: the Cholesky factor of the cosines between the axes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.machine.physics.kinematics import axis_directions, direction_derivatives, exact
from cmm_uq.machine.physics.superposition import Superposition
from tests.recordings import TRAVEL

SIX = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")
ARCSEC = np.pi / 180 / 3600

angles = st.floats(-2000.0, 2000.0)
ppm = st.floats(-500.0, 500.0)


def unit_vectors(squareness_arcsec: Floats) -> Floats:
    """Rows x, y, z that enclose 90° + S, x along the first coordinate and y in the plane z = 0."""
    xy, yz, zx = np.cos(np.pi / 2 + ARCSEC * np.asarray(squareness_arcsec))
    return np.linalg.cholesky(np.array([[1, xy, zx], [xy, 1, yz], [zx, yz, 1]]))


def somewhere(count: int = 7, **columns: Floats) -> Points:
    xyz = np.random.default_rng(3).uniform(TRAVEL[:, 0], TRAVEL[:, 1], (count, 3))
    number = np.arange(1, count + 1)
    return Points(xyz, number, np.ones_like(number), np.ones_like(number), Machine("m", "XYZ", TRAVEL), columns)


@settings(max_examples=50, deadline=None)
@given(st.tuples(ppm, ppm, ppm), st.tuples(angles, angles, angles))
def test_the_true_place_is_the_sum_of_unit_vectors_times_scaled_readings(scales, squareness) -> None:
    points = somewhere()
    scaled = points.xyz * (1 + 1e-6 * np.array(scales))
    true = scaled @ unit_vectors(np.array(squareness))
    e = Superposition(effects(SIX)).errors(points, np.array([*scales, *squareness]))
    np.testing.assert_allclose(points.xyz + e, true, atol=1e-9)


def test_readings_count_from_the_machines_origin() -> None:
    points = somewhere()
    moved = Machine("m", "XYZ", TRAVEL, np.array([100.0, -40.0, 60.0]))
    values = np.array([500.0, -300.0, 200.0, 1500.0, -1500.0, 600.0])
    read = points.xyz + moved.origin_mm
    expected = (read * (1 + 1e-6 * values[:3])) @ unit_vectors(values[3:]) - read
    found = Superposition(effects(SIX)).errors(replace(points, machine=moved), values)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_small_angles_move_points_as_the_effects_are_defined() -> None:
    """e_x = −Sxy·y − Szx·z and e_y = −Syz·z: what is left is the square of an angle."""
    points, (xy, yz, zx) = somewhere(), ARCSEC * np.array([3.0, -2.0, 1.0])
    _, y, z = points.xyz.T
    e = Superposition(effects(SIX)).errors(points, np.array([0, 0, 0, 3.0, -2.0, 1.0]))
    np.testing.assert_allclose(e, np.column_stack([-xy * y - zx * z, -yz * z, 0 * z]), atol=1e-6)


def test_an_angle_that_follows_temperature_adds_to_the_one_that_stays() -> None:
    warm = np.linspace(15.0, 30.0, 7)
    points = somewhere(temp_x_c=warm, temp_y_c=warm + 1, temp_z_c=warm - 1)
    e = Superposition(effects(("squareness_xy", "thermal_squareness_xy"))).errors(points, np.array([1200.0, 40.0]))
    for i in range(7):
        axes = unit_vectors(np.array([1200.0 + 40.0 * (warm[i] - 20), 0.0, 0.0]))
        np.testing.assert_allclose(points.xyz[i] + e[i], points.xyz[i] @ axes, atol=1e-9)


def test_a_rotation_acts_on_what_the_leaning_motions_carry() -> None:
    """Carriages x and y turn about z and x, and carry what they carry where it is: the rigid transformations."""
    points, squareness = somewhere(), np.array([1500.0, -1200.0, 900.0])
    per_m = np.array([30.0, -20.0])
    acting = Superposition(
        effects(("rotation_x_z", "rotation_y_x", "squareness_xy", "squareness_yz", "squareness_zx", "scale_y"))
    )
    e = acting.errors(points, np.array([*per_m, *squareness, 400.0]))
    errors = np.zeros((len(points), 3, 6))
    errors[:, 0, 5] = ARCSEC * per_m[0] * points.xyz[:, 0] / 1000
    errors[:, 1, 3] = ARCSEC * per_m[1] * points.xyz[:, 1] / 1000
    errors[:, 1, 1] = 400e-6 * points.xyz[:, 1]
    rigid = exact(points.xyz, errors, ARCSEC * squareness)
    # products of two rotations, and of a rotation with a position error: (4e-5 + 2e-4)·9e-5·500 mm
    np.testing.assert_allclose(e, rigid, atol=1.5e-5)
    assert np.abs(e - Superposition(acting.effects[:2]).errors(points, per_m)).max() > 1


def test_what_the_probe_does_keeps_to_the_workpiece() -> None:
    """The stylus radius acts along the surface's normal however the axes lean."""
    normals = np.full(7, 1 / np.sqrt(3))
    points = somewhere(nx=normals, ny=normals, nz=normals)
    both = Superposition(effects(("squareness_xy", "probe_radius"))).errors(points, np.array([1500.0, 7.0]))
    alone = Superposition(effects(("squareness_xy",))).errors(points, np.array([1500.0]))
    np.testing.assert_allclose(both - alone, 7e-3 / np.sqrt(3), atol=1e-12)


@settings(max_examples=20, deadline=None)
@given(st.tuples(angles, angles, angles))
def test_the_derivatives_are_those_of_the_directions(squareness) -> None:
    radians, step = ARCSEC * np.array(squareness), 1e-5
    found = direction_derivatives(radians)
    for i, one in enumerate(step * np.eye(3)):
        slope = (axis_directions(radians + one) - axis_directions(radians - one)) / (2 * step)
        np.testing.assert_allclose(found[i], slope, atol=1e-9)


def test_columns_are_derivatives_of_the_errors_and_scales_add_up_to_the_place() -> None:
    """Of a machine with no error but its squarenesses, at the places that it indicates."""
    warm = np.linspace(15.0, 30.0, 7)
    true = somewhere(temp_x_c=warm, temp_y_c=warm, temp_z_c=warm)
    acting = Superposition(effects((*SIX, "thermal_squareness_zx", "rotation_y_x", "periodic_scale_z", "hysteresis_y")),
                           {"periodic_scale_z": (40.0,)})  # fmt: skip
    true = replace(true, columns={**true.columns, "approach_y": np.ones(7)})
    values = np.array([0, 0, 0, 1500.0, -900.0, 700.0, 30.0, 0, 0, 0, 0])
    columns = acting.derivatives(acting.about(true, values))
    np.testing.assert_allclose(1e6 * columns[:, :, :3].sum(axis=2), true.xyz, atol=1e-8)
    indicated = true.xyz.copy()
    for _ in range(50):
        indicated = true.xyz - acting.errors(true.at(indicated), values)
    for i, step in enumerate(1e-2 * np.eye(len(values))):
        ahead, behind = (acting.errors(true.at(indicated), values + sign * step) for sign in (1, -1))
        np.testing.assert_allclose(columns[:, :, i], (ahead - behind) / 2e-2, rtol=1e-7, atol=1e-11)


def test_an_effect_beside_others_acts_as_if_it_were_one_of_them() -> None:
    true, values = somewhere(), np.array([0, 0, 0, 1500.0, -900.0, 700.0])
    six, more = effects(SIX), effects(("rotation_y_x", "scale_curvature_z"))
    both = Superposition((*six, *more))
    together, about = (
        both.derivatives(both.about(true, np.append(values, [0.0, 0.0]))),
        Superposition(six).about(true, values),
    )
    for i, effect in enumerate(more):
        beside = about.columns(effect)
        np.testing.assert_array_equal(beside, together[:, :, 6 + i : 7 + i])
        assert np.abs(beside - effect.basis(true)).max() > 1e-3 * np.abs(beside).max()
    np.testing.assert_array_equal(Superposition(six).about(true, 0 * values).columns(more[0]), more[0].basis(true))


def test_the_largest_lean_of_a_plane_sums_what_acts_in_it() -> None:
    points = somewhere(temp_x_c=np.full(7, 25.0), temp_y_c=np.full(7, 25.0), temp_z_c=np.full(7, 14.0))
    acting = Superposition(effects(("scale_x", "squareness_xy", "thermal_squareness_xy", "squareness_zx")))
    found = acting.largest_lean(points, np.array([1e6, 50.0, 10.0, 60.0]))
    assert found == pytest.approx(ARCSEC * (50 + 10 * 4 / 3))
    assert Superposition(effects(("scale_x",))).largest_lean(points, np.array([1e6])) == 0


def test_chosen_points_keep_their_directions() -> None:
    each = np.arange(63.0).reshape(7, 3, 3)
    points = replace(somewhere(), directions=each)
    np.testing.assert_array_equal(points.select(np.array([4, 1])).directions, each[[4, 1]])
    one = replace(somewhere(), directions=each[0])
    np.testing.assert_array_equal(one.select(np.array([4, 1])).directions, each[0])


def test_without_squareness_everything_adds_up() -> None:
    points = somewhere()
    acting = Superposition(effects((*SIX, "straightness_x_y", "rotation_x_z")))
    values = np.array([100.0, -200.0, 300.0, 0, 0, 0, 5.0, 10.0])
    each = [e.displacement(points, {e.coefficients[0].name: v}) for e, v in zip(acting.effects, values, strict=True)]
    np.testing.assert_allclose(acting.errors(points, values), sum(each), atol=1e-15)


@pytest.mark.parametrize("name", ["scale_x", "straightness_x_y"])
def test_what_is_no_squareness_has_no_lean(name: str) -> None:
    from cmm_uq.base.errors import CmmUqError

    with pytest.raises(CmmUqError, match="is no squareness"):
        effects((name,))[0].lean(somewhere())
