"""What a sampler proposes: Student's t distributions that together are nearly the density, found by importance sampling.

One of them does where the density has one rounded mode. Where components of noise may be present or absent, it has several of
different widths, and a mixture is fitted to weighted draws (Cappé et al. 2008, Statistics and Computing 18(4)).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass

Numbers = tuple[NDArray[Any], ...]  # random numbers, of which the first axis are draws
LogDensity = Callable[[Floats], Floats]  # of (w, d) parameters, up to a constant: (w,)
Fall = Callable[[Floats], tuple[float, Floats]]  # minus a logarithm of a density at (d,), and its slopes (d,)
_DOF = 6.0
# times the curvature's width at which a skewed density is first looked at: too wide costs draws, too narrow misses a tail
_WIDER, _LOOKS = 2.0, 3
# letting in by degrees: part of the draws that must count, rounds at most, least gain that is reckoned with
_ENOUGH, _MOST_LOOKS, NEVER = 0.2, 25, -1e30
_COUNT = 0.1  # draws of a round that must count, where each is weighed against all
_STUCK = 1.01  # times the power from round to round below which one distribution does not do
# distributions of a mixture; weight of one more as wide as all; their variance over that of all to begin with
_PARTS, _WIDE, _NARROWER = 8, 0.1, 0.3
_REFITS, _RECALLED, _LEAST_ENOUGH = 5, 3, 0.02
# of a logarithm's slopes; iterations, fewer where few draws find where the density is for themselves; least curvature
_STEP, _MOST_STEPS, _FEWER_STEPS, _FLATTEST = 0.05, 60, 25, 0.5
_FITS = 8  # mixtures fitted to the density itself from which the best is taken


@dataclass(frozen=True, eq=False)
class Proposal:
    """Student's t distributions with six degrees of freedom in whitened coordinates z; x = centre + factor @ z."""

    centre: Floats  # (d,) the parameters where z is zero
    factor: Floats  # (d, d)
    weights: Floats  # (K,)
    centres: Floats  # (K, d) in z
    factors: Floats  # (K, d, d) in z

    @classmethod
    def single(cls, centre: Floats, factor: Floats) -> Proposal:
        d = len(centre)
        return cls(centre, factor, np.ones(1), np.zeros((1, d)), np.eye(d)[None])

    def parameters(self, z: Floats) -> Floats:
        """(w, d) for coordinates z."""
        return np.asarray(self.centre + z @ self.factor.T)

    def draws(self, count: int, random: Any) -> Floats:
        return self.made(self.numbers_of(count, random))

    def numbers_of(self, count: int, random: Any) -> Numbers:
        """What draws are made of, taken in a fixed order: normal numbers (count, d), χ² (count, 1), distribution (count,)."""
        normal = random.standard_normal((count, len(self.centre)))
        return normal, random.chisquare(_DOF, size=(count, 1)), chosen(self._cumulative, count, random)

    def made(self, numbers: Numbers) -> Floats:
        """Coordinates (w, d) from such numbers, also of several draws one after another."""
        normal, squares, part = numbers
        t = np.asarray(normal / np.sqrt(squares / _DOF))
        if len(self.weights) == 1:
            return t
        return np.asarray(self.centres[part] + np.einsum("wij,wj->wi", self.factors[part], t))

    def log_density(self, z: Floats) -> Floats:
        """(w,) up to a constant."""
        log, _ = self.log_each(z)
        return log[:, 0] if len(self.weights) == 1 else np.asarray(np.logaddexp.reduce(log, axis=1))

    def log_probability(self, parameters: Floats) -> Floats:
        """Logarithm of the density (w,) of parameters (w, d), with its constant."""
        return np.asarray(self.log_density((parameters - self.centre) @ self._whitening) + self._constant)

    def log_each(self, z: Floats) -> tuple[Floats, Floats]:
        """Weighted log density of each distribution, and squared distance from its centre, (w, K)."""
        if len(self.weights) == 1:
            squares = np.einsum("wi,wi->w", z, z)[:, None]
        else:
            own = (z @ self._inverse.reshape(-1, z.shape[1]).T).reshape(len(z), *self.centres.shape) - self._centre
            squares = np.einsum("wki,wki->wk", own, own)
        log = -0.5 * (_DOF + z.shape[1]) * np.log1p(squares / _DOF)
        return log + self._log_weight, squares

    @cached_property
    def _whitening(self) -> Floats:
        return np.asarray(np.linalg.inv(self.factor).T)

    @cached_property
    def _constant(self) -> float:
        d = len(self.centre)
        constant = (
            scipy.special.gammaln(0.5 * (_DOF + d)) - scipy.special.gammaln(0.5 * _DOF) - 0.5 * d * np.log(np.pi * _DOF)
        )
        return float(constant - np.linalg.slogdet(self.factor)[1])

    @cached_property
    def _cumulative(self) -> Floats:
        return cumulative(self.weights)

    @cached_property
    def _inverse(self) -> Floats:
        return np.asarray(np.linalg.inv(self.factors))

    @cached_property
    def _centre(self) -> Floats:
        """(K, d) of each distribution in its own coordinates."""
        return np.asarray(np.einsum("kij,kj->ki", self._inverse, self.centres))

    @cached_property
    def _log_weight(self) -> Floats:
        return np.asarray(np.log(self.weights) - np.linalg.slogdet(self.factors)[1])


def cumulative(probability: Floats) -> Floats:
    """(K,) of which :func:`chosen` chooses."""
    found = np.cumsum(probability)
    return np.asarray(found / found[-1])


def chosen(cumulated: Floats, count: int, random: Any) -> NDArray[np.int64]:
    """(count,) as ``random.choice`` does, which looks through its probabilities each time; of a single one, with no number."""
    if len(cumulated) == 1:
        return np.zeros(count, dtype=np.int64)
    return np.asarray(cumulated.searchsorted(random.random_sample(count), side="right"), dtype=np.int64)


def refined(density: LogDensity, centre: Floats, factor: Floats, seed: int) -> Proposal:
    """A better approximation of a skewed density: its moments by importance sampling from a t distribution, thrice."""
    random = np.random.RandomState(np.random.MT19937(np.random.SeedSequence(seed)))
    width, looks = _WIDER, 0
    while looks < _LOOKS:
        proposal = Proposal.single(centre, width * factor)
        z = proposal.draws(500 * len(centre), random)
        theta = proposal.parameters(z)
        weight = weights(density(theta) - proposal.log_density(z))
        # too few draws that count would make it degenerate: the approximation is then better than its correction
        if 1 / np.sum(weight**2) < 5 * len(centre):
            if width == 1.0:
                break
            width = max(1.0, width / 2**0.25)  # in many dimensions most of what is so much wider lies where nothing is
            continue
        looks += 1
        centre, covariance = moments(theta, weight)
        factor, width = np.asarray(np.linalg.cholesky(covariance)), 1.0
    return Proposal.single(centre, factor)


def tempered(density: LogDensity, centre: Floats, factor: Floats, seed: int) -> Proposal:
    """An approximation of a density that may lie far from where it was looked for: importance sampling, let in by degrees.

    What is looked for goes from ``centre`` (d,) and ``factor`` (d, d), wide enough for the density to be somewhere within, to
    the density, in each round as far as enough draws count.
    """
    random, d = np.random.RandomState(np.random.MT19937(np.random.SeedSequence(seed))), len(centre)
    begin, back = centre, np.linalg.inv(factor)
    first = factor
    count, power, left = 100 * (d + 1), 0.0, _LOOKS
    for _ in range(_MOST_LOOKS):
        proposal = Proposal.single(centre, factor)
        z = proposal.draws(count, random)
        theta = proposal.parameters(z)
        from_begin = -0.5 * np.sum(((theta - begin) @ back.T) ** 2, axis=1)
        gain = np.maximum(density(theta) - from_begin, NEVER)
        known = from_begin - proposal.log_density(z)
        before, power = power, highest_power(gain, known, power, _ENOUGH * count)
        if power < min(1.0, _STUCK * before):
            return _mixture(density, begin, first, random)
        mean, covariance = moments(theta, weights(power * gain + known))
        centre, factor = mean, np.linalg.cholesky(covariance + 1e-12 * np.trace(covariance) * np.eye(d))
        left -= power == 1.0
        if not left:
            single = worth(gain + known) > 0.5 * _ENOUGH * count
            return Proposal.single(centre, factor) if single else _mixture(density, begin, first, random)
    return _mixture(density, begin, first, random)


def _mixture(density: LogDensity, centre: Floats, factor: Floats, random: Any) -> Proposal:
    """Several distributions, let in by degrees, and in the end those of several fits of whose draws most count.

    The draws of some rounds count together, as if each came from the mean of what drew them.
    """
    d = len(centre)
    proposals = [Proposal.single(centre, factor)]
    draws: list[Floats] = []
    gains: list[Floats] = []
    count, power, enough = 100 * (d + 1), 0.0, _ENOUGH
    tried: list[tuple[float, int]] = []
    while len(proposals) <= _MOST_LOOKS or (power == 1.0 and len(tried) < _FITS):
        z = proposals[-1].draws(count, random)
        draws = [*draws, z][-_RECALLED:]
        gain = np.maximum(density(proposals[-1].parameters(z)) + 0.5 * np.sum(z**2, axis=1), NEVER)
        gains = [*gains, gain][-_RECALLED:]
        if power == 1.0:
            own = -0.5 * np.sum(z**2, axis=1) - proposals[-1].log_density(z)
            tried.append((worth(gain + own), len(proposals) - 1))
            if len(tried) == _FITS or tried[-1][0] > _ENOUGH * count:
                break
        every, gain = np.vstack(draws), np.concatenate(gains)
        from_any = np.stack([proposal.log_density(every) for proposal in proposals[-_RECALLED:]])
        known = -0.5 * np.sum(every**2, axis=1) - scipy.special.logsumexp(from_any, axis=0)
        before, power = power, highest_power(gain, known, power, enough * len(every))
        enough = max(0.5 * enough, _LEAST_ENOUGH) if power < min(1.0, _STUCK * before) else enough
        proposals.append(_fitted(proposals[-1], every, weights(power * gain + known), random))
    return proposals[max(tried)[1]] if tried else proposals[-1]


def _fitted(proposal: Proposal, z: Floats, weight: Floats, random: Any) -> Proposal:
    """A mixture for weighted draws z, by expectation and maximisation from centres drawn among them."""
    d = z.shape[1]
    mean, covariance = moments(z, weight)
    covariance = covariance + 1e-9 * np.trace(covariance) * np.eye(d)
    many = 1 / np.sum(weight**2)
    narrow = np.linalg.cholesky(_NARROWER * covariance)
    centres, factors = z[random.choice(len(z), _PARTS, p=weight)], np.repeat(narrow[None], _PARTS, axis=0)
    found = Proposal(proposal.centre, proposal.factor, np.full(_PARTS, 1 / _PARTS), centres, factors)
    for _ in range(_REFITS):
        log, squares = found.log_each(z)
        share = weight[:, None] * np.exp(log - scipy.special.logsumexp(log, axis=1, keepdims=True))
        part = share.sum(axis=0)
        pull = share * (_DOF + d) / (_DOF + squares)
        # fewer draws say nothing about a distribution of its own
        kept = part * many > min(d / 2, 0.5 * part.max() * many)
        share, pull, part = share[:, kept], pull[:, kept], part[kept]
        centres = (pull.T @ z) / pull.sum(axis=0)[:, None]
        about = z[:, None] - centres
        own = np.einsum("wk,wki,wkj->kij", pull, about, about) / part[:, None, None]
        prior = (2 * d / (2 * d + part * many))[:, None, None]
        factors = np.linalg.cholesky((1 - prior) * own + prior * _NARROWER * covariance)
        found = Proposal(proposal.centre, proposal.factor, part / part.sum(), centres, factors)
    parts, centres = np.append((1 - _WIDE) * found.weights, _WIDE), np.vstack([found.centres, mean])
    factors = np.concatenate([found.factors, np.linalg.cholesky(covariance)[None]])
    return Proposal(proposal.centre, proposal.factor, parts, centres, factors)


def moments(values: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """Mean and covariance of weighted draws (w, d)."""
    mean = weight @ values
    about = values - mean
    return mean, (about * weight[:, None]).T @ about


def highest_power(gain: Floats, known: Floats, least: float, enough: float) -> float:
    """Largest power of a gain in density, not below ``least``, at which the draws are worth enough, by bisection."""
    low, high = least, 1.0
    if worth(gain + known) >= enough:
        return 1.0
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if worth(middle * gain + known) >= enough else (low, middle)
    return low


def weights(log: Floats) -> Floats:
    """Of draws whose density over that proposed has the logarithm (w,): their sum is one."""
    weight = np.exp(log - log.max())
    return np.asarray(weight / weight.sum())


def evenly_by(weight: Floats, count: int) -> NDArray[np.int64]:
    """Places (count,) of draws, each as often as its weight (w,) says, evenly spread."""
    place = np.searchsorted(np.cumsum(weight), (np.arange(count) + 0.5) / count * (1 - 1e-12))
    return np.minimum(place, len(weight) - 1)


def worth(log: Floats) -> float:
    """How many draws those are worth whose density over that proposed has the logarithm (w,)."""
    return float(1 / np.sum(weights(log) ** 2))


def weighed(
    density: LogDensity, centre: Floats, factor: Floats, random: Any, each: int, worth: float, most: int
) -> tuple[Floats, Floats, Proposal]:
    """Draws (N, d), the logarithms of their weights (N,), and the last of the t distributions that they are of.

    Each has the moments of the density, as far as enough of all draws before count, and a draw of any of them is weighed
    against all (Cornuet, Marin, Mira, Robert 2012, Scand. J. Stat. 39, 798): ``each`` at once, until they are worth so many
    independent ones or are ``most``.
    """
    proposals, latent, value = list[Proposal](), np.zeros((0, len(centre))), np.zeros(0)
    while True:
        proposals.append(Proposal.single(centre, factor))
        more = proposals[-1].parameters(proposals[-1].draws(each, random))
        latent, value = np.vstack([latent, more]), np.append(value, density(more))
        of_all = np.logaddexp.reduce([one.log_probability(latent) for one in proposals], axis=0) - np.log(
            len(proposals)
        )
        log = np.maximum(value - of_all, NEVER)
        weight = weights(log)
        if 1 / np.sum(weight**2) >= worth or len(latent) >= most:
            return latent, log, proposals[-1]
        power = highest_power(log, np.zeros(len(log)), 0.0, _COUNT * each)
        centre, covariance = moments(latent, weights(power * log))
        factor = np.linalg.cholesky(covariance + 1e-9 * np.trace(covariance) * np.eye(len(centre)))


def by_steps(density: LogDensity, at: Floats, d: int) -> tuple[float, Floats]:
    """Minus the logarithm of a density, and its slopes by the first d numbers, by differences over steps."""
    steps = _STEP * np.eye(len(at))[:d]
    values = np.maximum(density(np.vstack([at, at + steps, at - steps])), NEVER)
    return -float(values[0]), -(values[1 : d + 1] - values[d + 1 :]) / (2 * _STEP)


def laplace(density: LogDensity, start_at: Floats, fall: Fall | None = None) -> tuple[Floats, Floats]:
    """Where a density is largest (d,), and a factor (d, d) of its covariance there, nowhere much wider than the prior.

    ``fall``: what has slopes, where that is to be had for less; it is followed for fewer steps.
    """
    d = len(start_at)
    falling, most = (fall, _FEWER_STEPS) if fall else (lambda at: by_steps(density, at, d), _MOST_STEPS)
    found = scipy.optimize.minimize(falling, start_at, jac=True, method="L-BFGS-B", options={"maxiter": most})
    each = np.array([falling(found.x + step)[1] - falling(found.x - step)[1] for step in _STEP * np.eye(d)]) / (
        2 * _STEP
    )
    values, vectors = np.linalg.eigh(0.5 * (each + each.T))
    spread = (vectors / np.maximum(values, _FLATTEST)) @ vectors.T
    return np.asarray(found.x), np.linalg.cholesky(spread)
