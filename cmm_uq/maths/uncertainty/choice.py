"""Which method states the result: the simplest one that Monte Carlo confirms (JCGM 101:2008 clause 8).

The interval value ± U of the law of propagation is compared with Monte Carlo's probabilistically symmetric one. The ends
may differ by the numerical tolerance δ, half a unit of the last digit of u that is regarded as meaningful. Monte Carlo's
own error must not decide: trials are made until every comparison is clear of it by two standard errors, or the error is
below δ/5 (8.2).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import astuple, dataclass, field
from typing import Literal

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, after, foreign, say, semicolons
from cmm_uq.base.points import Floats
from cmm_uq.maths.uncertainty.coverage import NO_VARIANCE
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.monte_carlo import LARGEST, Simulated, numerical_tolerance, simulate_adaptively
from cmm_uq.maths.uncertainty.propagation import Propagated, first_order, second_order
from cmm_uq.maths.uncertainty.quantity import figure
from cmm_uq.maths.uncertainty.type_a import coverage_factor

Method = Literal["first", "second", "monte_carlo"]
NAMES: Mapping[Method, Text] = {
    "first": say("first order"),
    "second": say("second order"),
    "monte_carlo": say("Monte Carlo"),
}
_OF_TOLERANCE = 5.0  # δ over the error of Monte Carlo that leaves any comparison as it is
_ROUNDING = 4e-16


@dataclass(frozen=True)
class Comparison:
    """Interval of the law of propagation against that of Monte Carlo, for one output."""

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
    tolerance = float(numerical_tolerance(np.array([u]), digits)[0])
    return Comparison(
        abs(low - drawn_low), abs(high - drawn_high), tolerance, float(np.max(simulated.standard_error[row, 4:]))
    )


def simulate_to_validate(
    model: MeasurementModel,
    candidates: list[Propagated],
    coverage: float = 0.95,
    digits: int = 2,
    seed: int = 0,
    largest: int = LARGEST,
) -> Simulated:
    """Adaptive Monte Carlo, run until it can also say whether each candidate agrees with it."""
    ends = [np.stack(order.interval(coverage), axis=1) for order in candidates if np.all(order.dof >= 1)]

    def settled(figures: Floats, errors: Floats) -> bool:
        tolerance = numerical_tolerance(figures[:, 1], digits)[:, None]
        doubt = 2 * errors[:, 4:]
        clear = [np.abs(np.abs(end - figures[:, 4:]) - tolerance) > doubt for end in ends]
        return all(np.all(one | (doubt <= tolerance / _OF_TOLERANCE)) for one in clear)

    return simulate_adaptively(model, coverage, digits, seed, largest, settled)


@dataclass(frozen=True, eq=False)
class Ways:
    """What each method gave; None where it was not asked for or is impossible, and then ``problems`` may say why."""

    first: Propagated | None = None
    second: Propagated | None = None
    simulated: Simulated | None = None
    problems: Mapping[Method, Text] = field(default_factory=dict)

    def propagated(self, method: Method) -> Propagated | None:
        return self.first if method == "first" else self.second


def by_propagation(model: MeasurementModel) -> Ways:
    """First and second order, as far as they are possible."""
    orders: dict[Method, Propagated] = {}
    problems: dict[Method, Text] = {}
    propagations: dict[Method, Callable[[MeasurementModel], Propagated]] = {
        "first": first_order,
        "second": second_order,
    }
    for method, propagate in propagations.items():
        try:
            orders[method] = propagate(model)
        except CmmUqError as error:
            problems[method] = foreign(error.problem)
    return Ways(orders.get("first"), orders.get("second"), None, problems)


def must_be_possible(model: MeasurementModel, ways: Ways, method: Method) -> None:
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


def beside(ways: Ways, method: Method, row: int, digits: int) -> Text:
    """What the other order says, where it says something else."""
    if ways.first is None or ways.second is None or not _differ(ways.first, ways.second, row, digits):
        return NOTHING
    other: Method = "second" if method == "first" else "first"
    u = (ways.second if method == "first" else ways.first).u[row]
    return say("{name:capital} gives u = {u}.", name=NAMES[other], u=figure(u, digits))


def _differ(first: Propagated, second: Propagated, row: int, digits: int) -> bool:
    """Whether the terms of second order change estimate or uncertainty beyond the numerical tolerance."""
    tolerance = numerical_tolerance(second.u, digits)[row]
    return bool(max(abs(second.u[row] - first.u[row]), abs(second.value[row] - first.value[row])) > tolerance)


def _is_flat(model: MeasurementModel, propagated: Propagated, row: int) -> bool:
    """Whether the law of propagation gives no uncertainty, beyond rounding, although inputs have some."""
    uncertain = any(np.any(np.asarray(given.u) > 0) for given in model.inputs.values())
    return uncertain and bool(propagated.u[row] <= _ROUNDING * abs(propagated.value[row]))


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
        return after(
            unstable,
            say(
                "The tail of {name} is so heavy (Pareto shape {shape:.2f}; from 0.5 on there is no standard deviation) that u "
                "is of these trials alone and grows with their number; the coverage interval stands.",
                name=name,
                shape=shape,
            ),
        )
    if unseen > numerical_tolerance(drawn.u, digits)[row]:
        return after(
            unstable,
            say(
                "The tail of {name} is so heavy (Pareto shape {shape:.2f}) that rare draws rule u.",
                name=name,
                shape=shape,
            ),
        )
    return unstable


def choose(model: MeasurementModel, ways: Ways, row: int, digits: int) -> tuple[Method, Text]:
    if ways.simulated is None:
        return _without_monte_carlo(ways, row, digits)
    findings: list[Text] = []
    chosen: Method = "monte_carlo"
    orders: tuple[Method, ...] = ("first", "second")
    for method in orders:
        confirmed, finding = _finding(model, ways, ways.simulated, method, row, digits)
        findings.append(say("{names} {finding}", names=NAMES[method], finding=finding))
        if confirmed:
            chosen = method
            break
    reason = say("{said:capital} (JCGM 101 clause 8).", said=semicolons(findings))
    return chosen, after(reason, stability(ways, row, digits))


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
        return ("second", say("The terms of second order are not negligible. {unchecked}", unchecked=unchecked))
    return ("first", unchecked)
