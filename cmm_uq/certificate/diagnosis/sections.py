"""Sections of a diagnosis: what to measure next, what the choice of an explanation costs, what would not have been seen."""

from __future__ import annotations

from collections.abc import Iterator

from cmm_uq.analysis.conformity.accuracy import TITLES, UNITS
from cmm_uq.analysis.diagnosis.model_average import Rival
from cmm_uq.analysis.diagnosis.power import ALLOWED
from cmm_uq.analysis.diagnosis.smallest import PLACES, POWER, PeriodRange, SmallestEffect
from cmm_uq.analysis.planning.set_up import ODDS, NextPlan, odds_words, rounded
from cmm_uq.base import messages
from cmm_uq.base.messages import NOTHING, Text, Verbatim, number, plural, say
from cmm_uq.base.units import Unit
from cmm_uq.certificate.document import Column, Paragraph, Section, Table, section, table
from cmm_uq.certificate.plots.plans import placing_pictures
from cmm_uq.certificate.result import JobDiagnosis
from cmm_uq.certificate.wording import (
    OUTCOME_WORDS,
    effect_title,
    parameter_title,
    probability,
    titles,
    with_uncertainty,
)
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.machine.physics.effect import Effect

_PARTED = 3.0  # odds from which on two are parted at all
TO_FILL_IN = "next_plan.csv"  # file that a diagnosis writes the set-ups to


def next_section(result: JobDiagnosis) -> Section:
    """The set-ups that would part what this recording cannot, or show what it could not have shown."""
    title, plan = say("What to measure next"), result.next_plan
    if plan is None:
        return section(title)
    set_ups = (
        (number(plan.first + i), placing.title, placing.ends, number(plan.repeats))
        for i, placing in enumerate(plan.placings)
    )
    heads = (
        Column(say("Measurement")),
        say("Set-up"),
        say("First and last point, scale readings / mm"),
        Column(say("Repeats")),
    )
    note = say("A CSV to fill in comes with this page.")
    return section(
        title, Paragraph(_what(result, plan)), table(say("Set-ups to measure"), heads, set_ups, note), _partings(plan),
        _shown(plan, result.diagnosis.after.artefact), *placing_pictures(plan.placings, plan.box, plan.first),
    )  # fmt: skip


def next_sentence(result: JobDiagnosis) -> Text:
    """The set-ups in a sentence, with the odds that they are expected to reach; nothing without any."""
    plan = result.next_plan
    if plan is None:
        return NOTHING
    ends = messages.semicolons(say("{ends} mm", ends=placing.ends) for placing in plan.placings)
    told = say(
        "Measure next: {what} First and last point in scale readings: {ends}.", what=_what(result, plan), ends=ends
    )
    odds = [parting.after for parting in plan.partings]
    reached = [each for each in odds if each >= _PARTED]
    if odds and not reached and not plan.shown:
        return say(
            "No set-up that was tried is expected to part what this recording cannot: odds of {odds} : 1 at best for the "
            "true one. Another artefact is needed for that.", odds=rounded(max(odds)),
        )  # fmt: skip
    if not reached:
        return told
    least = rounded(min(reached))
    if len(reached) < len(odds):
        return say(
            "{told} Odds of {odds} : 1 or more for the true one are then expected, but for {count} of {all} pairs, which "
            "they do not part: see below.", told=told, odds=least, count=len(odds) - len(reached), all=len(odds),
        )  # fmt: skip
    return say("{told} Odds of {odds} : 1 or more for the true one are then expected.", told=told, odds=least)


def _what(result: JobDiagnosis, plan: NextPlan) -> Text:
    times = plural(plan.repeats, one=say("once"), many=say("{times} times", times=plan.repeats))
    count = plural(len(plan.placings), one=say("one set-up"), many=say("{count} set-ups", count=len(plan.placings)))
    what = say(
        "{count:capital} more of the {artefact:small}, each measured {times}, added to this recording.", count=count,
        artefact=result.diagnosis.before.artefact.title, times=times,
    )  # fmt: skip
    if plan.reached:
        return what
    return say("{what} They are the best that was found, but do not reach everything: see below.", what=what)


def _partings(plan: NextPlan) -> Table | None:
    rows = (
        (
            messages.together(map(effect_title, one.effects)),
            odds_words(one.before),
            say("{odds} : 1", odds=rounded(one.after)),
        )
        for one in plan.partings
    )
    heads = (say("Cannot be told apart"), Column(say("Odds now, first over second")), Column(say("Odds expected then")))
    return table(say("What the set-ups part"), heads, rows, say(
        "Expected are the odds of the true one of the two, whichever it is, each as large as it would have to be to explain "
        "this recording; {odds:.0f} : 1 is aimed at.", odds=ODDS,
    ))  # fmt: skip


def _shown(plan: NextPlan, artefact: Artefact) -> Table | None:
    acting = [(artefact.acting(every()[one.effect]), one) for one in plan.shown]
    rows = ((effect.title, _amplitude(effect, one.before), _amplitude(effect, one.after)) for effect, one in acting)
    heads = (say("Error"), Column(say("Found from, now")), Column(say("Found from, then")))
    note = say("One error at a time, in 90 of 100 such recordings, with everything that the model names fitted.")
    return table(say("What the set-ups show"), heads, rows, note)


def _amplitude(effect: Effect, size: float) -> Text:
    first = effect.coefficients[0]
    return say("not found") if size > ALLOWED else _size(size * first.prior_sd, first.unit)


_SHOWN = 4  # explanations that a table has columns for


def costs_section(result: JobDiagnosis) -> Section:
    """A table of what remains; without blocks where one explanation is settled, or nothing depends on it."""
    rivals = result.diagnosis.remaining.rivals
    heads = (
        Column(say("{what}: {probability}", what=explanation(one), probability=probability(one.probability)))
        for one in rivals[:_SHOWN]
    )
    note = say(
        "Each column is what follows if this explanation is the right one; figures and decisions are then corrected for "
        "its effects. Averages are weighted by the probabilities; a certificate states those of the error factors."
    )
    told, more = probability(sum(one.probability for one in rivals)), max(len(rivals) - _SHOWN, 0)
    share = say(
        "The averages are over explanations with {told} of the probability together; each of the rest has less.",
        told=told,
    )
    left = plural(
        more, one=say("One further explanation is in results.json."),
        many=say("{count} further explanations are in results.json.", count=more),
    )  # fmt: skip
    follows = table(
        say("What follows from each explanation that remains"),
        (say("Quantity"), *heads, Column(say("Averaged")), say("Unit")),
        _cost_rows(result) if rivals else (),  # none as against a simulation, where no effect of the job takes part
        note, messages.after(left if more else NOTHING, share),
    )  # fmt: skip
    return section(say("What the choice of an explanation costs"), follows)


def explanation(rival: Rival) -> Text:
    words = (*titles(rival.effects), *rival.functions)
    return messages.commas(words) if words else say("nothing missing")


def _cost_rows(result: JobDiagnosis) -> Iterator[tuple[Text, ...]]:
    remaining, costs = result.diagnosis.remaining, result.costs
    for effect, parameters in remaining.averaged.items():
        for name, quantity in parameters.items():
            each = (with_uncertainty(rival.named[effect][name]) for rival in remaining.rivals[:_SHOWN])
            yield (parameter_title(effect, name), *each, with_uncertainty(quantity), quantity.unit)
    if costs is None:
        return
    for name, quantity in costs.figures.items():
        each = (with_uncertainty(cost.figures[name]) for cost in costs.each[:_SHOWN])
        yield (TITLES[name], *each, with_uncertainty(quantity), UNITS[name])
    for i, first in enumerate(costs.each[0].statements):
        yield (
            say("{standard}, {quantity}", standard=Verbatim(first.facts.standard), quantity=first.quantity),
            *(OUTCOME_WORDS[cost.statements[i].outcome] for cost in costs.each[:_SHOWN]),
            messages.commas(
                say("{outcome} {probability}", outcome=OUTCOME_WORDS[outcome], probability=probability(p))
                for outcome, p in costs.decisions[i].items()
            ),
            NOTHING,
        )


_NAMED = 5  # effects that the sentence beside the verdict names
_RANGES = 3


def without_power(result: JobDiagnosis) -> Text:
    """What follows a verdict of agreement where even a plausible common effect would not have shown; else nothing."""
    if result.diagnosis.verdict != "consistent":
        return NOTHING
    order = {name: i for i, name in enumerate(every())}
    blind = sorted((row for row in result.unseen if row.blind), key=lambda row: order.get(row.effect, len(order)))
    words: list[Text] = [
        say("{title:small} up to {size}", title=row.title,
            size=_size(min(row.detected or row.allowed, row.allowed), row.unit))
        for row in blind
    ]  # fmt: skip
    if (more := len(words) - _NAMED) > 1:
        words = [*words[:_NAMED], say("{more} more", more=more)]
    return (
        say("But this recording could not have shown: {effects}.", effects=messages.listed(words)) if words else NOTHING
    )


def unseen_section(result: JobDiagnosis) -> Section:
    """The smallest amplitude of each common effect that the recording would have shown, and rarer ones that it would not."""
    rows = [
        (row.title, _found(row, row.detected), _found(row, row.named), _size(row.allowed, row.unit), _why(row))
        for row in result.unseen if row.common or not row.shown
    ]  # fmt: skip
    heads = (
        say("Error"), Column(say("Found from")), Column(say("Named from")), Column(say("Reckoned with up to")),
        say("Why, and for which periods"),
    )  # fmt: skip
    beside = without_power(result) if rows else NOTHING
    smallest = table(say("Smallest errors that would have shown"), heads, rows, say(
        "With the noise that was found and beside what was asserted, an error of this size would have been found, or "
        "called by its right name, in {power:.0f} of 100 such recordings; “not found” where even the largest error "
        "reckoned with would not. In closed form: mostly within 15 %, a name with a close rival within a factor of two.",
        power=100 * POWER,
    ))  # fmt: skip
    return section(
        say("What would not have been seen"), Paragraph(beside, tone="warning") if beside else None, smallest
    )


def _found(row: SmallestEffect, size: float | None) -> Text:
    return say("not found") if size is None or size > row.allowed else _size(size, row.unit)


def _size(value: float, unit: Unit) -> Text:
    return say("{value}\u00a0{unit}", value=number(value, ".2g" if value < 100 else ".0f"), unit=unit)


def _why(row: SmallestEffect) -> Text:
    takers = messages.listed([*map(_taker, row.taken_up)])
    said: list[Text] = []
    if row.taken_up:
        said.append(say("taken up by {effects}", effects=takers) if row.share < 1e-3 else
                    say("mostly taken up by {effects}", effects=takers))  # fmt: skip
    elif row.share == 0:
        said.append(say("moves nothing that is observed here"))
    if row.detected is not None and row.allowed < row.detected < 100 * row.allowed:
        said.append(say("it would take {size}", size=_size(row.detected, row.unit)))
    if row.periods is not None:
        said.append(_periods(row.periods, row))
    return messages.commas(said) if said else messages.DASH


def _taker(name: str) -> Text:
    if name == PLACES:
        return say("the place of the artefact")
    if name == ARTEFACT:
        return say("the size of the artefact")
    effect = every().get(name)
    return Verbatim(name) if effect is None else say("{title:small}", title=effect.title)


def _periods(periods: PeriodRange, row: SmallestEffect) -> Text:
    every_one = say("{low:.3g} to {high:.3g}\u00a0{unit}", low=periods.low, high=periods.high, unit=periods.unit)
    if periods.worst is None:
        return say("none of {every_one} resolved by these positions", every_one=every_one)
    worst = say("{every_one}, at worst {size}", every_one=every_one, size=_size(periods.worst, row.unit))
    if not periods.unresolved:
        return worst
    ranges = [
        number(low, ".3g") if low == high else say("{low:.3g} to {high:.3g}", low=low, high=high)
        for low, high in periods.unresolved
    ]
    if len(ranges) > _RANGES:
        ranges = [*ranges[:_RANGES], say("{more} more ranges", more=len(ranges) - _RANGES)]
    return say(
        "{worst}; not resolved: {ranges}\u00a0{unit}", worst=worst, ranges=messages.listed(ranges), unit=periods.unit
    )
