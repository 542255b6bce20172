"""An evaluation as plain data: what ``results.json`` of a measurement model holds, and the rows of its page."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Number, Text, Verbatim, in_a_row, number, say
from cmm_uq.maths.uncertainty.budget import NAMES, Budget
from cmm_uq.maths.uncertainty.quantity import figure, rounded, significant

if TYPE_CHECKING:
    from cmm_uq.maths.uncertainty.evaluation import Evaluation, OutputResult as Stated
    from cmm_uq.maths.uncertainty.propagation import Propagated

SCHEMA = "cmm-uq/budget/1"


def results_of(evaluation: Evaluation) -> dict[str, Any]:
    """The evaluation as dicts, lists and finite numbers, ready for JSON; what has no value is None."""
    request = evaluation.request
    return {
        "schema": SCHEMA,
        **{key: getattr(request, key) for key in ("coverage", "digits", "seed")},
        "outputs": {
            name: _output(evaluation, row, stated) for row, (name, stated) in enumerate(evaluation.stated.items())
        },
        "output_correlation": [[_finite(r) for r in line] for line in evaluation.correlation.tolist()],
    }


def _finite(number: float) -> float | None:
    return number if isfinite(number) else None


def _output(evaluation: Evaluation, row: int, stated: Stated) -> dict[str, Any]:
    ways, coverage, drawn = evaluation.ways, evaluation.request.coverage, evaluation.ways.simulated
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
        "monte_carlo": drawn
        and {
            "value": float(drawn.value[row]),
            "u": float(drawn.u[row]),
            "interval": drawn.interval[row].tolist(),
            "symmetric_interval": drawn.symmetric_interval[row].tolist(),
            "trials": drawn.trials,
            "stable": drawn.stable,
            "tail_shape": _finite(float(drawn.shape[row])),
        },
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


def _propagated(result: Propagated | None, row: int, coverage: float) -> dict[str, Any] | None:
    if result is None:
        return None
    try:
        ends = [float(end[row]) for end in result.interval(coverage)]
    except CmmUqError:  # too few effective degrees of freedom for any interval
        ends = []
    value, u, dof = float(result.value[row]), float(result.u[row]), _finite(float(result.dof[row]))
    return {"value": value, "u": u, "dof": dof, "interval": ends or None}


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
COMPARISON = (say("Method"), say("Estimate"), say("Standard uncertainty"), say("Interval"), say("Trials"))


def summary_rows(evaluation: Evaluation) -> list[tuple[Text, ...]]:
    """One row of text an output under :data:`SUMMARY`, rounded to the digits asked for."""
    rows: list[tuple[Text, ...]] = []
    digits = min(evaluation.request.digits, 2)
    for name, stated in evaluation.stated.items():
        low, high = (rounded(end, stated.u, digits)[0] for end in stated.interval)
        unit = NOTHING if stated.budget.unit == "1" else stated.budget.unit
        k = figure(stated.coverage_factor, 3)
        dof = figure(np.floor(stated.dof), 3) if isfinite(stated.dof) else Number("∞")
        value_and_u, interval = rounded(stated.value, stated.u, digits), say("[{low}, {high}]", low=low, high=high)
        rows.append((Verbatim(name), *value_and_u, unit, interval, k, dof, NAMES[stated.method]))
    return rows


def comparison_rows(evaluation: Evaluation, output: str) -> list[tuple[Text, ...]]:
    """One row of text for each method that was possible, under :data:`COMPARISON`."""
    results = results_of(evaluation)["outputs"][output]
    rows: list[tuple[Text, ...]] = []
    for method, name in NAMES.items():
        if result := results[method]:
            value, u = rounded(result["value"], result["u"])
            ends = [rounded(end, result["u"])[0] for end in result["interval"] or ()]
            interval = say("[{ends}]", ends=in_a_row(ends)) if ends else NOTHING
            rows.append((say("{name:capital}", name=name), value, u, interval, number(result.get("trials", ""))))
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
    return value if unit in ("", "1") else say("{value} {unit}", value=value, unit=unit)
