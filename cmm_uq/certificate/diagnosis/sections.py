"""Sections of a diagnosis: what to measure next, what the choice of an explanation costs, what would not have been seen."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cmm_uq.analysis.conformity.accuracy import TITLES, UNITS
from cmm_uq.analysis.diagnosis.diagnosis import Diagnosis, Rival
from cmm_uq.analysis.diagnosis.location import Place, residual_field
from cmm_uq.analysis.diagnosis.power import ALLOWED
from cmm_uq.analysis.diagnosis.smallest import PLACES, POWER, PeriodRange, SmallestEffect
from cmm_uq.analysis.planning.set_up import ODDS, NextPlan, odds_words, rounded
from cmm_uq.base import messages
from cmm_uq.base.messages import NOTHING, Text, Verbatim, commas, holding, number, plural, say, signed, together
from cmm_uq.base.points import AXES
from cmm_uq.base.units import Unit, unit
from cmm_uq.certificate import wording
from cmm_uq.certificate.document import Column, Paragraph, Plot, Section, Table, section, table
from cmm_uq.certificate.plots.volume import placing_pictures, profile_plot, residual_field_plot
from cmm_uq.certificate.result import JobDiagnosis
from cmm_uq.certificate.wording import OUTCOME_WORDS, effect_title, probability, with_uncertainty
from cmm_uq.jobs.columns import in_words, labelled, unit_of
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.maths.uncertainty.quantity import significant

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
    where, note = say("First and last point, scale readings / mm"), say("A CSV to fill in comes with this page.")
    heads = (Column(say("Measurement")), say("Set-up"), where, Column(say("Repeats")))
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
    what = _what(result, plan)
    told = say("Measure next: {what} First and last point in scale readings: {ends}.", what=what, ends=ends)
    odds = [parting.after for parting in plan.partings]
    reached = [each for each in odds if each >= _PARTED]
    if odds and not reached and not plan.shown:
        return say(
            "No set-up that was tried is expected to part what this recording cannot: odds of {odds} : 1 at best for the "
            "true one. Another artefact is needed for that.",
            odds=rounded(max(odds)),
        )
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
        "{count:capital} more of the {artefact:small}, measured {times} each, added to this recording.", count=count,
        artefact=result.diagnosis.before.artefact.title, times=times,
    )  # fmt: skip
    if plan.reached:
        return what
    return say("{what} They are the best that was found, but do not reach everything: see below.", what=what)


def _partings(plan: NextPlan) -> Table | None:
    rows = (
        (together(map(effect_title, one.effects)), odds_words(one.before), say("{odds} : 1", odds=rounded(one.after)))
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
    named = ((explanation(one), probability(one.probability)) for one in rivals[:_SHOWN])
    heads = (Column(say("{what}: {probability}", what=what, probability=chance)) for what, chance in named)
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
        more,
        one=say("One further explanation is in results.json."),
        many=say("{count} further explanations are in results.json.", count=more),
    )
    follows = table(
        say("What follows from each explanation that remains"),
        (say("Quantity"), *heads, Column(say("Averaged")), say("Unit")),
        _cost_rows(result) if rivals else (),  # none as against a simulation, where no effect of the job takes part
        note,
        messages.after(left if more else NOTHING, share),
    )
    return section(say("What the choice of an explanation costs"), follows)


def explanation(rival: Rival) -> Text:
    words = (*wording.titles(rival.effects), *rival.functions)
    return messages.commas(words) if words else say("nothing missing")


def _cost_rows(result: JobDiagnosis) -> Iterator[tuple[Text, ...]]:
    remaining, costs = result.diagnosis.remaining, result.costs
    for effect, parameters in remaining.averaged.items():
        for name, quantity in parameters.items():
            each = (with_uncertainty(rival.named[effect][name]) for rival in remaining.rivals[:_SHOWN])
            yield (wording.parameter_title(effect, name), *each, with_uncertainty(quantity), quantity.unit)
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
    blindness = say("But this recording could not have shown: {effects}.", effects=messages.listed(words))
    return blindness if words else NOTHING


def unseen_section(result: JobDiagnosis) -> Section:
    """The smallest amplitude of each common effect that the recording would have shown, and rarer ones that it would not."""
    rows = [
        (row.title, _found(row, row.detected), _found(row, row.named), _size(row.allowed, row.unit), _why(row))
        for row in result.unseen
        if row.common or not row.shown
    ]
    heads = (
        say("Error"), Column(say("Found from")), Column(say("Named from")), Column(say("Considered up to")),
        say("Why, and for which periods"),
    )  # fmt: skip
    beside = without_power(result) if rows else NOTHING
    smallest = table(say("Smallest errors that would have shown"), heads, rows, say(
        "With the noise that was found and beside what was asserted, an error of this size would have been found, or "
        "called by its right name, in {power:.0f} of 100 such recordings; “not found” where even the largest error "
        "considered would not. In closed form: mostly within 15 %, a name with a close rival within a factor of two.",
        power=100 * POWER,
    ))  # fmt: skip
    warned = Paragraph(beside, tone="warning") if beside else None
    return section(say("What would not have been seen"), warned, smallest)


def _found(row: SmallestEffect, size: float | None) -> Text:
    return say("not found") if size is None or size > row.allowed else _size(size, row.unit)


def _size(value: float, unit: Unit) -> Text:
    return say("{value}\u00a0{unit}", value=number(value, ".2g" if value < 100 else ".0f"), unit=unit)


def _why(row: SmallestEffect) -> Text:
    takers, beyond, periods = messages.listed([*map(_taker, row.taken_up)]), row.detected, row.periods
    mostly = say("mostly taken up by {effects}", effects=takers)
    far = beyond is not None and row.allowed < beyond < 100 * row.allowed
    return messages.commas(holding(
        (takers, say("taken up by {effects}", effects=takers) if row.share < 1e-3 else mostly),
        (not takers and row.share == 0, say("moves nothing that is observed here")),
        (far, say("it would take {size}", size=_size(beyond or 0.0, row.unit))),
        (periods, NOTHING if periods is None else _periods(periods, row)),
    )) or messages.DASH  # fmt: skip


def _taker(name: str) -> Text:
    effect = every().get(name)
    own = {PLACES: say("the place of the artefact"), ARTEFACT: say("the size of the artefact")}
    return own.get(name, Verbatim(name) if effect is None else say("{title:small}", title=effect.title))


def _periods(periods: PeriodRange, row: SmallestEffect) -> Text:
    of = say("of the travel") if periods.unit == "1" else periods.unit
    every_one = say("{low:.3g} to {high:.3g}\u00a0{unit}", low=periods.low, high=periods.high, unit=of)
    if periods.worst is None:
        return say("these positions tell apart none of {every_one}", every_one=every_one)
    worst = say("{every_one}, at worst {size}", every_one=every_one, size=_size(periods.worst, row.unit))
    if not periods.unresolved:
        return worst
    ranges = [
        number(low, ".3g") if low == high else say("{low:.3g} to {high:.3g}", low=low, high=high)
        for low, high in periods.unresolved
    ]
    if len(ranges) > _RANGES:
        ranges = [*ranges[:_RANGES], say("{more} more ranges", more=len(ranges) - _RANGES)]
    return say("{worst}; not resolved: {ranges}\u00a0{unit}", worst=worst, ranges=messages.listed(ranges), unit=of)


_READINGS = frozenset(f"{a}_mm" for a in AXES)


def place_words(place: Place) -> Text:
    """A place in words: ``along Y, depending on X, most from 300 to 600 mm``."""
    what, region = in_words(place.covariate), region_words(place.covariate, *place.region)
    if place.covariate not in _READINGS:
        what = say("the {what}", what=what)
    if place.along is None:
        return say("depending on {what}, most {region}", what=what, region=region)
    axis = Verbatim(place.along.upper())
    if place.scale:
        return say("in the scale of {axis}, depending on {what}, most {region}", axis=axis, what=what, region=region)
    return say("along {axis}, depending on {what}, most {region}", axis=axis, what=what, region=region)


def region_words(covariate: str, low: float, high: float) -> Text:
    """A region of a covariate: ``from 300 to 600 mm``; of one value, ``at 300 mm``."""
    own = unit_of(covariate)
    space = Verbatim("\u00a0" if own else "")
    one, other = (signed(value, ".0f" if abs(value) >= 100 else ".3g") for value in (low, high))
    if one == other:
        return say("at {value}{space}{unit}", value=one, space=space, unit=own)
    return say("from {low} to {high}{space}{unit}", low=one, high=other, space=space, unit=own)


def by_columns(d: Diagnosis) -> Text:
    """What the effects found go by, where no function of it was looked for, such as of two directions of travel."""
    found = (wording.effect_of(item.effect, d.after.effects) for item in d.effects)
    columns = dict.fromkeys(column for effect in found if effect is not None for column in effect.columns)
    return say("It depends on the {what}.", what=commas(in_words(column) for column in columns)) if columns else NOTHING


def where_section(d: Diagnosis) -> Section:
    """Pictures and table of where the residuals lie; without a mismatch, nothing."""
    if d.agrees:
        return section(say("Where it is"))
    further = (_profile(d.where[0]), _table(d.where)) if d.where else ()
    return section(say("Where it is"), Paragraph(where_sentence(d)), field_picture(d), *further)


def where_sentence(d: Diagnosis) -> Text:
    if not d.where:
        spread = say("No reading, column or direction by itself carries the evidence: it is spread over the recording.")
        return by_columns(d) or spread
    first = d.where[0]
    told = say(
        "The evidence lies {place}: up to {size} µm.", place=place_words(first), size=significant(first.amplitude_um)
    )
    others = messages.alternatives(first.also)
    return messages.after(told, say("It could as well be read as {others}.", others=others) if others else NOTHING)


def field_picture(d: Diagnosis) -> Plot | None:
    """The residual field before and after what was found; before alone, where nothing was."""
    field = residual_field(d.before, d.after)
    if field is None:
        return None
    expanded = field.expanded(d.noise.coordinate)
    beyond = [int(np.sum(np.linalg.norm(values, axis=1) > expanded)) for values in (field.before, field.after)]
    titles: tuple[Text, Text] | tuple[Text] = (say("Before: what the model leaves"), say("After: with what was found"))
    if not d.effects:
        titles = (titles[0],)
    what = say("Half of each length's residual at either end") if field.lengths else say("Residual of each point")
    told = say(
        "{what}, as far as it was observed, over the scale readings; arrows are longer than their U, shaded is where the "
        "evidence lies.",
        what=what,
    )
    count = say("{before} of {all} vectors are longer than their U before", before=beyond[0], all=len(expanded))
    if d.effects:
        count = say("{count} and {after} after", count=count, after=beyond[1])
    along = next((place for place in d.where[:1] if place.covariate in _READINGS), None)
    shade = None if along is None else (along.covariate[0], *along.region)
    alternative = say("{count}.", count=count)
    return residual_field_plot(field, expanded, titles=titles, shade=shade, caption=told, alternative=alternative)


def _profile(place: Place) -> Plot:
    (x, y, u), along, k = place.curve, Verbatim((place.along or "").upper()), number(place.k, ".2f")
    label = say("Error along {along} / µm", along=along) if place.along else say("Error / µm")
    if place.scale:
        label = say("Scale of {along}, at the end of its range / µm", along=along)
    caption = say(
        "{what:capital}, with U (k = {k}), as what the model leaves shows it; below, each observation over the range of "
        "its points. What the model itself would absorb is no part of it.", what=place.what, k=k,
    )  # fmt: skip
    region = region_words(place.covariate, *place.region)
    shown = say("A function of up to {size:.3g} µm, largest {region}.", size=place.amplitude_um, region=region)
    return profile_plot((x, y, place.k * u), place.data, place.region, x_label=labelled(place.covariate), y_label=label,
                        caption=caption, alternative=shown)  # fmt: skip


def _table(where: tuple[Place, ...]) -> Table | None:
    rows = (
        (place.what, say("{where:capital}", where=region_words(place.covariate, *place.region)),
         significant(place.amplitude_um), number(place.p_value, ".1g"))
        for place in where
    )  # fmt: skip
    heads = (say("What it depends on"), say("Where"), Column(say("Up to"), unit("µm")), Column(say("p")))
    return table(say("What the residuals depend on"), heads, rows, say(
        "p is corrected for having looked everywhere, and of a further place holds beside those above it. A region is where "
        "the function exceeds half its largest value and its band does not hold zero, or between which values it jumps."
    ))  # fmt: skip
