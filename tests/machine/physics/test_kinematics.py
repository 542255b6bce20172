from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.machine.physics.kinematics import (
    PARAMETRIC_ERRORS,
    KinematicChain,
    axis_directions,
    carried_offset,
    exact,
    first_order,
    jacobian,
    parametric_error,
    rotate,
)

CHAINS = ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX", "XFYZ", "YXFZ", "XYZF"]


def machine_state(seed: int, n: int = 6, size: float = 1.0):
    """Readings, errors of a bad machine times ``size``, squareness and tips."""
    rng = np.random.default_rng(seed)
    errors = np.concatenate([rng.normal(scale=0.02, size=(n, 3, 3)), rng.normal(scale=5e-5, size=(n, 3, 3))], axis=2)
    tip = rng.uniform(-300, 300, (n, 3))
    return rng.uniform(-900, 900, (n, 3)), size * errors, size * rng.normal(scale=5e-4, size=3), tip


def test_chain_xyz_is_harris_equations_11_to_13():
    (x, y, z), (dx, dy, dz), (sxy, syz, szx) = (100.0, 200.0, -300.0), np.eye(3) * 1e-3, (1e-4, 2e-4, 3e-4)
    rotations = np.array([[1.0, 2, 3], [4, 5, 6], [7, 8, 9]]) * 1e-6  # of carriages x, y, z about x, y, z
    errors = np.concatenate([[dx, dy, dz], rotations], axis=1)[None]
    (exx, eyx, ezx), (exy, eyy, _), _ = rotations
    e = first_order(np.array([[x, y, z]]), errors, np.array([sxy, syz, szx]))[0]
    assert e == pytest.approx(
        [
            1e-3 - y * ezx + z * (eyx + eyy) - y * sxy - z * szx,  # (11)
            1e-3 - z * (exx + exy) - z * syz,  # (12)
            1e-3 + y * exx,  # (13)
        ],
        abs=1e-15,
    )


def test_chain_yxz_with_tip_is_manlays_section_1():
    rng = np.random.default_rng(1)
    P, T = rng.uniform(-500, 500, (2, 3))
    L, R = rng.normal(scale=1e-2, size=(3, 3)), rng.normal(scale=1e-5, size=(3, 3))  # [carriage, direction]
    X, Y, Z = 0, 1, 2
    Cx = L[:, X].sum() + R[Y, Y] * (P[Z] + T[Z]) - R[Y, Z] * T[Y] + R[X, Y] * (P[Z] + T[Z]) - R[X, Z] * T[Y]
    Cx += R[Z, Y] * T[Z] - R[Z, Z] * T[Y]
    Cy = L[:, Y].sum() + R[Y, Z] * (P[X] + T[X]) - R[Y, X] * (P[Z] + T[Z]) + R[X, Z] * T[X] - R[X, X] * (P[Z] + T[Z])
    Cy += R[Z, Z] * T[X] - R[Z, X] * T[Z]
    Cz = L[:, Z].sum() + R[Y, X] * T[Y] - R[Y, Y] * (P[X] + T[X]) + R[X, X] * T[Y] - R[X, Y] * T[X]
    Cz += R[Z, X] * T[Y] - R[Z, Y] * T[X]
    e = first_order(P[None], np.hstack([L, R])[None], tip=T, chain="YXZ")[0]
    np.testing.assert_allclose(e, [Cx, Cy, Cz], atol=1e-15)


def test_carried_offsets_of_chain_xyz():
    readings = np.array([[1.0, 2, 3]])
    assert carried_offset("x", readings).tolist() == [[0, 2, 3]]
    assert carried_offset("y", readings).tolist() == [[0, 0, 3]]
    assert carried_offset("z", readings).tolist() == [[0, 0, 0]]
    assert carried_offset("z", readings, np.array([10.0, 20, 30])).tolist() == [[10, 20, 30]]
    assert carried_offset("y", readings, np.array([10.0, 20, 30])).tolist() == [[10, 20, 33]]


def test_a_table_that_carries_the_workpiece_carries_its_own_reading_too():
    # the workpiece turns with the table by −ε as seen from it; the probe stands at (x, y, z) of the table's own point
    readings, angle = np.array([[400.0, 100.0, -50.0]]), 2e-5
    errors = np.zeros((1, 3, 6))
    errors[0, 0, 5] = angle
    probe_in_table = readings[0]
    c, s = np.cos(angle), np.sin(angle)
    turned = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ probe_in_table
    np.testing.assert_allclose(exact(readings, errors, chain="XFYZ")[0], turned - probe_in_table, atol=1e-12)
    assert carried_offset("x", readings, chain="XFYZ").tolist() == readings.tolist()
    assert carried_offset("x", readings, chain="XYZ").tolist() == [[0, 100, -50]]


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**31), st.sampled_from(CHAINS))
def test_the_first_order_leaves_only_products_of_errors(seed, chain):
    readings, errors, squareness, tip = machine_state(seed)
    far = np.abs(exact(readings, errors, squareness, tip=tip, chain=chain))
    gap = exact(readings, errors, squareness, tip=tip, chain=chain) - first_order(
        readings, errors, squareness, tip=tip, chain=chain
    )
    half = exact(readings, errors / 2, squareness / 2, tip=tip, chain=chain) - first_order(
        readings, errors / 2, squareness / 2, tip=tip, chain=chain
    )
    assert np.abs(gap).max() < 0.02 * far.max()
    # half the errors leave a quarter of the gap; products of three are a thousandth of it
    np.testing.assert_allclose(4 * half, gap, atol=0.02 * np.abs(gap).max())


@pytest.mark.parametrize("chain", CHAINS)
def test_the_jacobian_is_the_derivative_of_the_exact_form(chain):
    readings, _, _, tip = machine_state(3)
    J = jacobian(readings, tip=tip, chain=chain)
    for i in range(21):
        values = np.zeros(21)
        values[i] = 1e-6
        pair = [
            exact(readings, np.tile(v[:18].reshape(3, 6), (6, 1, 1)), v[18:], tip=tip, chain=chain)
            for v in (values, -values)
        ]
        np.testing.assert_allclose(
            (pair[0] - pair[1]) / 2e-6, J[:, :, i], atol=1e-5, err_msg=PARAMETRIC_ERRORS[i].symbol
        )


def test_the_first_order_is_linear_with_that_jacobian():
    readings, errors, squareness, tip = machine_state(4)
    parameters = np.hstack([errors.reshape(6, 18), np.tile(squareness, (6, 1))])
    e = np.einsum("nij,nj->ni", jacobian(readings, tip=tip, chain="YXZ"), parameters)
    np.testing.assert_allclose(first_order(readings, errors, squareness, tip=tip, chain="YXZ"), e, atol=1e-15)


def test_squareness_may_differ_from_point_to_point():
    readings, errors, squareness, tip = machine_state(5)
    each = np.outer(np.arange(6.0), squareness)
    for form in (first_order, exact):
        one_by_one = [form(readings[i : i + 1], errors[i : i + 1], each[i], tip=tip[i : i + 1])[0] for i in range(6)]
        np.testing.assert_allclose(form(readings, errors, each, tip=tip), one_by_one, atol=1e-12)


@given(st.floats(-0.02, 0.02), st.floats(-0.02, 0.02), st.floats(-0.02, 0.02))
def test_axes_enclose_a_right_angle_and_their_squareness(sxy, syz, szx):
    x, y, z = axis_directions(np.array([sxy, syz, szx]))
    assert np.arccos(x @ y) - np.pi / 2 == pytest.approx(sxy, abs=1e-12)
    assert np.arccos(y @ z) - np.pi / 2 == pytest.approx(syz, abs=1e-12)
    assert np.arccos(z @ x) - np.pi / 2 == pytest.approx(szx, abs=1e-12)
    np.testing.assert_allclose(np.linalg.norm([x, y, z], axis=1), 1, atol=1e-14)


def test_rotation_vectors_turn_as_those_of_scipy():
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng(6)
    turns, vectors = rng.normal(size=(20, 3)), rng.normal(size=(20, 3))
    np.testing.assert_allclose(rotate(turns, vectors), Rotation.from_rotvec(turns).apply(vectors), atol=1e-14)
    assert rotate(np.zeros((1, 3)), np.ones((1, 3))).tolist() == [[1, 1, 1]]


@pytest.mark.parametrize(
    ("name", "vdi", "symbol"),
    [
        ("xtx", "xtx", "δx(x)"),
        ("ytx", "ytx", "δx(y)"),
        ("δx(y)", "ytx", "δx(y)"),
        ("delta_x(y)", "ytx", "δx(y)"),
        ("xrz", "xrz", "εz(x)"),
        ("epsilon_z(x)", "xrz", "εz(x)"),
        ("εy(z)", "zry", "εy(z)"),
        ("xwy", "xwy", "Sxy"),
        ("Szx", "xwz", "Szx"),
        ("squareness_yz", "ywz", "Syz"),
    ],
)
def test_errors_go_by_their_vdi_and_their_greek_names(name, vdi, symbol):
    error = parametric_error(name)
    assert (error.vdi, error.symbol) == (vdi, symbol)


def test_there_are_twenty_one_errors_each_found_by_both_names():
    assert len({e.vdi for e in PARAMETRIC_ERRORS}) == 21
    for error in PARAMETRIC_ERRORS:
        assert parametric_error(error.vdi) == parametric_error(error.symbol) == error


@pytest.mark.parametrize("name", ["xtw", "xwx", "axb", "scale", ""])
def test_no_other_name_is_an_error(name):
    with pytest.raises(CmmUqError, match="no parametric error is named"):
        parametric_error(name)


@pytest.mark.parametrize("chain", CHAINS)
def test_chains_are_written_as_they_are_read(chain):
    assert KinematicChain.of(chain).letters == chain


def test_the_frame_may_be_named_where_every_carriage_moves_the_probe():
    assert KinematicChain.of("FXYZ") == KinematicChain.of("xyz") == KinematicChain()


@pytest.mark.parametrize("chain", ["XY", "XXZ", "XYZA", "XFYFZ", ""])
def test_no_other_chain_is_one(chain):
    with pytest.raises(CmmUqError, match="no chain of three carriages"):
        KinematicChain.of(chain)
