"""Whether what is stated of one machine agrees with itself, by whichever way each figure was found.

A certificate states a machine several times over: error factors by the named errors alone; slopes of lines and errors of
lengths as they were read; and, of the draws of all errors together, the factors once more, what lengths are to be expected,
figures of performance without noise, error maps, parts. Of one quantity x₁ ± u₁ and x₂ ± u₂ disagree where

    |x₁ − x₂| > z·√(u₁² + u₂²),   Φ(z) = 1 − α/2q,   α = 0.001

for any of the q quantities (Bonferroni). What follows from one recording twice is correlated, so that a difference is then
less spread than that: of models that fit fewer than one in a thousand disagree.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import Literal

import numpy as np
import scipy

from cmm_uq.analysis.machine.performance import MachinePerformance
from cmm_uq.analysis.machine.recordings import components_of, shown_in_parts
from cmm_uq.analysis.machine.state import StatedNoise
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import MICROMETRE, PPM, Unit, unit
from cmm_uq.base.values import dataclass
from cmm_uq.machine.model.artefact_doubt import growth
from cmm_uq.machine.model.measurement import RecordingModel
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.maths.inference.draws import evenly
from cmm_uq.maths.inference.noise import Sizes
from cmm_uq.maths.inference.posterior import Doubt, NoisyPosterior, gain
from cmm_uq.maths.uncertainty.quantity import Quantity

DISAGREES = 0.001  # probability with which anything of a machine whose model fits would be found to disagree
_ON_LINE = 0.05  # extent of points across a line over that along it
# lines that are looked at, evenly of all; sizes of the noise, over which its variance is the mean
_LINES, _SIZES = 200, 200
_AT_ONCE = 2_000_000  # weights of observations in slopes that are held at once

Key = tuple[str, str]
Kind = Literal["factor", "line", "length"]


@dataclass(frozen=True)
class FigurePair:
    """One quantity of a machine, as it is stated or was read, and by all errors together."""

    kind: Kind
    of: Key | int  # a factor by effect and name, a line or length by the number of its measurement
    stated: Quantity
    together: Quantity
    ratio: float  # of their difference to the largest that their joint uncertainty allows
    length_mm: float | None = None  # of a length

    @property
    def name(self) -> str:
        return ".".join(self.of) if isinstance(self.of, tuple) else f"{self.kind} {self.of}"


@dataclass(frozen=True, eq=False)
class Agreement:
    counts: Mapping[Kind, int]  # figures that were looked at
    pairs: tuple[FigurePair, ...]  # of each kind the one that differs most, and all that disagree; the worst first

    @property
    def disagree(self) -> tuple[FigurePair, ...]:
        return tuple(one for one in self.pairs if one.ratio > 1)

    @property
    def largest(self) -> float:
        return max((one.ratio for one in self.pairs), default=0.0)

    @property
    def factors(self) -> tuple[Key, ...]:
        """Of which the named model says something else than all errors together."""
        return tuple(sorted({one.of for one in self.disagree if isinstance(one.of, tuple)}))

    @property
    def of_readings(self) -> tuple[FigurePair, ...]:
        """What was read otherwise than all errors together expect it."""
        return tuple(one for one in self.disagree if one.kind != "factor")


@dataclass(frozen=True, eq=False)
class Figures:
    """Some of one kind: as stated or read, and by all errors together, each (q,)."""

    kind: Kind
    of: Sequence[Key | int]
    units: Sequence[Unit]
    stated: Floats
    u: Floats
    together: Floats
    u_together: Floats
    lengths: Floats | None = None  # mm

    def pair(self, i: int, ratio: float) -> FigurePair:
        each = ((self.stated, self.u), (self.together, self.u_together))
        one, other = (
            Quantity(float(x[i]), float(u[i]), (float(x[i] - 2 * u[i]), float(x[i] + 2 * u[i])), self.units[i])
            for x, u in each
        )
        length = None if self.lengths is None else float(self.lengths[i])
        return FigurePair(self.kind, self.of[i], one, other, ratio, length)


def held_together(every: Sequence[Figures]) -> Agreement:
    """All figures of a machine, each against what all errors together say of it."""
    count, found = sum(len(one.of) for one in every), list[FigurePair]()
    z = float(scipy.special.ndtri(1 - 0.5 * DISAGREES / max(count, 1)))
    for one in every:
        off, allowed = np.abs(one.stated - one.together), z * np.hypot(one.u, one.u_together)
        ratio = np.divide(off, allowed, out=np.where(off > 0, np.inf, 0.0), where=allowed > 0)
        chosen = {*np.flatnonzero(ratio > 1).tolist(), *([int(np.argmax(ratio))] if len(ratio) else [])}
        found += [one.pair(i, float(ratio[i])) for i in chosen]
    return Agreement({one.kind: len(one.of) for one in every}, tuple(sorted(found, key=lambda one: -one.ratio)))


@dataclass(frozen=True, eq=False)
class RecordedDraws:
    """Draws of all errors of a machine, and what they make of a recording of it."""

    model: RecordingModel
    which: Ints  # (k,) those of the model's unknowns that are drawn
    own: Floats  # (N, k) of these
    effects: Sequence[Effect]  # others
    further: Floats  # (N, f) of their coefficients
    noise: Sizes  # that goes with them
    sigma_mm: float  # of a coordinate, by which an estimate of the unknowns alone weighs their priors

    @cached_property
    def _sizes(self) -> tuple[Ints, Ints]:
        """Unknowns that are not drawn: of which something is known beforehand, and of which nothing is."""
        rest, sd = np.setdiff1d(np.arange(len(self.model.unknowns)), self.which), self.model.estimate().linear.prior_sd
        return rest[np.isfinite(sd[rest])], rest[~np.isfinite(sd[rest])]

    @cached_property
    def _lines(self) -> tuple[list[int], scipy.sparse.csr_array, Floats, Floats]:
        """Lines by their measurement, and weights W − A·B (l, m) of the observations in the slope of each, mm/mm.

        W (l, m) is of few observations each; A (l, s) and B (s, m) take what sizes that nobody certified would make.
        """
        found, design = list(lines_of(self.model)), self.model.estimate().linear.design
        each = [scipy.sparse.csr_array((0, len(design))), *(scipy.sparse.csr_array(one[None]) for _, one in found)]
        weights = scipy.sparse.csr_array(scipy.sparse.vstack(each))
        free = design[:, self._sizes[1]]
        return [number for number, _ in found], weights, np.asarray(weights @ free), np.asarray(np.linalg.pinv(free))

    @cached_property
    def _seen(self) -> tuple[Floats, Floats]:
        """By which estimates of the unknowns (k, f), and slopes of lines (l, f), change with a unit of each of the others."""
        gains, (_, lines, taken, free) = gain(self.model.estimate().linear, self.sigma_mm)[self.which], self._lines
        k, both = len(gains), np.vstack([gains, free])
        dense, slopes = [both[:, :0]], [taken[:, :0]]
        for part in (part for one in self.effects for part in shown_in_parts(self.model, one, along=True)):
            dense.append(both @ part)
            slopes.append(lines @ part - taken @ dense[-1][k:])
        return np.hstack(dense)[:k], np.hstack(slopes)

    @cached_property
    def factors(self) -> Floats:
        """(N, k) of the unknowns as means over the recorded set-ups, as an estimate of them alone has them."""
        return np.asarray(self.own + self.further @ self._seen[0].T)

    def slopes(self, doubt: Doubt) -> Figures:
        """Of each line by itself, as read and by the draws, µm/m; ``doubt``: what is stated to be in doubt about readings."""
        linear, (numbers, sparse, taken, free), (known, _) = self.model.estimate().linear, self._lines, self._sizes
        noise, sizes = components_of(self.model), self.noise.at(evenly(len(self.own), _SIZES))
        observed = linear.observed - linear.design[:, known] @ linear.prior_mean[known]
        fast, read, u = noise.variances(sizes)[0].mean(axis=0), np.empty(len(numbers)), np.empty(len(numbers))
        moved = np.empty((len(numbers), len(self.which)))
        for some in np.array_split(np.arange(len(numbers)), 1 + len(numbers) * len(observed) // _AT_ONCE):
            weights = sparse[some].toarray() - taken[some] @ free
            read[some], moved[some] = weights @ observed, weights @ linear.design[:, self.which]
            variance = fast @ (noise.shares.T @ np.asarray(noise.turn @ weights.T) ** 2)
            variance += ((weights @ linear.design[:, known]) ** 2) @ linear.prior_sd[known] ** 2
            of_doubt, slow = Doubt.of(doubt.causes, weights), (noise.slow_along(one, sizes).mean() for one in weights)
            variance += np.array([*map(of_doubt.variance, np.eye(len(some)))]) + np.array([*slow])
            u[some] = np.sqrt(variance)
        drawn = self.own @ moved.T + self.further @ self._seen[1].T
        mean, sd = drawn.mean(axis=0), drawn.std(axis=0)
        return Figures("line", numbers, (unit("µm/m"),) * len(numbers), *(each / PPM for each in (read, u, mean, sd)))


def lines_of(model: RecordingModel, most: int = _LINES) -> Iterator[tuple[int, Floats]]:
    """Each measurement of points on one line, and the weights (m,) of the used observations in its slope, mm/mm."""
    along, measurement, points = growth(model.artefact), model.artefact.measurement[model.used], model.artefact.points
    if along is None:
        return
    numbers = np.unique(measurement)
    for number in numbers[evenly(len(numbers), most)].tolist():
        xyz = points.xyz[points.measurement == number]
        extents = np.linalg.svd(xyz - xyz.mean(axis=0), compute_uv=False)
        own = np.where(measurement == number, along[model.used], 0.0)
        about = model.estimate().linear.freedoms.without(own[:, None])[:, 0]
        if np.all(extents[1:] <= _ON_LINE * extents[0]) and about @ about > 0:
            yield number, about / (about @ about)


def of_factors(model: RecordingModel, posterior: NoisyPosterior, drawn: Floats, doubt: Doubt) -> Figures:
    """Of the named model, and the same by draws (N, k) of all errors together.

    ``doubt``: what is in doubt about the named model's, and not about the draws in the same way.
    """
    k = drawn.shape[1]
    one, more = posterior.draws[:, :k], np.diag(doubt.covariance())[:k] if doubt.carried else 0.0
    keys, units = [each.key for each in model.unknowns[:k]], [each.unit for each in model.unknowns[:k]]
    u = np.sqrt(one.var(axis=0) + more)
    return Figures("factor", keys, units, one.mean(axis=0), u, drawn.mean(axis=0), drawn.std(axis=0))


def of_lengths(found: MachinePerformance, model: RecordingModel, noise: StatedNoise, doubt: Doubt) -> Figures:
    """Errors of lengths as read, beside those that figures without noise are of by all errors; not of readings left out.

    ``noise``: of a coordinate. Of lengths that nobody certified their differences from the mean.
    """
    artefact, indications = model.artefact, model.artefact.indications()
    here = np.isin(found.rows, artefact.rows[model.used]).all(axis=1)
    rows, errors = found.rows[here], found.errors[::2, here]  # others are of machines with the named errors alone
    steps, lengths, certified = artefact.lines_of(rows)[1], artefact.lengths(), np.zeros(len(rows))
    along = steps / np.linalg.norm(steps, axis=1)[:, None]
    length = np.abs(np.sum(along * np.diff(artefact.points.xyz[rows], axis=1)[:, 0], axis=1))
    length = length if lengths is None else lengths[here]
    if found.recorded is not None and indications is not None:
        read, certified = found.recorded[here], indications.u[here]
    else:
        read, errors = (length - length.mean()) / MICROMETRE, errors - errors.mean(axis=1, keepdims=True)
    of_ends = along**2 @ np.mean(np.atleast_2d(noise.coordinate_mm) ** 2, axis=0)
    shared = np.mean(np.square(noise.placing_mm)) + np.mean(np.square(noise.slow_mm))
    grown = np.mean(np.square(noise.growth_mm)) * (length / (noise.longest_mm or np.inf)) ** 2
    u = np.sqrt(2 * (of_ends + shared) + grown + certified**2 + _of_doubt(model, doubt, length)) / MICROMETRE
    numbers = artefact.points.measurement[rows[:, 0]].tolist()
    stated = read, u, errors.mean(axis=0), errors.std(axis=0)
    return Figures("length", numbers, (unit("µm"),) * len(numbers), *stated, length)


def _of_doubt(model: RecordingModel, doubt: Doubt, length: Floats) -> Floats:
    """(m,) variances, mm², of lengths for what is in doubt about observations, each by itself: of no length more than that."""
    square, along = np.zeros(int(model.used.sum())), growth(model.artefact)
    for one in doubt.causes:
        each = [one.common, *([] if one.apart is None else [one.apart.columns])]
        square = square + np.max([np.sum(part**2, axis=1) for part in each], axis=0)
    if along is None:
        return np.full(len(length), 2 * square.max(initial=0.0))
    long = np.abs(along := along[model.used]) >= 0.5 * np.abs(along).max(initial=0.0)
    return np.asarray(np.max(square[long] / along[long] ** 2, initial=0.0) * length**2)
