"""From a measurement model to a stated result: first order, second order or Monte Carlo, with its budget.

``auto`` takes the simplest way that Monte Carlo confirms (JCGM 101:2008 clause 8).
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from html import escape
from math import inf

import numpy as np

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.messages import NOTHING, Text, Verbatim, after, commas, names, say
from cmm_uq.base.overflow import must_be_finite, refusing_overflow
from cmm_uq.base.points import Floats
from cmm_uq.maths.uncertainty.budget import Budget, Labels, budget_of, joint_line, line_of
from cmm_uq.maths.uncertainty.choice import (
    Method,
    Ways,
    beside,
    by_propagation,
    choose,
    must_be_possible,
    simulate_to_validate,
    stability,
)
from cmm_uq.maths.uncertainty.correlation import correlation_of
from cmm_uq.maths.uncertainty.distributions import constant
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.monte_carlo import HIGHEST_COVERAGE, LARGEST, Simulated, simulate, simulate_adaptively
from cmm_uq.maths.uncertainty.quantity import rounded
from cmm_uq.maths.uncertainty.type_a import check_coverage, coverage_factor

METHODS = ("first", "second", "monte_carlo", "auto")
_TRIALS_FOR_SENSITIVITY = 100_000


@dataclass(frozen=True)
class Request:
    method: str = "auto"  # ``first``, ``second``, ``monte_carlo`` or ``auto``
    coverage: float = 0.95  # probability of the intervals
    digits: int = 2  # significant digits of u that Monte Carlo must support, and to which clause 8 compares
    seed: int = 0  # of the random numbers
    largest: int = LARGEST  # trials that the adaptive Monte Carlo makes at most

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise CmmUqError(f"there is no method {self.method!r}", fix=suggestion(self.method, METHODS))
        if self.digits not in range(1, 5):
            raise CmmUqError(f"{self.digits} significant digits of u", fix="1 or 2 are usual, 4 the most")
        if self.seed < 0:
            raise CmmUqError(f"a seed of {self.seed}", fix="It is an integer that is not negative")
        check_coverage(self.coverage)


@dataclass(frozen=True, eq=False)
class OutputResult:
    method: Method
    reason: Text  # why by this method
    value: float
    u: float
    dof: float  # effective degrees of freedom; infinite for Monte Carlo, whose intervals need none
    interval: tuple[float, float]  # coverage interval; the shortest one for Monte Carlo
    coverage_factor: float  # half the interval's length over u
    budget: Budget


@dataclass(frozen=True, eq=False, repr=False)
class Evaluation:
    request: Request
    stated: Mapping[str, OutputResult]  # by name
    correlation: Floats  # (p, p) of the outputs; ``nan`` where one has no uncertainty
    ways: Ways  # results of every method that was asked for and possible

    @property
    def stable(self) -> bool:
        """Whether Monte Carlo, where it was run, is stable to the digits asked for."""
        return self.ways.simulated is None or bool(self.ways.simulated.stable)

    def __repr__(self) -> str:
        texts = []
        for name, result in self.stated.items():
            (value, u), unit = rounded(result.value, result.u), result.budget.unit
            texts.append(f"{name} = {value}, u = {u}{f' {unit}' if unit not in ('', '1') else ''}")
        return f"<Evaluation: {'; '.join(texts)}>"

    def _repr_html_(self) -> str:
        from cmm_uq.maths.uncertainty.budget_results import SUMMARY, summary_rows

        rows = ("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in (SUMMARY, *summary_rows(self)))
        return f"<table>{''.join(f'<tr>{row}</tr>' for row in rows)}</table>"


def evaluate(model: MeasurementModel, request: Request | None = None, labels: Labels | None = None) -> Evaluation:
    """Evaluate a measurement model at one point; :class:`CmmUqError` where the method asked for, or the input, cannot be."""
    request, labels = request or Request(), labels or Labels()
    model.must_be_at_one_point()
    fix = "State the inputs in units in which their numbers are neither huge nor tiny"
    with refusing_overflow("[inputs]", fix):
        evaluation = _evaluate(model, request, labels)
    for name, result in evaluation.stated.items():
        must_be_finite((result.value, result.u, *result.interval), f"[model] outputs.{name}", fix)
    return evaluation


def _evaluate(model: MeasurementModel, request: Request, labels: Labels) -> Evaluation:
    ways = _ways(model, request)
    choices = [_choice(model, ways, row, request) for row in range(len(model.outputs))]
    methods = {method for method, _ in choices}
    drawn = ways.simulated if "monte_carlo" in methods else None
    alone = one_at_a_time(model, request.seed) if drawn else np.zeros(0)
    results: dict[str, OutputResult] = {}
    for row, (name, (method, reason)) in enumerate(zip(model.outputs, choices, strict=True)):
        propagated = ways.propagated(method)
        if method == "monte_carlo" and drawn:
            results[name] = _by_monte_carlo(model, drawn, row, reason, alone[row], labels)
        elif propagated is not None:
            dof, u, value = float(propagated.dof[row]), float(propagated.u[row]), float(propagated.value[row])
            k = float(coverage_factor(dof, request.coverage))
            budget = budget_of(model, propagated, row, labels=labels, coverage=request.coverage)
            results[name] = OutputResult(method, reason, value, u, dof, (value - k * u, value + k * u), k, budget)
    # correlation by the most general of the methods that state the outputs
    general = drawn or (ways.second if "second" in methods or ways.first is None else ways.first)
    covariance = np.zeros((0, 0)) if general is None else general.covariance
    return Evaluation(request, results, correlation_of(covariance), ways)


def _ways(model: MeasurementModel, request: Request) -> Ways:
    ways = by_propagation(model)
    if request.method == "monte_carlo":
        simulated = simulate_adaptively(model, request.coverage, request.digits, request.seed, request.largest)
        return replace(ways, simulated=simulated)
    if request.method != "auto":
        must_be_possible(model, ways, "first" if request.method == "first" else "second")
        return ways
    problem = NOTHING
    without = [name for name, given in model.inputs.items() if not np.isfinite(given.standard_deviation)]
    if without:
        problem = say(
            "{inputs} has too few degrees of freedom for a standard deviation (ν ≤ 2)", inputs=commas(names(without))
        )
    elif request.coverage > HIGHEST_COVERAGE:
        problem = say(
            "a coverage probability above {highest_coverage} needs too many trials", highest_coverage=HIGHEST_COVERAGE
        )
    if problem:
        return replace(ways, problems={**ways.problems, "monte_carlo": problem})
    candidates = [order for order in (ways.first, ways.second) if order is not None]
    return replace(
        ways,
        simulated=simulate_to_validate(
            model, candidates, request.coverage, request.digits, request.seed, request.largest
        ),
    )


def _choice(model: MeasurementModel, ways: Ways, row: int, request: Request) -> tuple[Method, Text]:
    if request.method == "auto":
        return choose(model, ways, row, request.digits)
    if request.method == "monte_carlo":
        return "monte_carlo", after(say("Asked for."), stability(ways, row, request.digits))
    method: Method = "first" if request.method == "first" else "second"
    return method, after(say("Asked for; not confirmed by Monte Carlo."), beside(ways, method, row, request.digits))


def _by_monte_carlo(
    model: MeasurementModel, drawn: Simulated, row: int, reason: Text, alone: Floats, labels: Labels
) -> OutputResult:
    name, value, u = drawn.outputs[row], float(drawn.value[row]), float(drawn.u[row])
    lines = []
    for (quantity, given), variance in zip(model.inputs.items(), alone.tolist(), strict=True):
        line = line_of(quantity, given, labels)
        lines.append(replace(line, variance=variance, sensitivity=variance**0.5 / line.u if line.u else 0.0))
    lines.append(joint_line(say("together"), u**2 - float(np.sum(alone))))
    statement = say(
        "Each quantity's contribution is what it does alone, the others held at their estimates "
        "(JCGM 101 annex B); “together” is what they add or take away jointly, by correlation or "
        "nonlinearity."
    )
    unit, coverage = labels.unit(name), drawn.coverage
    budget = Budget(Verbatim(name), lines, value, unit, coverage, effective_dof=inf, statement=statement)
    low, high = map(float, drawn.interval[row])
    return OutputResult("monte_carlo", reason, value, u, inf, (low, high), (high - low) / (2 * u) if u else 0.0, budget)


def one_at_a_time(model: MeasurementModel, seed: int = 0) -> Floats:
    """Variance (p, m) of each output when one input alone varies (JCGM 101 annex B).

    Zero where the model gives no finite value that way.
    """
    variances = np.zeros((len(model.outputs), len(model.inputs)))
    held = {name: constant(given.mean) for name, given in model.inputs.items()}
    for k, (name, given) in enumerate(model.inputs.items()):
        if np.any(np.asarray(given.u) > 0):
            with suppress(CmmUqError):
                alone = MeasurementModel(model.function, {**held, name: given}, model.outputs)
                variances[:, k] = simulate(alone, _TRIALS_FOR_SENSITIVITY, seed=seed).u ** 2
    return variances
