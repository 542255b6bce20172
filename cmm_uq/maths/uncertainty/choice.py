"""Which method states the result: the simplest one that Monte Carlo confirms (JCGM 101:2008 clause 8).

Is the law of propagation good enough here? Monte Carlo says (JCGM 101:2008 clause 8).

The interval value ± U of the law of propagation is compared with Monte Carlo's probabilistically symmetric one. The ends
may differ by the numerical tolerance δ, half a unit of the last digit of u that is regarded as meaningful. Monte Carlo's
own error must not decide: trials are made until every comparison is clear of it by two standard errors, or the error is
below δ/5 (8.2).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
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

_OF_TOLERANCE = 5.0


@dataclass(frozen=True)
class Comparison:
    """Interval of the law of propagation against that of Monte Carlo, for one output."""

    # low, high: differences of the lower and the upper ends
    low: float
    high: float
    tolerance: float  # δ
    error: float  # standard error of Monte Carlo's ends, the larger of the two

    @property
    def agrees(self) -> bool:
        """Whether both ends agree within δ."""
        return max(self.low, self.high) <= self.tolerance

    @property
    def clear(self) -> bool:
        """Whether Monte Carlo's own error leaves the comparison as it is."""
        difference = abs(max(self.low, self.high) - self.tolerance)
        return 2 * self.error <= max(difference, self.tolerance / _OF_TOLERANCE)

    @property
    def words(self) -> Text:
        """The comparison as part of a sentence."""
        low, high, tolerance = (figure(number, 2) for number in (self.low, self.high, self.tolerance))
        return say(
            "its interval's ends differ from Monte Carlo's by {low} and {high}, numerical tolerance {tolerance}",
            low=low, high=high, tolerance=tolerance,
        )  # fmt: skip


def compare(propagated: Propagated, simulated: Simulated, row: int, digits: int) -> Comparison:
    """Clause 8.1 for one output; ``digits`` of u are regarded as meaningful."""
    low, high = (float(end[row]) for end in propagated.interval(simulated.coverage))
    drawn_low, drawn_high = simulated.symmetric_interval[row]
    u = simulated.u[row]
    if not simulated.stable:
        # the standard deviation of draws without one (a ratio, a Cauchy distribution) must not widen the tolerance
        u = min(u, (drawn_high - drawn_low) / (2 * float(coverage_factor(np.inf, simulated.coverage))))
    return Comparison(
        abs(low - drawn_low),
        abs(high - drawn_high),
        float(numerical_tolerance(np.array([u]), digits)[0]),
        float(np.max(simulated.standard_error[row, 4:])),
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
    ends = [np.stack(candidate.interval(coverage), axis=1) for candidate in candidates if _has_interval(candidate)]

    def settled(figures: Floats, errors: Floats) -> bool:
        tolerance = numerical_tolerance(figures[:, 1], digits)[:, None]
        doubt = 2 * errors[:, 4:]
        clear = [np.abs(np.abs(end - figures[:, 4:]) - tolerance) > doubt for end in ends]
        return all(np.all(one | (doubt <= tolerance / _OF_TOLERANCE)) for one in clear)

    return simulate_adaptively(model, coverage, digits, seed, largest, settled)


def _has_interval(propagated: Propagated) -> bool:
    return bool(np.all(propagated.dof >= 1))


Method = Literal["first", "second", "monte_carlo"]
_ROUNDING = 4e-16
PROPAGATION: tuple[Method, ...] = ("first", "second")
NAMES: Mapping[Method, Text] = {
    "first": say("first order"),
    "second": say("second order"),
    "monte_carlo": say("Monte Carlo"),
}


@dataclass(frozen=True, eq=False)
class Ways:
    """What each method gave; None where it was not asked for or is impossible, and then ``problems`` may say why."""

    first: Propagated | None = None
    second: Propagated | None = None
    simulated: Simulated | None = None
    problems: Mapping[Method, Text] = field(default_factory=dict)

    def propagated(self, method: Method) -> Propagated | None:
        """Result by the law of propagation."""
        return self.first if method == "first" else self.second


def by_propagation(model: MeasurementModel) -> Ways:
    """First and second order, as far as they are possible."""
    found: dict[Method, Propagated] = {}
    problems: dict[Method, Text] = {}
    for method, propagate in zip(PROPAGATION, (first_order, second_order), strict=True):
        try:
            found[method] = propagate(model)
        except CmmUqError as error:
            problems[method] = foreign(error.problem)
    return Ways(found.get("first"), found.get("second"), None, problems)


def must_be_possible(model: MeasurementModel, ways: Ways, method: Method) -> None:
    """Refuse a method that was asked for by name and does not give an uncertainty."""
    found = ways.propagated(method)
    if found is None:
        raise CmmUqError(ways.problems[method], where=f"method = {method!r}", fix="Use method 'auto' or 'monte_carlo'")
    for row, output in enumerate(found.outputs):
        if is_flat(model, found, row):
            raise CmmUqError(
                f"{NAMES[method]} gives u = 0 for {output} although its inputs are uncertain: "
                "the derivatives vanish at the estimates, or correlations cancel",
                where=f"method = {method!r}",
                fix="Use method 'auto' or 'monte_carlo'",
            )


def beside(ways: Ways, method: Method, row: int, digits: int) -> Text:
    """What the other order says, where it says something else."""
    if ways.first is None or ways.second is None:
        return NOTHING
    other = ways.second if method == "first" else ways.first
    name = NAMES["second" if method == "first" else "first"]
    differs = _differ(ways.first, ways.second, row, digits)
    return say("{name:capital} gives u = {u}.", name=name, u=figure(other.u[row], digits)) if differs else NOTHING


def _differ(first: Propagated, second: Propagated, row: int, digits: int) -> bool:
    """Whether the terms of second order change estimate or uncertainty beyond the numerical tolerance."""
    tolerance = numerical_tolerance(second.u, digits)[row]
    return bool(max(abs(second.u[row] - first.u[row]), abs(second.value[row] - first.value[row])) > tolerance)


def is_flat(model: MeasurementModel, found: Propagated, row: int) -> bool:
    """Whether the law of propagation gives no uncertainty, beyond rounding, although inputs have some."""
    uncertain = any(np.any(np.asarray(given.u) > 0) for given in model.inputs.values())
    return uncertain and bool(found.u[row] <= _ROUNDING * abs(found.value[row]))


def stability(ways: Ways, row: int, digits: int) -> Text:
    """Sentences where Monte Carlo gave up before its figures were stable, and why it had to, else nothing."""
    found = ways.simulated
    if found is None or found.stable:
        return NOTHING
    told = say(
        "Monte Carlo is not stable to {digits} digits after {trials} trials.", digits=digits, trials=found.trials
    )
    name, shape, unseen = foreign(found.outputs[row]), float(found.shape[row]), float(found.unseen[row])
    if shape >= NO_VARIANCE:
        heavy = say(
            "The tail of {name} is so heavy (Pareto shape {shape:.2f}; from 0.5 on there is no standard deviation) that u "
            "is of these trials alone and grows with their number; the coverage interval stands.",
            name=name,
            shape=shape,
        )
        return after(told, heavy)
    if unseen > numerical_tolerance(found.u, digits)[row]:
        heavy = say(
            "The tail of {name} is so heavy (Pareto shape {shape:.2f}) that rare draws rule u.", name=name, shape=shape
        )
        return after(told, heavy)
    return told


def choose(model: MeasurementModel, ways: Ways, row: int, digits: int) -> tuple[Method, Text]:
    """Method for one output, and why."""
    if ways.simulated is None:
        return _without_monte_carlo(ways, row, digits)
    findings: list[Text] = []
    told = stability(ways, row, digits)
    for method in PROPAGATION:
        confirmed, finding = _finding(model, ways, ways.simulated, method, row, digits)
        findings.append(say("{names} {finding}", names=NAMES[method], finding=finding))
        if confirmed:
            return method, after(_sentence(findings), told)
    return ("monte_carlo", after(_sentence(findings), told))


def _finding(
    model: MeasurementModel, ways: Ways, simulated: Simulated, method: Method, row: int, digits: int
) -> tuple[bool, Text]:
    """Whether Monte Carlo confirms the method for one output, and what to say of it."""
    found = ways.propagated(method)
    if found is None:
        return (False, say("is impossible ({problems})", problems=ways.problems[method]))
    if is_flat(model, found, row):
        return (False, say("gives u = 0, since the model is flat at the estimates"))
    if found.dof[row] < 1:
        return (False, say("has no interval, with {dof:.2g} effective degrees of freedom", dof=found.dof[row]))
    comparison = compare(found, simulated, row, digits)
    if not comparison.clear:
        error = figure(comparison.error, 2)
        return (
            max(comparison.low, comparison.high) <= comparison.tolerance + 2 * comparison.error,
            say(
                "is neither confirmed nor refuted: {words}, but Monte Carlo's own error is {error}",
                words=comparison.words,
                error=error,
            ),
        )
    words = comparison.words
    return comparison.agrees, (
        say("is confirmed: {words}", words=words) if comparison.agrees else say("is not enough: {words}", words=words)
    )


def _sentence(findings: Sequence[Text]) -> Text:
    said = semicolons(findings)
    return say("{said:capital} (JCGM 101 clause 8).", said=said)


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
