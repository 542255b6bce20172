"""The distance equations of US 4,437,151, and the three ways to solve them."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy import linalg

from cmm_uq.artefacts.distance_equations import PLACINGS, missing_placings, quadratic_terms, solve_distances
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.units import ARCSECOND, PPM
from tests.conftest import ROOT

SCALES = np.array([120.0, -80.0, 45.0])
SQUARENESS = np.array([-173.0, -19.0, 21.0])  # xy, yz, zx


def bars(seed: int, count: int = 20, length: float = 404.2357) -> Floats:
    direction = np.random.default_rng(seed).standard_normal((count, 3))
    return length * direction / np.linalg.norm(direction, axis=1, keepdims=True)


def read_by(true: Floats, scales: Floats = SCALES, squareness: Floats = SQUARENESS) -> Floats:
    """Readings of true differences: true = M · indicated with e_x = −Sxy·y − Szx·z, e_y = −Syz·z."""
    (x, y, z), (xy, yz, zx) = 1 + scales * PPM, squareness * ARCSECOND
    M = np.array([[x, -xy, -zx], [0, y, -yz], [0, 0, z]])
    return np.linalg.solve(M, true.T).T


def recorded_by_the_iota() -> Floats:
    """The twenty bars of Harris 2004, figures C 1 and C 2."""
    file = ROOT / "examples" / "iota-1102-20C" / "ballbar.csv"
    rows = [line for line in file.read_text(encoding="utf-8").splitlines() if line and not line.startswith("#")]
    columns = rows[0].split(",")
    xyz = np.array([[float(row.split(",")[columns.index(f"{a}_mm")]) for a in "xyz"] for row in rows[1:]])
    return np.diff(xyz.reshape(-1, 2, 3), axis=1)[:, 0]


def test_the_real_recording_gives_the_machines_own_calibration() -> None:
    """Squareness −174.8″, −16.9″, +18.1″, residual 12.7 µm; the machine's calibration has −173″, −19″, +21″ (its table 7)."""
    found = solve_distances(recorded_by_the_iota(), 404.2357)
    np.testing.assert_allclose(found.factors[3:], [-174.75, -16.89, 18.08], atol=0.01)
    np.testing.assert_allclose(found.factors[3:], [-173, -19, 21], atol=3)
    assert found.residual_sd == pytest.approx(12.7e-3, abs=0.05e-3)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 10_000))
def test_three_ways_agree_on_well_posed_data(seed: int) -> None:
    noisy = read_by(bars(seed, 30)) + 2e-3 * np.random.default_rng(seed + 1).standard_normal((30, 3))
    A, b = quadratic_terms(noisy) / (2 * 404.2357), (404.2357**2 - np.sum(noisy**2, axis=1)) / (2 * 404.2357)
    for solution in SOLUTIONS.values():
        np.testing.assert_allclose(solution(A, b), solve_distances(noisy, 404.2357).e, atol=1e-11)


def test_exact_readings_give_the_metric_of_the_machine() -> None:
    """d² = DᵀMᵀM·D: 1 + e1 = (1 + sx)², e2 = −(1 + sx)·Sxy and so on, written out by hand."""
    found = solve_distances(read_by(bars(1)), 404.2357)
    s, (xy, yz, zx) = 1 + SCALES * PPM, SQUARENESS * ARCSECOND
    expected = [
        s[0] ** 2 - 1, -s[0] * xy, -s[0] * zx,
        xy**2 + s[1] ** 2 - 1, xy * zx - s[1] * yz, zx**2 + yz**2 + s[2] ** 2 - 1,
    ]  # fmt: skip
    np.testing.assert_allclose(found.e, expected, atol=1e-13)
    np.testing.assert_allclose(found.factors[:3], SCALES, atol=0.4)  # second order: Sxy² / 2 = 0.35 ppm of Y
    np.testing.assert_allclose(found.factors[3:], SQUARENESS, atol=0.03)


def test_uncertainties_are_those_of_repeated_recordings() -> None:
    """400 recordings of forty bars with noise of 1 µm: the scatter of every factor, within 4 standard errors of a scatter."""
    random, true = np.random.default_rng(5), read_by(bars(2, 40))
    found = [solve_distances(true + 1e-3 * random.standard_normal(true.shape), 404.2357) for _ in range(400)]
    scatter = np.std([f.factors for f in found], axis=0)
    stated = np.sqrt(np.mean([f.u**2 for f in found], axis=0))
    np.testing.assert_allclose(scatter, stated, rtol=4 / np.sqrt(2 * 400))


def test_each_distance_may_have_its_own_certified_length() -> None:
    true = bars(3) * np.linspace(0.5, 1.5, 20)[:, None]
    found = solve_distances(read_by(true), np.linalg.norm(true, axis=1))
    np.testing.assert_allclose(found.factors[3:], SQUARENESS, atol=0.03)


def test_normal_equations_square_the_condition_number() -> None:
    """Factors that hang on 1 part in 10⁶: an exact answer comes back to 10⁻⁹ by QR, to 10⁻⁴ at best by the patent's ways."""
    random = np.random.default_rng(7)
    U, _ = np.linalg.qr(random.standard_normal((30, 6)))
    V, _ = np.linalg.qr(random.standard_normal((6, 6)))
    A, e = U * np.logspace(0, -6, 6) @ V.T, np.ones(6)
    off = {method: np.abs(solution(A, A @ e) - e).max() for method, solution in SOLUTIONS.items()}
    assert off["QR"] < 1e-9
    assert min(off["Doolittle"], off["Jacobi"]) > 1e3 * off["QR"]


@pytest.mark.parametrize(
    ("differences", "problem", "wanted"),
    [
        (np.tile([400.0, 0, 0], (20, 1)), "all 20 distances are parallel", 5),
        (bars(1) * [1, 1, 0], "all 20 distances lie in one plane", 3),
        (bars(1)[:5], "5 distances are too few", 1),
        (np.repeat(bars(1)[:3], 4, axis=0), "leave a factor of scale or squareness open", 3),
    ],
)
def test_poor_placings_are_refused_and_the_missing_ones_named(differences: Floats, problem: str, wanted: int) -> None:
    with pytest.raises(CmmUqError, match=problem) as refusal:
        solve_distances(differences, 400.0)
    assert f"Add {wanted} set-up" in str(refusal.value)
    assert len(missing_placings(differences)) == wanted


def test_the_named_placings_mend_what_was_missing() -> None:
    poor = np.tile([1.0, 0, 0], (6, 1))
    assert missing_placings(np.vstack([poor, [PLACINGS[name] for name in missing_placings(poor)]])) == ()


def test_two_positions_in_one_place_are_no_distance() -> None:
    differences = bars(1)
    differences[4] = 0
    with pytest.raises(CmmUqError, match="distance 5 is zero"):
        solve_distances(differences, 400.0)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 8))
def test_jacobi_and_doolittle_agree_with_lapack(seed: int, n: int) -> None:
    random = np.random.default_rng(seed)
    half = random.standard_normal((n + 3, n))
    matrix, right = half.T @ half + 0.1 * np.eye(n), random.standard_normal(n)
    values, vectors = jacobi_eigenvalues(matrix)
    np.testing.assert_allclose(np.sort(values), linalg.eigvalsh(matrix), rtol=1e-12)
    np.testing.assert_allclose(vectors.T @ vectors, np.eye(n), atol=1e-13)
    np.testing.assert_allclose(by_jacobi(matrix, right), linalg.solve(matrix, right), rtol=1e-9)
    np.testing.assert_allclose(by_doolittle(matrix, right), linalg.solve(matrix, right), rtol=1e-9)


def test_singular_equations_are_refused() -> None:
    singular = np.array([[0.0, 1.0], [1.0, 0.0]])
    with pytest.raises(CmmUqError, match="pivot 1 is zero"):
        by_doolittle(singular, np.ones(2))
    with pytest.raises(CmmUqError, match="an eigenvalue is zero"):
        by_jacobi(np.diag([1.0, 0.0]), np.ones(2))


_SWEEPS = 30  # of Jacobi rotations; convergence is quadratic, and ten suffice for rounding accuracy at this size


def by_doolittle(matrix: Floats, right: Floats) -> Floats:
    """Solve by matrix = L·U with a unit diagonal in L, in order, without pivoting."""
    n = len(matrix)
    L, U = np.eye(n), np.zeros((n, n))
    for i in range(n):
        U[i, i:] = matrix[i, i:] - L[i, :i] @ U[:i, i:]
        if U[i, i] == 0:
            raise CmmUqError(f"normal equations: pivot {i + 1} is zero", fix="Record placings in more directions")
        L[i + 1 :, i] = (matrix[i + 1 :, i] - L[i + 1 :, :i] @ U[:i, i]) / U[i, i]
    return np.asarray(np.linalg.solve(U, np.linalg.solve(L, right)), dtype=np.float64)


def by_jacobi(matrix: Floats, right: Floats) -> Floats:
    """Solve by matrix = V·diag(values)·Vᵀ from Jacobi rotations."""
    values, V = jacobi_eigenvalues(matrix)
    if np.abs(values).min() <= np.finfo(np.float64).eps * np.abs(values).max():
        raise CmmUqError("normal equations: an eigenvalue is zero", fix="Record placings in more directions")
    return np.asarray(V @ ((V.T @ right) / values), dtype=np.float64)


def jacobi_eigenvalues(matrix: Floats) -> tuple[Floats, Floats]:
    """Eigenvalues (n,) and eigenvectors (n, n) of a symmetric matrix, by cyclic Jacobi rotations (Golub & Van Loan, 8.5)."""
    A, n = matrix.astype(np.float64, copy=True), len(matrix)
    V = np.eye(n)
    for _ in range(_SWEEPS):
        if np.linalg.norm(A - np.diag(np.diag(A))) <= np.finfo(np.float64).eps * np.linalg.norm(A):
            break
        for p, q in combinations(range(n), 2):
            if A[p, q] == 0:
                continue
            half = (A[q, q] - A[p, p]) / (2 * A[p, q])
            t = np.copysign(1.0, half) / (abs(half) + np.hypot(half, 1.0))
            c = 1 / np.hypot(t, 1.0)
            turn = np.array([[c, t * c], [-t * c, c]])
            A[:, [p, q]] = A[:, [p, q]] @ turn
            A[[p, q], :] = turn.T @ A[[p, q], :]
            V[:, [p, q]] = V[:, [p, q]] @ turn
    return np.diag(A).copy(), V


def by_qr(A: Floats, b: Floats) -> Floats:
    Q, R = np.linalg.qr(A)
    return np.linalg.solve(R, Q.T @ b)


SOLUTIONS = {
    "QR": by_qr,
    "Doolittle": lambda A, b: by_doolittle(A.T @ A, A.T @ b),
    "Jacobi": lambda A, b: by_jacobi(A.T @ A, A.T @ b),
}
