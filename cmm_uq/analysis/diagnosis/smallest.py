"""What a recording would not have shown: of each effect the smallest amplitude that its diagnosis would have found and named.

On the recording's own design and noise, beside what was asserted, in closed form and not drawn as in ``power``; how far the
two differ is in docs/diagnosis.md. The length δ is that of what an effect leaves in all observations, the baseline projected
out, over the noise. The statistic of the lack-of-fit test sees of the noise, nearly, its part z along the effect, and its size
besides, which it takes for σ: the test rejects when z exceeds its threshold times s/σ, z² having a noncentral χ² distribution
with δ² (z over s/σ a noncentral t). To be named, an effect must besides exceed each rival, that sees z·c and noise of its own,
by odds: their z² differ by more than a threshold. What remains is one integral over z.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import comb, sqrt

import numpy as np
import scipy
from numpy.typing import NDArray

from cmm_uq.analysis.diagnosis.comparison.combinations import EFFECTS
from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, UNKNOWN, Explanation
from cmm_uq.analysis.diagnosis.comparison.lack_of_fit import NOTHING, known_singles, log_prior, tail_probability
from cmm_uq.analysis.diagnosis.comparison.search import SearchResult
from cmm_uq.analysis.diagnosis.power import ALLOWED, CERTAIN, LONGEST, SHORTEST, Naming, Thresholds
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats
from cmm_uq.base.units import Unit
from cmm_uq.base.values import dataclass
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.machine.physics.effect import CONTRACT, Effect
from cmm_uq.maths.inference.linear_model import reached
from cmm_uq.maths.inference.slow import root

PLACES = "placing"  # name among what takes an effect up: the free places of the artefact
HIDDEN = 0.3  # part of an effect's length, what is fitted taken away, below which it is that which hides it
_PART = 0.1  # share from which on a fitted effect counts as part of what takes another one up
_ALIKE = 0.96  # mean square cosine from which on two periods look alike
_NEIGHBOURS = 2
_RIDGE = 1e-13
_ROUNDING = 1e-12  # of a share that is none


@dataclass(frozen=True, eq=False)
class Visibility:
    """A comparison, the noise in it once what was asserted is taken away, and what is fitted."""

    result: SearchResult
    fitted: Floats  # (m, f) are columns of what was asserted, orthonormal
    noise: Floats  # (m,) what they leave
    weight: Floats  # (k,) the probability of each kind of noise and squares (k,) its mean σ², mm²
    squares: Floats
    known: float  # degrees of freedom of σ beforehand
    left: int

    @classmethod
    def of(cls, result: SearchResult) -> Visibility:
        comparison = result.first.comparison
        scale, chosen = comparison.noise_scale[:, None], [v for v in result.versions if v.explanation in result.chosen]
        columns = [comparison.explanations[v.explanation].members[v.member].columns / scale for v in chosen]
        fitted = reached(comparison.rest(np.hstack(columns))) if columns else np.zeros((len(scale), 0))
        noise = comparison.left - fitted @ (fitted.T @ comparison.left)
        both, log_sigma = comparison.noise_posterior(noise), np.log(comparison.sigma)
        weight, of_sigma = both.sum(axis=1), both.sum(axis=0)
        squares = both @ comparison.sigma**2 / np.maximum(weight, 1e-300)
        variance = float(of_sigma @ log_sigma**2 - (of_sigma @ log_sigma) ** 2)
        left = comparison.degrees_of_freedom - fitted.shape[1]
        return cls(result, fitted, noise, weight, squares, max(0.5 / max(variance, 1e-12) - left, 0.0), left)

    @property
    def explanations(self) -> Sequence[Explanation]:
        return self.result.first.explanations

    def rest(self, columns: Floats) -> Floats:
        """What baseline and asserted effects leave of columns (m, b)."""
        left = self.result.first.comparison.rest(columns)
        return left - self.fitted @ (self.fitted.T @ left)

    def taking(self, raw: Floats) -> tuple[str, ...]:
        """Names of what takes most of a column (m,) up: of what was asserted, or else fitted, that together looks like it.

        Of what is fitted the artefact's free places come first, of the rest the smallest solution.
        """
        if np.linalg.norm(self.result.first.comparison.rest(raw[:, None])) >= HIDDEN * np.linalg.norm(raw):
            return self.result.effects
        linear = self.result.first.model.estimate().linear
        left = linear.freedoms.over(linear.noise_scale).without(raw[:, None])[:, 0]
        length, rest = float(np.linalg.norm(raw)), float(np.linalg.norm(left))
        names = [PLACES] if rest < (1 - _PART) * length else []
        if rest > _PART * length:
            free = [i for i, unknown in enumerate(linear.unknowns) if not unknown.known]
            columns = linear.reduced.design[:, free]
            sizes = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
            parts = np.linalg.lstsq(columns / sizes, left / rest, rcond=_RIDGE**0.5)[0]
            names = [linear.unknowns[i].key[0] for i, p in zip(free, parts, strict=True) if abs(p) > _PART] + names
        return tuple(dict.fromkeys(names))

    def lengths(self, columns: Floats) -> Floats:
        """Visible length (b,) of columns (m, b) of which everything fitted has been taken."""
        each = self.result.first.comparison.lengths(columns)
        variance = (self.weight[:, None] * self.squares[:, None] / np.maximum(each, 1e-300)).sum(axis=0)
        return np.asarray(np.where(each.min(axis=0) > 0, 1 / np.sqrt(variance), 0.0))


def phases(view: Visibility, lefts: Floats) -> tuple[Floats, Floats, Floats]:
    """Visible length of the worst (p,) and of the typical phase (p,), and the coefficients (p, r) of that one."""
    p, m, r = lefts.shape
    pairs = [(a, b) for a in range(r) for b in range(a, r)]
    sums = np.stack([lefts[:, :, a] + (lefts[:, :, b] if a != b else 0.0) for a, b in pairs])  # polarised squares
    squares = view.lengths(sums.reshape(-1, m).T).reshape(len(pairs), p) ** 2
    gram = np.zeros((p, r, r))
    own = {a: squares[k] for k, (a, b) in enumerate(pairs) if a == b}
    for k, (a, b) in enumerate(pairs):
        gram[:, a, b] = gram[:, b, a] = own[a] if a == b else 0.5 * (squares[k] - own[a] - own[b])
    strengths, turn = np.linalg.eigh(gram)
    strengths = np.maximum(strengths, 0.0)
    return np.sqrt(strengths[:, 0]), np.sqrt(strengths.mean(axis=1)), turn.sum(axis=2) / sqrt(r)


def aliased(view: Visibility, lefts: Floats, values: Floats) -> NDArray[np.bool_]:
    """(p,) whether another value, not next to it, looks the same in these observations."""
    p, m, r = lefts.shape
    basis, s, _ = np.linalg.svd(lefts, full_matrices=False)
    basis = np.where((s > 1e-6 * s.max(initial=1e-300))[:, None, :], basis, 0.0)
    flat = basis.transpose(1, 0, 2).reshape(m, p * r)
    alike = ((flat.T @ flat) ** 2).reshape(p, r, p, r).sum(axis=(1, 3)) / r > _ALIKE
    place = np.argsort(np.argsort(values))
    return np.asarray((alike & (np.abs(place[:, None] - place) > _NEIGHBOURS)).any(axis=1))


SIZES = (1.0, 2.0, 5.0)  # visible lengths, over a first guess of the threshold, at which the statistic is computed
LENGTHS = np.geomspace(SHORTEST, LONGEST, 160)
_CLOSEST = 0.9999
_RIVALS = 4


def thresholds(view: Visibility, which: Sequence[int], columns: Floats, alpha: float) -> Iterator[Thresholds]:
    """Of each effect, from the statistic on the bare effect at :data:`SIZES`; ``columns`` (n, m) of visible length one."""
    if not which:
        return
    first, explanations = view.result.first, view.explanations
    comparison, null = first.comparison, first.null
    low, high = float(null.min()) - 1.0, float(null.max()) + 50.0
    gate = root(lambda value: float(np.log(tail_probability(null, value) / alpha)), low, high, 1e-6)
    prior = log_prior(explanations)
    sizes = np.array([[sqrt(max(2 * (gate - prior[i] + 1.0), 4.0)) * size for size in SIZES] for i in which])
    data = (sizes[:, :, None] * columns[:, None, :]).reshape(-1, columns.shape[1]).T
    odds = comparison.of_signal(data, view.noise).reshape(len(explanations), len(which), len(SIZES))
    dof, naming = max(view.known + view.left, 1.0), Naming(explanations)
    count, pair = len(known_singles(comparison)), None
    if count > 1:
        pair = float(np.log(EFFECTS[2] / EFFECTS[0]) - np.log(comb(count, 2)) + np.log(NOTHING) + np.log(count - 1))
    for i, index in enumerate(which):
        each = _between(dof * np.log1p(sizes[i] ** 2 / dof), odds[:, i], dof * np.log1p(LENGTHS**2 / dof))
        statistic = scipy.special.logsumexp(prior[:, None] + each, axis=0)
        if pair is not None:
            statistic = np.logaddexp(statistic, pair + each[index])
        (detected,) = _passes((statistic - gate)[None])
        yield Thresholds(float(detected), *_rivals(naming, each, index), view.known, view.left)


def _between(v: Floats, odds: Floats, at: Floats) -> Floats:
    """Log odds (c, d) at lengths ``at`` (d,) from those (c, s) at ``v`` (s,), by straight lines, the outer ones prolonged."""
    known = np.where(np.isfinite(odds), odds, -1e6)
    part = np.clip(np.searchsorted(v, at) - 1, 0, len(v) - 2)
    slope = np.diff(known, axis=1) / np.diff(v)
    return np.asarray(known[:, part] + slope[:, part] * (at - v[part]))


def _passes(margins: Floats) -> Floats:
    """Length (r,) from which on margins (r, d) over :data:`LENGTHS` stay positive; infinite where one never does."""
    count = len(LENGTHS)
    last = count - 1 - np.argmax(margins[:, ::-1] <= 0, axis=1)  # where it is not positive for the last time
    before, each = np.minimum(last, count - 2), np.arange(len(margins))
    low, high = margins[each, before], margins[each, before + 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        found = -low * ((LENGTHS[before + 1] - LENGTHS[before]) / (high - low)) + LENGTHS[before]
    found[last == count - 1] = np.inf
    found[(margins > 0).all(axis=1)] = LENGTHS[0]
    return np.asarray(found, dtype=np.float64)


def _rivals(naming: Naming, odds: Floats, true: int) -> tuple[Floats, Floats]:
    """Length (r,) from which on the true effect exceeds each closest rival, and cosines (r,) by how fast both gain."""
    kinds = np.array([explanation.kind for explanation in naming.explanations])
    weight = odds + naming.priors[:, None]
    known = (kinds == EFFECT) & (np.arange(len(kinds)) != true)
    functions = scipy.special.logsumexp(weight[kinds == UNKNOWN], axis=0, keepdims=True)
    others = np.vstack([weight[known] + CERTAIN, functions])
    lengths = _passes(weight[true] - others)
    closest = np.argsort(-lengths, kind="stable")[:_RIVALS]
    at = np.searchsorted(LENGTHS, np.minimum(lengths[closest], LONGEST)).clip(1, len(LENGTHS) - 1)
    own, other = (rows[..., at] - rows[..., at - 1] for rows in (weight[true], others[closest]))
    gained = np.diagonal(other) / np.maximum(own, 1e-12)
    return lengths[closest], np.sqrt(np.clip(gained, 0.0, _CLOSEST))


POWER = 0.9
# Part of what physics allows, half of its standard deviation, that a recording with power shows of a common effect
BLIND = 1 / 6
USUAL_LENGTH = 6.0  # visible length, over the noise, from which on a usual diagnosis detects an effect
_FAINT = 0.5  # visible length of the largest allowed amplitude below which an effect is not looked at
ABSORBED = 1e-5  # part of its length below which a column is the baseline's own


@dataclass(frozen=True)
class PeriodRange:
    parameter: str  # parameter, unit: its name and unit
    unit: Unit
    low: float  # low, high: range of what is tried
    high: float
    worst: float | None  # largest of the smallest amplitudes that are detected, over all resolved values and any phase
    # ranges of values that the positions do not resolve: nothing of them is left, or another looks the same
    unresolved: tuple[tuple[float, float], ...]


@dataclass(frozen=True, eq=False)
class SmallestEffect:
    effect: str  # effect, title: its name, and in words
    title: Text
    parameter: str  # parameter, unit: its (first) parameter
    unit: Unit
    allowed: float  # largest amplitude that physics allows
    # amplitude detected with a probability of 90 %, though beyond what is allowed; None where hardly any is
    detected: float | None
    named: float | None  # amplitude named rightly with this probability; None where none that is allowed is
    share: float  # part of the effect's length in the observations that what is fitted leaves
    taken_up: tuple[str, ...]  # names of what is fitted that takes up the rest, where that is most of it
    common: bool  # whether it is one of the common effects
    # where it has a nonlinear parameter, of which the figures are then the typical ones
    periods: PeriodRange | None = None
    # of what is left of it over the noise, from which on it is detected; None where it was not computed
    length: float | None = None

    @property
    def shown(self) -> bool:
        """Whether an amplitude that physics allows would have been detected."""
        return self.detected is not None and self.detected <= self.allowed

    @property
    def blind(self) -> bool:
        """Whether not even a plausible amplitude of a common effect would have been detected, though it shows at all."""
        there = self.share > 0 or bool(self.taken_up)
        return self.common and there and (self.detected is None or self.detected > BLIND * self.allowed)


def smallest_effects(result: SearchResult, alpha: float, model: RecordingModel) -> tuple[SmallestEffect, ...]:
    """The smallest amplitude of each effect that a recording would have shown; those that it could least come first."""
    view, named = Visibility.of(result), {effect.name for effect in model.effects}
    unnamed = ((i, one, one.effect) for i, one in enumerate(view.explanations) if one.name not in named)
    listed = [(i, one, effect) for i, one, effect in unnamed if effect is not None and not effect.of_artefact]
    signals = _signals(view, listed)
    visible = [signal for signal in signals if signal.unit_length * ALLOWED > _FAINT]
    which, columns = [s.index for s in visible], np.array([s.column / s.unit_length for s in visible])
    each = dict(zip(which, thresholds(view, which, columns, alpha), strict=True))
    rows, points = [s.smallest(view, each.get(s.index)) for s in signals], result.first.model.artefact.points
    # common effects of which nothing shows here, though they could act and all that they need is recorded
    for effect in every().values():
        if effect.name in named | {one.name for one in view.explanations} or effect.tier != CONTRACT or effect.shape:
            continue
        if any(column not in points.columns for column in effect.columns) or effect.unfit(points) is not None:
            continue
        try:
            effect.basis(points)
        except CmmUqError:  # the job does not give the travel that this effect needs
            continue
        first = effect.coefficients[0]
        never = (ALLOWED * first.prior_sd, None, None, 0.0, (), effect.tier == CONTRACT)
        rows.append(SmallestEffect(effect.name, effect.title, effect.reported[0].name, first.unit, *never))
    amplitude = [np.inf if row.detected is None else row.detected / row.allowed for row in rows]
    return tuple(rows[i] for i in sorted(range(len(rows)), key=lambda i: -min(amplitude[i], 1e9)))


@dataclass(frozen=True, eq=False)
class _Signal:
    index: int
    effect: Effect
    raw: Floats  # (m,) the whole. Of an effect with a nonlinear parameter it is the typical one
    column: Floats  # (m,) is what is left of it, unit_length its visible length
    unit_length: float
    values: Floats
    worst: Floats  # worst, typical: (p,) are then the lengths at each value of values
    typical: Floats
    resolved: NDArray[np.bool_]

    @classmethod
    def shaped(cls, view: Visibility, index: int, explanation: Explanation, effect: Effect) -> _Signal:
        scale = view.result.first.comparison.noise_scale[:, None]
        members = [member for member in explanation.members if member.shape and not member.rough]
        raws = np.stack([member.columns / scale for member in members])
        p, m, r = raws.shape
        lefts = view.rest(raws.transpose(1, 0, 2).reshape(m, p * r)).reshape(m, p, r).transpose(1, 0, 2)
        worst, typical, way = phases(view, lefts)
        middle, values = int(np.argsort(typical)[p // 2]), np.array([member.shape[0] for member in members])
        raw, column = raws[middle] @ way[middle], lefts[middle] @ way[middle]
        length, resolved = float(view.lengths(column[:, None])[0]), ~aliased(view, lefts, values)
        return cls(index, effect, raw, column, length, values, worst, typical, resolved)

    def smallest(self, view: Visibility, thresholds: Thresholds | None) -> SmallestEffect:
        effect, parameter, whole = self.effect, self.effect.coefficients[0], float(np.linalg.norm(self.raw))
        share = float(np.linalg.norm(self.column)) / whole if whole else 0.0
        share = share if share > _ROUNDING else 0.0
        length, detected, named = float(np.inf), None, None
        if thresholds is not None:
            length = thresholds.length_detected(POWER)
            detected = _amplitude(length, self.unit_length, parameter.prior_sd)
            if length <= self.unit_length * ALLOWED:
                named = _amplitude(thresholds.length_named(POWER), self.unit_length, parameter.prior_sd)
        return SmallestEffect(
            effect.name, effect.title, effect.reported[0].name, parameter.unit, ALLOWED * parameter.prior_sd, detected, named,
            share, view.taking(self.raw) if share < HIDDEN else (), effect.tier == CONTRACT,
            self._periods(length) if len(self.values) else None, length if np.isfinite(length) else None,
        )  # fmt: skip

    def _periods(self, length: float) -> PeriodRange:
        parameter, shape, order = self.effect.coefficients[0], self.effect.shape[0], np.argsort(self.values)
        shown, values = self.resolved & (self.worst * ALLOWED >= length), self.values[order]
        worst = _amplitude(length, float(self.worst[shown].min()), parameter.prior_sd) if shown.any() else None
        runs = np.flatnonzero(np.diff(~shown[order], prepend=False, append=False)).reshape(-1, 2)
        unresolved = tuple((float(values[start]), float(values[end - 1])) for start, end in runs)
        return PeriodRange(shape.name, shape.unit, float(values[0]), float(values[-1]), worst, unresolved)


def _signals(view: Visibility, listed: Sequence[tuple[int, Explanation, Effect]]) -> list[_Signal]:
    """What each of some effects shows; of several coefficients the first."""
    straight, none = [row for row in listed if not row[1].shaped], np.zeros(0)
    scale = view.result.first.comparison.noise_scale
    raws = np.column_stack([np.zeros((len(scale), 0)), *(e.members[0].columns[:, 0] / scale for _, e, _ in straight)])
    lefts = view.rest(raws)
    lefts = np.where(np.linalg.norm(lefts, axis=0) > ABSORBED * np.linalg.norm(raws, axis=0), lefts, 0.0)
    found = [
        _Signal(i, effect, raw, left, size, none, none, none, none > 0)
        for (i, _, effect), raw, left, size in zip(straight, raws.T, lefts.T, view.lengths(lefts).tolist(), strict=True)
    ]
    return found + [_Signal.shaped(view, *row) for row in listed if row[1].shaped]


def _amplitude(length: float, unit_length: float, unit: float) -> float | None:
    return length / unit_length * unit if np.isfinite(length) and unit_length > 0 else None
