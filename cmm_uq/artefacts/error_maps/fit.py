"""What follows from a compared: how the maps differ, what is left, what held-out parts say, and how noisy a reading is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from cmm_uq.analysis.diagnosis.comparison.conditional import Version
from cmm_uq.artefacts.error_maps.search import ColumnComparison
from cmm_uq.base.points import Floats

BLOCKS = 5
"""Parts of the travel that are held out in turn."""

_LEAST_NOISE = 1e-7
"""mm; figures that agree to their last digit have no less."""


def function(compared: ColumnComparison, index: int) -> tuple[Floats, Floats]:
    """An unknown function of the best combination at the positions, and its standard uncertainty, mm, each (p,).

    A straightness is about its best line; anything else is zero where a map begins, nearest to the origin.
    """
    columns, spread = _given(compared, compared.versions)
    sigma = _sigma(compared, compared.versions, compared.observed, np.arange(len(compared.observed)))
    precision = columns.T @ columns / sigma**2 + np.diag(1 / (spread * sigma) ** 2)
    covariance = np.linalg.inv(precision)
    mean = covariance @ (columns.T @ compared.comparison.rest(compared.observed[:, None])[:, 0]) / sigma**2
    begin = 0
    for version in compared.versions:
        values = compared.comparison.explanations[version.explanation].members[version.member].values
        if version.explanation == index:
            break
        begin += values.shape[1]
    part = slice(begin, begin + values.shape[1])
    if compared.column.is_straightness:
        place = compared.column.positions - compared.column.positions.mean()
        lines = np.column_stack([np.ones_like(place), place])
        values = values - lines @ np.linalg.lstsq(lines, values, rcond=None)[0]
    else:
        values = values - values[np.argmin(np.abs(compared.column.positions))]
    return values @ mean[part], np.sqrt(np.einsum("pi,ij,pj->p", values, covariance[part, part], values))


def held_out(compared: ColumnComparison, versions: Sequence[Version]) -> tuple[Floats, Floats]:
    """Errors (m,), mm, of predictions of parts of the travel from the rest, and log predictive densities (blocks,)."""
    p = len(compared.column.positions)
    block = np.tile(np.arange(p) * min(BLOCKS, p // 2) // p, len(compared.observed) // p)
    errors, densities = np.zeros(len(compared.observed)), []
    columns, spread = compared.columns_of(versions)
    covariance = np.eye(len(compared.observed)) + (columns * spread**2) @ columns.T
    for k in np.unique(block):
        out, kept = block == k, block != k
        sigma = _sigma(compared, versions, compared.observed, np.flatnonzero(kept))
        factor = linalg.cho_factor(covariance[np.ix_(kept, kept)])
        across = linalg.cho_solve(factor, covariance[np.ix_(kept, out)]).T
        known = compared.baseline[kept]
        weighed = linalg.cho_solve(factor, known)
        free = np.linalg.pinv(known.T @ weighed, rcond=1e-10, hermitian=True)
        level = free @ (weighed.T @ compared.observed[kept])
        error = (
            compared.observed[out] - compared.baseline[out] @ level - across @ (compared.observed[kept] - known @ level)
        )
        open_to = compared.baseline[out] - across @ known
        spread_out = covariance[np.ix_(out, out)] - across @ covariance[np.ix_(kept, out)] + open_to @ free @ open_to.T
        lower = sigma * np.linalg.cholesky(spread_out)
        white = np.linalg.solve(lower, error)
        errors[out] = error
        densities.append(-0.5 * white @ white - np.log(np.diag(lower)).sum() - 0.5 * len(error) * np.log(2 * np.pi))
    return errors, np.array(densities)


def residual(compared: ColumnComparison, versions: Sequence[Version]) -> Floats:
    """What is left of the observations (m,), mm."""
    if not versions:
        return compared.comparison.rest(compared.observed[:, None])[:, 0]
    columns, spread = _given(compared, versions)
    left = compared.comparison.rest(compared.observed[:, None])[:, 0]
    mean = np.linalg.solve(columns.T @ columns + np.diag(1 / spread**2), columns.T @ left)
    return left - columns @ mean


def noise_of(compared: ColumnComparison, versions: Sequence[Version]) -> tuple[float, int]:
    """Variance of a reading once versions are given, mm², and its degrees of freedom."""
    every = np.arange(len(compared.observed))
    return _sigma(compared, versions, compared.observed, every) ** 2, compared.comparison.degrees_of_freedom


def _given(compared: ColumnComparison, versions: Sequence[Version]) -> tuple[Floats, Floats]:
    columns, spread = compared.columns_of(versions)
    return compared.comparison.rest(columns), spread


def _sigma(compared: ColumnComparison, versions: Sequence[Version], observed: Floats, rows: NDArray[np.intp]) -> float:
    """Noise of some rows, mm, once versions are given."""
    columns, spread = compared.columns_of(versions)
    Q = linalg.orth(compared.baseline[rows] / np.linalg.norm(compared.baseline[rows], axis=0).clip(1e-300))
    left, columns = observed[rows] - Q @ (Q.T @ observed[rows]), columns[rows] - Q @ (Q.T @ columns[rows])
    covariance = np.eye(len(rows)) + (columns * spread**2) @ columns.T
    squares = float(left @ linalg.solve(covariance, left, assume_a="pos"))
    return max(float(np.sqrt(squares / max(len(rows) - Q.shape[1], 1))), _LEAST_NOISE)
