"""What a technician turns sets the axes upright: the unit vectors, by Cholesky, turned by rotation matrices."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.spatial.transform import Rotation

from cmm_uq.artefacts.adjustment import turns
from cmm_uq.machine.physics.kinematics import KinematicChain

ARCSEC = np.pi / 180 / 3600
angles = st.floats(-2000.0, 2000.0)


@given(st.tuples(angles, angles, angles), st.booleans())
def test_the_turns_make_the_axes_square(arcsec, rides: bool) -> None:
    squareness = ARCSEC * np.array(arcsec)
    xy, yz, zx = np.cos(np.pi / 2 + squareness)
    x, y, z = np.linalg.cholesky(np.array([[1, xy, zx], [xy, 1, yz], [zx, yz, 1]]))
    about_z, about_x, about_y = turns(squareness, rides)
    guide_of_y = Rotation.from_rotvec([0, 0, about_z])
    y = guide_of_y.apply(y)
    z = guide_of_y.apply(z) if rides else z
    z = Rotation.from_rotvec([0, about_y, 0]).apply(Rotation.from_rotvec([about_x, 0, 0]).apply(z))
    np.testing.assert_allclose([x, y, z], np.eye(3), atol=1e-12)


def test_small_angles_are_turned_back_by_themselves() -> None:
    found = turns(ARCSEC * np.array([3.0, 2.0, 1.0]), True) / ARCSEC
    np.testing.assert_allclose(found, [-3.0, -2.0, 1.0], atol=1e-4)


def test_a_product_of_angles_matters_where_z_stands_on_its_own() -> None:
    """1500″ twice: 1500″² is 10.9″ about X, which a ram that rides on the bridge does not show, but shows about Y."""
    squareness = ARCSEC * np.array([1500.0, 0.0, 1500.0])
    assert turns(squareness, False)[1] / ARCSEC == pytest.approx(-10.9, abs=0.05)
    assert turns(squareness, True)[1] / ARCSEC == pytest.approx(0, abs=0.1)


@pytest.mark.parametrize(
    ("chain", "rides"),
    [("XYZ", True), ("YXZ", True), ("ZXY", False), ("YFXZ", False), ("ZYFX", True), ("YZFX", False), ("XFYZ", True)],
)
def test_the_ram_rides_on_the_carriage_that_carries_it(chain: str, rides: bool) -> None:
    assert KinematicChain.of(chain).rides("z", on="y") is rides
