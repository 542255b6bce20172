"""Propagation of distributions by Monte Carlo (JCGM 101:2008, JCGM 102:2011), in blocks, so that memory stays flat.

:func:`simulate` makes a given number of trials, :func:`simulate_adaptively` as many as the digits asked for need (JCGM
101 7.9). The same seed gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.maths.uncertainty.correlation import joint_draws
from cmm_uq.maths.uncertainty.coverage import Tails, both_intervals, draws_in_tail, tail_of
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.type_a import check_coverage

BLOCK = 10_000
LARGEST = 20_000_000
HIGHEST_COVERAGE = 0.9999  # of the adaptive procedure, whose blocks have 100/(1 − p) trials (JCGM 101 7.9.4 b).
_FEWEST_BLOCKS, _BINS = 10, 200


@dataclass(frozen=True, eq=False)
class Source:
    """Where trials come from: a measurement model with its inputs, or any other way to draw outputs."""

    outputs: Sequence[str]  # p names
    draw: Callable[[np.random.Generator, int], Floats]  # outputs (p, n) of n trials


@dataclass(frozen=True, eq=False)
class Simulated:
    outputs: Sequence[str]  # p names
    trials: int
    coverage: float  # probability of the intervals
    seed: int
    value: Floats  # (p,) means
    covariance: Floats  # (p, p)
    interval: Floats  # (p, 2) shortest coverage intervals
    symmetric_interval: Floats  # (p, 2) probabilistically symmetric coverage intervals
    standard_error: Floats  # (p, 6) of value, u and the ends of both intervals; ``nan`` for fewer than two blocks
    stable: bool | None  # all figures within their tolerance, rare draws included; None when no digits are asked for
    shape: Floats  # (p,) of the heavier tail of each output (:mod:`cmm_uq.maths.uncertainty.coverage`).
    unseen: Floats  # (p,) by how much u would be larger with draws too rare to have come; may be infinite
    edges: Floats  # (p, b + 1) of the histogram of the output, for pictures
    density: Floats  # (p, b)

    @cached_property
    def u(self) -> Floats:
        """(p,) standard uncertainties: standard deviations of the draws."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance)))


def simulate(model: MeasurementModel | Source, trials: int, coverage: float = 0.95, seed: int = 0) -> Simulated:
    check_coverage(coverage)
    if trials < (fewest := int(np.ceil(2 / (1 - coverage)))):
        problem = f"{trials} trials cannot give a {coverage:.4g} coverage interval"
        raise CmmUqError(problem, fix=f"Make at least {fewest}")
    run = _Run(_source(model), coverage, seed)
    while run.trials < trials:
        run.advance(min(BLOCK, trials - run.trials))
    return run.result(None)


def simulate_adaptively(
    model: MeasurementModel | Source,
    coverage: float = 0.95,
    digits: int = 2,
    seed: int = 0,
    largest: int = LARGEST,
    settled: Callable[[Floats, Floats], bool] = lambda figures, errors: True,
    fewest_trials: int = 1_000_000,
) -> Simulated:
    """Make trials until value, u and the ends of the shortest interval are known to ``digits`` digits of u (7.9.4).

    ``largest``: trials after which it stops whether or not the figures are stable. ``settled``: further condition on the
    figures (p, 6) and their standard errors (p, 6), in the order of :class:`Simulated`; a validation asks here for more.
    ``fewest_trials``: before it may stop. A million (7.2.2) cost little, and the first few blocks can agree by chance; fewer
    where each costs more than arithmetic.
    """
    check_coverage(coverage)
    if coverage > HIGHEST_COVERAGE:
        raise CmmUqError(
            f"a coverage probability of {coverage} needs {100 / (1 - coverage):.2g} trials for one look at the tails",
            fix=f"Ask for at most {HIGHEST_COVERAGE}, or use the law of propagation",
        )
    run = _Run(_source(model), coverage, seed)
    block = max(BLOCK, int(np.ceil(100 / (1 - coverage))))
    most = max(largest // block, _FEWEST_BLOCKS)
    fewest = min(max(fewest_trials // block, _FEWEST_BLOCKS), most)
    stable = False
    while not stable and run.blocks < most:
        run.advance(block)
        if run.blocks >= fewest:
            figures, errors = run.figures(), run.standard_errors()
            tolerance = numerical_tolerance(figures[:, 1], digits)
            stable = bool(np.all(2 * errors[:, :4] <= tolerance[:, None])) and settled(figures, errors)
            if stable:
                shape, unseen = run.tails()
                stable = bool(np.all(unseen <= tolerance))
                with np.errstate(over="ignore"):  # what is missing falls as n^(2k − 1), if at all
                    at_last = unseen * (run.blocks / most) ** np.clip(1 - 2 * shape, 0.0, None)
                if np.any(at_last > tolerance):
                    break
    return run.result(stable)


def draw_outputs(model: MeasurementModel, trials: int, seed: int = 0) -> Floats:
    """Draws (p, trials) of the outputs themselves, for regions and pictures; memory grows with the trials."""
    source, rng = _source(model), np.random.default_rng(seed)
    return np.concatenate([source.draw(rng, min(BLOCK, trials - k)) for k in range(0, trials, BLOCK)], axis=1)


def numerical_tolerance(u: Floats, digits: int) -> Floats:
    """Δ of JCGM 101 7.9.2: half a unit of the last of ``digits`` significant digits of u; zero for u = 0."""
    tolerance = np.zeros_like(np.asarray(u, dtype=np.float64))
    for index, number in np.ndenumerate(u):
        if number > 0:
            exponent = int(f"{number:.{digits - 1}e}".split("e")[1])
            tolerance[index] = 0.5 * 10.0 ** (exponent - digits + 1)
    return tolerance


def _source(model: MeasurementModel | Source) -> Source:
    """Outputs of a model, of joint draws of its inputs."""
    if isinstance(model, Source):
        return model
    model.must_be_at_one_point()
    for name, given in model.inputs.items():
        if not np.isfinite(given.standard_deviation):
            problem = f"{name} has {given.dof:g} degrees of freedom, and so no standard deviation to draw with"
            fix = "Repeat the readings (JCGM 101 6.4.9.5 needs four or more), or use the law of propagation"
            raise CmmUqError(problem, fix=fix)
    draw = joint_draws(model.inputs, model.correlation_matrix)

    def outputs(rng: np.random.Generator, n: int) -> Floats:
        inputs = draw(rng, n)
        with np.errstate(all="ignore"):
            values = model(*inputs)
        stacked = np.stack([np.broadcast_to(np.asarray(y, dtype=np.float64), (n,)) for y in values])
        finite = np.isfinite(stacked)
        if not finite.all():
            row = int(np.argmin(finite.all(axis=1)))
            first = int(np.argmin(finite[row]))
            example = ", ".join(f"{name} = {x[first]:.6g}" for name, x in zip(model.names, inputs, strict=True))
            raise CmmUqError(
                f"the model gives no finite {model.outputs[row]} in {n - int(finite[row].sum())} of {n} trials, "
                f"such as {example}",
                fix="Give the inputs distributions that stay within the range of the model",
            )
        return stacked

    return Source(model.outputs, outputs)


class _Run:
    """Trials made so far, and what must be remembered of them."""

    def __init__(self, source: Source, coverage: float, seed: int) -> None:
        self.source, self.coverage, self.seed = source, coverage, seed
        self._rng = np.random.default_rng(seed)
        p = len(source.outputs)
        self.trials = self.blocks = 0
        self._mean, self._comoment = np.zeros(p), np.zeros((p, p))
        self._tails = [Tails(coverage) for _ in range(p)]
        self._block_mean, self._block_squares = np.zeros((p, 6)), np.zeros((p, 6))
        self._width, self._edges, self._counts = np.zeros(0), np.zeros((0, _BINS + 1)), np.zeros((p, _BINS))

    def advance(self, n: int) -> None:
        outputs = self.source.draw(self._rng, n)
        total = self.trials + n
        with np.errstate(all="ignore"):  # what overflows is told by result()
            mean = outputs.mean(axis=1)
            centred = outputs - mean[:, None]
            comoment = centred @ centred.T
            shift = mean - self._mean
            self._comoment += comoment + np.outer(shift, shift) * (self.trials * n / total)
            self._mean = self._mean + shift * (n / total)
        self.trials = total
        outputs.sort(axis=1)
        if n >= BLOCK:
            u = np.sqrt(np.diagonal(comoment) / (n - 1))
            figures = np.column_stack([mean, u, np.array([both_intervals(draws, self.coverage) for draws in outputs])])
            self.blocks += 1
            with np.errstate(all="ignore"):
                step = figures - self._block_mean
                self._block_mean = self._block_mean + step / self.blocks
                self._block_squares = self._block_squares + step * (figures - self._block_mean)
        if not self._edges.size:  # the bins are laid about the first block
            low, high = outputs[:, 0], outputs[:, -1]
            extent = np.where(high > low, high - low, np.abs(low) + 1.0)
            self._width = 1.2 * extent / _BINS
            self._edges = (low - 0.1 * extent)[:, None] + self._width[:, None] * np.arange(_BINS + 1)
        for row, (tails, draws) in enumerate(zip(self._tails, outputs, strict=True)):
            tails.add(draws)
            self._counts[row] += np.diff(np.searchsorted(draws, self._edges[row]))

    def figures(self) -> Floats:
        """(p, 6) value and u of all trials, and the mean ends of the blocks' intervals."""
        means = self._block_mean.copy()
        means[:, 0], means[:, 1] = self._mean, np.sqrt(np.diagonal(self._comoment) / (self.trials - 1))
        return means

    def standard_errors(self) -> Floats:
        """(p, 6) standard deviations of the averages over blocks (7.9.4 h, i)."""
        if self.blocks < 2:
            return np.full((len(self._mean), 6), np.nan)
        return np.asarray(np.sqrt(self._block_squares / ((self.blocks - 1) * self.blocks)))

    def tails(self) -> tuple[Floats, Floats]:
        """(p,) shape of the heavier tail of each output, and how much larger its u would be with draws that did not come."""
        count, shapes, unseen = draws_in_tail(self.trials) + 1, [], []
        for mean, square, tails in zip(self._mean, np.diagonal(self._comoment), self._tails, strict=True):
            lowest, highest = tails.extremes(count)
            above, below = tail_of(highest, mean, self.trials), tail_of(-lowest[::-1], -mean, self.trials)
            variance = square / (self.trials - 1)
            shapes.append(max(above[0], below[0]))
            unseen.append(np.sqrt(variance + (above[1] + below[1])) - np.sqrt(variance))
        return np.array(shapes), np.array(unseen)

    def result(self, stable: bool | None) -> Simulated:
        ends = np.array([tails.intervals() for tails in self._tails])
        lengths, variances = ends[:, 3] - ends[:, 2], np.diagonal(self._comoment)
        for name, variance, length in zip(self.source.outputs, variances, lengths, strict=True):
            if not np.isfinite(variance) or (variance == 0 and length > 0):
                fix = "State the quantities in units that make their numbers moderate"
                raise CmmUqError(f"the variance of {name} is beyond what floating-point numbers hold", fix=fix)
        covariance = self._comoment / (self.trials - 1)
        figures = self._mean, covariance, ends[:, :2], ends[:, 2:], self.standard_errors(), stable, *self.tails()
        density = self._counts / (self.trials * self._width[:, None])
        outputs = list(self.source.outputs)
        return Simulated(outputs, self.trials, self.coverage, self.seed, *figures, self._edges, density)
