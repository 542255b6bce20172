"""Uncertainty of an integrated curve: law of propagation, and Monte Carlo.

Sums of slopes share readings, so neighbouring points are strongly correlated: without a known length the curve is worst at
its end, with one it is pinned at two points and worst between them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmm_uq.artefacts.shift_axis.shift_integration import (
    Method,
    Readings,
    calibration_curve,
    check_readings,
    position_error,
    with_known_length,
)
from cmm_uq.base.points import Floats

_STEP = 1e-30
"""Of the complex derivative, which is exact to rounding at any step."""


@dataclass(frozen=True)
class KnownSpan:
    """A length known between two points (indices from 0), mm."""

    first: int
    last: int
    length: float
    u: float


@dataclass(frozen=True, eq=False)
class IntegratedCurve:
    """Error e of each reading of the first series, true = indicated + e.

    Parameters
    ----------
    position : (n,) readings, mm.
    error : (n,) mm, zero at the first point.
    covariance : (n, n) mm².
    """

    position: Floats
    error: Floats
    covariance: Floats

    @property
    def u(self) -> Floats:
        """(n,) standard uncertainties, mm."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


def integrated(
    a: Floats, b: Floats, u: Floats, *, method: Method = "pitch", shift: float | None = None, u_shift: float = 0.0,
    known: KnownSpan | None = None,
) -> IntegratedCurve:  # fmt: skip
    """Curve with its covariance by the law of propagation (JCGM 100:2008, 5.2.2; JCGM 102:2011, 6.2).

    Parameters
    ----------
    a, b : (n,) readings, mm.
    u : (2, n) their standard uncertainties, independent, mm.
    method : of integration.
    shift, u_shift : true shift and its standard uncertainty, mm; from the readings when left out.
    known : length that gives the mean sensitivity.

    Raises
    ------
    CmmUqError : the readings cannot have come from a shift.
    """
    check_readings(a, b)
    inputs, sd = _inputs(a, b, u, shift, u_shift, known)
    stepped = inputs + 1j * _STEP * np.eye(len(inputs))
    sensitivity = _error(stepped, len(a), method, shift, known).imag / _STEP
    error = _error(inputs, len(a), method, shift, known)
    scaled = sensitivity * sd[:, None]
    return IntegratedCurve(a, error, scaled.T @ scaled)


def integrated_by_monte_carlo(
    a: Floats, b: Floats, u: Floats, *, method: Method = "pitch", shift: float | None = None, u_shift: float = 0.0,
    known: KnownSpan | None = None, trials: int = 100_000, seed: int = 0,
) -> IntegratedCurve:  # fmt: skip
    """The same by propagating distributions (JCGM 102:2011, 7): mean and covariance of Gaussian trials."""
    check_readings(a, b)
    inputs, sd = _inputs(a, b, u, shift, u_shift, known)
    drawn = inputs + sd * np.random.default_rng(seed).standard_normal((trials, len(inputs)))
    errors = _error(drawn, len(a), method, shift, known)
    return IntegratedCurve(a, errors.mean(axis=0), np.cov(errors, rowvar=False))


def _inputs(
    a: Floats, b: Floats, u: Floats, shift: float | None, u_shift: float, known: KnownSpan | None
) -> tuple[Floats, Floats]:
    """Readings, shift and known length as one vector, and their standard uncertainties."""
    given = [] if shift is None else [(shift, u_shift)]
    given += [] if known is None else [(known.length, known.u)]
    more = np.array(given, dtype=np.float64).reshape(-1, 2)
    return np.concatenate([a, b, more[:, 0]]), np.concatenate([u[0], u[1], more[:, 1]])


def _error(inputs: Readings, n: int, method: Method, shift: float | None, known: KnownSpan | None) -> Readings:
    a, b = inputs[..., :n], inputs[..., n : 2 * n]
    curve = calibration_curve(a, b, None if shift is None else inputs[..., 2 * n], method)
    if known is not None:
        curve = with_known_length(curve, known.first, known.last, inputs[..., -1])
    return position_error(a, curve)
