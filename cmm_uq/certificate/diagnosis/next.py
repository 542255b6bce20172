"""What to measure next, after a diagnosis: set-ups, what they will part and show, pictures of them, and results.json."""

from __future__ import annotations

from typing import Any

import numpy as np

from cmm_uq.analysis.diagnosis.power import ALLOWED
from cmm_uq.analysis.planning.advice import ODDS, NextPlan, Shown, odds_words, rounded
from cmm_uq.base.messages import NOTHING, Text, number, plural, say, semicolons, together
from cmm_uq.certificate.document import Block, Column, Paragraph, Section, Table
from cmm_uq.certificate.effect_words import title_of
from cmm_uq.certificate.plan_picture import placing_pictures
from cmm_uq.certificate.result import Diagnosed
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.machine.physics.effect import Effect

_PARTED = 3.0
"""Odds from which on two are parted at all."""

TO_FILL_IN = "next_plan.csv"
"""File that a diagnosis writes the set-ups to."""


def next_section(found: Diagnosed) -> Section:
    """The set-ups that would part what this recording cannot, or show what it could not have shown."""
    title, plan = say("What to measure next"), found.next_plan
    if plan is None:
        return Section(title, ())
    blocks: list[Block] = [Paragraph(_what(found, plan)), _set_ups(plan)]
    if plan.partings:
        blocks.append(_partings(plan))
    if plan.shown:
        blocks.append(_shown(plan, found.diagnosis.after.artefact))
    return Section(title, (*blocks, *placing_pictures(plan.placings, plan.box, plan.first)))


def next_sentence(found: Diagnosed) -> Text:
    """The set-ups in a sentence, with the odds that they are expected to reach; nothing without any."""
    plan = found.next_plan
    if plan is None:
        return NOTHING
    ends = semicolons(say("{ends} mm", ends=placing.ends) for placing in plan.placings)
    told = say(
        "Measure next: {what} First and last point in scale readings: {ends}.", what=_what(found, plan), ends=ends
    )
    if not plan.partings:
        return told
    odds = [parting.after for parting in plan.partings]
    if max(odds) < _PARTED and not plan.shown:
        return say(
            "No set-up that was tried is expected to part what this recording cannot: odds of {odds} : 1 at best for the "
            "true one. Another artefact is needed for that.", odds=rounded(max(odds)),
        )  # fmt: skip
    least = min((each for each in odds if each >= _PARTED), default=None)
    if least is None:
        return told
    if min(odds) < _PARTED:
        return say(
            "{told} Odds of {odds} : 1 or more for the true one are then expected, but for {count} of {all} pairs, which "
            "they do not part: see below.", told=told, odds=rounded(least), count=sum(each < _PARTED for each in odds),
            all=len(odds),
        )  # fmt: skip
    return say("{told} Odds of {odds} : 1 or more for the true one are then expected.", told=told, odds=rounded(least))


def _what(found: Diagnosed, plan: NextPlan) -> Text:
    times = plural(plan.repeats, one=say("once"), many=say("{times} times", times=plan.repeats))
    count = plural(len(plan.placings), one=say("one set-up"), many=say("{count} set-ups", count=len(plan.placings)))
    what = say(
        "{count:capital} more of the {artefact:small}, each measured {times}, added to this recording.", count=count,
        artefact=found.diagnosis.before.artefact.title, times=times,
    )  # fmt: skip
    if plan.reached:
        return what
    return say("{what} They are the best that was found, but do not reach everything: see below.", what=what)


def _set_ups(plan: NextPlan) -> Table:
    rows = tuple(
        (number(plan.first + i), placing.title, placing.ends, number(plan.repeats))
        for i, placing in enumerate(plan.placings)
    )
    heads = (
        Column(say("Measurement")), Column(say("Set-up"), numeric=False),
        Column(say("First and last point, scale readings / mm"), numeric=False), Column(say("Repeats")),
    )  # fmt: skip
    return Table(say("Set-ups to measure"), heads, rows, (say("A CSV to fill in comes with this page."),))


def _partings(plan: NextPlan) -> Table:
    rows = tuple(
        (
            together(title_of(name) for name in parting.effects),
            odds_words(parting.before),
            say("{odds} : 1", odds=rounded(parting.after)),
        )
        for parting in plan.partings
    )  # fmt: skip
    heads = (
        Column(say("Cannot be told apart"), numeric=False), Column(say("Odds now, first over second")),
        Column(say("Odds expected then")),
    )  # fmt: skip
    note = say(
        "Expected are the odds of the true one of the two, whichever it is, each as large as it would have to be to explain "
        "this recording; {odds:.0f} : 1 is aimed at.", odds=ODDS,
    )  # fmt: skip
    return Table(say("What the set-ups part"), heads, rows, (note,))


def _shown(plan: NextPlan, artefact: Artefact) -> Table:
    rows = []
    for one in plan.shown:
        effect = _acting(one, artefact)
        rows.append((effect.title, _amplitude(effect, one.before), _amplitude(effect, one.after)))
    heads = (Column(say("Error"), numeric=False), Column(say("Found from, now")), Column(say("Found from, then")))
    note = say("One error at a time, in 90 of 100 such recordings, with everything that the model names fitted.")
    return Table(say("What the set-ups show"), heads, tuple(rows), (note,))


def _acting(one: Shown, artefact: Artefact) -> Effect:
    """The effect with the sizes that this artefact allows it, where it is a fault of its own."""
    return artefact.acting(every()[one.effect])


def _amplitude(effect: Effect, size: float) -> Text:
    parameter = effect.coefficients[0]
    if size > ALLOWED:
        return say("not found")
    value = size * parameter.prior_sd
    return say("{value}\u00a0{unit}", value=number(value, ".2g" if value < 100 else ".0f"), unit=parameter.unit)


def next_data(plan: NextPlan | None, artefact: Artefact) -> dict[str, Any] | None:
    """The same for results.json."""
    if plan is None:
        return None
    return {
        "repeats": plan.repeats,
        "reached": plan.reached,
        "set_ups": [
            {"measurement": plan.first + i, "what": placing.title, "ends": placing.ends}
            for i, placing in enumerate(plan.placings)
        ],
        "parts": [
            {"effects": list(parting.effects), "odds_before": parting.before, "odds_after": parting.after}
            for parting in plan.partings
        ],
        "shows": [_shown_data(one, _acting(one, artefact)) for one in plan.shown],
    }  # fmt: skip


def _shown_data(one: Shown, effect: Effect) -> dict[str, Any]:
    parameter = effect.coefficients[0]
    before, after = (
        size * parameter.prior_sd if np.isfinite(size) and size <= ALLOWED else None for size in (one.before, one.after)
    )
    return {
        "effect": one.effect,
        "parameter": effect.reported[0].name,
        "detected_before": before,
        "detected_after": after,
    }
