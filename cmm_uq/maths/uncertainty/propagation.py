"""Propagation of distributions by Monte Carlo (JCGM 101:2008, JCGM 102:2011), in blocks, so that memory stays flat.

:func:`simulate` makes a given number of trials, :func:`simulate_adaptively` as many as the digits asked for need (JCGM
101 7.9). The same seed gives the same bytes.

Law of propagation of uncertainty: first order, and second order where the model bends.

First order is JCGM 100:2008 5.1 and 5.2, with the covariance of several outputs (JCGM 102:2011 6.2.1). Second order adds
to the variance the terms of 5.1.2, NOTE, in their general form for correlated inputs (the two agree for independent
ones; both take the inputs as normal), and to the estimate the mean of the quadratic term (JCGM 100:2008/Amd.1:2026).
Everything works at one point or at many: ``...`` is the shape of the points.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, replace
from cmm_uq.maths.uncertainty import measurement_model
from cmm_uq.maths.uncertainty.coverage import Tails, both_intervals, draws_in_tail, tail_of
from cmm_uq.maths.uncertainty.measurement_model import Derivatives, MeasurementModel
from cmm_uq.maths.uncertainty.type_a import check_coverage, coverage_factor, effective_dof, joint_draws

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


@dataclass(frozen=True, eq=False)
class Propagated:
    inputs: Sequence[str]  # m names
    outputs: Sequence[str]  # p names
    value: Floats  # (p, ...)
    covariance: Floats  # (p, p, ...) of the outputs
    dof: Floats  # (p, ...) effective degrees of freedom
    sensitivity: Floats  # (p, m, ...) derivatives at the estimates
    contribution: Floats  # (p, m, ...) sensitivity × standard uncertainty, with its sign
    correlation: Floats  # (m, m) of the inputs
    bending: Floats  # (p, m, m, ...) parts of the variance by second derivatives, pairs of inputs above the diagonal
    cubic: Floats  # (p, ...) part of the variance from third derivatives; zero for first order, as is ``bending``

    @cached_property
    def u(self) -> Floats:
        # correlations can cancel the variance completely, and rounding then leaves less than nothing
        return np.asarray(np.sqrt(np.maximum(_diagonal(self.covariance), 0.0)))

    def interval(self, coverage: float) -> tuple[Floats, Floats]:
        """Ends (p, ...) of the coverage intervals value ± k u."""
        expanded = coverage_factor(self.dof, coverage) * self.u
        return self.value - expanded, self.value + expanded


def first_order(model: MeasurementModel) -> Propagated:
    """Propagate by the first derivatives; :class:`CmmUqError` where they or the model are not finite at the estimates."""
    u = [np.asarray(given.u) for given in model.inputs.values()]
    if model.differentiation == "complex_step":
        found = measurement_model.complex_step(model, model.means, [np.maximum(v, np.finfo(float).tiny) for v in u])
    else:
        found = measurement_model.derivatives(model, model.means)
    return _first_order(model, found, u)


def second_order(model: MeasurementModel) -> Propagated:
    """Propagate by first and second derivatives, with the third ones where they belong to the same order."""
    if model.differentiation == "complex_step":
        fix = "Write the model with NumPy's elementary functions, or use Monte Carlo"
        raise CmmUqError("second derivatives by complex steps are not exact", fix=fix)
    u = [np.asarray(given.u) for given in model.inputs.values()]
    found = measurement_model.derivatives(model, model.means, order=2)
    linear, correlation = _first_order(model, found, u), model.correlation_matrix
    with np.errstate(all="ignore"):  # what is not finite is refused below
        spread = np.stack(np.broadcast_arrays(*u, found.value[0])[:-1])
        scaled = np.asarray(found.hessian) * spread[:, None] * spread[None, :]
        correlated = np.einsum("pij...,jk->pik...", scaled, correlation)
        quadratic = 0.5 * np.einsum("pij...,qji...->pq...", correlated, correlated)
        cubic = np.stack([_cubic(model, linear, spread, row) for row in range(len(linear.value))])
        covariance = linear.covariance + quadratic + 0.5 * (cubic + np.swapaxes(cubic, 0, 1))
        variance = _diagonal(covariance)
        value = linear.value + 0.5 * np.einsum("pii...->p...", correlated)
        bending = 0.5 * correlated * np.swapaxes(correlated, 1, 2)  # of ½ tr(HVHV)
        m = len(correlation)
        both = (np.triu(np.ones((m, m))) + np.triu(np.ones((m, m)), 1)).reshape(1, m, m, *(1,) * (bending.ndim - 3))
        if np.any(variance < 0) or not np.all(np.isfinite(variance)):
            raise CmmUqError(
                "the terms of second order give no variance: the model bends too strongly within the uncertainty of its "
                "inputs",
                fix="Use Monte Carlo",
            )
        dof = effective_dof(linear.contribution, correlation, [given.dof for given in model.inputs.values()], variance)
        both_ways = np.asarray(bending * both)  # entries (i, j) and (j, i) added above the diagonal
        return replace(linear, value=value, covariance=covariance, dof=dof, bending=both_ways, cubic=_diagonal(cubic))


def _cubic(model: MeasurementModel, linear: Propagated, spread: Floats, row: int) -> Floats:
    """Σ (V g)ᵢ ∂ᵢ tr(H V): covariance (p, ...) of the linear term of one output with the cubic terms of all."""
    towards = np.einsum("ij,j...->i...", linear.correlation, linear.contribution[row]) * spread
    turning = measurement_model.hessian_along(model, model.means, list(towards)) * spread[:, None] * spread[None, :]
    return np.asarray(np.einsum("pij...,ij->p...", turning, linear.correlation))


def _first_order(model: MeasurementModel, found: Derivatives, u: Sequence[Any]) -> Propagated:
    for row, output in enumerate(model.outputs):
        _must_be_finite(found.value[row], f"the model gives no finite value of {output} at the estimates")
        for k, name in enumerate(model.names):
            problem = f"the derivative of {output} by {name} is not finite at the estimates"
            _must_be_finite(found.jacobian[row, k], problem)
    contribution = np.stack([found.jacobian[:, k] * v for k, v in enumerate(u)], axis=1)
    correlation = model.correlation_matrix
    if np.count_nonzero(correlation) == len(correlation):
        covariance = np.einsum("pi...,qi...->pq...", contribution, contribution)
    else:
        covariance = np.einsum("pi...,ij,qj...->pq...", contribution, correlation, contribution)
    variance = np.maximum(_diagonal(covariance), 0.0)
    dof = effective_dof(contribution, correlation, [given.dof for given in model.inputs.values()], variance)
    p, m, *shape = contribution.shape
    none, no_cubic = np.zeros((p, m, m, *(1 for _ in shape))), np.zeros((p, *shape))
    figures = found.value, covariance, dof, found.jacobian, contribution, correlation, none, no_cubic
    return Propagated(model.names, list(model.outputs), *figures)


def _diagonal(matrices: Floats) -> Floats:
    return np.asarray(np.einsum("pp...->p...", matrices))


def _must_be_finite(numbers: Floats, problem: str) -> None:
    bad = np.size(numbers) - int(np.count_nonzero(np.isfinite(numbers)))
    if bad:
        points = f" ({bad} of {np.size(numbers)} points)" if np.size(numbers) > 1 else ""
        raise CmmUqError(problem + points, fix="Mend the estimates or the model, or use Monte Carlo")
