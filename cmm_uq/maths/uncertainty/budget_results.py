"""An evaluation as plain data: what ``results.json`` of a measurement model holds, and the rows of its page."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Number, Text, Verbatim, in_a_row, number, say
from cmm_uq.maths.uncertainty.budget import Budget
from cmm_uq.maths.uncertainty.quantity import figure, rounded, significant

if TYPE_CHECKING:
    from cmm_uq.maths.uncertainty.evaluation import Evaluation, OutputResult as Stated
    from cmm_uq.maths.uncertainty.monte_carlo import Simulated
    from cmm_uq.maths.uncertainty.propagation import Propagated

SCHEMA = "cmm-uq/budget/1"


def results_of(evaluation: Evaluation) -> dict[str, Any]:
    """The evaluation as dicts, lists and finite numbers, ready for JSON; what has no value is None."""
    outputs = {name: _output(evaluation, row, stated) for row, (name, stated) in enumerate(evaluation.stated.items())}
    asked = evaluation.request
    return {
        "schema": SCHEMA,
        "coverage": asked.coverage,
        "digits": asked.digits,
        "seed": asked.seed,
        "outputs": outputs,
        "output_correlation": [[_finite(r) for r in line] for line in evaluation.correlation.tolist()],
    }


def _finite(number: float) -> float | None:
    return number if isfinite(number) else None


def _output(evaluation: Evaluation, row: int, stated: Stated) -> dict[str, Any]:
    ways, coverage = evaluation.ways, evaluation.request.coverage
    return {
        "value": stated.value,
        "u": stated.u,
        "dof": _finite(stated.dof),
        "interval": list(stated.interval),
        "coverage_factor": stated.coverage_factor,
        "unit": stated.budget.unit or None,
        "method": stated.method,
        "reason": stated.reason,
        "first": _propagated(ways.first, row, coverage),
        "second": _propagated(ways.second, row, coverage),
        "monte_carlo": _simulated(ways.simulated, row),
        "budget": _lines(stated.budget),
    }


def budget_data(budget: Budget) -> dict[str, Any]:
    """A budget by itself, of an uncertainty alone or of a measurand with an estimate."""
    return {
        "measurand": budget.measurand,
        "value": budget.value,
        "u": budget.u,
        "U": budget.expanded,
        "k": budget.k,
        "dof": _finite(budget.dof),
        "unit": budget.unit or None,
        "budget": _lines(budget),
    }


def _lines(budget: Budget) -> list[dict[str, Any]]:
    return [
        {
            "input": line.name,
            "value": line.value,
            "u": line.u,
            "unit": line.unit or None,
            "distribution": line.distribution or None,
            "dof": _finite(line.dof),
            "sensitivity": line.sensitivity,
            "contribution": line.contribution,
            "share": share,
            "source": line.origin,
        }
        for line, share in zip(budget.lines, budget.shares, strict=True)
    ]


def _propagated(found: Propagated | None, row: int, coverage: float) -> dict[str, Any] | None:
    if found is None:
        return None
    try:
        ends = [float(end[row]) for end in found.interval(coverage)]
    except CmmUqError:  # too few effective degrees of freedom for any interval
        ends = []
    return {
        "value": float(found.value[row]),
        "u": float(found.u[row]),
        "dof": _finite(float(found.dof[row])),
        "interval": ends or None,
    }


def _simulated(found: Simulated | None, row: int) -> dict[str, Any] | None:
    if found is None:
        return None
    return {
        "value": float(found.value[row]),
        "u": float(found.u[row]),
        "interval": found.interval[row].tolist(),
        "symmetric_interval": found.symmetric_interval[row].tolist(),
        "trials": found.trials,
        "stable": found.stable,
        "tail_shape": _finite(float(found.shape[row])),
    }


SUMMARY = (
    say("Quantity"),
    say("Estimate"),
    say("Standard uncertainty"),
    say("Unit"),
    say("Interval"),
    say("k"),
    say("ν"),
    say("Method"),
)


def summary_rows(evaluation: Evaluation) -> list[tuple[Text, ...]]:
    """One row of text an output under :data:`SUMMARY`, rounded to the digits asked for."""
    return [_summary(name, stated, min(evaluation.request.digits, 2)) for name, stated in evaluation.stated.items()]


_METHODS: Mapping[str, Text] = {
    "first": say("first order"),
    "second": say("second order"),
    "monte_carlo": say("Monte Carlo"),
}


def _summary(name: str, stated: Stated, digits: int) -> tuple[Text, ...]:
    value, u = rounded(stated.value, stated.u, digits)
    low, high = (rounded(end, stated.u, digits)[0] for end in stated.interval)
    return (
        Verbatim(name),
        value,
        u,
        (NOTHING if stated.budget.unit == "1" else stated.budget.unit),
        say("[{low}, {high}]", low=low, high=high),
        figure(stated.coverage_factor, 3),
        (figure(np.floor(stated.dof), 3) if isfinite(stated.dof) else Number("∞")),
        _METHODS[stated.method],
    )


COMPARISON = (say("Method"), say("Estimate"), say("Standard uncertainty"), say("Interval"), say("Trials"))


def comparison_rows(evaluation: Evaluation, output: str) -> list[tuple[Text, ...]]:
    """One row of text for each method that was possible, under :data:`COMPARISON`."""
    told = results_of(evaluation)["outputs"][output]
    rows: list[tuple[Text, ...]] = []
    for method, name in _METHODS.items():
        if found := told[method]:
            value, u = rounded(found["value"], found["u"])
            ends = [rounded(end, found["u"])[0] for end in found["interval"] or ()]
            interval = say("[{ends}]", ends=in_a_row(ends)) if ends else NOTHING
            rows.append((say("{name:capital}", name=name), value, u, interval, number(found.get("trials", ""))))
    return rows


def statement(evaluation: Evaluation, output: str) -> Text:
    """The result of one output as a sentence that a certificate could carry (JCGM 100:2008 7.2.4)."""
    stated, coverage = evaluation.stated[output], evaluation.request.coverage
    unit = stated.budget.unit
    percent = figure(100 * coverage)
    if stated.method == "monte_carlo":
        low, high = (rounded(e, stated.u)[0] for e in stated.interval)
        value, u = rounded(stated.value, stated.u)
        return say(
            "{output} = {value} with standard uncertainty {u}; the shortest {percent} % coverage interval is {interval}.",
            output=Verbatim(output), value=_in(unit, value), u=_in(unit, u), percent=percent,
            interval=_in(unit, say("[{low}, {high}]", low=low, high=high)),
        )  # fmt: skip
    value, expanded = rounded(stated.value, stated.coverage_factor * stated.u)
    factor: Text = figure(stated.coverage_factor, 3)
    if isfinite(stated.dof):
        factor = say("{k} for ν = {dof}", k=factor, dof=figure(np.floor(stated.dof), 4))
    return say(
        "{output} = {value} ± {expanded}, the expanded uncertainty U = k u with u = {u} and k = {k}, "
        "coverage probability {percent} %.",
        output=Verbatim(output), value=_in(unit, value), expanded=_in(unit, expanded), u=_in(unit, significant(stated.u)),
        k=factor, percent=percent,
    )  # fmt: skip


def _in(unit: Text, value: Text) -> Text:
    """With its unit, where it has one."""
    return value if unit in ("", "1") else say("{value} {unit}", value=value, unit=unit)
