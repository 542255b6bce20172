"""Correlation between inputs: the matrix, what makes it possible, and which inputs it ties together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.points import Floats

Correlations = Mapping[tuple[str, str], float]

_ROUNDING = 1e-9


def correlation_matrix(names: Sequence[str], correlations: Correlations) -> Floats:
    """Matrix (m, m) from the coefficients of pairs; pairs that are not given are uncorrelated.

    Raises
    ------
    CmmUqError : an unknown input, a pair given twice, a coefficient beyond ±1, or coefficients that no joint
        distribution can have (the matrix is not positive semidefinite).
    """
    matrix = np.eye(len(names))
    for (a, b), r in correlations.items():
        where = f"correlation {a},{b}"
        for name in (a, b):
            if name not in names:
                raise CmmUqError(f"there is no input {name!r}", where=where, fix=suggestion(name, names))
        i, j = names.index(a), names.index(b)
        if i == j:
            raise CmmUqError("an input is not correlated with itself", where=where, fix="Leave the line out")
        if not abs(r) <= 1:
            raise CmmUqError(f"a correlation coefficient of {r}", where=where, fix="It lies between -1 and 1")
        if matrix[i, j] not in (0.0, r):
            raise CmmUqError("the pair is given twice", where=where, fix="Keep one of the two lines")
        matrix[i, j] = matrix[j, i] = r
    _must_be_possible(names, matrix)
    return matrix


def _must_be_possible(names: Sequence[str], matrix: Floats) -> None:
    eigenvalues, vectors = np.linalg.eigh(matrix)
    if eigenvalues[0] < -_ROUNDING * len(names):
        involved = [name for name, weight in zip(names, vectors[:, 0], strict=True) if abs(weight) > 1e-6]
        raise CmmUqError(
            f"the correlations of {', '.join(involved)} contradict each other: the matrix is not positive semidefinite "
            f"(smallest eigenvalue {eigenvalues[0]:.3g})",
            where="correlation",
            fix="Give the coefficients with more digits, or mend the one that is wrong",
        )


def square_root(matrix: Floats) -> Floats:
    """L with L Lᵀ = matrix, also where the matrix is singular."""
    eigenvalues, vectors = np.linalg.eigh(matrix)
    return np.asarray(vectors * np.sqrt(np.maximum(eigenvalues, 0.0)))


def tied(matrix: Floats) -> list[list[int]]:
    """Groups of inputs that are correlated with each other, directly or through others; single inputs are groups too."""
    remaining, groups = set(range(len(matrix))), []
    while remaining:
        group, new = set(), {min(remaining)}
        while new:
            group |= new
            new = {int(j) for i in new for j in np.flatnonzero(matrix[i])} - group
        remaining -= group
        groups.append(sorted(group))
    return groups


def correlation_of(covariance: Floats) -> Floats:
    """Correlation matrix (p, p) of a covariance matrix; ``nan`` where an uncertainty is zero."""
    u = np.sqrt(np.diagonal(covariance))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(covariance / np.outer(u, u))
