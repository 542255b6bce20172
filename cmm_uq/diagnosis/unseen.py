"""What a recording would not have shown: of each effect the smallest amplitude that its diagnosis would have found.

On the recording's own design, with the noise that was found, beside what was asserted. *Detected* and *named* are those of
:mod:`cmm_uq.diagnosis.power`, but here probabilities are a closed form (:mod:`cmm_uq.diagnosis.detection`): the statistic is
computed on the bare effect at a few sizes, and where it passes the threshold of the recording's own null distribution is
interpolated; no recording is drawn. How far the two differ is in docs/diagnosis.md.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import comb, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy import special

from cmm_uq.diagnosis.comparison.combinations import EFFECTS
from cmm_uq.diagnosis.comparison.explanations import EFFECT, UNKNOWN, Explanation
from cmm_uq.diagnosis.comparison.lack_of_fit import NOTHING, log_prior, tail_probability
from cmm_uq.diagnosis.comparison.search import Found
from cmm_uq.diagnosis.detection import LONGEST, SHORTEST, Thresholds
from cmm_uq.diagnosis.power import ALLOWED, CERTAIN, Naming
from cmm_uq.errors import CmmUqError
from cmm_uq.inference.freedoms import reached
from cmm_uq.inference.root import root
from cmm_uq.messages import Text
from cmm_uq.model import MeasurementModel
from cmm_uq.physics.catalogue import every
from cmm_uq.physics.effect import CONTRACT, Effect
from cmm_uq.points import Floats
from cmm_uq.units import Unit

POWER = 0.9

BLIND = 1 / 6
"""Part of what physics allows, half of its standard deviation, that a recording with power shows of a common effect."""

USUAL_LENGTH = 6.0
"""Visible length, over the noise, from which on a usual diagnosis detects an effect."""

PLACES = "placing"
"""Name among what takes an effect up: the free places of the artefact."""

SIZES = (1.0, 2.0, 5.0)
"""Visible lengths, over a first guess of the threshold, at which the statistic is computed."""

_PART = 0.1
"""Share from which on a fitted effect counts as part of what takes another one up."""

_HIDDEN = 0.3
"""Part of an effect's length, what is fitted taken away, below which it is that which hides it."""

_ALIKE = 0.96
"""Mean square cosine from which on two periods look alike."""

_NEIGHBOURS = 2

_FAINT = 0.5
"""Visible length of the largest allowed amplitude below which an effect is not looked at."""

_CLOSEST = 0.9999
_RIVALS = 4
LENGTHS = np.geomspace(SHORTEST, LONGEST, 160)
ABSORBED = 1e-5
"""Part of its length below which a column is the baseline's own."""

_RIDGE = 1e-13


@dataclass(frozen=True)
class Periods:
    """Of an effect with a nonlinear parameter, for which values of it the figures hold.

    Parameters
    ----------
    parameter, unit : its name and unit.
    low, high : range of what is tried.
    worst : largest of the smallest amplitudes that are detected, over all resolved values and any phase.
    unresolved : ranges of values that the positions do not resolve: nothing of them is left, or another looks the same.
    """

    parameter: str
    unit: Unit
    low: float
    high: float
    worst: float | None
    unresolved: tuple[tuple[float, float], ...]


@dataclass(frozen=True, eq=False)
class Smallest:
    """How large one effect must have been for the recording to show it.

    Parameters
    ----------
    effect, title : its name, and in words.
    parameter, unit : its (first) parameter.
    allowed : largest amplitude that physics allows.
    detected : amplitude detected with a probability of 90 %, though beyond what is allowed; ``None`` where hardly any is.
    named : amplitude named rightly with this probability; ``None`` where none that is allowed is.
    share : part of the effect's length in the observations that what is fitted leaves.
    taken_up : names of what is fitted that takes up the rest, where that is most of it.
    common : whether it is one of the common effects.
    periods : where it has a nonlinear parameter, of which the figures are then the typical ones.
    length : of what is left of it over the noise, from which on it is detected; ``None`` where it was not computed.
    """

    effect: str
    title: Text
    parameter: str
    unit: Unit
    allowed: float
    detected: float | None
    named: float | None
    share: float
    taken_up: tuple[str, ...]
    common: bool
    periods: Periods | None = None
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


def smallest_effects(found: Found, alpha: float, model: MeasurementModel) -> tuple[Smallest, ...]:
    """The smallest amplitude of each effect that a recording would have shown; those that it could least come first.

    Of effects of machine and surroundings: faults of the artefact are parted from them by further set-ups.

    Parameters
    ----------
    found : the search of the recording.
    alpha : false-alarm rate.
    model : with all that was asserted.
    """
    view = _View.of(found)
    named = {effect.name for effect in model.effects}
    listed = [
        (i, explanation, effect)
        for i, explanation in enumerate(view.explanations)
        if (effect := explanation.effect) is not None and not effect.of_artefact and explanation.name not in named
    ]
    signals = _signals(view, listed)
    visible = [signal for signal in signals if signal.unit_length * ALLOWED > _FAINT]
    thresholds = dict(zip((s.index for s in visible), _thresholds(view, visible, alpha), strict=True))
    rows = [signal.smallest(view, thresholds.get(signal.index)) for signal in signals]
    known = {explanation.name for explanation in view.explanations}
    rows += [_never(effect) for effect in _motionless(found.first.model, named | known)]
    return tuple(sorted(rows, key=lambda row: -_reach(row)))


def _reach(row: Smallest) -> float:
    return min(float("inf") if row.detected is None else row.detected / row.allowed, 1e9)


def _never(effect: Effect) -> Smallest:
    parameter = effect.coefficients[0]
    allowed, common = ALLOWED * parameter.prior_sd, effect.tier == CONTRACT
    name = effect.reported[0].name
    return Smallest(effect.name, effect.title, name, parameter.unit, allowed, None, None, 0.0, (), common)


def _motionless(model: MeasurementModel, known: set[str]) -> Iterator[Effect]:
    """Common effects of which nothing shows in such observations, though all that they need is recorded."""
    points = model.artefact.points
    for effect in every().values():
        if effect.name in known or effect.tier != CONTRACT or effect.shape:
            continue
        if any(column not in points.columns for column in effect.columns):
            continue
        try:
            effect.basis(points)
        except CmmUqError:  # the job does not give the travel that this effect needs
            continue
        yield effect


@dataclass(frozen=True, eq=False)
class _View:
    """A comparison, the noise in it once what was asserted is taken away, and what is fitted.

    ``fitted`` (m, f) are columns of what was asserted, orthonormal; ``noise`` (m,) what they leave; ``weight`` (k,) the
    probability of each kind of noise and ``squares`` (k,) its mean σ², mm²; ``known`` degrees of freedom of σ beforehand.
    """

    found: Found
    fitted: Floats
    noise: Floats
    weight: Floats
    squares: Floats
    known: float
    left: int

    @classmethod
    def of(cls, found: Found) -> _View:
        comparison = found.first.comparison
        scale = comparison.noise_scale[:, None]
        columns = [
            comparison.explanations[v.explanation].members[v.member].columns / scale
            for v in found.versions
            if v.explanation in found.chosen
        ]
        fitted = np.zeros((len(scale), 0))
        if columns:
            fitted = reached(comparison.rest(np.hstack(columns)))
        noise = comparison.left - fitted @ (fitted.T @ comparison.left)
        both = comparison.noise_posterior(noise)
        weight = both.sum(axis=1)
        squares = both @ comparison.sigma**2 / np.maximum(weight, 1e-300)
        log_sigma = np.log(comparison.sigma)
        of_sigma = both.sum(axis=0)
        variance = float(of_sigma @ log_sigma**2 - (of_sigma @ log_sigma) ** 2)
        left = comparison.degrees_of_freedom - fitted.shape[1]
        return cls(found, fitted, noise, weight, squares, max(0.5 / max(variance, 1e-12) - left, 0.0), left)

    @property
    def explanations(self) -> Sequence[Explanation]:
        return self.found.first.explanations

    def rest(self, columns: Floats) -> Floats:
        """What baseline and asserted effects leave of columns (m, b)."""
        left = self.found.first.comparison.rest(columns)
        return left - self.fitted @ (self.fitted.T @ left)

    def lengths(self, columns: Floats) -> Floats:
        """Visible length (b,) of columns (m, b) of which everything fitted has been taken."""
        each = self.found.first.comparison.lengths(columns)
        variance = (self.weight[:, None] * self.squares[:, None] / np.maximum(each, 1e-300)).sum(axis=0)
        return np.asarray(np.where(each.min(axis=0) > 0, 1 / np.sqrt(variance), 0.0))

    def taking(self, raw: Floats) -> tuple[str, ...]:
        """Names of what takes most of a column (m,) up: what was asserted, or else what the model names."""
        left = self.found.first.comparison.rest(raw[:, None])
        if np.linalg.norm(left) >= _HIDDEN * np.linalg.norm(raw):
            return self.found.effects
        return _imitators(self.found.first.model, raw)


@dataclass(frozen=True, eq=False)
class _Signal:
    """What an effect shows, for a coefficient as large as its prior standard deviation.

    ``column`` (m,) is what is left of it, ``unit_length`` its visible length; ``raw`` (m,) the whole. Of an effect with a
    nonlinear parameter it is the typical one; ``worst`` and ``typical`` (p,) are then the lengths at each value of ``values``.
    """

    index: int
    effect: Effect
    raw: Floats
    column: Floats
    unit_length: float
    values: Floats
    worst: Floats
    typical: Floats
    resolved: NDArray[np.bool_]

    @classmethod
    def shaped(cls, view: _View, index: int, explanation: Explanation, effect: Effect) -> _Signal:
        """Of an effect with a nonlinear parameter."""
        scale = view.found.first.comparison.noise_scale[:, None]
        members = [member for member in explanation.members if member.shape and not member.rough]
        raws = np.stack([member.columns / scale for member in members])
        p, m, r = raws.shape
        lefts = view.rest(raws.transpose(1, 0, 2).reshape(m, p * r)).reshape(m, p, r).transpose(1, 0, 2)
        worst, typical, way = _phases(view, lefts)
        middle = int(np.argsort(typical)[p // 2])
        values = np.array([member.shape[0] for member in members])
        column = lefts[middle] @ way[middle]
        length = float(view.lengths(column[:, None])[0])
        resolved = np.logical_not(_aliased(view, lefts, values))
        return cls(index, effect, raws[middle] @ way[middle], column, length, values, worst, typical, resolved)

    def smallest(self, view: _View, thresholds: Thresholds | None) -> Smallest:
        """The row of this effect."""
        effect, parameter = self.effect, self.effect.coefficients[0]
        whole = float(np.linalg.norm(self.raw))
        share = float(np.linalg.norm(self.column)) / whole if whole else 0.0
        detected = named = None
        length = float(np.inf) if thresholds is None else thresholds.length_detected(POWER)
        if thresholds is not None:
            detected = _amplitude(length, self.unit_length, parameter.prior_sd)
            if length <= self.unit_length * ALLOWED:
                named = _amplitude(thresholds.length_named(POWER), self.unit_length, parameter.prior_sd)
        periods = self._periods(length) if len(self.values) else None
        taken_up = view.taking(self.raw) if share < _HIDDEN else ()
        return Smallest(
            effect.name, effect.title, effect.reported[0].name, parameter.unit, ALLOWED * parameter.prior_sd, detected, named,
            share, taken_up, effect.tier == CONTRACT, periods, length if np.isfinite(length) else None,
        )  # fmt: skip

    def _periods(self, length: float) -> Periods:
        parameter = self.effect.coefficients[0]
        shown = self.resolved & (self.worst * ALLOWED >= length)
        worst = _amplitude(length, float(self.worst[shown].min()), parameter.prior_sd) if shown.any() else None
        shape = self.effect.shape[0]
        order = np.argsort(self.values)
        values = self.values[order]
        return Periods(
            shape.name, shape.unit, float(values[0]), float(values[-1]), worst, _ranges(values, ~shown[order])
        )


def _signals(view: _View, listed: Sequence[tuple[int, Explanation, Effect]]) -> list[_Signal]:
    """What each of some effects shows; of several coefficients the first."""
    straight = [row for row in listed if not row[1].shaped]
    scale, none = view.found.first.comparison.noise_scale, np.zeros(0)
    raws = np.column_stack([np.zeros((len(scale), 0)), *(e.members[0].columns[:, 0] / scale for _, e, _ in straight)])
    lefts = view.rest(raws)
    there = np.linalg.norm(lefts, axis=0) > ABSORBED * np.linalg.norm(raws, axis=0)
    lefts = np.where(there, lefts, 0.0)
    found = [
        _Signal(i, effect, raw, left, length, none, none, none, none > 0)
        for (i, _, effect), raw, left, length in zip(
            straight, raws.T, lefts.T, view.lengths(lefts).tolist(), strict=True
        )
    ]
    return found + [_Signal.shaped(view, *row) for row in listed if row[1].shaped]


def _amplitude(length: float, unit_length: float, unit: float) -> float | None:
    return length / unit_length * unit if np.isfinite(length) and unit_length > 0 else None


def _ranges(values: Floats, chosen: NDArray[np.bool_]) -> tuple[tuple[float, float], ...]:
    """Runs of ascending values (p,) that are chosen."""
    found: list[tuple[float, float]] = []
    run = False
    for value, one in zip(values.tolist(), chosen.tolist(), strict=True):
        if one:
            found.append((found.pop()[0], value) if run else (value, value))
        run = bool(one)
    return tuple(found)


def _phases(view: _View, lefts: Floats) -> tuple[Floats, Floats, Floats]:
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
    way = turn.sum(axis=2) / sqrt(r)
    return np.sqrt(strengths[:, 0]), np.sqrt(strengths.mean(axis=1)), way


def _aliased(view: _View, lefts: Floats, values: Floats) -> NDArray[np.bool_]:
    """(p,) whether another value, not next to it, looks the same in these observations."""
    p, m, r = lefts.shape
    basis, s, _ = np.linalg.svd(lefts, full_matrices=False)
    basis = np.where((s > 1e-6 * s.max(initial=1e-300))[:, None, :], basis, 0.0)
    flat = basis.transpose(1, 0, 2).reshape(m, p * r)
    squares = (flat.T @ flat) ** 2
    alike = squares.reshape(p, r, p, r).sum(axis=(1, 3)) / r > _ALIKE
    place = np.argsort(np.argsort(values))
    near = np.abs(place[:, None] - place) <= _NEIGHBOURS
    return np.asarray((alike & ~near).any(axis=1))


def _imitators(model: MeasurementModel, raw: Floats) -> tuple[str, ...]:
    """Names of what is fitted that together looks like a column (m,): those with a share of it that counts.

    What the free places of the artefact take up is theirs; for the rest, of many solutions the smallest counts.
    """
    linear = model.estimate().linear
    places = linear.freedoms.over(linear.noise_scale)
    left = places.without(raw[:, None])[:, 0]
    length, rest = float(np.linalg.norm(raw)), float(np.linalg.norm(left))
    names = [PLACES] if rest < (1 - _PART) * length else []
    if rest > _PART * length:
        free = [i for i, unknown in enumerate(linear.unknowns) if not unknown.known]
        columns = linear.reduced.design[:, free]
        sizes = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        parts = np.linalg.lstsq(columns / sizes, left / rest, rcond=_RIDGE**0.5)[0]
        names = [linear.unknowns[i].key[0] for i, part in zip(free, parts, strict=True) if abs(part) > _PART] + names
    return tuple(dict.fromkeys(names))


def _thresholds(view: _View, signals: Sequence[_Signal], alpha: float) -> Iterator[Thresholds]:
    """Of each signal, from the statistic on the bare effect at :data:`SIZES`."""
    if not signals:
        return
    first = view.found.first
    comparison, explanations = first.comparison, first.explanations
    gate = _gate(first.null, alpha)
    prior = log_prior(explanations)
    sizes = np.array([[sqrt(max(2 * (gate - prior[s.index] + 1.0), 4.0)) * size for size in SIZES] for s in signals])
    columns = np.stack([s.column / s.unit_length for s in signals])
    data = (sizes[:, :, None] * columns[:, None, :]).reshape(-1, columns.shape[1]).T
    odds = comparison.of_signal(data, view.noise).reshape(len(explanations), len(signals), len(SIZES))
    dof = max(view.known + view.left, 1.0)
    naming = Naming(explanations)
    pair = _pair(explanations, comparison.visible)
    for i, signal in enumerate(signals):
        each = _between(dof * np.log1p(sizes[i] ** 2 / dof), odds[:, i], dof * np.log1p(LENGTHS**2 / dof))
        statistic = special.logsumexp(prior[:, None] + each, axis=0)
        if pair is not None:
            statistic = np.logaddexp(statistic, pair + each[signal.index])
        yield Thresholds(_passes(statistic - gate), *_rivals(naming, each, signal.index), view.known, view.left)


def _between(v: Floats, odds: Floats, at: Floats) -> Floats:
    """Log odds (c, d) at lengths ``at`` (d,) from those (c, s) at ``v`` (s,), by straight lines, the outer ones prolonged."""
    known = np.where(np.isfinite(odds), odds, -1e6)
    part = np.clip(np.searchsorted(v, at) - 1, 0, len(v) - 2)
    slope = np.diff(known, axis=1) / np.diff(v)
    return np.asarray(known[:, part] + slope[:, part] * (at - v[part]))


def _pair(explanations: Sequence[Explanation], visible: frozenset[int]) -> float | None:
    """Logarithm of what a second effect adds to the statistic beside the first: nothing but its prior, on average."""
    count = sum(
        e.kind == EFFECT and e.weight == 1 and not e.shaped and i in visible for i, e in enumerate(explanations)
    )
    if count < 2:
        return None
    return float(np.log(EFFECTS[2] / EFFECTS[0]) - np.log(comb(count, 2)) + np.log(NOTHING) + np.log(count - 1))


def _gate(null: Floats, alpha: float) -> float:
    """Statistic that the test rejects from."""
    low, high = float(null.min()) - 1.0, float(null.max()) + 50.0
    return root(lambda value: float(np.log(tail_probability(null, value) / alpha)), low, high, 1e-6)


def _passes(margin: Floats) -> float:
    """Length from which on a margin (d,) over :data:`LENGTHS` stays positive; infinite where it never does."""
    below = np.flatnonzero(margin <= 0)
    if not len(below):
        return float(LENGTHS[0])
    i = int(below[-1])
    if i == len(LENGTHS) - 1:
        return float(np.inf)
    return float(np.interp(0.0, margin[i : i + 2], LENGTHS[i : i + 2]))


def _rivals(naming: Naming, odds: Floats, true: int) -> tuple[Floats, Floats]:
    """Length (r,) from which on the true effect exceeds each of its closest rivals, and the cosines (r,) with them.

    A cosine follows from how fast the two gain evidence.

    Parameters
    ----------
    odds : (c, d) log odds of each explanation at :data:`LENGTHS`.
    """
    kinds = np.array([explanation.kind for explanation in naming.explanations])
    weight = odds + naming.priors[:, None]
    known = (kinds == EFFECT) & (np.arange(len(kinds)) != true)
    functions = special.logsumexp(weight[kinds == UNKNOWN], axis=0, keepdims=True)
    others = np.vstack([weight[known] + CERTAIN, functions])
    lengths = np.array([_passes(margin) for margin in weight[true] - others])
    closest = np.argsort(-lengths, kind="stable")[:_RIVALS]
    at = np.searchsorted(LENGTHS, np.minimum(lengths[closest], LONGEST)).clip(1, len(LENGTHS) - 1)
    own, other = (rows[..., at] - rows[..., at - 1] for rows in (weight[true], others[closest]))
    gained = np.diagonal(other) / np.maximum(own, 1e-12)
    return lengths[closest], np.sqrt(np.clip(gained, 0.0, _CLOSEST))
