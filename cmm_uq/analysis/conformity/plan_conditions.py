"""Whether placings, planned or recorded, are those that a standard asks for, and what is missing.

A plan and a recording are held to the same conditions. Of a recording alone, what repeats another measurement to the last
digit does not count: that is a copy, where in a plan it is a wish.
"""

from __future__ import annotations

from collections.abc import Sequence

from cmm_uq.analysis.conformity.bar_conditions import bar_positions
from cmm_uq.analysis.conformity.length_conditions import lengths_measured
from cmm_uq.analysis.conformity.plans import BarPlan, Condition, LengthPlan, Plan
from cmm_uq.analysis.conformity.sphere_conditions import sphere_points
from cmm_uq.machine.model.artefact import Artefact


def conditions(plan: Plan, artefact: Artefact, *, recorded: bool) -> tuple[Condition, ...]:
    """All that a standard asks for.

    Parameters
    ----------
    plan : of the standard.
    artefact : with the points that were planned or recorded.
    recorded : whether they were; then copies do not count.
    """
    copies = artefact.points.copies if recorded else {}
    if isinstance(plan, LengthPlan):
        return lengths_measured(plan, artefact, copies)
    if isinstance(plan, BarPlan):
        return bar_positions(plan, artefact, copies)
    forms = artefact.forms()
    return () if forms is None else sphere_points(plan, artefact.points, forms.directions, copies)


def best_of(plans: Sequence[Plan], artefact: Artefact, *, recorded: bool) -> tuple[Condition, ...]:
    """Conditions of the one of several plans that lacks least."""
    each = [conditions(plan, artefact, recorded=recorded) for plan in plans]
    return min(each, key=lambda found: sum(len(condition.missing) for condition in found))
