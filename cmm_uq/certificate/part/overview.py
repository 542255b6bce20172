"""A part's measurement in short: whether it conforms, where it is nearest to a limit, what its uncertainty comes from."""

from __future__ import annotations

from collections.abc import Sequence

from cmm_uq.analysis.conformity.decision import Outcome
from cmm_uq.base.messages import (
    NOTHING,
    Text,
    Verbatim,
    commas,
    names,
    number,
    plural,
    say,
    semicolons,
    sentences,
    signed,
)
from cmm_uq.certificate.document import Overview
from cmm_uq.certificate.part.budget_section import best_words, largest_words, unseen_words
from cmm_uq.certificate.part.figures import Figures, critical, figures_of
from cmm_uq.certificate.part.found import PartFound
from cmm_uq.certificate.wording import probability
from cmm_uq.jobs.verdicts import gravest, standing_of


def overview_of(found: PartFound) -> Overview:
    """The first thing on the page."""
    one = critical(found)
    rows = (
        (say("Part"), part_words(found)),
        (say("Decision rule"), found.judged_by if any(found.judged) else NOTHING),
        (say("Least margin") if found.nearest is not None else say("Tightest"), _least(one)),
        (say("Probability"), _together(found)),
        (say("Uncertainty"), largest_words(one) if found.budget.causes and one.stated.u else NOTHING),
        (say("To reduce it"), best_words(one) if len(found.ways) > 1 else NOTHING),
        (say("Not seen"), unseen_words(found) if found.unseen else NOTHING),
        (say("Not covered"), _not_covered(found)),
    )
    return Overview(
        verdict_words(found.outcomes, measured=found.measured is not None),
        "unknown" if found.outcome is None else standing_of(found.outcome),
        tuple(row for row in rows if row[1]),
    )


def verdict_words(outcomes: Sequence[Outcome], *, measured: bool) -> Text:
    """Whether the part conforms.

    Parameters
    ----------
    outcomes : of the characteristics that were decided on.
    measured : whether anything was.
    """
    outcome = gravest(outcomes)
    if not outcomes:
        return say("Measured: no limits to decide on") if measured else _UNMEASURED
    all_ = len(outcomes)
    if outcome == "pass":
        return plural(all_, one=say("Conforms: its one limited characteristic is within its limits"),
                      many=say("Conforms: all {count} limited characteristics are within limits", count=all_))  # fmt: skip
    if outcome in ("fail", "conditional fail"):
        out = sum(one in ("fail", "conditional fail") for one in outcomes)
        told = plural(out, one=say("one of {all} characteristics is not", all=all_),
                      many=say("{count} of {all} characteristics are not", count=out, all=all_))  # fmt: skip
        if outcome == "conditional fail":
            return say("Conditionally rejected: {told} within its limits with certainty", told=told)
        return say("Does not conform: {told} within the limits", told=told)
    if outcome == "conditional pass":
        return say("Conditionally accepted: all values are within their limits, not all with their uncertainty")
    open_ = sum(one == "undecided" for one in outcomes)
    return plural(
        open_, one=say("Undecided: one of {all} characteristics is too near to a limit", all=all_),
        many=say("Undecided: {count} of {all} characteristics are too near to a limit", count=open_, all=all_),
    )  # fmt: skip


_UNMEASURED = say("Uncertainty of a planned measurement: nothing was measured")


def part_words(found: PartFound) -> Text:
    """Name, drawing, serial number."""
    part = found.job.facts.part
    drawing = say("drawing {number}", number=Verbatim(part.drawing)) if part.drawing else NOTHING
    serial = say("serial number {number}", number=Verbatim(part.serial)) if part.serial else NOTHING
    return commas(text for text in (Verbatim(part.name), drawing, serial) if text)


def _least(one: Figures) -> Text:
    """The characteristic nearest to a limit, or that takes most of its tolerance, with its figures."""
    if not one.allowed:
        return NOTHING
    told = say("{what}: {result}; allowed {allowed}", what=one.titled, result=one.result, allowed=one.allowed)
    margin = float(one.found.margins[one.place])
    if one.found.nearest is not None:
        inside = say("{told}, {times} u inside of the limit", told=told, times=number(margin, ".1f"))
        return inside if margin >= 0 else say("{told}, {times} u outside of the limit", told=told,
                                              times=number(-margin, ".1f"))  # fmt: skip
    if not one.width > 0:
        return told
    return say("{told}; the 95 % interval takes {share} % of it", told=told,
               share=signed(200 * one.expanded / one.width, ".0f"))  # fmt: skip


def _together(found: PartFound) -> Text:
    limited = sum(one is not None for one in found.judged)
    if found.together is None or limited < 2:
        return NOTHING
    return say("{chance} that all {count} limits are kept", chance=probability(found.together), count=limited)


def _not_covered(found: PartFound) -> Text:
    told: list[Text] = []
    left = found.job.facts.part.not_measured
    if left:
        told.append(say("Not measured: {names}.", names=commas(names(left))))
    free = [one.titled for one in figures_of(found) if one.judged is None]
    if free and len(free) < len(found.judged):
        told.append(say("Without limits: {names}.", names=semicolons(free)))
    return sentences(told)
