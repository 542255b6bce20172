"""Sizes of families of errors and of noise, as observations say: by their exact density, and with limits that are kept."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass
from cmm_uq.maths.inference.ensembles import Chains, run_ensembles
from cmm_uq.maths.inference.families import FieldModel
from cmm_uq.maths.inference.marginal import SIGMA_BOUNDS, Marginal
from cmm_uq.maths.inference.noise import Sizes
from cmm_uq.maths.inference.posterior import start
from cmm_uq.maths.inference.proposals import Fall, LogDensity, by_steps, evenly_by, laplace, weighed, weights

_LEAST_WORTH = 50.0  # of weighed draws of sizes, below which a sampler draws them
_EFFECTIVE, _STEPS = 400, 40  # sizes are few and smooth: what follows from them needs no more of them
HELD = 250  # sizes that all draws of a part's machine have among them
_WIDER, _SMALLEST = 1.3, 1e-4  # than the curvature says; of a family's size


@dataclass(frozen=True)
class Effort:
    each: int = 1000  # at once
    most: int = 24_000
    worth: float = 200.0  # independent draws that all are worth, with which that ends
    held: int = HELD  # sizes that all draws have among them
    sampler: bool = True  # whether emcee, which takes minutes, draws them where weighed ones are worth too little
    slopes: bool = False  # whether the likeliest are looked for by slopes, and not by steps


USUAL, BRIEF = Effort(), Effort(400, 8000, 150.0, 100, sampler=False)
FOLD = Effort(200, 8000, 60.0, 100, sampler=False, slopes=True)  # of one of many parts of a recording


def size_of(latent: Floats) -> Floats:
    """Half-normal sizes of standard normal numbers."""
    return np.maximum(scipy.special.ndtri(0.5 * (1 + scipy.special.ndtr(latent))), _SMALLEST)


@dataclass(frozen=True, eq=False)
class FieldSizes:
    """Sizes of noise and families, as often as their posterior has them."""

    noise: Sizes  # (N,)
    families: Floats  # (N, F) of those that are learned
    within: Floats  # (N, k) of the observations of which limits are known (:meth:`FieldModel.draw`)
    worth: float  # independent draws that they are worth
    chains: Chains | None  # of emcee, where the approximation by which they are drawn is not good enough


def sample_sizes(
    model: FieldModel, draws: int, seed: int, known: Sizes | None = None, effort: Effort = USUAL
) -> FieldSizes:
    """Posterior of the sizes of noise and families, ``draws`` of them, of which some hundred are different.

    ``known``: of the noise, one draw, where it is not to be found. Raises ``CmmUqError`` where they cannot be had with the
    effort.
    """
    count = len(model.families)
    if known is not None and not count:
        same, none = known.at(np.zeros(draws, dtype=np.int64)), np.zeros((draws, 0))
        return FieldSizes(same, none, none, np.inf, None)
    density, sizes, d, begin = _density(model, known)
    begin, fall = np.append(begin, np.zeros(count)), _fall(model, density, sizes, d)
    centre, factor = laplace(density, begin, fall if effort.slopes else None)
    random = np.random.RandomState(np.random.MT19937(np.random.SeedSequence(seed, spawn_key=(29,))))
    latent, log, proposal = weighed(density, centre, _WIDER * factor, random, effort.each, effort.worth, effort.most)
    weight = weights(log)
    worth, chains = float(1 / np.sum(weight**2)), None
    if worth >= _LEAST_WORTH:
        latent = latent[evenly_by(weight, effort.held)]
    elif not effort.sampler:
        raise CmmUqError("how large its errors are cannot be drawn in a short time", where="the recording")
    else:
        chains = run_ensembles(density, proposal, seed, effective_samples=_EFFECTIVE, steps_at_once=_STEPS)
        held = np.linspace(0, len(chains.draws) - 1, effort.held).astype(np.int64)
        latent, worth = chains.draws[held], chains.ess_min
    latent, within = _with_limits(model, sizes, d, latent, draws, seed)
    return FieldSizes(sizes(latent), size_of(latent[:, d:]), within, worth, chains)


def _with_limits(
    model: FieldModel, sizes: Callable[[Floats], Sizes], d: int, latent: Floats, draws: int, seed: int
) -> tuple[Floats, Floats]:
    """So many draws of the sizes, and (N, k) of what keeps limits, by which those are weighed anew, without approximation."""
    if not len(model.limit):
        return latent[np.arange(draws) % len(latent)], np.zeros((draws, 0))
    each = -(-draws // len(latent))
    within = model.recorded(sizes(latent), size_of(latent[:, d:]))[1]
    drawn, log = within.draw(np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(47,))), each)
    which = evenly_by(weights((log - within.log_probability[:, None]).ravel()), draws)
    return latent[which // each], drawn.reshape(-1, len(model.limit))[which]


def log_evidence(model: FieldModel, seed: int, known: Sizes | None = None, effort: Effort = BRIEF) -> float:
    """Logarithm of the probability density of the observations, all sizes integrated out by their priors.

    Up to a constant that all models of a recording with the same parameters share. ``known``: as of :func:`sample_sizes`.
    """
    count = len(model.families)
    density, _, _, begin = _density(model, known)
    if not len(begin) + count:
        return float(density(np.zeros((1, 0)))[0])
    centre, factor = laplace(density, np.append(begin, np.zeros(count)))
    random = np.random.RandomState(np.random.MT19937(np.random.SeedSequence(seed, spawn_key=(41,))))
    _, log, _ = weighed(density, centre, _WIDER * factor, random, effort.each, effort.worth, effort.most)
    return float(np.logaddexp.reduce(log) - np.log(len(log)) - 0.5 * count * np.log(2 * np.pi))


def _density(model: FieldModel, known: Sizes | None) -> tuple[LogDensity, Callable[[Floats], Sizes], int, Floats]:
    """Of latent sizes (w, d + F), those of the noise first; what sizes of the noise they are, d, and where to begin (d,)."""
    d = 0 if known is not None else model.noise.dimension

    def sizes(latent: Floats) -> Sizes:
        return model.noise.sizes(latent[:, :d]) if known is None else known.at(np.zeros(len(latent), dtype=np.int64))

    def density(latent: Floats) -> Floats:
        noise = latent[:, :d]
        prior = -0.5 * np.sum(latent[:, d:] ** 2, axis=1)
        if known is None:
            low, high = np.log(max(SIGMA_BOUNDS[0], model.noise.least)), np.log(SIGMA_BOUNDS[1])
            inside = (noise[:, 0] > low) & (noise[:, 0] < high)
            prior = np.where(inside, prior, -np.inf)
            noise = np.where(inside[:, None], noise, inside_of)
            prior = prior + model.noise.log_prior(noise, model.noise.sizes(noise))
        whole = np.hstack([noise, latent[:, d:]])
        with np.errstate(over="ignore", invalid="ignore"):  # of sizes that no machine has
            found = prior + model.log_likelihood(sizes(whole), size_of(latent[:, d:]))
        return np.where(np.isfinite(found), found, -np.inf)

    begin, _ = start(Marginal(model.linear, model.noise, model.estimate))
    inside_of = begin[:d]
    return density, sizes, d, inside_of


def _fall(model: FieldModel, density: LogDensity, sizes: Callable[[Floats], Sizes], d: int) -> Fall:
    """Of families by the slopes of the likelihood; of the noise, whose components come and go, by steps."""

    def fall(at: Floats) -> tuple[float, Floats]:
        value, of_noise = by_steps(density, at, d)
        scale = size_of(at[None, d:])  # its square grows by s·φ(z)/φ(s)·dz
        grows = (scale * np.exp(0.5 * (scale**2 - at[d:] ** 2)))[0]
        with np.errstate(over="ignore", invalid="ignore"):  # of sizes that no machine has
            slopes = model.slopes(sizes(at[None]), scale) * grows
        return value, np.append(of_noise, at[d:] - np.where(np.isfinite(slopes), slopes, 0.0))

    return fall
