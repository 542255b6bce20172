"""The linear model of a calibration's recording with what the calibration left out of its model.

However many errors were left out, a recording sees no more combinations of them than it has observations: those are its
unknowns beside the calibration's own. Each error takes up what is said of them by its covariance with them, and keeps its
prior in what is not seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cmm_uq.analysis.parts.at_each import shown
from cmm_uq.analysis.parts.machine import Unmodelled
from cmm_uq.analysis.parts.periods import GivenPeriod, covariance, linear
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.units import unit
from cmm_uq.machine.model.measurement import ARTEFACT, MeasurementModel
from cmm_uq.machine.physics.drives import PeriodicScale
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.maths.inference.least_squares import LeastSquares
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown

_UNSEEN = 0.01
"""Of the scatter of the residuals: what a combination of errors adds to the observations below which they do not show it."""

_MOST = 400
"""Combinations, those that the recording sees best; what others say is left to their prior."""

_SMALLEST = 1e-6
"""mm: the smallest noise that is sampled."""

_ROWS = 1000
"""Draws at once."""


@dataclass(frozen=True, eq=False)
class _Given:
    """An error that was left out, with what a recording says of it: its part of :class:`Together`."""

    effect: Effect
    sd: Floats
    seen: Floats
    gain: Floats


@dataclass(frozen=True, eq=False)
class _Shown:
    """What the recording shows of an error that was left out.

    Attributes
    ----------
    effect : linear; of a periodic one the sum of its trials.
    sd : (j,) of its coefficients beforehand: what physics allows, since the recording itself says how large it may be.
    columns : (m, j) mm of the observations for these, without what a placing reaches, which shows nothing.
    covariance : (m, m) mm² beforehand.
    periodic : the effect itself where it is periodic, else ``None``.
    readings, impulse : (p,) mm where its scale stood; (m, p) of the observations for a millimetre of error at each.
    """

    effect: Effect
    sd: Floats
    columns: Floats
    covariance: Floats
    periodic: PeriodicScale | None
    readings: Floats
    impulse: Floats

    @classmethod
    def of(cls, effect: Effect, model: MeasurementModel, own: LinearModel, about: Floats) -> _Shown:
        whole, nothing = linear(effect), np.zeros(0)
        sd = np.array([coefficient.prior_sd for coefficient in whole.coefficients])
        if not isinstance(effect, PeriodicScale):
            columns = sd * _left(own, model.seen(model.columns(whole, (), about), about))
            return cls(whole, sd, columns, columns @ columns.T, None, nothing, nothing)
        points, impulse = model.artefact.points, _left(own, shown(model, effect))
        readings = points.readings[effect.axis]
        columns = sd * (impulse @ whole.basis(points)[:, "xyz".index(effect.axis)])
        beforehand = impulse @ covariance(effect, readings, readings) @ impulse.T
        return cls(whole, sd, columns, beforehand, effect, readings, impulse)

    def given(self, into: Floats) -> _Given:
        """The effect with the recording.

        Parameters
        ----------
        into : (m, r) whose transpose takes observations, mm, to combinations.
        """
        seen = into.T @ self.columns
        if self.periodic is None:
            return _Given(self.effect, self.sd, seen, seen * self.sd)
        none = np.zeros((len(seen), len(seen)))
        return _Given(
            GivenPeriod(self.periodic, self.readings, self.impulse.T @ into), np.append(self.sd, np.zeros(len(seen))),
            np.hstack([seen, none]), np.hstack([np.zeros_like(seen), np.eye(len(seen))]),
        )  # fmt: skip


def _left(own: LinearModel, columns: Floats) -> Floats:
    """Columns (m, j), mm, without what a placing reaches."""
    return np.asarray(own.reduce(columns) * own.noise_scale[:, None])


@dataclass(frozen=True, eq=False)
class Together:
    """The linear model of a calibration with what it left out.

    Attributes
    ----------
    linear : of the calibration's unknowns, then of combinations of what it left out, standard normal beforehand.
    estimate : least squares of the calibration, where these are zero.
    which : places of what takes part in what was left out.
    effects : those, linear.
    sd : (f,) of their coefficients beforehand, zero of what a recording says of an error with a period.
    seen : (r, f) combinations that the recording sees, of the coefficients over their standard deviations.
    gain : (r, f) what a combination that is larger by one says of each coefficient.
    """

    linear: LinearModel
    estimate: LeastSquares
    which: tuple[int, ...]
    effects: tuple[Effect, ...]
    sd: Floats
    seen: Floats
    gain: Floats

    @classmethod
    def of(cls, model: MeasurementModel, further: Sequence[Unmodelled]) -> Together:
        """Of a calibration and of what it left out; what needs columns that were not recorded takes no part."""
        recorded = model.artefact.points.columns
        which = tuple(i for i, one in enumerate(further) if all(name in recorded for name in one.effect.columns))
        estimate = model.estimate()
        own = estimate.linear
        each = [_Shown.of(further[i].effect, model, own, estimate.about) for i in which]
        beforehand = sum((one.covariance for one in each), np.zeros((len(own.observed), len(own.observed))))
        squares, axes = np.linalg.eigh(beforehand)
        least = max(_SMALLEST, _UNSEEN * estimate.least_squares.sigma_of_residuals)
        kept = np.flatnonzero(squares > least**2)[::-1][:_MOST]
        sizes, axes = np.sqrt(squares[kept]), axes[:, kept]
        one = unit("1")
        combined = tuple(Unknown(("left out", str(j)), one, 0.0, 1.0, 1.0) for j in range(len(kept)))
        whole = replace(own, design=np.hstack([own.design, axes * sizes]), unknowns=(*own.unknowns, *combined))
        value = np.append(estimate.least_squares.value, np.zeros(len(combined)))
        given = [one.given(axes / sizes) for one in each]
        none = np.zeros((len(kept), 0))
        return cls(
            whole, replace(estimate.least_squares, value=value), which, tuple(one.effect for one in given),
            np.concatenate([np.zeros(0), *(one.sd for one in given)]), np.hstack([none, *(one.seen for one in given)]),
            np.hstack([none, *(one.gain for one in given)]),
        )  # fmt: skip

    def white(self, sigma_mm: float) -> tuple[Floats, Floats]:
        """Mean (u,) of the linear model's unknowns, and R (u, u) of their covariance RᵀR, for a white noise that is known.

        Raises
        ------
        CmmUqError : the recording leaves even the sizes of the artefact open.
        """
        rows, given = self.linear.priors
        scale = np.array([unknown.scale for unknown in self.linear.unknowns])
        whitened = np.vstack([self.linear.reduced.design / sigma_mm, rows]) * scale
        if np.linalg.matrix_rank(whitened) < whitened.shape[1]:
            raise open_size()
        inverse = scale[:, None] * np.linalg.pinv(whitened)
        mean = inverse @ np.append(self.linear.reduced.observed / sigma_mm, given)
        return mean, np.asarray(np.linalg.qr(inverse.T, mode="r"))

    def coefficients(self, draws: Floats, random: np.random.Generator) -> Floats:
        """(N, k + f) of the calibration's effects, then of what it left out, of draws (N, …) of the linear model."""
        k = len(draws[0]) - len(self.seen) - self._sizes
        found = np.empty((len(draws), k + len(self.sd)))
        found[:, :k] = draws[:, :k]
        for start in range(0, len(draws), _ROWS):
            rows = slice(start, start + _ROWS)
            free = self._beforehand(random, len(draws[rows]))
            more = draws[rows, len(draws[0]) - len(self.seen) :] - free @ self.seen.T
            free *= self.sd
            free += more @ self.gain
            found[rows, k:] = free
        return found

    def _beforehand(self, random: np.random.Generator, count: int) -> Floats:
        """Draws (N, f) of the coefficients over their standard deviations, without the recording."""
        each = [
            effect.beforehand(random, count) if isinstance(effect, GivenPeriod)
            else random.standard_normal((count, len(effect.coefficients)))
            for effect in self.effects
        ]  # fmt: skip
        return np.hstack([np.zeros((count, 0)), *each])

    @property
    def _sizes(self) -> int:
        """How many of the calibration's unknowns are sizes of its artefact."""
        return sum(unknown.key[0] == ARTEFACT for unknown in self.linear.unknowns)


def open_size() -> CmmUqError:
    """What is raised where nothing says how large the artefact is."""
    return CmmUqError("the recording leaves a size of its artefact open, of which nothing is known beforehand",
                      where="the calibration", fix="Give the artefact's length")  # fmt: skip
