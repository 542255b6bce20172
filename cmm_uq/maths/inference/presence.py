"""What a sampler proposes where components of noise may be present or absent: distributions for each set of those present.

A component's standard normal number says by the quantile of a probability whether it is present, and by what lies beyond how
large it is. Of an absent one the density knows no more than the prior, of one present it has one rounded mode in most
recordings. So each set of components present has a probability and a t distribution of the numbers that then matter, and
the others are drawn from their prior; all are found by importance sampling, let in by degrees.

What matters is counted in numbers that are standard normal, given that it is present: the size of each component, two for
the directions of the axes (whose radius and direction they are), and the rate of slow noise unless it is a walk.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass
from cmm_uq.maths.inference import proposals
from cmm_uq.maths.inference.noise import ABSENT, AXES, GROWTH, PLACING, SLOW, WALK
from cmm_uq.maths.inference.proposals import LogDensity, Proposal, highest_power, moments, weights

# numbers that say whether something is present, and the probability that it is not
_SWITCHES = {"spread": ABSENT[AXES], PLACING: ABSENT[PLACING], GROWTH: ABSENT[GROWTH], SLOW: ABSENT[SLOW], "rate": WALK}
_LEAST = -8.0  # of a standard normal number: what is less probable is not told from it
TRIED, _BY_PRIOR = 1500, 0.03  # draws of a round; part of what is proposed that goes by the prior of what is present
# part of each set's draws that come from as wide a distribution, in units of the usual one
_OUTER, _FARTHER = 0.15, 2.0
_ROUNDS, _LOOKS, _RECALLED = 30, 3, 3  # at most; to the density itself; whose draws count together
# part of the draws that must count, to begin with and at least; times the last power below which they count too much
_ENOUGH, _LEAST_ENOUGH, _STUCK = 0.2, 0.02, 1.01
_NEVER = -1e30


@dataclass(frozen=True)
class Numbers:
    names: tuple[str, ...]  # as in :attr:`cmm_uq.maths.inference.noise.Components.names`, or but for the first.

    @cached_property
    def switches(self) -> tuple[str, ...]:
        return tuple(name for name in self.names if name in _SWITCHES)

    @cached_property
    def sets(self) -> NDArray[np.bool_]:
        """(S, switches) what is present together; slow noise that is absent has no rate."""
        every = np.array(list(product((False, True), repeat=len(self.switches))), dtype=bool)
        if "rate" not in self.switches:
            return every
        slow, rate = (every[:, self.switches.index(name)] for name in (SLOW, "rate"))
        return np.asarray(every[slow | ~rate])

    @cached_property
    def log_prior(self) -> Floats:
        absent = np.array([_SWITCHES[name] for name in self.switches])
        each = np.where(self.sets, np.log1p(-absent), np.log(absent))
        if "rate" in self.switches:
            each[~self.sets[:, self.switches.index(SLOW)], self.switches.index("rate")] = 0.0
        return np.asarray(each.sum(axis=1))

    @cached_property
    def normal(self) -> Ints:
        return np.array([i for i, name in enumerate(self.names) if name != "log_sigma"], dtype=np.int64)

    @cached_property
    def matters(self) -> NDArray[np.bool_]:
        """(S, D) which of the coordinates matter in each set."""
        with_set = {name: self.sets[:, i] for i, name in enumerate(self.switches)}
        with_set["log_sigma"] = np.ones(len(self.sets), dtype=bool)
        if "spread" in with_set:
            with_set["first"] = with_set["second"] = with_set["spread"]
        return np.column_stack([with_set[name] for name in self.names if name != "spread"])

    @cached_property
    def has_prior(self) -> NDArray[np.bool_]:
        """(D,) which of the coordinates are standard normal beforehand."""
        return np.array([name != "log_sigma" for name in self.names if name != "spread"])

    def of(self, latent: Floats) -> tuple[Ints, Floats]:
        """Set (w,) and coordinates (w, D) of numbers (w, d); what does not matter in a set is not to be looked at."""
        column = {name: latent[:, i] for i, name in enumerate(self.names)}
        on = np.column_stack([column[name] > scipy.special.ndtri(_SWITCHES[name]) for name in self.switches])
        if "rate" in column:
            on[:, self.switches.index("rate")] &= on[:, self.switches.index(SLOW)]
        # logarithm of the probability of more, given that it is present
        log = {name: scipy.special.log_ndtr(-column[name]) - np.log1p(-_SWITCHES[name]) for name in self.switches}
        beyond = {name: np.minimum(each, 0.0) for name, each in log.items()}
        found = {name: np.maximum(-scipy.special.ndtri_exp(each), _LEAST) for name, each in beyond.items()}
        if "spread" in column:
            length = np.sqrt(-2 * beyond["spread"]) / np.maximum(np.hypot(column["first"], column["second"]), 1e-300)
            found |= {name: length * column[name] for name in ("first", "second")}
        coordinates = [found.get(name, column[name]) for name in self.names if name != "spread"]
        bits = 1 << np.arange(len(self.switches))
        place = np.full(1 << len(self.switches), -1)
        place[self.sets @ bits] = np.arange(len(self.sets))
        return np.asarray(place[on @ bits]), np.column_stack(coordinates)

    def latent(self, number: Ints, coordinates: Floats, normal: Floats, uniform: Floats) -> Floats:
        """Numbers (w, d) of sets (w,) and their coordinates (w, D).

        ``normal, uniform``: (w, d) and (w, switches) random numbers, from which what does not matter is drawn by its prior.
        """
        on = self.sets[number]
        column = dict(zip((name for name in self.names if name != "spread"), coordinates.T, strict=True))
        found = dict(zip(self.names, normal.T, strict=True))
        if "log_sigma" in column:
            found["log_sigma"] = column["log_sigma"]
        beyond = {name: scipy.special.log_ndtr(-column[name]) for name in self.switches if name != "spread"}
        if "spread" in found:
            square = column["first"] ** 2 + column["second"] ** 2
            beyond["spread"] = -0.5 * square
            length = np.hypot(found["first"], found["second"]) / np.maximum(np.sqrt(square), 1e-300)
            present = on[:, self.switches.index("spread")]
            for name in ("first", "second"):
                found[name] = np.where(present, length * column[name], found[name])
        for i, name in enumerate(self.switches):
            absent = _SWITCHES[name]
            without = scipy.special.ndtri(absent * uniform[:, i])
            if name == "rate":
                slow = on[:, self.switches.index(SLOW)]
                without = np.where(slow, without, found[name])
            found[name] = np.where(on[:, i], -scipy.special.ndtri_exp(np.log1p(-absent) + beyond[name]), without)
        return np.column_stack([found[name] for name in self.names])


@dataclass(frozen=True, eq=False)
class Present:
    numbers: Numbers  # what they mean
    probability: Floats  # (S,) of each set
    each: Sequence[Proposal]  # (S,) of the coordinates that matter in it

    @property
    def centre(self) -> Floats:
        """(d,) from which nothing is counted: the numbers are proposed as they are."""
        return np.zeros(len(self.numbers.names))

    def parameters(self, z: Floats) -> Floats:
        return z

    def draws(self, count: int, random: Any) -> Floats:
        return self.made(self.numbers_of(count, random))

    def numbers_of(self, count: int, random: Any) -> proposals.Numbers:
        """Set (count,), coordinates (count, D), and two arrays of what is absent, normal and uniform."""
        number, numbers = proposals.chosen(self._cumulative, count, random), self.numbers
        coordinates = np.zeros((count, numbers.matters.shape[1]))
        for s in np.flatnonzero(np.bincount(number)).tolist():
            matters = np.flatnonzero(numbers.matters[s])
            if len(matters):
                rows, each = np.flatnonzero(number == s), self.each[s]
                coordinates[rows[:, None], matters] = each.parameters(each.draws(len(rows), random))
        absent = random.standard_normal((len(numbers.names), count)).T
        return number, coordinates, absent, random.random_sample((len(numbers.switches), count)).T

    def made(self, numbers: proposals.Numbers) -> Floats:
        return self.numbers.latent(*numbers)

    @cached_property
    def _cumulative(self) -> Floats:
        return proposals.cumulative(self.probability)

    def log_density(self, z: Floats) -> Floats:
        """(w,) of numbers (w, d), with its constant."""
        numbers, normal = self.numbers, z[:, self.numbers.normal]
        number, coordinates = numbers.of(z)
        found = (np.log(self.probability) - numbers.log_prior)[number] - 0.5 * np.sum(normal**2, axis=1)
        found -= 0.5 * normal.shape[1] * np.log(2 * np.pi)
        for s in np.unique(number):
            own, matters = np.flatnonzero(number == s), numbers.matters[s]
            if matters.any():
                at = coordinates[np.ix_(own, matters)]
                before = at[:, numbers.has_prior[matters]]
                found[own] += self.each[s].log_probability(at) + 0.5 * np.sum(before**2, axis=1)
                found[own] += 0.5 * before.shape[1] * np.log(2 * np.pi)
        return np.asarray(found)

    log_probability = log_density  # the numbers are proposed as they are


Proposes = Proposal | Present  # what a sampler takes its steps from


def beginning(names: Sequence[str], log_sigma: float = 0.0, width: float = 1.0) -> Present:
    """The prior, and where the reading noise is looked for."""
    numbers = Numbers(tuple(names))
    mean = np.where(numbers.has_prior, 0.0, log_sigma)
    factor = np.diag(np.where(numbers.has_prior, 1.0, width))
    each = [_wide(mean[matters], factor[np.ix_(matters, matters)]) for matters in numbers.matters]
    return Present(numbers, np.exp(numbers.log_prior), each)


def present(density: LogDensity, begin: Present, seed: int, looks: int = _LOOKS, tried: int = TRIED) -> Present:
    """An approximation of a density of the numbers that say the sizes of noise."""
    random = np.random.RandomState(np.random.MT19937(np.random.SeedSequence(seed, spawn_key=(17,))))
    fits: list[Present] = [begin]
    draws: list[Floats] = []
    gains: list[Floats] = []
    power, enough, left = 0.0, _ENOUGH, looks
    for _ in range(_ROUNDS):
        z = fits[-1].draws(tried, random)
        draws = [*draws, z][-_RECALLED:]
        gains = [*gains, np.maximum(density(z) - begin.log_density(z), _NEVER)][-_RECALLED:]
        every, gain = np.vstack(draws), np.concatenate(gains)
        from_any = np.stack([each.log_density(every) for each in fits[-_RECALLED:]])
        known = begin.log_density(every) - scipy.special.logsumexp(from_any, axis=0)
        before, power = power, highest_power(gain, known, power, enough * len(every))
        enough = max(0.5 * enough, _LEAST_ENOUGH) if power < min(1.0, _STUCK * before) else enough
        fits.append(_fitted(begin, every, weights(power * gain + known)))
        left -= power == 1.0
        if not left:
            break
    return fits[-1]


def _fitted(begin: Present, latent: Floats, weight: Floats) -> Present:
    """Distributions for weighted draws: those of sets that hardly any draw has, from what the others have in common."""
    numbers = begin.numbers
    number, coordinates = numbers.of(latent)
    part = np.bincount(number, weight, len(numbers.sets))
    probability = (1 - _BY_PRIOR) * part + _BY_PRIOR * np.exp(numbers.log_prior)
    mean, covariance = _together(begin, number, coordinates, weight)
    each = []
    for s, matters in enumerate(numbers.matters):
        common, own = covariance[np.ix_(matters, matters)], np.flatnonzero((number == s) & (weight > 0))
        at, about = mean[matters], common
        if len(own) and matters.any():
            inside = weight[own] / part[s]
            count, k = 1 / np.sum(inside**2), matters.sum()
            centre, scatter = moments(coordinates[np.ix_(own, matters)], inside)
            at = (count * centre + at) / (count + 1)
            about = (count * scatter + 2 * k * common) / (count + 2 * k)
        each.append(_wide(at, np.asarray(np.linalg.cholesky(about + 1e-9 * np.eye(len(at))))))
    return Present(numbers, probability / probability.sum(), each)


def _together(begin: Present, number: Ints, coordinates: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """Mean (D,) and covariance (D, D) of each coordinate over all sets in which it matters; the prior's where none is."""
    numbers = begin.numbers
    counts = numbers.matters[number] * weight[:, None]
    total = counts.sum(axis=0)
    seen = total > 0
    sums = np.where(counts > 0, counts * coordinates, 0.0).sum(axis=0)
    mean = np.where(seen, sums / np.where(seen, total, 1.0), 0.0)
    about = np.where(counts > 0, coordinates - mean, 0.0)
    variance = (about**2 * weight[:, None]).sum(axis=0) / np.where(seen, total, 1.0)
    variance = np.where(seen, np.maximum(variance, 1e-6), 1.0)
    both = (counts > 0).T.astype(np.float64) * weight @ (counts > 0)
    covariance = (about * weight[:, None]).T @ about / np.where(both > 0, both, 1.0)
    scale = np.sqrt(variance)
    correlation = covariance / scale / scale[:, None]
    np.fill_diagonal(correlation, 1.0)
    values, vectors = np.linalg.eigh(correlation)  # of different draws each: not surely positive definite
    correlation = (vectors * np.maximum(values, 0.05)) @ vectors.T
    return mean, correlation * scale * scale[:, None]


def _wide(mean: Floats, factor: Floats) -> Proposal:
    """A t distribution, and a wider one that some of the draws come from."""
    k = len(mean)
    inner = np.sqrt(2.0 / 3.0)  # six degrees of freedom have 6/4 of their scale's variance
    factors = np.stack([inner * np.eye(k), _FARTHER * np.eye(k)])
    return Proposal(mean, factor, np.array([1 - _OUTER, _OUTER]), np.zeros((2, k)), factors)
