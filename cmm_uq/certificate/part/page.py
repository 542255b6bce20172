"""The page of a part: whether it conforms, its characteristics with their uncertainty, how it was probed, and its form."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.analysis.conformity.decision import NOT_BY_PRIOR_ALONE, Outcome
from cmm_uq.analysis.parts.budget import ASSOCIATIONS, KINDS
from cmm_uq.analysis.parts.evaluation import characteristics_of
from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.analysis.parts.result import deviations_of
from cmm_uq.base import messages
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, commas, holding, number, plural, say
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate import certificate, document as doc
from cmm_uq.certificate.clauses import PART_TITLE as TITLE, STATEMENTS, not_stated, of_a_part
from cmm_uq.certificate.document import Column, Paragraph, Section, Table, columns, section, table
from cmm_uq.certificate.part import budget_section as causes, method
from cmm_uq.certificate.part.figures import CharacteristicFigures, critical, figures_of
from cmm_uq.certificate.part.measurement import PartMeasurement
from cmm_uq.certificate.part.pictures import errors_picture, form_picture, part_picture
from cmm_uq.certificate.part.plots import Margin, correlation_section, margin_plots
from cmm_uq.certificate.wording import OUTCOME_WORDS, TOO_UNCERTAIN, probability
from cmm_uq.jobs.tables.conformity import needs_prior
from cmm_uq.jobs.verdicts import standing_of
from cmm_uq.maths.uncertainty.quantity import nominal


def overview_of(found: PartMeasurement) -> doc.Overview:
    one = critical(found)
    facts = doc.facts(
        (say("Part"), part_words(found)),
        (say("Decision rule"), found.judged_by if any(found.judged) else NOTHING),
        (say("Least margin") if found.nearest is not None else say("Tightest"), _least(one)),
        (say("Probability"), _together(found)),
        (say("Uncertainty"), causes.largest_words(one) if found.budget.causes and one.stated.u else NOTHING),
        (say("To reduce it"), causes.best_words(one) if len(found.ways) > 1 else NOTHING),
        (say("Not seen"), causes.unseen_words(found) if found.unseen else NOTHING),
        (say("Not covered"), _not_covered(found)),
    )
    return doc.Overview(
        verdict_words(
            found.outcomes,
            found.outcome,
            measured=found.measured is not None,
            withheld=found.withheld,
            none_accepted=any(one and one.accepted is None for one in found.judged),
        ),
        "unknown" if found.outcome is None else standing_of(found.outcome),
        facts.rows,
    )


def verdict_words(
    outcomes: Sequence[Outcome],
    outcome: str | None,
    *,
    measured: bool,
    withheld: Sequence[Text] = (),
    none_accepted: bool = False,
) -> Text:
    """Whether the part conforms.

    ``outcomes``: of its characteristics; ``outcome``: of the whole. ``measured``: whether anything was. ``none_accepted``:
    whether the uncertainty of one leaves no value to be accepted.
    """
    if not outcomes:
        planned = say("Uncertainty of a planned measurement: nothing was measured")
        return say("Measured: no limits to decide on") if measured else planned
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
    if outcome == "incomplete":
        return say("Incomplete: not all of the drawing was measured")
    if withheld:
        return withheld[0]
    if none_accepted:
        return TOO_UNCERTAIN
    open_ = sum(one == "undecided" for one in outcomes)
    return plural(
        open_,
        one=say("Undecided: one of {all} characteristics is too near to a limit", all=all_),
        many=say("Undecided: {count} of {all} characteristics are too near to a limit", count=open_, all=all_),
    )


def part_words(found: PartMeasurement) -> Text:
    part = found.job.facts.part
    drawing = say("drawing {number}", number=Verbatim(part.drawing)) if part.drawing else NOTHING
    serial = say("serial number {number}", number=Verbatim(part.serial)) if part.serial else NOTHING
    return commas(text for text in (Verbatim(part.name), drawing, serial) if text)


def _least(one: CharacteristicFigures) -> Text:
    """The characteristic nearest to a limit, or that takes most of its tolerance, with its figures."""
    if not one.allowed:
        return NOTHING
    told = say("{what}: {result}; allowed {allowed}", what=one.titled, result=one.result, allowed=one.allowed)
    if one.found.nearest is not None:
        margin = float(one.found.margins[one.place])
        times = messages.number(abs(margin), ".1f")
        return (say("{told}, {times} u inside of the limit", told=told, times=times) if margin >= 0 else
                say("{told}, {times} u outside of the limit", told=told, times=times))  # fmt: skip
    share = messages.signed(200 * one.expanded / one.width, ".0f") if one.width > 0 else NOTHING
    return say("{told}; the 95 % interval takes {share} % of it", told=told, share=share) if share else told


def _together(found: PartMeasurement) -> Text:
    limited = sum(one is not None for one in found.judged)
    if found.together is None or limited < 2:
        return NOTHING
    return say("{chance} that all {count} limits are kept", chance=probability(found.together), count=limited)


def _not_covered(found: PartMeasurement) -> Text:
    left, free = found.job.facts.part.not_measured, [one.titled for one in figures_of(found) if one.judged is None]
    return messages.sentences(holding(
        (left, say("Not measured: {names}.", names=commas(messages.names(left)))),
        (0 < len(free) < len(found.judged), say("Without limits: {names}.", names=messages.semicolons(free))),
    ))  # fmt: skip


PLANNED = say("Measurement uncertainty")


def part_document(found: PartMeasurement) -> doc.Document:
    facts, measured = found.job.facts, found.measured is not None
    lacking = [one for one in of_a_part(facts, found.measured) if one.status == "missing"]
    sections = (
        results_section(found), conformity_section(found), part_section(found),
        errors_section(found), causes.budget_section(found), causes.priors_section(found),
        causes.unseen_section(found),
        causes.ways_section(found), method.methods_section(found.methods), correlation_section(found),
        method.machine_section(found), method.method_section(found), method.not_covered_section(found),
    )  # fmt: skip
    date = messages.day(facts.job.date)
    came = say("measured on {date}", date=date) if measured else say("planned for {date}", date=date)
    return certificate.formal_document(
        facts.job, facts.laboratory, found.job.inputs, draft=bool(lacking), authorised=measured,
        title=TITLE if measured else PLANNED, subject=say("{part}, {came}", part=part_words(found), came=came),
        particulars=_particulars(found), warnings=(*found.warnings, *not_stated(lacking)),
        sections=tuple(section for section in sections if section.blocks),
        produced_by=say("{program}, seed {seed}", program=method.program_words(), seed=found.seed), end=say("End of report"),
        overview=overview_of(found), general=(STATEMENTS[0], say(
            "This report shall not be reproduced except in full without the written approval of the issuing laboratory.")),
    )  # fmt: skip


def _particulars(found: PartMeasurement) -> tuple[doc.Facts, ...]:
    facts = found.job.facts
    job, part = facts.job, facts.part
    expansion = say("{cte:g} × 10⁻⁶ /K", cte=part.cte_per_k * 1e6) if part.cte_per_k else NOTHING
    if expansion and part.u_cte_per_k:
        expansion = say("{expansion}, u = {u:g} × 10⁻⁶ /K", expansion=expansion, u=part.u_cte_per_k * 1e6)
    return certificate.grouped(
        certificate.identified(job, facts.laboratory, job.origin, say("Report number")),
        ((say("Part"), part.name), (say("Drawing"), part.drawing), (say("Serial number"), part.serial),
         (say("Owner"), part.owner), (say("Material"), part.material), (say("Thermal expansion"), expansion),
         (say("Place"), job.place)),
        method.certificate_rows(found.standing),
        (*certificate.performed(job), (say("Conditions"), job.conditions)),
    )  # fmt: skip


def results_section(found: PartMeasurement) -> Section:
    """Every characteristic with its value, if anything was measured, and its uncertainty."""
    measured, reported = found.measured is not None, found.job.reported is not None
    tables = (_table(part, measured=measured, reported=reported) for part in _parts(figures_of(found)))
    return section(say("Results"), None if measured else Paragraph(say(
        "Nothing was measured: what follows is how surely this measurement, done as it is planned, will know the part."
    )), *tables)  # fmt: skip


def _parts(every: Sequence[CharacteristicFigures]) -> list[list[CharacteristicFigures]]:
    """Lengths and then angles, those that there are."""
    return list(filter(None, ([one for one in every if one.angular == angular] for angular in (False, True))))


def _table(every: Sequence[CharacteristicFigures], *, measured: bool, reported: bool) -> Table | None:
    scale = every[0].scale
    heads = (
        Column(say("No.")), say("Characteristic"), *((Column(say("Value"), scale.value),) if measured else ()),
        Column(say("U"), scale.small), Column(say("k")),
        Column(say("95 % interval"), scale.value if measured else scale.small, numeric=False),
        *(() if measured else (Column(say("Mean error"), scale.small),)),
    )  # fmt: skip
    rows = (
        (one.number, one.beside, *(() if one.stated.value is None else (one.at(one.stated.value),)),
         *one.with_factor, one.interval, *(() if measured else (one.error(one.stated.error),)))
        for one in every
    )  # fmt: skip
    notes = holding(
        (True, say(
            "95 % interval: the shortest that holds 95 % of the virtual measurements. U = k · u is half of it, u the standard "
            "uncertainty; the value lies in the middle only where errors to both sides are alike.")),
        (any(one.one_sided for one in every) and reported, say(
            "A form, orientation or location that another program states is within U of the true one at least as often, "
            "however the part deviates; its interval is never below zero.")),
        (any(one.one_sided for one in every) and not reported, say(
            "A measured form, orientation or location has one side and is stated by its interval, which is never below "
            "zero and as likely to hold a small width as a large one (Feldman and Cousins, 1998); its value is the median.")),
        (True, say("The interval is that of the true value less the indicated one.") if every[0].stated.value is None else
         say("All other values are corrected by the mean of their errors.") if any(one.one_sided for one in every) else
         say("The values are corrected by the mean of their errors.")),
    )  # fmt: skip
    return table(say("Angles") if every[0].angular else say("Lengths, forms and places"), heads, rows, *notes)


def conformity_section(found: PartMeasurement) -> Section:
    """Limits, what the rule accepts, decisions, and their picture; nothing where the drawing has no limits."""
    limited = [one for one in figures_of(found) if one.judged is not None]
    if not limited:
        return section(say("Conformity"))
    nominal, measured = characteristics_of(found.plan, found.plan.points).tolist(), found.measured is not None
    return section(
        say("Conformity with the drawing"),
        Paragraph(_rule(found, limited)),
        Paragraph(NOT_BY_PRIOR_ALONE) if needs_prior(found.job.facts.decision.rule) else None,
        *margin_plots([_margin(one) for one in limited if measured or one.width > 0]),
        *(_decisions(part, nominal, measured=measured) for part in _parts(limited)),
    )


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
    shares = [
        one.judged.share_of_prior for one in every if one.judged is not None and one.judged.share_of_prior is not None
    ]
    notes = holding(
        (True, say("Accepted: values that the rule accepts with this uncertainty.")),
        (measured and not shares,
         say("P: probability that the true value is within its limits, by the virtual measurements.")),
        (bool(shares), say(
            "P: probability that the true value is within its limits, by the virtual measurements and prior knowledge of such "
            "parts, which has up to {share:.1f} % of the weight.", share=100 * max(shares, default=0.0))),
        (any(one.judged is not None and one.judged.accepted is None for one in every),
         say("None: the uncertainty is too large for any value to be accepted.")),
    )  # fmt: skip
    if measured:
        caption = say("Decisions on angles") if every[0].angular else say("Decisions")
    else:
        caption = say("Angles that the rule will accept") if every[0].angular else say("What the rule will accept")
    return table(caption, heads, (_decision(one, nominal[one.place], measured=measured) for one in every), *notes)


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
        table(say("Features"), heads, rows, note), _lies(found),
    )  # fmt: skip


def _lies(found: PartMeasurement) -> doc.Facts:
    facts, varied = found.job.facts, len(found.given.poses)
    placed = say("origin at {origin} mm, turned by {angles}° about x, y, z of the machine",
                 origin=_three(found.origin_mm), angles=_three(facts.placing.rotation_deg))  # fmt: skip
    if varied > 1:
        placed = say("{placed}; drawn in {count} places about it", placed=placed, count=varied)
    datums = commas(messages.names(facts.alignment.datums))
    styli = messages.semicolons(
        say("{name}: tip of {diameter} mm, offset {offset} mm", name=Verbatim(one.name), diameter=nominal(one.diameter_mm),
            offset=_three(one.offset_mm.tolist()))
        for one in found.plan.styli
    )  # fmt: skip
    return doc.facts(
        (say("Place in the machine"), placed),
        (say("Alignment"), say("best fit of all points") if facts.alignment.best_fit else datums),
        (say("Styli"), styli),
        (say("Repeats of each point"), number(facts.probing.repeats) if facts.probing.repeats > 1 else NOTHING),
    )


def _three(values: Sequence[float]) -> Text:
    return messages.in_a_row(nominal(value) for value in values)


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
            rows.append((number(i + 1), Verbatim(feature.name), *(messages.signed(each, ".1f") for each in ends)))
    note = say("Noise of the machine and its errors are in these distances too; no form is stated here.")
    heads = columns((Column(say("No.")), say("Feature"), *figures))
    return Table(say("Distances of the points from their features"), heads, tuple(rows), (note,))
