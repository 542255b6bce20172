"""From a measurement model to a stated result: first order, second order or Monte Carlo, with its budget.

``auto`` takes the simplest method that Monte Carlo confirms (JCGM 101:2008 clause 8). The interval value ± U of the law of
propagation is compared with Monte Carlo's probabilistically symmetric one. The ends may differ by the numerical tolerance δ,
half a unit of the last digit of u that is regarded as meaningful. Monte Carlo's own error must not decide: trials are made
until every comparison is clear of it by two standard errors, or the error is below δ/5 (8.2).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from html import escape
from math import inf

import numpy as np

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.messages import NOTHING, Text, Verbatim, after, commas, foreign, names, say, semicolons
from cmm_uq.base.overflow import must_be_finite, refusing_overflow
from cmm_uq.base.points import Floats
from cmm_uq.base.values import astuple, dataclass, field, replace
from cmm_uq.maths.uncertainty.budget import NAMES, Budget, Labels, Method, budget_of, joint_line, line_of
from cmm_uq.maths.uncertainty.coverage import NO_VARIANCE
from cmm_uq.maths.uncertainty.distributions import constant
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.propagation import (
    HIGHEST_COVERAGE,
    LARGEST,
    Propagated,
    Simulated,
    first_order,
    numerical_tolerance,
    second_order,
    simulate,
    simulate_adaptively,
)
from cmm_uq.maths.uncertainty.quantity import figure, rounded
from cmm_uq.maths.uncertainty.type_a import check_coverage, correlation_of, coverage_factor

METHODS = (*NAMES, "auto")
_ORDERS: Mapping[Method, Callable[[MeasurementModel], Propagated]] = {"first": first_order, "second": second_order}
_OF_TOLERANCE = 5.0  # δ over the error of Monte Carlo that leaves any comparison as it is
_ROUNDING = 4e-16
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


@dataclass(frozen=True)
class Comparison:
    low: float  # difference of the lower ends
    high: float  # difference of the upper ends
    tolerance: float  # δ
    error: float  # standard error of Monte Carlo's ends, the larger of the two

    @property
    def agrees(self) -> bool:
        return max(self.low, self.high) <= self.tolerance

    @property
    def clear(self) -> bool:
        """Whether Monte Carlo's own error leaves the comparison as it is."""
        difference = abs(max(self.low, self.high) - self.tolerance)
        return 2 * self.error <= max(difference, self.tolerance / _OF_TOLERANCE)


def compare(propagated: Propagated, simulated: Simulated, row: int, digits: int) -> Comparison:
    """Clause 8.1 for one output; ``digits`` of u are regarded as meaningful."""
    low, high = (float(end[row]) for end in propagated.interval(simulated.coverage))
    drawn_low, drawn_high = simulated.symmetric_interval[row]
    u = simulated.u[row]
    if not simulated.stable:
        # the standard deviation of draws without one (a ratio, a Cauchy distribution) must not widen the tolerance
        u = min(u, (drawn_high - drawn_low) / (2 * float(coverage_factor(np.inf, simulated.coverage))))
    tolerance, error = numerical_tolerance(np.array([u]), digits)[0], np.max(simulated.standard_error[row, 4:])
    return Comparison(abs(low - drawn_low), abs(high - drawn_high), float(tolerance), float(error))


@dataclass(frozen=True, eq=False)
class Ways:
    """What each method gave; None where it was not asked for or is impossible, and then ``problems`` may say why."""

    first: Propagated | None = None
    second: Propagated | None = None
    simulated: Simulated | None = None
    problems: Mapping[Method, Text] = field(default_factory=dict)

    def propagated(self, method: Method) -> Propagated | None:
        return self.first if method == "first" else self.second


def _by_propagation(model: MeasurementModel) -> Ways:
    """First and second order, as far as they are possible."""
    orders: dict[Method, Propagated] = {}
    problems: dict[Method, Text] = {}
    for method, propagate in _ORDERS.items():
        try:
            orders[method] = propagate(model)
        except CmmUqError as error:
            problems[method] = foreign(error.problem)
    return Ways(orders.get("first"), orders.get("second"), None, problems)


def _must_be_possible(model: MeasurementModel, ways: Ways, method: Method) -> None:
    """Refuse a method that was asked for by name and does not give an uncertainty."""
    propagated = ways.propagated(method)
    where, fix = f"method = {method!r}", "Use method 'auto' or 'monte_carlo'"
    if propagated is None:
        raise CmmUqError(ways.problems[method], where=where, fix=fix)
    for row, output in enumerate(propagated.outputs):
        if _is_flat(model, propagated, row):
            raise CmmUqError(
                f"{NAMES[method]} gives u = 0 for {output} although its inputs are uncertain: "
                "the derivatives vanish at the estimates, or correlations cancel",
                where=where,
                fix=fix,
            )


def _is_flat(model: MeasurementModel, propagated: Propagated, row: int) -> bool:
    """Whether the law of propagation gives no uncertainty, beyond rounding, although inputs have some."""
    uncertain = any(np.any(np.asarray(given.u) > 0) for given in model.inputs.values())
    return uncertain and bool(propagated.u[row] <= _ROUNDING * abs(propagated.value[row]))


def _differ(first: Propagated, second: Propagated, row: int, digits: int) -> bool:
    """Whether the terms of second order change estimate or uncertainty beyond the numerical tolerance."""
    tolerance = numerical_tolerance(second.u, digits)[row]
    return bool(max(abs(second.u[row] - first.u[row]), abs(second.value[row] - first.value[row])) > tolerance)


def stability(ways: Ways, row: int, digits: int) -> Text:
    """Sentences where Monte Carlo gave up before its figures were stable, and why it had to, else nothing."""
    drawn = ways.simulated
    if drawn is None or drawn.stable:
        return NOTHING
    unstable = say(
        "Monte Carlo is not stable to {digits} digits after {trials} trials.", digits=digits, trials=drawn.trials
    )
    name, shape, unseen = foreign(drawn.outputs[row]), float(drawn.shape[row]), float(drawn.unseen[row])
    if shape >= NO_VARIANCE:
        heavy = say(
            "The tail of {name} is so heavy (Pareto shape {shape:.2f}; from 0.5 on there is no standard deviation) that u "
            "is of these trials alone and grows with their number; the coverage interval stands.",
            name=name,
            shape=shape,
        )
    elif unseen > numerical_tolerance(drawn.u, digits)[row]:
        heavy = say(
            "The tail of {name} is so heavy (Pareto shape {shape:.2f}) that rare draws rule u.", name=name, shape=shape
        )
    else:
        return unstable
    return after(unstable, heavy)


def _choose(model: MeasurementModel, ways: Ways, row: int, digits: int) -> tuple[Method, Text]:
    """The simplest method that Monte Carlo confirms for one output, and why."""
    if ways.simulated is None:
        return _without_monte_carlo(ways, row, digits)
    findings: list[Text] = []
    for method in _ORDERS:
        confirmed, finding = _finding(model, ways, ways.simulated, method, row, digits)
        findings.append(say("{names} {finding}", names=NAMES[method], finding=finding))
        if confirmed:
            break
    else:
        method = "monte_carlo"
    reason = say("{said:capital} (JCGM 101 clause 8).", said=semicolons(findings))
    return method, after(reason, stability(ways, row, digits))


def _finding(
    model: MeasurementModel, ways: Ways, simulated: Simulated, method: Method, row: int, digits: int
) -> tuple[bool, Text]:
    """Whether Monte Carlo confirms the method for one output, and what to say of it."""
    propagated = ways.propagated(method)
    if propagated is None:
        return False, say("is impossible ({problems})", problems=ways.problems[method])
    if _is_flat(model, propagated, row):
        return False, say("gives u = 0, since the model is flat at the estimates")
    if propagated.dof[row] < 1:
        return False, say("has no interval, with {dof:.2g} effective degrees of freedom", dof=propagated.dof[row])
    comparison = compare(propagated, simulated, row, digits)
    low, high, tolerance, error = (figure(number, 2) for number in astuple(comparison))
    words = say(
        "its interval's ends differ from Monte Carlo's by {low} and {high}, numerical tolerance {tolerance}",
        low=low,
        high=high,
        tolerance=tolerance,
    )
    if comparison.clear:
        if comparison.agrees:
            return True, say("is confirmed: {words}", words=words)
        return False, say("is not enough: {words}", words=words)
    return max(comparison.low, comparison.high) <= comparison.tolerance + 2 * comparison.error, say(
        "is neither confirmed nor refuted: {words}, but Monte Carlo's own error is {error}", words=words, error=error
    )


def _without_monte_carlo(ways: Ways, row: int, digits: int) -> tuple[Method, Text]:
    first, second = ways.first, ways.second
    unchecked = say(
        "Not confirmed by Monte Carlo, which is impossible here: {problems}.", problems=ways.problems["monte_carlo"]
    )
    if first is None or first.u[row] == 0:
        raise CmmUqError(
            f"no method gives an uncertainty of {first.outputs[row] if first else 'the outputs'}: "
            f"{ways.problems.get('first', 'the derivatives vanish')}; {ways.problems['monte_carlo']}"
        )
    if second is not None and _differ(first, second, row, digits):
        return "second", say("The terms of second order are not negligible. {unchecked}", unchecked=unchecked)
    return "first", unchecked


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
    model.must_be_at_one_point()
    fix = "State the inputs in units in which their numbers are neither huge nor tiny"
    with refusing_overflow("[inputs]", fix):
        evaluation = _evaluate(model, request or Request(), labels or Labels())
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
    """What the request needs: Monte Carlo until it can also say whether each order agrees with it, where ``auto`` asks."""
    ways, digits = _by_propagation(model), request.digits
    if request.method in ("first", "second"):
        _must_be_possible(model, ways, "first" if request.method == "first" else "second")
        return ways
    auto = request.method == "auto"
    if auto and (problem := _no_monte_carlo(model, request.coverage)):
        return replace(ways, problems={**ways.problems, "monte_carlo": problem})
    orders = [order for order in (ways.first, ways.second) if auto and order is not None]
    ends = [np.stack(order.interval(request.coverage), axis=1) for order in orders if np.all(order.dof >= 1)]

    def settled(figures: Floats, errors: Floats) -> bool:
        tolerance = numerical_tolerance(figures[:, 1], digits)[:, None]
        doubt = 2 * errors[:, 4:]
        clear = [np.abs(np.abs(end - figures[:, 4:]) - tolerance) > doubt for end in ends]
        return all(np.all(one | (doubt <= tolerance / _OF_TOLERANCE)) for one in clear)

    simulated = simulate_adaptively(model, request.coverage, digits, request.seed, request.largest, settled)
    return replace(ways, simulated=simulated)


def _no_monte_carlo(model: MeasurementModel, coverage: float) -> Text:
    """Why trials are impossible, else nothing."""
    without = [name for name, given in model.inputs.items() if not np.isfinite(given.standard_deviation)]
    if without:
        return say(
            "{inputs} has too few degrees of freedom for a standard deviation (ν ≤ 2)", inputs=commas(names(without))
        )
    if coverage > HIGHEST_COVERAGE:
        return say(
            "a coverage probability above {highest_coverage} needs too many trials", highest_coverage=HIGHEST_COVERAGE
        )
    return NOTHING


def _choice(model: MeasurementModel, ways: Ways, row: int, request: Request) -> tuple[Method, Text]:
    if request.method == "auto":
        return _choose(model, ways, row, request.digits)
    if request.method == "monte_carlo":
        return "monte_carlo", after(say("Asked for."), stability(ways, row, request.digits))
    method: Method = "first" if request.method == "first" else "second"
    reason, other = say("Asked for; not confirmed by Monte Carlo."), NOTHING
    if ways.first is not None and ways.second is not None and _differ(ways.first, ways.second, row, request.digits):
        # what the other order says
        name, propagated = (NAMES["second"], ways.second) if method == "first" else (NAMES["first"], ways.first)
        other = say("{name:capital} gives u = {u}.", name=name, u=figure(propagated.u[row], request.digits))
    return method, after(reason, other)


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
        "Each quantity's contribution is what it does alone, the others held at their estimates (JCGM 101 annex B); "
        "“together” is what they add or take away jointly, by correlation or nonlinearity."
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
