"""Normal equations as US 4,437,151 solves them: Doolittle's triangular factors, and Jacobi's eigenvalues."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats

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
