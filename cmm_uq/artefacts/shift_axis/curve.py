"""The error of an axis from all shifted readings at once, with its posterior.

    reading + e(reading) = X_point · cos + D_series + drift · time + noise,    e(x) = slope · x + smooth function

The artefact's dimensions X and the slope are free; D is known, or known within its uncertainty; a known length ties two X.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cmm_uq.artefacts.shift_axis.integration import KnownSpan
from cmm_uq.artefacts.shift_axis.series import RepeatedDrift, ShiftedSeries
from cmm_uq.artefacts.shifting.smooth_function import FINEST, SmoothFunction
from cmm_uq.artefacts.shifting.smooth_model import Coefficients, SmoothModel, sampled
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.units import HOUR, MICROMETRE
from cmm_uq.maths.inference.ensembles import Chains, Progress
from cmm_uq.maths.uncertainty.quantity import expanded_of

_TYPICAL = 5 * MICROMETRE
_DRIFT = 10 * MICROMETRE  # standard deviation of the drift, mm per hour


@dataclass(frozen=True, eq=False)
class Curve:
    """Draws of e at positions, true = indicated + e."""

    position: Floats  # (m,) mm
    draws: Floats  # (N, m) mm

    @cached_property
    def error(self) -> Floats:
        """(m,) posterior means, mm."""
        return np.asarray(self.draws.mean(axis=0))

    @cached_property
    def u(self) -> Floats:
        """(m,) standard uncertainties, mm."""
        return np.asarray(self.draws.std(axis=0, ddof=1))

    @cached_property
    def interval95(self) -> tuple[Floats, Floats]:
        """Ends of the 95 % interval at each position."""
        low, high = np.quantile(self.draws, [0.025, 0.975], axis=0)
        return np.asarray(low), np.asarray(high)

    @cached_property
    def expanded(self) -> Floats:
        """(m,) U: at each position the larger distance from the error to an end of its 95 % interval, mm."""
        return expanded_of(self.draws, self.error)

    @cached_property
    def band(self) -> Floats:
        """(m,) half width of the band that holds the whole curve with 95 % probability, mm."""
        return self.simultaneous_factor * self.u

    @cached_property
    def simultaneous_factor(self) -> float:
        """The k for which error ± k·u holds the whole curve in 95 % of draws."""
        moving = self.u > 1e-9 * max(self.u.max(), 1e-12)
        if not moving.any():
            return 0.0
        away = np.abs(self.draws[:, moving] - self.error[moving]) / self.u[moving]
        return float(np.quantile(away.max(axis=1), 0.95))


@dataclass(frozen=True, eq=False)
class CurveEstimate:
    """All that the readings say of an axis."""

    series: ShiftedSeries  # series, known: what it was made from
    known: KnownSpan | None
    coefficients: Coefficients  # joint draws of everything linear
    chains: Chains  # of the hyper-parameters, and how they converged
    seed: int  # of everything random
    scale_known: bool  # whether the mean sensitivity is determined: by a known length, or by shifts known exactly

    @cached_property
    def _ends(self) -> Floats:
        a = self.series.reading[self.series.series == 0]
        return np.array([a[0], a[-1]])

    def _raw(self, position: Floats) -> Floats:
        slope = self.coefficients.flat[:, -1:]
        return np.asarray(slope * (position - self._ends[0]) + self.coefficients.function(0, position))

    def at(self, position: Floats) -> Curve:
        """The curve, zero at the first reading of the first series; at its last one too unless the scale is known."""
        values, ends = self._raw(position), self._raw(self._ends)
        values -= ends[:, :1]
        if not self.scale_known:
            part = (position - self._ends[0]) / (self._ends[1] - self._ends[0])
            values -= (ends[:, 1:] - ends[:, :1]) * part
        return Curve(position, values)

    @cached_property
    def curve(self) -> Curve:
        return self.at(self.series.positions)

    @cached_property
    def scale(self) -> Floats:
        """(N,) draws of the mean of e' between the first and last reading of the first series."""
        ends = self._raw(self._ends)
        return np.asarray((ends[:, 1] - ends[:, 0]) / (self._ends[1] - self._ends[0]))

    @cached_property
    def about_the_ends(self) -> Floats:
        """(N, m) draws of the curve about the line through its ends at the first series, mm."""
        draws = self.curve.draws
        return draws - self.scale[:, None] * (self.curve.position - self._ends[0]) if self.scale_known else draws

    @cached_property
    def shifts(self) -> Floats:
        """(N, s) draws of the shift of each series against the first, mm; the nominal ones where they are known exactly."""
        nominal = np.tile(self.series.shifts, (len(self.sigma), 1))
        if self.series.u_shift > 0:
            nominal[:, 1:] += self.coefficients.columns[:, : len(self.series.shifts) - 1]
        return nominal

    @property
    def sigma(self) -> Floats:
        """(N,) draws of the standard uncertainty of one reading, mm."""
        return self.coefficients.sigma

    @cached_property
    def artefact(self) -> Floats:
        """(N, p) draws of the distances of the points from the first along the artefact, mm."""
        flat, columns = self.coefficients.flat, self.coefficients.columns
        places = flat @ _point_columns(self.series, self.known).T
        if self.known is not None:
            places[:, self.known.last] += self.known.length
            if self.known.u > 0:
                places[:, self.known.last] += columns[:, -1]
        return np.asarray(places - places[:, :1])

    @cached_property
    def residuals(self) -> tuple[Floats, Floats]:
        """(n,) what does not fit, mm: with no error of the machine but its scale, and with the curve."""
        count = len(self.series.reading)
        before = self.coefficients.model.without_functions(float(self.sigma.mean()))
        return before[:count], self.coefficients.left[:count]


def estimate_curve(
    series: ShiftedSeries,
    known: KnownSpan | None = None,
    *,
    sigma: float | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> CurveEstimate:
    """Fit all readings at once.

    ``sigma`` standard uncertainty of one reading, mm; from repeats and residuals when left out.
    """
    model = _model(series, known, sigma)
    if len(series.reading) - model.flat.shape[1] < 1:
        raise CmmUqError(f"{len(series.reading)} readings of {len(series.numbers)} points leave nothing to compare",
                         fix="Read more points in both placings, or a third placing")  # fmt: skip
    coefficients, chains = sampled(model, seed, progress)
    return CurveEstimate(series, known, coefficients, chains, seed, known is not None or series.u_shift == 0)


def _point_columns(series: ShiftedSeries, known: KnownSpan | None) -> Floats:
    """(p, q) which flat coefficient, the slope last, is the place of each point: a known length lends two points one."""
    count = len(series.numbers)
    same = np.arange(count)
    if known is not None:
        same[known.last] = known.first
    own, index = np.unique(same, return_inverse=True)
    columns = np.zeros((count, len(own) + 1))
    columns[np.arange(count), index] = 1.0
    return columns


def _model(series: ShiftedSeries, known: KnownSpan | None, sigma: float | None) -> SmoothModel:
    low, high = series.span
    cosine = series.cosine[series.series]
    flat = cosine[:, None] * _point_columns(series, known)[series.point]
    start = series.reading[series.series == 0][0]
    flat[:, -1] = start - series.reading
    observed = series.reading - series.shifts[series.series]
    columns, sd = [], []
    if series.u_shift > 0:
        columns += [(series.series == s).astype(np.float64) for s in range(1, len(series.shifts))]
        sd += [series.u_shift] * (len(series.shifts) - 1)
    if series.time is not None:
        columns.append((series.time - series.time[series.series == 0].mean()) / HOUR)
        sd.append(_DRIFT)
    if known is not None:
        ends = cosine * (series.point == known.last)
        observed = observed - known.length * ends
        if known.u > 0:
            columns.append(ends)
            sd.append(known.u)
    shortest = max(FINEST * (high - low), 0.5 * series.pitch)
    smooth = SmoothFunction(
        f"linearity_{series.axis}", low, high, shortest, series.reading, -np.ones(len(series.reading)), _TYPICAL
    )
    model = SmoothModel(
        observed, series.noise_scale, flat, np.column_stack(columns) if columns else np.zeros((len(observed), 0)),
        np.array(sd, dtype=np.float64), (smooth,), None if sigma is not None else series.scatter, sigma,
    )  # fmt: skip
    return (
        model if series.drift is None else _with_drift_seen(model, series.drift, series.u_shift > 0, len(series.shifts))
    )


def _with_drift_seen(model: SmoothModel, seen: RepeatedDrift, shifts_free: bool, count: int) -> SmoothModel:
    """One observation more: the drift that repeats show, of the column that stands after those of the shifts."""
    row = np.zeros((1, model.columns.shape[1]))
    row[0, count - 1 if shifts_free else 0] = 1.0
    smooth = model.functions[0]
    nowhere = replace(smooth, position=np.r_[smooth.position, smooth.low], factor=np.r_[smooth.factor, 0.0])
    return replace(
        model, observed=np.r_[model.observed, seen.rate], noise_scale=np.r_[model.noise_scale, seen.noise_scale],
        flat=np.vstack([model.flat, np.zeros((1, model.flat.shape[1]))]), columns=np.vstack([model.columns, row]),
        functions=(nowhere,),
    )  # fmt: skip
