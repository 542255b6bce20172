"""The three integrations of Shimizu, Kiyono & Gao, "A Self-calibration Method for Coordinate Measuring Machines".

An artefact is read twice, at a[i] and, shifted by D, at b[i]. The calibration curve h, true = h(reading), has the slope
D/(b − a) about there (3), which is summed from the first point on: by (6) for equal or unequal pitch, by (8) improved for
unequal pitch. Two signs of the source contradict its other equations and are mended here: (4) must be the mean of b − a
for (3) to hold, and (8) must halve the sum of neighbouring slopes, as (7) does. Sums of slopes share readings, so neighbouring
points are strongly correlated.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass

Readings = NDArray[Any]  # (..., n) mm; real, or complex where a derivative is taken by a complex step
Method = Literal["pitch", "improved"]  # ``pitch``: equation (6), equal or unequal pitch; ``improved``: equation (8)


def check_readings(a: Floats, b: Floats) -> None:
    """Refuse two series that no shift can have given."""
    if a.shape != b.shape or a.ndim != 1:
        raise CmmUqError(f"the first series has {a.shape[-1]} readings, the shifted one {b.shape[-1]}",
                         fix="Read every point in both placings, or leave it out of both")  # fmt: skip
    if len(a) < 2:
        raise CmmUqError("fewer than two points are read in both series", fix="Read at least two points twice")
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        raise CmmUqError("a reading is no finite number", fix="Read the point again, or leave it out of both series")
    for name, series in (("first", a), ("shifted", b)):
        bad = np.flatnonzero(np.sign(np.diff(series)) != np.sign(series[-1] - series[0]))
        if bad.size:
            raise CmmUqError(f"the {name} series is out of order at point {bad[0] + 2}",
                             fix="Number the points along the artefact, the same way in both placings")  # fmt: skip
    difference = b - a
    if np.any(difference == 0) or np.ptp(np.sign(difference)) > 0:
        raise CmmUqError("the second placing is not shifted against the first",
                         fix="Shift the artefact along the axis by about the pitch of its points")  # fmt: skip
    if np.abs(difference).min() > np.ptp(a):
        problem = f"shifted by {abs(difference.mean()):g} mm, the artefact of {np.ptp(a):g} mm reads no range twice"
        raise CmmUqError(problem, fix=f"Shift it by less than {np.ptp(a):g} mm, best by the pitch of its points")


def estimated_shift(a: Readings, b: Readings) -> Readings:
    """D as the readings have it, (...), mm: the mean of b − a. Source: (4), with the sign that (3) needs."""
    return np.asarray((b - a).mean(axis=-1))


def local_sensitivity(a: Readings, b: Readings, shift: Readings) -> Readings:
    """Slopes h' of the calibration curve about each point, (..., n). Source: (3)."""
    return np.asarray(np.expand_dims(shift, -1) / (b - a))


def calibration_curve(
    a: Readings, b: Readings, shift: Readings | float | None = None, method: Method = "pitch"
) -> Readings:
    """True position of each point of the first series from the first point, (..., n) mm.

    ``a``, ``b`` (..., n) readings of the points before and after the shift, mm; ``shift`` true shift, mm;
    :func:`estimated_shift` when left out.
    """
    slope = local_sensitivity(a, b, estimated_shift(a, b) if shift is None else np.asarray(shift))
    if method == "pitch":
        steps = slope[..., :-1] * np.diff(a, axis=-1)
    else:
        # over the shift the slope of this point holds; over what is left of the pitch that of both neighbours
        steps = slope[..., :-1] * (b - a)[..., :-1] + (slope[..., :-1] + slope[..., 1:]) / 2 * (
            a[..., 1:] - b[..., :-1]
        )
    return np.concatenate([np.zeros_like(a[..., :1]), np.cumsum(steps, axis=-1)], axis=-1)


def with_known_length(curve: Readings, first: int, last: int, length: Readings | float) -> Readings:
    """The curve with its mean sensitivity from a known length between two points (indices from 0), such as a gauge block's.

    The shift then cancels: a curve is proportional to it.
    """
    ratio = np.asarray(length) / (curve[..., last] - curve[..., first])
    return np.asarray(curve * np.expand_dims(ratio, -1))


def position_error(a: Readings, curve: Readings) -> Readings:
    """Error e of each reading, true = indicated + e, zero at the first point; (..., n) mm."""
    return np.asarray(curve - (a - a[..., :1]))


_STEP = 1e-30  # of the complex derivative, which is exact to rounding at any step


@dataclass(frozen=True)
class KnownSpan:
    """A length known between two points (indices from 0), mm."""

    first: int
    last: int
    length: float
    u: float


@dataclass(frozen=True, eq=False)
class IntegratedCurve:
    """Error e of each reading of the first series, true = indicated + e."""

    position: Floats  # (n,) readings, mm
    error: Floats  # (n,) mm, zero at the first point
    covariance: Floats  # (n, n) mm²

    @property
    def u(self) -> Floats:
        """(n,) standard uncertainties, mm."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


def integrated(
    a: Floats, b: Floats, u: Floats, *, method: Method = "pitch", shift: float | None = None, u_shift: float = 0.0,
    known: KnownSpan | None = None,
) -> IntegratedCurve:  # fmt: skip
    """Curve with its covariance by the law of propagation (JCGM 100:2008, 5.2.2; JCGM 102:2011, 6.2).

    ``a``, ``b`` (n,) readings, mm; ``u`` (2, n) their standard uncertainties, independent, mm; ``shift``, ``u_shift``
    true shift and its standard uncertainty, mm; from the readings when left out.
    """
    check_readings(a, b)
    given = [] if shift is None else [(shift, u_shift)]
    given += [] if known is None else [(known.length, known.u)]
    further, sd = np.array(given, dtype=np.float64).reshape(-1, 2).T
    inputs, n = np.concatenate([a, b, further]), len(a)

    def error(of: Readings) -> Readings:
        first, second = of[..., :n], of[..., n : 2 * n]
        curve = calibration_curve(first, second, None if shift is None else of[..., 2 * n], method)
        if known is not None:
            curve = with_known_length(curve, known.first, known.last, of[..., -1])
        return position_error(first, curve)

    sensitivity = error(inputs + 1j * _STEP * np.eye(len(inputs))).imag / _STEP
    scaled = sensitivity * np.concatenate([*u, sd])[:, None]
    return IntegratedCurve(a, error(inputs), scaled.T @ scaled)
