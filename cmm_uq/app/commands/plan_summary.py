"""A plan in a few lines: whether it has what its standards ask for, what it determines, what it leaves open."""

from __future__ import annotations

from cmm_uq.analysis.planning.identifiability import Identifiability
from cmm_uq.app.commands.plan_page import placing_rows, to_measure_words
from cmm_uq.app.commands.plan_words import STATUS, absorbed, combination, expected, named, pairs, unit_of
from cmm_uq.app.commands.planning import Plan
from cmm_uq.base.messages import Text, say
from cmm_uq.certificate.in_short import Figure, Summary, Verdict


def plan_summary(plan: Plan) -> Summary:
    """For the end of the command; its details are the placings, below their headings."""
    found = plan.outlook.identifiability
    met = tuple(
        Verdict("MET", "good", one.what, ()) if one.met else Verdict("NOT MET", "open", one.what, ())
        for one in plan.conditions
    )
    free = tuple(say("No reading shows: {what}.", what=text) for text in plan.free)
    heads = (say("No."), say("Set up"), say("From → to / mm"), say("Points"), say("min"))
    placings = tuple(placing_rows(plan))
    return Summary(
        to_measure_words(plan), verdicts=met, figures=() if found is None else _figures(found),
        remarks=free if found is None else (*free, *_open(found)), details=(heads, *placings) if placings else (),
    )  # fmt: skip


def _figures(found: Identifiability) -> tuple[Figure, ...]:
    return tuple(
        (named(p), say("u = {u} {unit}", u=expected(p), unit=unit_of(p)), STATUS[p.status]) for p in found.parameters
    )


def _open(found: Identifiability) -> list[Text]:
    """What the placings leave open."""
    return [
        *(say("Stays free: {what}.", what=combination(parts)) for parts in found.free),
        *(say("Could not be told apart: {effects}.", effects=text) for text in pairs(found)),
        *(say("Would be taken for what the job names: {effects}.", effects=text) for text in absorbed(found)),
    ]
