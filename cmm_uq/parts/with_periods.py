"""All errors of a machine given a recording, those with a period with one each a draw; for one noise, or one of several.

A short period goes by where the scale truly stood, not by what noise made of it: otherwise a wave that is steep there would
seem to explain the noise. Readings are therefore taken less the noise that errors of any period leave.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.inference.linear_model import LinearModel, Whiten
from cmm_uq.model.measurement import MeasurementModel
from cmm_uq.parts.drawn_periods import DrawnPeriod, shown
from cmm_uq.parts.machine import Unmodelled
from cmm_uq.parts.one_period import Found, draw, systematic
from cmm_uq.parts.waves import Wave, coefficients_given, evidence_of
from cmm_uq.points import Floats, Ints
from cmm_uq.units import MICROMETRE

_SEEN = 1e-10
"""Part of an observation's variance below which other errors leave nothing of it."""

_NOTHING = 1e-6
"""Part of the largest singular value below which observations show nothing."""

_SAME = 1e-3
"""mm between readings that are taken as one: a wave of half a millimetre turns by less than a hundredth of a radian."""

_TRIED = 400
"""Combinations by which noises are weighed against each other."""

_LEAST = 5.0
"""Noises that weights must leave, in effect."""


class Conditioned:
    """A linear model for one noise, with errors of one period each beside it.

    Parameters
    ----------
    model : of the calibration.
    linear : of its unknowns and of what it left out without a period, in observations without correlation.
    sigma_mm : their noise.
    periodic : errors with a period.
    whiten : what makes the observations uncorrelated; nothing where they are.
    stood : (n,) where the scale of each error stood at the model's points, mm; its readings without them.
    """

    def __init__(
        self, model: MeasurementModel, linear: LinearModel, sigma_mm: float, periodic: Sequence[Unmodelled],
        whiten: Whiten | None = None, stood: Sequence[Floats] | None = None,
    ) -> None:  # fmt: skip
        self.periodic = periodic
        if whiten is not None:
            linear = linear.uncorrelated(whiten)
        rows, given = linear.priors
        self._scale = np.array([unknown.scale for unknown in linear.unknowns])
        root = np.vstack([linear.reduced.design / sigma_mm, rows]) * self._scale
        self._target = np.append(linear.reduced.observed / sigma_mm, given)
        self.open = bool(np.linalg.matrix_rank(root) < root.shape[1])
        self._m = m = len(linear.reduced.observed)
        self._Q, self._R = np.linalg.qr(root)
        left = (self._target - self._Q @ (self._Q.T @ self._target))[:m]
        values, V = np.linalg.eigh(np.eye(m) - self._Q[:m] @ self._Q[:m].T)
        kept = values > _SEEN
        W = (V[:, kept] * np.sqrt(values[kept])).T
        v = (V[:, kept] / np.sqrt(values[kept])).T @ left
        if stood is None:
            readings = model.artefact.points.readings
            stood = [readings[str(one.effect.along_motion)] for one in periodic]
        self.stood = stood
        each = [shown(model, one.effect) for one in periodic]
        self._impulses = [linear.reduce(one if whiten is None else whiten(one)) / sigma_mm for one in each]
        self._W, whole = W, v
        at, self._shown = zip(*(_together(x, seen) for x, seen in zip(stood, self._impulses, strict=True)), strict=True)
        U, s, _ = np.linalg.svd(W @ np.hstack(self._shown), full_matrices=False)
        basis = U[:, s > _NOTHING * s[0]]
        self.v, self._v = basis.T @ whole, whole
        self.waves = [
            Wave(x, basis.T @ W @ own, MICROMETRE * one.effect.coefficients[0].prior_sd,
                 1 / one.effect.shape[0].high, 1 / one.effect.shape[0].low)
            for one, x, own in zip(periodic, at, self._shown, strict=True)
        ]  # fmt: skip
        self._basis = basis

    def without_noise(self) -> list[Floats]:
        """(n,) of each error, where its scale stood: readings less the noise that is likely beside errors of any period."""
        K = np.eye(len(self.v)) + sum(wave.beforehand() for wave in self.waves)
        own = self._v - self._basis @ self.v + self._basis @ np.linalg.solve(K, self.v)
        impulses = np.hstack(self._impulses)
        n = np.linalg.lstsq(impulses, self._W.T @ own, rcond=1e-9)[0]
        return [x + moved for x, moved in zip(self.stood, np.split(n, len(self.stood)), strict=True)]

    def evidence(self, frequency: Floats) -> Floats:
        """(N,) log of it, of frequencies (N, w), over that of no period."""
        return evidence_of(self.v, self.waves, frequency)

    def combinations(self, count: int, random: np.random.Generator) -> Found:
        """Frequencies by their evidence."""
        return draw(self.v, self.waves, count, random)

    def drawn(self, frequency: Floats, random: np.random.Generator) -> tuple[Floats, Floats]:
        """Of frequencies (N, w): amplitudes of sines and cosines (N, 2w), mm, and the linear model's parameters (N, k)."""
        own = coefficients_given(self.v, self.waves, frequency, random)
        normal = random.standard_normal((len(frequency), len(self._target))) + self._target
        for i, (wave, seen) in enumerate(zip(self.waves, self._shown, strict=True)):
            one = DrawnPeriod(self.periodic[i].effect, frequency[:, i], own[:, 2 * i : 2 * i + 2])
            normal[:, : self._m] -= one.at(wave.reading) @ seen.T
        return own, np.asarray(self._scale * np.linalg.solve(self._R, (normal @ self._Q).T).T)


class Noises:
    """Several noises, of which every draw has one.

    Parameters
    ----------
    usual : the model for a usual noise.
    each : for each of s noises.
    likelier : (s,) how much likelier each is, in its logarithm, without the errors that have a period than it was thought to
        be; nothing where all are as likely, whatever the recording says.
    """

    def __init__(self, usual: Conditioned, each: Sequence[Conditioned], likelier: Floats | None = None) -> None:
        self.usual, self.each, self.likelier = usual, each, likelier

    def drawn(self, found: Found, random: np.random.Generator) -> tuple[Ints, Floats, float]:
        """Which noise (N,) each draw of the usual one now has, its frequencies (N, w), and the part that weights leave."""
        count = len(found.frequency)
        if len(self.each) == 1:
            return np.zeros(count, dtype=np.int64), found.frequency, found.effective
        some = found.frequency[:: max(1, count // _TRIED)]
        start = self.usual.evidence(some)
        ratio = np.array([one.evidence(some) - start for one in self.each])
        top = ratio.max(axis=1)
        mean = np.log(np.exp(ratio - top[:, None]).mean(axis=1)) + top
        log = np.zeros(len(mean)) if self.likelier is None else self.likelier + mean
        weight = np.exp(log - log.max())
        if weight.sum() ** 2 / (weight**2).sum() < _LEAST:
            return np.zeros(count, dtype=np.int64), found.frequency, 0.0
        which = systematic(weight, count, random)
        random.shuffle(which)
        left = -self.usual.evidence(found.frequency)
        for i in np.unique(which):
            own = which == i
            left[own] += self.each[i].evidence(found.frequency[own]) - mean[i]
        last = np.exp(left - left.max())
        again = systematic(last, count, random)
        effective = min(found.effective, float(last.sum() ** 2 / (last**2).sum()) / count)
        return which[again], found.frequency[again], effective


def _together(reading: Floats, seen: Floats) -> tuple[Floats, Floats]:
    """Readings (u,) that differ, and what observations (m, u) show of an error there."""
    order = np.argsort(reading)
    index = np.empty(len(reading), dtype=np.int64)
    index[order] = np.cumsum(np.diff(reading[order], prepend=reading[order[0]]) > _SAME)
    count = np.bincount(index)
    into = np.zeros((len(reading), len(count)))
    into[np.arange(len(reading)), index] = 1.0
    return np.bincount(index, reading) / count, seen @ into
