"""The results of a part, what the drawing's limits make of them, and the part itself as it is probed, with errors and form."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.analysis.parts.budget import ASSOCIATIONS, KINDS
from cmm_uq.analysis.parts.evaluation import characteristics_of
from cmm_uq.analysis.parts.plan import Plan, Stylus
from cmm_uq.analysis.parts.result import deviations_of
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, commas, in_a_row, names, number, say, semicolons, signed
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Column, Facts, Paragraph, Section, Table, columns, section, table
from cmm_uq.certificate.part.figures import CharacteristicFigures, figures_of
from cmm_uq.certificate.part.measurement import PartMeasurement
from cmm_uq.certificate.part.pictures import errors_picture, form_picture, part_picture
from cmm_uq.certificate.part.plots import Margin, correlation_plot, margin_plots
from cmm_uq.certificate.wording import OUTCOME_WORDS, probability
from cmm_uq.maths.uncertainty.quantity import nominal

FEW = 8  # characteristics up to which their correlations are a table


def results_section(found: PartMeasurement) -> Section:
    """Every characteristic with its value, if anything was measured, and its uncertainty."""
    measured = found.measured is not None
    tables = (_table(part, measured=measured) for part in _parts(figures_of(found)))
    return section(say("Results"), None if measured else Paragraph(_UNMEASURED), *tables)


def _parts(every: Sequence[CharacteristicFigures]) -> list[list[CharacteristicFigures]]:
    """Lengths and then angles, those that there are."""
    parts = ([one for one in every if one.angular == angular] for angular in (False, True))
    return [part for part in parts if part]


_UNMEASURED = say(
    "Nothing was measured: what follows is how surely this measurement, done as it is planned, will know the part."
)


def _table(every: Sequence[CharacteristicFigures], *, measured: bool) -> Table | None:
    scale = every[0].scale
    heads = (
        Column(say("No.")), say("Characteristic"), *((Column(say("Value"), scale.value),) if measured else ()),
        Column(say("U"), scale.small), Column(say("k")),
        Column(say("95 % interval"), scale.value if measured else scale.small, numeric=False),
        *(() if measured else (Column(say("Mean error"), scale.small),)),
    )  # fmt: skip
    rows = (
        (one.number, one.beside, *(() if one.stated.value is None else (one.at(one.stated.value),)),
         *one.with_factor(one.stated.k), one.interval, *(() if measured else (one.error(one.stated.error),)))
        for one in every
    )  # fmt: skip
    notes = (
        (True, say(
            "95 % interval: the shortest that holds 95 % of the virtual measurements. U = k · u is half of it, u the standard "
            "uncertainty; the value lies in the middle only where errors to both sides are alike.")),
        (any(one.one_sided for one in every), say(
            "A measured form, orientation or location has one side and is stated by its interval, which is never below "
            "zero and as likely to hold a small width as a large one (Feldman and Cousins, 1998); its value is the median.")),
        (True, say("All other values are stated less the mean of their errors.") if every[0].stated.value is not None else
         say("The interval is that of the true value less the indicated one.")),
    )  # fmt: skip
    caption = say("Angles") if every[0].angular else say("Lengths, forms and places")
    return table(caption, heads, rows, *(text for holds, text in notes if holds))


def conformity_section(found: PartMeasurement) -> Section:
    """Limits, what the rule accepts, decisions, and their picture; nothing where the drawing has no limits."""
    limited = [one for one in figures_of(found) if one.judged is not None]
    if not limited:
        return section(say("Conformity"))
    nominal, measured = characteristics_of(found.plan, found.plan.points).tolist(), found.measured is not None
    return section(
        say("Conformity with the drawing"), Paragraph(_rule(found, limited)),
        *margin_plots([_margin(one) for one in limited if measured or one.width > 0]),
        *(_decisions(part, nominal, measured=measured) for part in _parts(limited)),
    )  # fmt: skip


def _rule(found: PartMeasurement, limited: Sequence[CharacteristicFigures]) -> Text:
    told = say("Decision rule: {rule}.", rule=found.judged_by)
    if found.together is None or len(limited) < 2:
        return told
    return say(
        "{rule} Probability that all {count} limits are kept at once, with what the characteristics have in common: {chance}.",
        rule=told, count=len(limited), chance=probability(found.together),
    )  # fmt: skip


def _decisions(every: Sequence[CharacteristicFigures], nominal: Sequence[float], *, measured: bool) -> Table | None:
    value = every[0].scale.value
    heads = (
        Column(say("No.")), say("Characteristic"), Column(say("Nominal"), value), Column(say("Lower limit"), value),
        Column(say("Upper limit"), value), Column(say("Accepted"), value, numeric=False),
        *((say("Decision"), say("P")) if measured else ()),
    )  # fmt: skip
    notes = (
        (True, say("Accepted: values that the rule accepts with this uncertainty.")),
        (measured, say("P: probability that the true value is within its limits, by the virtual measurements.")),
        (any(one.judged is not None and one.judged.accepted is None for one in every),
         say("None: the uncertainty is too large for any value to be accepted.")),
    )  # fmt: skip
    if measured:
        caption = say("Decisions on angles") if every[0].angular else say("Decisions")
    else:
        caption = say("Angles that the rule will accept") if every[0].angular else say("What the rule will accept")
    rows = (_decision(one, nominal[one.place], measured=measured) for one in every)
    return table(caption, heads, rows, *(text for holds, text in notes if holds))


def _decision(one: CharacteristicFigures, nominal: float, *, measured: bool) -> tuple[Text, ...]:
    judged, (low, high), decided = one.judged, one.limits, tuple[Text, ...]()
    if measured and judged is not None:
        decided = (
            DASH if judged.outcome is None else OUTCOME_WORDS[judged.outcome],
            DASH if judged.probability is None else probability(judged.probability),
        )
    return (one.number, one.beside, DASH if one.zone else one.limit(nominal), one.limit(low), one.limit(high),
            one.accepted_of(None if judged is None else judged.accepted), *decided)  # fmt: skip


def _margin(one: CharacteristicFigures) -> Margin:
    judged, (low, high) = one.judged, one.limits
    low = 0.0 if one.zone else low
    accepted, outcome = (None, None) if judged is None else (judged.accepted, judged.outcome)
    if (value := one.stated.value) is None:
        middle = 0.5 * ((low or 0.0) + (high or 0.0))
        return Margin(one.titled, middle, (middle - one.expanded, middle + one.expanded), low, high, None, accepted)
    return Margin(one.titled, value, one.stated.interval, low, high, outcome, accepted)


def correlation_section(found: PartMeasurement) -> Section:
    """What characteristics have in common: a table of few, a picture of many; nothing of one."""
    every, title = figures_of(found), say("Correlations")
    if len(every) < 2:
        return section(title)
    told = Paragraph(
        say("Errors that several characteristics have in common make them correlated; what is computed from several of them "
            "needs this. results.json has all figures."), "note",
    )  # fmt: skip
    if len(every) > FEW:
        return section(title, told, correlation_plot([one.number for one in every], found.correlation))
    rows = (
        (one.number, one.beside, *(_r(float(found.correlation[one.place, j]), one.place, j) for j in range(len(every))))
        for one in every
    )
    numbers = (Column(say("No. {number}", number=one.number)) for one in every)
    heads: tuple[Text | Column, ...] = (Column(say("No.")), say("Characteristic"), *numbers)
    return section(title, told, table(say("Correlations between the characteristics"), heads, rows))


def _r(value: float, row: int, column: int) -> Text:
    """Of a matrix that is the same below and above its diagonal, the lower half."""
    if column > row:
        return DASH
    return number(1) if column == row else signed(round(value, 2) + 0.0, ".2f")


_SHORT = 8  # letters up to which features are lettered in pictures by their names, else by their numbers


def lettered_names(plan: Plan) -> list[Text]:
    """What features are called in pictures: their names where all are short, else their numbers."""
    if all(len(feature.name) <= _SHORT for feature in plan.features):
        return [Verbatim(feature.name) for feature in plan.features]
    return [number(i + 1) for i in range(len(plan.features))]


def part_section(found: PartMeasurement) -> Section:
    """What is probed, with which styli, and where the part lies."""
    plan, several = found.plan, len(found.plan.styli) > 1
    heads: tuple[Text | Column, ...] = (
        Column(say("No.")), say("Feature"), say("Kind"), Column(say("Points")), *((say("Stylus"),) if several else ()),
        say("Association"),
    )  # fmt: skip
    rows = (
        (number(i + 1), Verbatim(feature.name), KINDS[feature.kind], number(len(feature.points)),
         *((Verbatim(feature.stylus),) if several else ()),
         ASSOCIATIONS[feature.association] if len(feature.points) > 1 else DASH)
        for i, feature in enumerate(plan.features)
    )  # fmt: skip
    note = say("Association: how a feature is made of its points, where a characteristic says nothing else.")
    return section(
        say("The part as it is probed"), part_picture(plan, found.given.poses[0], lettered_names(plan)),
        table(say("Features"), heads, rows, note), Facts(tuple(row for row in _lies(found) if row[1])),
    )  # fmt: skip


def _lies(found: PartMeasurement) -> list[tuple[Text, Text]]:
    facts, given = found.job.facts, found.job.facts.placing
    varied = len(found.given.poses)
    placed = say("origin at {origin} mm, turned by {angles}° about x, y, z of the machine",
                 origin=_three(found.origin_mm), angles=_three(given.rotation_deg))  # fmt: skip
    if varied > 1:
        placed = say("{placed}; drawn in {count} places about it", placed=placed, count=varied)
    datums = commas(names(facts.alignment.datums))
    alignment = say("best fit of all points") if facts.alignment.best_fit else datums
    repeats = facts.probing.repeats
    return [
        (say("Place in the machine"), placed),
        (say("Alignment"), alignment),
        (say("Styli"), semicolons(_stylus(one) for one in found.plan.styli)),
        (say("Repeats of each point"), number(repeats) if repeats > 1 else NOTHING),
    ]


def _stylus(one: Stylus) -> Text:
    return say("{name}: tip of {diameter} mm, offset {offset} mm", name=Verbatim(one.name), diameter=nominal(one.diameter_mm),
               offset=_three(one.offset_mm.tolist()))  # fmt: skip


def _three(values: Sequence[float]) -> Text:
    return in_a_row(nominal(value) for value in values)


def errors_section(found: PartMeasurement) -> Section:
    """The errors of the points, and the form that was measured."""
    title, errors = say("Errors of the points"), errors_picture(found.plan, found.displaced)
    deviations = None if found.job.measured is None else deviations_of(found.plan, found.job.measured)
    if deviations is not None and np.isfinite(deviations).any():
        return section(title, errors, form_picture(found.plan, deviations), _forms(found.plan, deviations))
    none = Paragraph(say("No feature has more points than determine it: no form was measured."), "note")
    return section(title, errors, none if found.measured is not None else None)


def _forms(plan: Plan, deviations: Floats) -> Table:
    """Range of the measured deviations of each feature that has some."""
    figures = (Column(head, unit("µm")) for head in (say("From"), say("To"), say("Root mean square")))
    rows = []
    for i, feature in enumerate(plan.features):
        own = deviations[plan.rows[feature.name]] / MICROMETRE
        if np.isfinite(own).all():
            ends = (float(own.min()), float(own.max()), float(np.sqrt(np.mean(own**2))))
            rows.append((number(i + 1), Verbatim(feature.name), *(signed(each, ".1f") for each in ends)))
    note = say("Noise of the machine and its errors are in these distances too; no form is stated here.")
    heads = columns((Column(say("No.")), say("Feature"), *figures))
    return Table(say("Distances of the points from their features"), heads, tuple(rows), (note,))
