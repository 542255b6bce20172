"""What standards and tolerances decide, as items of one list (:mod:`cmm_uq.jobs.verdicts`)."""

from __future__ import annotations

from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.base.messages import Text, say
from cmm_uq.base.units import UNITS
from cmm_uq.jobs.verdicts import TOLERANCE_OUTCOMES, Verdict
from cmm_uq.maths.uncertainty.quantity import Quantity

TOLERANCE_WORDS = {outcome: word for word, outcome in TOLERANCE_OUTCOMES.items()}
"""Beside a tolerance, by outcome: in, out or open."""


def by_standard(statement: Statement) -> Verdict:
    """A statement by a standard, with the value that is least favourable."""
    U = 2 * statement.u_um if statement.u_um > 0 else None
    return Verdict(statement.characteristic, statement.outcome, statement.value_um, U, statement.limit_um, UNITS["µm"],
                   statement.facts.standard, statement.quantity, statement.missing)  # fmt: skip


def by_tolerance(name: str, title: Text, quantity: Quantity, tolerance: float, *, determined: bool = True) -> Verdict:
    """A parameter against its tolerance.

    A pass or a fail where the whole 95 % interval is within or beyond it (with U as guard band on both sides, ISO 14253-1),
    undecided between, and where the recording does not determine the parameter.

    Parameters
    ----------
    name, title : ``scale_x.ppm``, and in words.
    quantity : its estimate.
    tolerance : for either sign, in the quantity's unit.
    determined : whether the recording determines it by itself.
    """
    if not determined:
        missing = (say("the recording does not determine it"),)
        return Verdict(name, "undecided", None, None, tolerance, quantity.unit, title=title, missing=missing)
    low, high = quantity.interval95
    within, beyond = -tolerance <= low and high <= tolerance, low > tolerance or high < -tolerance
    outcome = "pass" if within else "fail" if beyond else "undecided"
    return Verdict(name, outcome, quantity.value, quantity.expanded, tolerance, quantity.unit, title=title)
