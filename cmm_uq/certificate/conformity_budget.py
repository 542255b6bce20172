"""The test uncertainty of the value that a statement of conformity names, line by line, in µm."""

from __future__ import annotations

from cmm_uq.base.messages import Text, commas, say, signed
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Column, Table
from cmm_uq.maths.uncertainty.budget import Budget, Line
from cmm_uq.maths.uncertainty.rounding import figure, significant


def budget_table(measurand: Text, budget: Budget) -> Table:
    """What contributes and how much; a column, or a line, of which nothing is to be said is left out.

    Parameters
    ----------
    measurand : in words.
    budget : in mm or µm, of quantities alone.
    """
    scale = 1 / MICROMETRE if budget.unit == unit("mm") else 1.0
    there = [(line, share) for line, share in zip(budget.lines, budget.shares, strict=True) if line.part]
    turned = any(line.unit != budget.unit or line.sensitivity != 1.0 for line, _ in there)
    several = len(there) > 1
    columns = (
        Column(say("Cause"), numeric=False),
        *(
            (Column(say("Standard uncertainty"), numeric=False), Column(say("Sensitivity"), numeric=False))
            if turned
            else ()
        ),
        Column(say("Contribution"), unit("µm")),
        *((Column(say("Share")),) if several else ()),
        Column(say("Origin"), numeric=False),
    )
    rows = tuple(
        (
            line.name,
            *((_u(line), _sensitivity(line, scale)) if turned else ()),
            significant(scale * line.contribution),
            *((say("{share} %", share=signed(100 * share, ".1f")),) if several else ()),
            line.origin,
        )
        for line, share in there
    )
    notes = [say("Combined: u = {u} µm.", u=significant(scale * budget.u))] if several else []
    if absent := [line.name for line in budget.lines if not line.part]:
        notes.append(say("Without a contribution, or not stated: {absent}.", absent=commas(absent)))
    return Table(say("Contributions to {measurand}", measurand=measurand), columns, rows, tuple(notes))


def _u(line: Line) -> Text:
    factor, shown = _shown(line)
    return say("{u} {unit}", u=significant((line.u or 0.0) * factor), unit=shown)


def _sensitivity(line: Line, scale: float) -> Text:
    """Change of the value, µm, by one unit of the quantity as it is shown."""
    factor, shown = _shown(line)
    per = figure(scale / factor * (line.sensitivity or 0.0))
    return per if shown == unit("µm") else say("{per} µm per {unit}", per=per, unit=shown)


def _shown(line: Line) -> tuple[float, Text]:
    """By what a figure of the line is multiplied to be shown, and in which unit."""
    if line.unit == unit("mm"):
        return 1 / MICROMETRE, unit("µm")
    if line.unit == unit("1/K"):
        return 1e6, say("10⁻⁶ /K")
    return 1.0, line.unit
