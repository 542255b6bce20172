"""Several ensembles on one density, side by side, with moves of emcee, until the autocorrelation time says enough.

The walkers move in coordinates whitened by an approximation of the density. Walkers of one ensemble are not independent, so
the ensembles, each with random numbers of its own, are compared with each other. Most steps are independence proposals from
the approximation; differential-evolution steps repair what it misses. (emcee's snooker move is not used: its normalisation is
wrong in release 3.1.6.) Independence proposals do not depend on where the walkers are, so those of all ensembles are drawn
ahead, up to each one's next differential-evolution step, and the density is asked for all of them at once; so it is for the
differential-evolution steps of several ensembles.

Chains are worth as many independent draws as the bulk effective sample size of Vehtari, Gelman, Simpson, Carpenter and Bürkner
(2021) says: "Rank-normalization, folding, and localization: an improved R-hat", Bayesian Analysis 16(2), sections 3.2 and 4.3.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass
from cmm_uq.maths.inference.proposals import LogDensity, Numbers

if TYPE_CHECKING:
    from cmm_uq.maths.inference.presence import Proposes

SHARES = (0.9, 0.1)  # how often the step is an independence proposal, and one of differential evolution
_AHEAD = 40  # most steps that are drawn ahead


# of independence: proposals (w, d), logarithms of the density, of what they come from and of what decides on them, (w,)
Step = tuple[Floats, Floats, Floats, Floats]


class SideBySide:
    """Ensembles of walkers (e, w, d), each with random numbers of its own, and a proposal that is roughly the density."""

    def __init__(self, density: LogDensity, proposal: Proposes, randoms: Sequence[Any], begin: Floats) -> None:
        from emcee.moves import DEMove

        self._density, self._proposal, self._randoms, self._at = density, proposal, randoms, begin.copy()
        every = begin.reshape(-1, begin.shape[2])
        self._log_density, self._log_proposal = (
            of(every).reshape(begin.shape[:2]) for of in (density, proposal.log_density)
        )
        self._differences = DEMove()
        self._differences.setup(every)
        self._ahead: tuple[deque[Step | None], ...] = tuple(deque() for _ in randoms)

    def steps(self, count: int) -> Floats:
        """Where the walkers are after each of so many steps, (e, count, w, d)."""
        found, done = np.empty((len(self._at), count, *self._at.shape[1:])), [0] * len(self._at)
        while min(done) < count:
            self._draw_ahead()
            differing = list[int]()
            for i, steps in enumerate(self._ahead):
                while steps and done[i] < count and (not differing or differing[-1] != i):
                    if (step := steps.popleft()) is None:
                        differing.append(i)
                    else:
                        self._independent(i, *step)
                        found[i, done[i]] = self._at[i]
                        done[i] += 1
            self._differ(differing)
            for i in differing:
                found[i, done[i]] = self._at[i]
                done[i] += 1
        return found

    def _independent(self, i: int, at: Floats, log: Floats, log_proposal: Floats, log_uniform: Floats) -> None:
        """Metropolis and Hastings: an ensemble's walkers to where they are proposed, or not."""
        accepted = log_uniform < log - self._log_density[i] + (self._log_proposal[i] - log_proposal)
        for held, new in ((self._at, at), (self._log_density, log), (self._log_proposal, log_proposal)):
            held[i][accepted] = new[accepted]

    def _differ(self, which: Sequence[int]) -> None:
        """A step of differential evolution of some ensembles, as emcee proposes it: each half by the other."""
        halves = [np.arange(self._at.shape[1]) % 2 for _ in which]
        for half, i in zip(halves, which, strict=True):
            self._randoms[i].shuffle(half)
        for part in (0, 1) if halves else ():
            rows = [np.flatnonzero(half == part) for half in halves]
            proposed = [
                self._differences.get_proposal(self._at[i][own], [self._at[i][half != part]], self._randoms[i])[0]
                for i, own, half in zip(which, rows, halves, strict=True)
            ]
            each = np.split(self._density(np.concatenate(proposed)), np.cumsum([len(own) for own in rows])[:-1])
            for i, own, at, log in zip(which, rows, proposed, each, strict=True):
                accepted = log - self._log_density[i, own] > np.log(self._randoms[i].rand(len(own)))
                moved = own[accepted]
                self._at[i, moved], self._log_density[i, moved] = at[accepted], log[accepted]
                if len(moved):
                    self._log_proposal[i, moved] = self._proposal.log_density(at[accepted])

    def _draw_ahead(self) -> None:
        """Next steps of each ensemble that has none: independent ones, and ``None`` for one of differential evolution."""
        drawn: list[tuple[deque[Step | None], Numbers, Floats]] = []
        differences, walkers = [], self._at.shape[1]
        for steps, random in zip(self._ahead, self._randoms, strict=True):
            for _ in range(0 if steps else _AHEAD):
                if random.random_sample() >= SHARES[0]:  # its random numbers are the next
                    differences.append(steps)
                    break
                drawn.append((steps, self._proposal.numbers_of(walkers, random), random.rand(walkers)))
        if drawn:
            each = zip(*(numbers for _, numbers, _ in drawn), strict=True)
            z = self._proposal.made(tuple(np.concatenate(column) for column in each))
            log_proposal, log_density = self._proposal.log_density(z), self._density(z)
            for i, (steps, _, uniform) in enumerate(drawn):
                own = slice(i * walkers, (i + 1) * walkers)
                steps.append((z[own], log_density[own], log_proposal[own], np.log(uniform)))
        for steps in differences:
            steps.append(None)


ENSEMBLES, WALKERS = 4, 32
STEPS_AT_ONCE, MOST_STEPS, BURN_IN = 300, 6000, 60
EFFECTIVE_SAMPLES = 4000  # of every parameter: intervals' ends are then stable to about 3 % of u
LEAST_EFFECTIVE_SAMPLES, LARGEST_RHAT = 1000, 1.01
_WINDOW = 5.0  # autocorrelation times that are summed over
Progress = Callable[[float], None]


@dataclass(frozen=True, eq=False, kw_only=True)
class Convergence:
    """Whether draws can be trusted, by the worst of all parameters."""

    sampler: str  # program and version
    ess_min: float  # effective samples, the fewest
    rhat_max: float  # rank-normalised R-hat, the largest
    steps: int  # of each chain
    autocorrelation_time: float  # the longest

    @property
    def converged(self) -> bool:
        """At least 1000 effective samples, R-hat below 1.01, and chains longer than 50 autocorrelation times."""
        enough, long = self.ess_min >= LEAST_EFFECTIVE_SAMPLES, self.steps > 50 * self.autocorrelation_time
        return bool(enough and self.rhat_max < LARGEST_RHAT and long)


@dataclass(frozen=True, eq=False)
class Chains(Convergence):
    draws: Floats  # (N, d) in the density's own parameters: ensembles, steps and walkers in this order

    @property
    def quality(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "draws"}

    def thinning(self, most: int) -> int:
        """Of how many steps one is to be kept for at most ``most`` draws (or for those of two steps of each chain)."""
        return max(1, min(-(-len(self.draws) // most), self.steps // 2))

    def thinned(self, every: int) -> Floats:
        by_step = self.draws.reshape(ENSEMBLES, self.steps, -1, self.draws.shape[1])
        return np.asarray(by_step[:, every - 1 :: every].reshape(-1, self.draws.shape[1]))


def run_ensembles(
    density: LogDensity,
    proposal: Proposes,
    seed: int,
    progress: Progress | None = None,
    *,
    effective_samples: int = EFFECTIVE_SAMPLES,
    steps_at_once: int = STEPS_AT_ONCE,
    walkers: int | None = None,
    burn_in: int = BURN_IN,
) -> Chains:
    """Sample a density with emcee; ``progress`` gets the part done, ``walkers`` are 32 an ensemble, or four a dimension."""
    import emcee

    d = len(proposal.centre)
    walkers = walkers or max(WALKERS, 4 * d)

    def whitened(z: Floats) -> Floats:
        return density(proposal.parameters(z))

    begin = np.stack([_start(whitened, proposal, walkers, random) for random in _randoms(seed)])
    sampler, steps, slow = SideBySide(whitened, proposal, _randoms(seed), begin), 0, 0
    sampler.steps(burn_in)
    chains = np.empty((ENSEMBLES, 0, walkers, d))
    while True:
        chains = np.concatenate([chains, sampler.steps(steps_at_once)], axis=1)
        steps += steps_at_once
        short = min(steps / 50, steps * ENSEMBLES * walkers / effective_samples) if steps < MOST_STEPS else np.inf
        slow, time, effective = _effective_samples(chains, slow, short)
        if progress:
            progress(min(1.0, effective / effective_samples))
        if (effective >= effective_samples and steps > 50 * time) or steps >= MOST_STEPS:
            break
    draws = proposal.parameters(chains.reshape(-1, d))
    quality = {"ess_min": effective, "rhat_max": rhat(chains.reshape(ENSEMBLES, -1, d)), "autocorrelation_time": time}
    return Chains(draws, sampler=f"emcee {emcee.__version__}", steps=steps, **quality)


def _randoms(seed: int) -> list[Any]:
    return [np.random.RandomState(np.random.MT19937(child)) for child in np.random.SeedSequence(seed).spawn(ENSEMBLES)]


def _start(density: LogDensity, proposal: Proposes, walkers: int, random: Any) -> Floats:
    """Where the walkers begin: draws that the density does not forbid."""
    z = proposal.draws(walkers, random)
    for _ in range(100):
        forbidden = ~np.isfinite(density(z))
        if not forbidden.any():
            break
        z[forbidden] = proposal.draws(int(forbidden.sum()), random)
    return z


def _effective_samples(chains: Floats, first: int, short: float) -> tuple[int, float, float]:
    """The slowest parameter, its autocorrelation time, and effective samples; from `first` on, as far as all are `short`."""
    ensembles, steps, walkers, d = chains.shape
    merged = chains.transpose(1, 0, 2, 3).reshape(steps, ensembles * walkers, d)
    if (np.ptp(merged, axis=0) == 0).any():  # a walker that never moved has no autocorrelation time yet
        return first, float(steps), float(ensembles * walkers)
    slow, time = first, 1.0
    for i in sorted(range(d), key=lambda i: i != first):
        slow, time = max((slow, time), (i, autocorrelation_time(merged[:, :, i].T)), key=lambda one: one[1])
        if time > short:
            break
    return slow, time, steps * ensembles * walkers / time


def autocorrelation_time(chains: Floats) -> float:
    """Integrated autocorrelation time of one parameter in chains (c, n), in steps: emcee's estimate, all chains at once.

    The window is the first that is five times as long as the time up to it (Sokal 1997, section 3; emcee averages the chains).
    """
    n = chains.shape[1]
    waves = np.fft.rfft(chains - chains.mean(axis=1, keepdims=True), 1 << n.bit_length() + 1, axis=1)
    covariance = np.fft.irfft(waves.real**2 + waves.imag**2, axis=1)[:, :n]
    times = 2 * np.cumsum(np.mean(covariance / covariance[:, :1], axis=0)) - 1
    beyond = np.flatnonzero(np.arange(n) >= _WINDOW * times)
    return float(times[beyond[0] if len(beyond) else -1])


def rhat(chains: Floats, scores: Floats | None = None) -> float:
    """Largest rank-normalised split R-hat of the parameters of chains (c, n, d), bulk or tail (section 4)."""
    halves = split(chains)
    folded = np.abs(halves - np.median(halves, axis=(0, 1)))
    bulk = normal_scores(halves) if scores is None else scores
    return max(float(_split_rhat(values).max()) for values in (bulk, normal_scores(folded)))


def split(chains: Floats) -> Floats:
    """The first and the last half of each chain as chains (2c, n // 2, d)."""
    half = chains.shape[1] // 2
    return np.concatenate([chains[:, :half], chains[:, -half:]])


def normal_scores(values: Floats) -> Floats:
    """Normal quantiles of the ranks of (c, n, d) values, for each parameter over all chains; ties share their rank."""
    flat = values.reshape(-1, values.shape[2])
    ranks = np.empty_like(flat)
    for rank, column in zip(ranks.T, flat.T, strict=True):
        _, place, count = np.unique(column, return_inverse=True, return_counts=True)
        rank[:] = (np.cumsum(count) - 0.5 * (count - 1))[place]
    return np.asarray(scipy.special.ndtri((ranks - 0.375) / (len(flat) + 0.25)), dtype=np.float64).reshape(values.shape)


def _split_rhat(values: Floats) -> Floats:
    """√((n − 1)/n + B/(n·W)) with the variances between and within chains, (d,)."""
    n = values.shape[1]
    within = values.var(axis=1, ddof=1).mean(axis=0)
    between = values.mean(axis=1).var(axis=0, ddof=1)
    # of chains that never moved it is infinite or not a number: not converged
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.sqrt((n - 1) / n + between / within), dtype=np.float64)


def bulk_ess(chains: Floats, scores: Floats | None = None) -> float:
    """Smallest bulk effective sample size of the parameters of chains (c, n, d), n at least 8."""
    scores = normal_scores(split(chains)) if scores is None else scores
    return min(_effective(scores[:, :, i]) for i in range(scores.shape[2]))


def _effective(values: Floats) -> float:
    """Of one quantity, (c, n): the draws over their integrated autocorrelation time (equations 10 and 11)."""
    c, n = values.shape
    if np.ptp(values) == 0:
        return float(c * n)  # what does not vary is known from any draw
    # autocorrelation (n,) at every lag, from the variances within the chains and between them (equation 10)
    spectrum = np.fft.rfft(values - values.mean(axis=1, keepdims=True), n=2 * n, axis=1)
    covariance = np.fft.irfft(np.abs(spectrum) ** 2, n=2 * n, axis=1)[:, :n].mean(axis=0) / n
    within = covariance[0] * n / (n - 1)
    correlation = 1.0 - (within - covariance) / (covariance[0] + values.mean(axis=1).var(ddof=1))
    correlation[0] = 1.0
    pairs = correlation[: (n - 1) // 2 * 2].reshape(-1, 2).sum(axis=1)
    ends = np.flatnonzero(pairs <= 0)  # Geyer's initial positive sequence: its sums of pairs are all positive
    last = int(ends[0]) if len(ends) else len(pairs) - 1
    monotone = np.minimum.accumulate(pairs[:last]) if last else pairs[:0]  # and, as they must be, never growing
    time = -1.0 + 2.0 * float(monotone.sum()) + max(float(correlation[2 * last]), 0.0)
    draws = c * n
    return float(draws / max(time, 1.0 / np.log10(draws)))
