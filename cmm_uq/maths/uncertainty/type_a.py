"""Type A evaluation: estimates, covariances and degrees of freedom from repeated readings, and from a straight line.

Sources: JCGM 100:2008 4.2 (repeated readings), 5.2.3 and annex H.2 (simultaneous readings), annex H.3 (line by least
squares); JCGM 101:2008 6.4.9 and JCGM 102:2011 5.3.2 for the t distributions that Monte Carlo draws.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.maths.uncertainty.correlation import correlation_of
from cmm_uq.maths.uncertainty.distributions import Distribution, normal, student_t


@dataclass(frozen=True, eq=False)
class JointInputs:
    """Inputs that belong together, with the correlation of each pair; both go into a measurement model as they are."""

    inputs: Mapping[str, Distribution]
    correlation: Mapping[tuple[str, str], float] = field(default_factory=dict)


def repeated_readings(readings: Sequence[float] | Floats) -> Distribution:
    """Mean of n independent readings of one quantity: u = s/√n with n − 1 degrees of freedom (JCGM 100 4.2).

    Raises
    ------
    CmmUqError : fewer than two readings, one that is not finite, or all the same (their scatter is then below the
        resolution, which has to be stated as an input of its own).
    """
    return simultaneous_readings({"the quantity": readings}).inputs["the quantity"]


def simultaneous_readings(readings: Mapping[str, Sequence[float] | Floats]) -> JointInputs:
    """Means of quantities that were read together n times, and their correlation (JCGM 100 5.2.3, annex H.2).

    Parameters
    ----------
    readings : n readings of each quantity, in the same order.
    """
    table = _table(readings)
    n = table.shape[1]
    covariance = np.atleast_2d(np.cov(table)) / n
    means, u = table.mean(axis=1), np.sqrt(np.diagonal(covariance))
    inputs = {name: student_t(float(x), float(s), n - 1.0) for name, x, s in zip(readings, means, u, strict=True)}
    return JointInputs(inputs, _pairs(list(readings), correlation_of(covariance)))


def multivariate_normal(names: Sequence[str], mean: Floats, covariance: Floats) -> JointInputs:
    """Normal quantities with a covariance matrix (JCGM 101 6.4.8); mean (m,), covariance (m, m).

    Raises
    ------
    CmmUqError : a matrix that is not symmetric or has a variance that is not positive.
    """
    matrix = np.asarray(covariance, dtype=np.float64)
    if matrix.shape != (len(names), len(names)) or not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0):
        raise CmmUqError("the covariance matrix is not symmetric with one row a quantity", where=", ".join(names))
    if not np.all(np.diagonal(matrix) > 0):
        raise CmmUqError("a variance is not positive", where=", ".join(names), fix="Leave constants out of the matrix")
    u = np.sqrt(np.diagonal(matrix))
    inputs = {name: normal(float(x), float(s)) for name, x, s in zip(names, mean, u, strict=True)}
    return JointInputs(inputs, _pairs(names, correlation_of(matrix)))


@dataclass(frozen=True, eq=False)
class Line:
    """Straight line y = intercept + slope (x − reference) by least squares (JCGM 100 annex H.3).

    Parameters
    ----------
    covariance : (2, 2) of intercept and slope.
    residual_sd : standard deviation of the residuals, n − 2 degrees of freedom.
    """

    reference: float
    intercept: float
    slope: float
    covariance: Floats
    residual_sd: float
    dof: int

    def at(self, x: Floats | float) -> tuple[Floats, Floats]:
        """The line's value at x and its standard uncertainty, shape of x."""
        step = np.asarray(x, dtype=np.float64) - self.reference
        (v11, v12), (_, v22) = self.covariance
        return self.intercept + self.slope * step, np.sqrt(v11 + 2 * step * v12 + step**2 * v22)

    def inputs(self, intercept: str, slope: str) -> JointInputs:
        """Intercept and slope as correlated inputs of a measurement model."""
        u, r = np.sqrt(np.diagonal(self.covariance)), correlation_of(self.covariance)[0, 1]
        return JointInputs(
            {
                intercept: student_t(self.intercept, float(u[0]), float(self.dof)),
                slope: student_t(self.slope, float(u[1]), float(self.dof)),
            },
            {(intercept, slope): float(r)},
        )


def straight_line(x: Sequence[float] | Floats, y: Sequence[float] | Floats, reference: float = 0.0) -> Line:
    """Fit a line to readings y of equal, unknown uncertainty at positions x that are known (JCGM 100 annex H.3).

    Raises
    ------
    CmmUqError : fewer than three points, or all at the same x.
    """
    table = _table({"x": x, "y": y})
    n = table.shape[1]
    step, readings = table[0] - reference, table[1]
    if n < 3 or np.ptp(step) == 0:
        raise CmmUqError("a line needs three points or more that are not all at the same place")
    design = np.column_stack([np.ones(n), step])
    q, r = np.linalg.qr(design)
    intercept, slope = np.linalg.solve(r, q.T @ readings)
    variance = float(np.sum((readings - design @ [intercept, slope]) ** 2) / (n - 2))
    inverse = np.linalg.inv(r)
    return Line(reference, float(intercept), float(slope), variance * inverse @ inverse.T, variance**0.5, n - 2)


def _table(readings: Mapping[str, Sequence[float] | Floats]) -> Floats:
    lengths = {name: np.size(column) for name, column in readings.items()}
    if len(set(lengths.values())) != 1:
        told = ", ".join(f"{name} {n}" for name, n in lengths.items())
        raise CmmUqError(f"the numbers of readings differ: {told}", fix="Give one reading of each quantity at a time")
    table = np.array([np.asarray(column, dtype=np.float64) for column in readings.values()])
    for name, column in zip(readings, table, strict=True):
        if len(column) < 2:
            raise CmmUqError(
                f"{len(column)} reading of {name} says nothing of its scatter", fix="Read it at least twice"
            )
        if not np.all(np.isfinite(column)):
            raise CmmUqError(f"a reading of {name} is not finite")
        if np.ptp(column) == 0:
            raise CmmUqError(
                f"all readings of {name} are the same",
                fix="Their scatter is below the resolution: state that as a rectangular input",
            )
    return table


def _pairs(names: Sequence[str], matrix: Floats) -> dict[tuple[str, str], float]:
    kept = np.clip(matrix, -1.0, 1.0)
    return {(names[i], names[j]): float(kept[i, j]) for j in range(len(names)) for i in range(j) if kept[i, j] != 0}
