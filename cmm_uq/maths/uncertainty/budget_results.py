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
    stated = enumerate(evaluation.stated.items())
    return {
        "schema": SCHEMA,
        **_data(evaluation.request, "coverage digits seed"),
        "outputs": {name: _output(evaluation, row, result) for row, (name, result) in stated},
        "output_correlation": [[_plain(r) for r in line] for line in evaluation.correlation.tolist()],
    }


def _plain(value: Any) -> Any:
    if isinstance(value, float) and not isfinite(value):
        return None
    return list(value) if isinstance(value, tuple) else value


def _data(source: object, names: str) -> dict[str, Any]:
    """Attributes by their names, what has no value as None."""
    return {name: _plain(getattr(source, name)) for name in names.split()}


def _output(evaluation: Evaluation, row: int, stated: Stated) -> dict[str, Any]:
    ways, coverage = evaluation.ways, evaluation.request.coverage
    if drawn := ways.simulated:
        of_row = {name: getattr(drawn, name)[row].tolist() for name in ("value", "u", "interval", "symmetric_interval")}
        simulated = {**of_row, **_data(drawn, "trials stable"), "tail_shape": _plain(float(drawn.shape[row]))}
    return {
        **_data(stated, "value u dof interval coverage_factor"), "unit": stated.budget.unit or None,
        **_data(stated, "method reason"), "first": _propagated(ways.first, row, coverage),
        "second": _propagated(ways.second, row, coverage), "monte_carlo": simulated if drawn else None,
        "budget": _lines(stated.budget),
    }  # fmt: skip


def budget_data(budget: Budget) -> dict[str, Any]:
    """A budget by itself, of an uncertainty alone or of a measurand with an estimate."""
    figures = {**_data(budget, "measurand value u"), "U": budget.expanded, **_data(budget, "k dof")}
    return {**figures, "unit": budget.unit or None, "budget": _lines(budget)}


def _lines(budget: Budget) -> list[dict[str, Any]]:
    return [
        {
            "input": line.name,
            **_data(line, "value u"),
            **{name: getattr(line, name) or None for name in ("unit", "distribution")},
            **_data(line, "dof sensitivity contribution"),
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
    return {name: _plain(float(getattr(result, name)[row])) for name in ("value", "u", "dof")} | {
        "interval": ends or None
    }


COMPARISON = (say("Method"), say("Estimate"), say("Standard uncertainty"), say("Interval"), say("Trials"))
SUMMARY = (say("Quantity"), *COMPARISON[1:3], say("Unit"), say("Interval"), say("k"), say("ν"), COMPARISON[0])


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
