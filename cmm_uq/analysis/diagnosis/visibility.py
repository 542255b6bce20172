"""What of an effect a recording shows, and from which size on it is detected and named.

The length δ is that of what an effect leaves in all observations, the baseline projected out, over the noise. The statistic
of the lack-of-fit test sees of the noise, nearly, its part z along the effect, and its size besides, which it takes for σ: the
test rejects when z exceeds its threshold times s/σ, z² having a noncentral χ² distribution with δ² (z over s/σ a
noncentral t). To be named, an effect must besides exceed each rival, that sees z·c and noise of its own, by odds: their z²
differ by more than a threshold. What remains is one integral over z.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import comb, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy import special

from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, UNKNOWN, Explanation
from cmm_uq.analysis.diagnosis.comparison.lack_of_fit import NOTHING, log_prior, tail_probability
from cmm_uq.analysis.diagnosis.comparison.prior import EFFECTS
from cmm_uq.analysis.diagnosis.comparison.search import SearchResult
from cmm_uq.analysis.diagnosis.power import CERTAIN, Naming
from cmm_uq.base.points import Floats
from cmm_uq.machine.model import RecordingModel
from cmm_uq.maths.inference.linear_model import reached
from cmm_uq.maths.inference.slow import root

PLACES = "placing"  # name among what takes an effect up: the free places of the artefact
HIDDEN = 0.3  # part of an effect's length, what is fitted taken away, below which it is that which hides it
_PART = 0.1  # share from which on a fitted effect counts as part of what takes another one up
_ALIKE = 0.96  # mean square cosine from which on two periods look alike
_NEIGHBOURS = 2
_RIDGE = 1e-13


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

    def lengths(self, columns: Floats) -> Floats:
        """Visible length (b,) of columns (m, b) of which everything fitted has been taken."""
        each = self.result.first.comparison.lengths(columns)
        variance = (self.weight[:, None] * self.squares[:, None] / np.maximum(each, 1e-300)).sum(axis=0)
        return np.asarray(np.where(each.min(axis=0) > 0, 1 / np.sqrt(variance), 0.0))

    def taking(self, raw: Floats) -> tuple[str, ...]:
        """Names of what takes most of a column (m,) up: what was asserted, or else what the model names."""
        left = self.result.first.comparison.rest(raw[:, None])
        if np.linalg.norm(left) >= HIDDEN * np.linalg.norm(raw):
            return self.result.effects
        return _imitators(self.result.first.model, raw)


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
    way = turn.sum(axis=2) / sqrt(r)
    return np.sqrt(strengths[:, 0]), np.sqrt(strengths.mean(axis=1)), way


def aliased(view: Visibility, lefts: Floats, values: Floats) -> NDArray[np.bool_]:
    """(p,) whether another value, not next to it, looks the same in these observations."""
    p, m, r = lefts.shape
    basis, s, _ = np.linalg.svd(lefts, full_matrices=False)
    basis = np.where((s > 1e-6 * s.max(initial=1e-300))[:, None, :], basis, 0.0)
    flat = basis.transpose(1, 0, 2).reshape(m, p * r)
    alike = ((flat.T @ flat) ** 2).reshape(p, r, p, r).sum(axis=(1, 3)) / r > _ALIKE
    place = np.argsort(np.argsort(values))
    return np.asarray((alike & (np.abs(place[:, None] - place) > _NEIGHBOURS)).any(axis=1))


def _imitators(model: RecordingModel, raw: Floats) -> tuple[str, ...]:
    """What is fitted that together looks like a column (m,); the artefact's free places first, of the rest the smallest."""
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


# Visible lengths within which one is looked for; beyond the last nothing is said to be found
SHORTEST, LONGEST = 1.0, 60.0
_NOISES = 7
_Z = np.linspace(-5.0, 5.0, 101)


@dataclass(frozen=True, eq=False)
class Thresholds:
    """What an effect must pass, in terms of z; see the module's docstring."""

    detected: float  # z from which on the test rejects
    named: Floats  # z (r,) from which on it exceeds each of its closest rivals, on average; infinite where never
    cosines: Floats  # (r,) with these
    known: float  # degrees of freedom of what was known of σ beforehand
    left: int  # degrees of freedom of the residuals

    @property
    def noises(self) -> Floats:
        """(q,) s/σ at evenly probable sizes of the residuals at right angles to the effect."""
        count = max(self.left - 1, 1)
        squares = special.chdtri(count, 1 - (np.arange(_NOISES) + 0.5) / _NOISES)
        return np.asarray(np.sqrt((self.known + squares) / (self.known + count)))

    def detects(self, length: Floats) -> Floats:
        """Probability (d,) that the test rejects, for visible lengths (d,)."""
        gate = self.detected * self.noises[:, None]
        return np.asarray((special.ndtr(length - gate) + special.ndtr(-length - gate)).mean(axis=0))

    def names(self, length: Floats) -> Floats:
        """Probability (d,) that it is called by its name."""
        if not np.all(np.isfinite(self.named)):
            return np.zeros(len(length))
        z = length[:, None] + _Z  # (d, z)
        noises = self.noises[:, None, None]
        passed = (np.abs(z) > self.detected * noises).astype(np.float64)
        for named, cosine in zip(self.named, self.cosines, strict=True):
            beside = 1 - cosine**2
            room = z**2 - beside * (named * noises) ** 2  # what is left of it for the rival's own z²
            rival, spread = np.sqrt(np.maximum(room, 0.0)), np.sqrt(beside)
            below = special.ndtr((rival - cosine * z) / spread) - special.ndtr((-rival - cosine * z) / spread)
            passed *= np.where(room > 0, below, 0.0)
        density = np.exp(-0.5 * _Z**2)
        return np.asarray(passed.mean(axis=0) @ density / density.sum())

    def length_detected(self, power: float) -> float:
        return _length_of(self.detects, power)

    def length_named(self, power: float) -> float:
        """Visible length named with this probability; infinite where none is."""
        return _length_of(self.names, power) if np.all(np.isfinite(self.named)) else float(np.inf)


def _length_of(probability: Callable[[Floats], Floats], power: float) -> float:
    """Length at which a probability that grows with it reaches a power; infinite beyond the longest."""

    def short(length: float) -> float:
        return float(probability(np.array([length]))[0]) - power

    if short(LONGEST) < 0:
        return float(np.inf)
    return root(short, SHORTEST, LONGEST, 1e-10) if short(SHORTEST) < 0 else SHORTEST


SIZES = (1.0, 2.0, 5.0)  # visible lengths, over a first guess of the threshold, at which the statistic is computed
LENGTHS = np.geomspace(SHORTEST, LONGEST, 160)
_CLOSEST = 0.9999
_RIVALS = 4


def thresholds(view: Visibility, which: Sequence[int], columns: Floats, alpha: float) -> Iterator[Thresholds]:
    """Of each effect, from the statistic on the bare effect at :data:`SIZES`; ``columns`` (n, m) of visible length one."""
    if not which:
        return
    first = view.result.first
    comparison, explanations = first.comparison, first.explanations
    null = first.null
    low, high = float(null.min()) - 1.0, float(null.max()) + 50.0
    gate = root(lambda value: float(np.log(tail_probability(null, value) / alpha)), low, high, 1e-6)
    prior = log_prior(explanations)
    sizes = np.array([[sqrt(max(2 * (gate - prior[i] + 1.0), 4.0)) * size for size in SIZES] for i in which])
    data = (sizes[:, :, None] * columns[:, None, :]).reshape(-1, columns.shape[1]).T
    odds = comparison.of_signal(data, view.noise).reshape(len(explanations), len(which), len(SIZES))
    dof = max(view.known + view.left, 1.0)
    naming = Naming(explanations)
    pair = _pair(explanations, comparison.visible)
    for i, index in enumerate(which):
        each = _between(dof * np.log1p(sizes[i] ** 2 / dof), odds[:, i], dof * np.log1p(LENGTHS**2 / dof))
        statistic = special.logsumexp(prior[:, None] + each, axis=0)
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


def _pair(explanations: Sequence[Explanation], visible: frozenset[int]) -> float | None:
    count = sum(
        e.kind == EFFECT and e.weight == 1 and not e.shaped and i in visible for i, e in enumerate(explanations)
    )
    if count < 2:
        return None
    return float(np.log(EFFECTS[2] / EFFECTS[0]) - np.log(comb(count, 2)) + np.log(NOTHING) + np.log(count - 1))


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
    functions = special.logsumexp(weight[kinds == UNKNOWN], axis=0, keepdims=True)
    others = np.vstack([weight[known] + CERTAIN, functions])
    lengths = _passes(weight[true] - others)
    closest = np.argsort(-lengths, kind="stable")[:_RIVALS]
    at = np.searchsorted(LENGTHS, np.minimum(lengths[closest], LONGEST)).clip(1, len(LENGTHS) - 1)
    own, other = (rows[..., at] - rows[..., at - 1] for rows in (weight[true], others[closest]))
    gained = np.diagonal(other) / np.maximum(own, 1e-12)
    return lengths[closest], np.sqrt(np.clip(gained, 0.0, _CLOSEST))
