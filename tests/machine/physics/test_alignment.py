from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.machine.physics.digitizer import Alignment, align_on_sphere, euler_313, mount_offset, three_alignment_offset
from cmm_uq.maths.geometry import cap_directions

OFFSET = np.array([1.001, 264.505, 129.575])
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
