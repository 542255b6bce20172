"""A laser digitizer on the ram: points, scan plane and alignment (Harris 2004 chapters 4 and 5)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.spatial.transform import Rotation

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.recording.beside import parse_temperature_log
from cmm_uq.machine.physics.compensation import BLOCK, Compensation
from cmm_uq.machine.physics.digitizer import (
    Alignment,
    Digitizer,
    align_on_sphere,
    euler_313,
    mount_axes,
    mount_offset,
    scan_plane,
    scan_roll,
    three_alignment_offset,
)
from cmm_uq.machine.physics.error_map import AxisErrors, ErrorMap, read_error_map
from cmm_uq.machine.physics.kinematics import exact, rotate
from cmm_uq.machine.physics.map_interpolation import ErrorMaps
from cmm_uq.maths.geometry import cap_directions

HARRIS = Path(__file__).parent / "harris2004"
OFFSET = np.array([1.001, 264.505, 129.575])
ANGLES = st.floats(-3.1, 3.1)


def perfect_machine() -> Compensation:
    none = [AxisErrors(np.array([-1000.0, 1000]), np.zeros((2, 6))) for _ in range(3)]
    return Compensation(ErrorMaps([ErrorMap((none[0], none[1], none[2]))]))


def published_machine(*temperatures: int) -> Compensation:
    maps = [
        read_error_map(HARRIS / f"error_map_{t}C.csv", temperature=t).with_squareness_arcsec(-173, -19, 21)
        for t in temperatures
    ]
    return Compensation(ErrorMaps(maps))


def cloud(n: int, seed: int = 1):
    rng = np.random.default_rng(seed)
    readings = np.column_stack([rng.uniform(0, 900, n), rng.uniform(0, 550, n), rng.uniform(-500, 0, n)])
    return rng.uniform(-30, 30, (n, 2)), readings


@given(ANGLES, st.floats(0.01, 3.1), ANGLES)
def test_equation_7_is_three_turns_about_z_x_and_z(alpha, beta, gamma):
    E = euler_313(alpha, beta, gamma)
    np.testing.assert_allclose(E, Rotation.from_euler("ZXZ", [alpha, beta, gamma]).as_matrix(), atol=1e-14)


@given(st.lists(st.floats(-1e-4, 1e-4), min_size=3, max_size=3))
def test_the_mounts_axes_are_orthonormal_and_turn_by_the_right_hand(rotation):
    axes = np.stack(mount_axes(np.array(rotation)[:, None]), axis=-1)[:, 0]
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1)
    turned = np.array([rotate(np.array(rotation), unit) for unit in np.eye(3)]).T
    # plane and solid angles differ by products of two
    np.testing.assert_allclose(axes, turned, atol=2e-8)


def test_the_third_axis_is_printed_equation_29():
    ex, ey = 0.02, -0.03
    Z = mount_axes(np.array([[ex], [ey], [0.01]]))[2][:, 0]
    expected = np.array([np.tan(ey), -np.tan(ex), 1]) / np.sqrt(1 + np.tan(ex) ** 2 + np.tan(ey) ** 2)
    np.testing.assert_allclose(Z, expected, atol=1e-15)


def test_the_first_axis_as_printed_in_equation_30_turns_the_wrong_way_about_z():
    ez = 1e-4
    X = mount_axes(np.array([[0.0], [0.0], [ez]]))[0][:, 0]
    assert X[1] == pytest.approx(np.tan(ez), rel=1e-7)  # (30) prints −tan εZ, against −E·εz(x) in (11)


def test_on_a_perfect_machine_equation_35_is_equations_15_and_25():
    scan, readings = cloud(50)
    E = euler_313(np.pi / 2, np.pi / 2, -np.pi / 3)
    xyz, _ = Digitizer(E, OFFSET, perfect_machine()).coordinates(scan, readings)
    expected = readings + (np.column_stack([scan, np.zeros(50)]) - OFFSET) @ E.T
    np.testing.assert_allclose(xyz, expected, atol=1e-12)


@pytest.mark.parametrize("gamma", [0.0, -np.pi / 3, np.pi / 2])
def test_equation_35_is_the_rigid_machine_with_the_digitizer_as_its_tip(gamma):
    scan, readings = cloud(300)
    E = euler_313(np.pi / 2, np.pi / 2, gamma)
    machine = published_machine(20)
    xyz, _ = Digitizer(E, OFFSET, machine).coordinates(scan, readings)
    q = (np.column_stack([scan, np.zeros(300)]) - OFFSET) @ E.T
    looked_up = machine.maps.at(readings)
    true = readings + q + exact(readings, looked_up.errors, looked_up.squareness, tip=q)
    # products of two errors: squareness 173″ squared over 550 mm is 0.2 µm
    assert np.abs(xyz - true).max() < 0.25e-3
    assert np.abs(xyz - readings - q).max() > 0.3


def test_blocks_leave_no_seam():
    n = 2 * BLOCK + 17
    scan, readings = cloud(n)
    digitizer = Digitizer(euler_313(1.5, 1.6, 0.2), OFFSET, published_machine(20))
    whole, _ = digitizer.coordinates(scan, readings)
    for rows in (slice(BLOCK - 3, BLOCK + 3), slice(n - 20, n)):
        np.testing.assert_array_equal(digitizer.coordinates(scan[rows], readings[rows])[0], whole[rows])


def test_temperatures_come_by_time_stamp():
    log = parse_temperature_log(b"time_s,x1_c,y1_c,z1_c\n0,20,20,20\n100,25,25,25\n", "log.csv")
    scan, readings = cloud(20)
    digitizer = Digitizer(euler_313(1.5, 1.6, 0.2), OFFSET, published_machine(20, 25))
    rows = np.column_stack([scan, readings, np.full(20, 40.0)])
    np.testing.assert_allclose(
        digitizer.transform(log.at)(rows), digitizer.coordinates(scan, readings, 22.0)[0], atol=1e-12
    )
    np.testing.assert_array_equal(digitizer.transform(22.0)(rows), digitizer.coordinates(scan, readings, 22.0)[0])


def test_a_refused_point_is_numbered_through_all_blocks():
    scan, readings = cloud(BLOCK + 10)
    readings[BLOCK + 4, 2] = 7.0
    with pytest.raises(CmmUqError, match=f"point {BLOCK + 5}: z reads 7 mm"):
        Digitizer(np.eye(3), OFFSET, published_machine(20)).coordinates(scan, readings)
    with pytest.raises(CmmUqError, match=f"point {BLOCK + 5}: z reads 7 mm"):
        published_machine(20).compensate(readings)


def test_points_beyond_the_map_are_marked():
    scan, readings = cloud(5)
    readings[3, 1] = 600.0
    machine = published_machine(20)
    with pytest.raises(CmmUqError, match="point 4: y reads 600 mm"):
        Digitizer(np.eye(3), OFFSET, machine).coordinates(scan, readings)
    beyond = Compensation(machine.maps, beyond="extrapolate")
    assert Digitizer(np.eye(3), OFFSET, beyond).coordinates(scan, readings)[1].tolist() == [False] * 3 + [True, False]


@pytest.mark.parametrize(("alpha", "beta"), [(90.0, 90.0), (180.0, 90.0), (-90.0, 75.0), (30.0, 120.0)])
def test_alpha_and_beta_come_from_three_points_of_the_scan_plane(alpha, beta):
    E = euler_313(*np.radians([alpha, beta, 40.0]))
    light = np.array([[-20.0, 5, 0], [25, -10, 0], [3, 28, 0]]) @ E.T  # of the detector, seen from the digitizer
    readings = np.array([400.0, 300, -200]) - light
    found = scan_plane(readings, E[:, 2] + 0.2, u_point=5e-3)
    assert np.degrees([found.alpha % (2 * np.pi), found.beta]) == pytest.approx([alpha % 360, beta], abs=1e-10)


@pytest.mark.long
def test_the_uncertainty_of_the_scan_plane_is_that_of_drawn_points():
    E, rng = euler_313(*np.radians([80.0, 70.0, 0.0])), np.random.default_rng(3)
    exact_points = np.array([[-20.0, -20, 0], [25, -10, 0], [3, 28, 0]]) @ E.T
    drawn = []
    for _ in range(3000):
        found = scan_plane(exact_points + rng.normal(scale=5e-3, size=(3, 1)) * E[:, 2], E[:, 2], u_point=5e-3)
        drawn.append([found.alpha, found.beta])
    # variances from 3000 draws have a relative standard uncertainty of 2.6 %
    np.testing.assert_allclose(
        np.cov(drawn, rowvar=False), found.covariance, rtol=0.13, atol=0.1 * found.covariance[1, 1]
    )


def test_points_that_do_not_tell_the_scan_plane_are_refused():
    line = np.outer(np.arange(3.0), [1, 2, 3])
    with pytest.raises(CmmUqError, match="lie on one line"):
        scan_plane(line, np.array([1.0, 0, 0]), u_point=1e-3)
    with pytest.raises(CmmUqError, match="nothing to estimate"):
        scan_plane(np.eye(3), np.ones(3))
    with pytest.raises(CmmUqError, match="lies in the scan plane"):
        scan_plane(np.eye(3), np.array([1.0, -1, 0]), u_point=1e-3)
    with pytest.raises(CmmUqError, match="α is not determined"):
        scan_plane(np.eye(3) * [1, 1, 0], np.array([0, 0, 1.0]), u_point=1e-3)


def scanned_plane(gamma: float, moves):
    """Scan lines on the plane 0.3 x + 0.2 y + z = 10 while the machine stands at ``moves``."""
    E, n = euler_313(np.pi / 2, np.pi / 2, gamma), np.array([0.3, 0.2, 1.0])
    along, slope = n @ E[:, 0], n @ E[:, 1]
    scan, readings = [], []
    for D in moves:
        for t in np.linspace(-25, 25, 21):
            # a point of the line along + slope in the scan plane
            foot = (10 - n @ D) / (along**2 + slope**2)
            scan.append([foot * along - t * slope, foot * slope + t * along])
            readings.append(D)
    return np.array(scan), np.array(readings)


MOVES = [np.array([x, y, 0.1 * (x + y) - 0.3 * x - 0.2 * y]) for x in (0.0, 40, 80) for y in (0.0, 30, 60)]


@pytest.mark.parametrize("gamma", [-60.7, -14.1, 0.0, 31.2, 90.4])
def test_gamma_comes_from_the_scan_of_a_plane(gamma):
    nominal = np.radians(15 * round(gamma / 15))
    found = scan_roll(*scanned_plane(np.radians(gamma), MOVES), np.pi / 2, np.pi / 2, nominal)
    assert np.degrees(found) == pytest.approx(gamma, abs=1e-7)


def test_gamma_far_from_the_index_of_the_wrist_is_refused():
    with pytest.raises(CmmUqError, match="the wrist is indexed at"):
        scan_roll(*scanned_plane(np.radians(40.0), MOVES), np.pi / 2, np.pi / 2, np.radians(15.0))


def test_gamma_is_not_determined_by_moving_along_one_line():
    moves = [np.array([x, 0.0, 0.0]) for x in (0.0, 20, 40, 60)]
    with pytest.raises(CmmUqError, match=r"do not determine|does not settle"):
        scan_roll(*scanned_plane(0.2, moves), np.pi / 2, np.pi / 2, 0.2)


ATTITUDES = [(np.pi / 2, np.pi / 2, 0.0), (np.pi / 2, np.pi / 2, np.pi / 2), (np.pi, np.pi / 2, 0.0)]
U = np.sqrt([9**2 + 5.8**2 + 2**2, 9**2 + 5.8**2 + 16.5**2, 9**2 + 5.8**2 + 1**2]) * 1e-3
"""Standard uncertainties of D, E, F in mm: probing 9 µm, centre 5.8 µm, scales 2, 16.5 and 1 µm (Harris 2004 5.3)."""


def readings_of(sphere, noise=None):
    exact = np.array([sphere + euler_313(*angles) @ OFFSET for angles in ATTITUDES])
    return exact if noise is None else exact + noise


def alignments(readings, covariance=None):
    covariance = np.diag(U**2) if covariance is None else covariance
    return [Alignment(*angles, D, covariance) for angles, D in zip(ATTITUDES, readings, strict=True)]


SPHERE = np.array([350.0, 200.0, -480.0])


def test_a_scan_of_the_sphere_gives_the_reading_at_which_the_origin_is_its_centre():
    attitude, rng = euler_313(*ATTITUDES[0]), np.random.default_rng(4)
    surface = 38.125 * cap_directions(1.3, 3000) @ attitude.T[[1, 2, 0]] + rng.normal(scale=9e-3, size=(3000, 1))
    centre = np.array([500.0, 250.0, -300.0])
    # wherever the machine stands, the scan plane holds what lies in it: w = 0
    local = surface @ attitude
    scan, readings = local[:, :2], centre + local[:, 2:] * attitude[:, 2]
    alignment = align_on_sphere(scan, readings, *ATTITUDES[0], u_point=9e-3)
    assert np.abs(alignment.reading - centre).max() < 5 * np.sqrt(np.diag(alignment.covariance).max())
    assert np.sqrt(np.diag(alignment.covariance).max()) < 1e-3
    points = alignment.from_sphere(scan, readings)
    assert np.linalg.norm(points, axis=1).mean() == pytest.approx(38.125, abs=1e-3)


def test_nine_equations_give_offset_and_sphere():
    found = mount_offset(alignments(readings_of(SPHERE)))
    np.testing.assert_allclose(found.offset, OFFSET, atol=1e-12)
    np.testing.assert_allclose(found.sphere, SPHERE, atol=1e-12)
    assert found.degrees_of_freedom == 3
    assert np.abs(found.residuals).max() < 1e-12


def test_equations_19_to_21_agree_where_the_readings_do():
    offset, _ = three_alignment_offset(readings_of(SPHERE), U)
    np.testing.assert_allclose(offset, OFFSET, atol=1e-12)


def test_alignments_1_and_2_share_d_and_1_and_3_share_f():
    first, second, third = readings_of(SPHERE)
    assert first[0] == pytest.approx(second[0])
    assert first[2] == pytest.approx(third[2])


def test_equations_22_to_24_give_16_um_where_the_source_prints_35():
    _, u = three_alignment_offset(readings_of(SPHERE), U)
    assert u * 1e3 == pytest.approx([15.85, 15.85, 15.90], abs=0.005)
    # what it prints is the sum of the lines, not of their squares, and without the ½
    assert np.hypot(9 + 5.8 + 16.5, 9 + 5.8 + 1) == pytest.approx(35.1, abs=0.05)


def test_all_nine_equations_weighted_know_the_offset_better_than_six():
    _, six = three_alignment_offset(readings_of(SPHERE), U)
    assert (mount_offset(alignments(readings_of(SPHERE))).u < six).all()


@pytest.mark.long
def test_the_covariance_is_that_of_drawn_readings():
    rng = np.random.default_rng(5)
    found = [mount_offset(alignments(readings_of(SPHERE, rng.normal(size=(3, 3)) * U))) for _ in range(4000)]
    spread = np.cov([[*f.offset, *f.sphere] for f in found], rowvar=False)
    # variances from 4000 draws have a relative standard uncertainty of 2.2 %
    np.testing.assert_allclose(np.diag(spread), np.diag(found[0].covariance), rtol=0.11)
    assert np.mean([f.chi_squared for f in found]) == pytest.approx(3, abs=5 * np.sqrt(6 / 4000))


def test_correlated_readings_count_as_such():
    covariance = np.diag(U**2)
    covariance[0, 1] = covariance[1, 0] = 0.9 * U[0] * U[1]
    plain = mount_offset(alignments(readings_of(SPHERE)))
    correlated = mount_offset(alignments(readings_of(SPHERE), covariance))
    assert not np.allclose(plain.u, correlated.u)
    np.testing.assert_allclose(correlated.offset, OFFSET, atol=1e-12)


@pytest.mark.parametrize(
    ("chosen", "message"),
    [
        ([], "0 alignments do not determine"),
        ([0], "1 alignments do not determine"),
        ([0, 1], "2 alignments do not determine"),
        ([0, 0, 0], "3 alignments do not determine"),
    ],
)
def test_attitudes_that_leave_the_offset_unknown_are_refused(chosen, message):
    given = alignments(readings_of(SPHERE))
    with pytest.raises(CmmUqError, match=message):
        mount_offset([given[i] for i in chosen])


def test_readings_without_uncertainty_are_refused():
    with pytest.raises(CmmUqError, match="not positive definite"):
        mount_offset(alignments(readings_of(SPHERE), np.zeros((3, 3))))
