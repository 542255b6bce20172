"""The results of a part: every characteristic with its uncertainty, and what the drawing's limits make of it."""

from __future__ import annotations

from collections.abc import Sequence

from cmm_uq.analysis.parts.evaluation import characteristics_of
from cmm_uq.base.messages import DASH, Text, number, say, signed
from cmm_uq.certificate.document import Block, Column, Paragraph, Section, Table
from cmm_uq.certificate.part.figures import CharacteristicFigures, figures_of
from cmm_uq.certificate.part.measurement import PartMeasurement
from cmm_uq.certificate.part.plots import Margin, correlation_plot, margin_plots
from cmm_uq.certificate.wording import OUTCOME_WORDS, probability

FEW = 8  # characteristics up to which their correlations are a table


def results_section(found: PartMeasurement) -> Section:
    """Every characteristic with its value, if anything was measured, and its uncertainty."""
    every = figures_of(found)
    parts = [
        part for part in ([one for one in every if not one.angular], [one for one in every if one.angular]) if part
    ]
    tables = [_table(part, measured=found.measured is not None) for part in parts]
    return Section(say("Results"), (*([] if found.measured is not None else [Paragraph(_UNMEASURED)]), *tables))


_UNMEASURED = say(
    "Nothing was measured: what follows is how surely this measurement, done as it is planned, will know the part."
)


def _table(every: Sequence[CharacteristicFigures], *, measured: bool) -> Table:
    scale = every[0].scale
    columns = (
        Column(say("No.")), Column(say("Characteristic"), numeric=False),
        *((Column(say("Value"), scale.value),) if measured else ()),
        Column(say("U"), scale.small), Column(say("k")),
        Column(say("95 % interval"), scale.value if measured else scale.small, numeric=False),
        *(() if measured else (Column(say("Mean error"), scale.small),)),
    )  # fmt: skip
    rows = tuple(_row(one, measured=measured) for one in every)
    return Table(say("Angles") if every[0].angular else say("Lengths, forms and places"), columns, rows, _notes(every))


def _row(one: CharacteristicFigures, *, measured: bool) -> tuple[Text, ...]:
    value = () if one.stated.value is None else (one.at(one.stated.value),)
    error = () if measured else (one.error(one.stated.error),)
    return (
        one.number,
        one.beside,
        *value,
        *one.with_factor(one.stated.k),
        one.interval,
        *error,
    )


def _notes(every: Sequence[CharacteristicFigures]) -> tuple[Text, ...]:
    notes: list[Text] = [
        say(
            "95 % interval: the shortest that holds 95 % of the virtual measurements. U = k · u is half of it, u the standard "
            "uncertainty; the value lies in the middle only where errors to both sides are alike."
        )
    ]
    if any(one.one_sided for one in every):
        notes.append(
            say(
                "A measured form, orientation or location has one side and is stated by its interval, which is never below "
                "zero and as likely to hold a small width as a large one (Feldman and Cousins, 1998); its value is the median."
            )
        )
    if every[0].stated.value is None:
        notes.append(say("The interval is that of the true value less the indicated one."))
        return tuple(notes)
    notes.append(say("All other values are stated less the mean of their errors."))
    return tuple(notes)


def conformity_section(found: PartMeasurement) -> Section:
    """Limits, what the rule accepts, decisions, and their picture; nothing where the drawing has no limits."""
    limited = [one for one in figures_of(found) if one.judged is not None]
    if not limited:
        return Section(say("Conformity"), ())
    blocks: list[Block] = [Paragraph(_rule(found, limited))]
    blocks += margin_plots([_margin(one) for one in limited if found.measured is not None or one.width > 0])
    nominal = characteristics_of(found.plan, found.plan.points)
    parts = [
        part for part in ([one for one in limited if not one.angular], [one for one in limited if one.angular]) if part
    ]
    blocks += [_decisions(part, nominal.tolist(), measured=found.measured is not None) for part in parts]
    return Section(say("Conformity with the drawing"), tuple(blocks))


def _rule(found: PartMeasurement, limited: Sequence[CharacteristicFigures]) -> Text:
    told = say("Decision rule: {rule}.", rule=found.judged_by)
    if found.together is None or len(limited) < 2:
        return told
    return say(
        "{rule} Probability that all {count} limits are kept at once, with what the characteristics have in common: {chance}.",
        rule=told, count=len(limited), chance=probability(found.together),
    )  # fmt: skip


def _decisions(every: Sequence[CharacteristicFigures], nominal: Sequence[float], *, measured: bool) -> Table:
    scale = every[0].scale
    columns = (
        Column(say("No.")), Column(say("Characteristic"), numeric=False), Column(say("Nominal"), scale.value),
        Column(say("Lower limit"), scale.value), Column(say("Upper limit"), scale.value),
        Column(say("Accepted"), scale.value, numeric=False),
        *((Column(say("Decision"), numeric=False), Column(say("P"), numeric=False)) if measured else ()),
    )  # fmt: skip
    rows = tuple(_decision(one, nominal[one.place], measured=measured) for one in every)
    notes: list[Text] = [say("Accepted: values that the rule accepts with this uncertainty.")]
    if measured:
        notes.append(say("P: probability that the true value is within its limits, by the virtual measurements."))
    if any(one.judged is not None and one.judged.accepted is None for one in every):
        notes.append(say("None: the uncertainty is too large for any value to be accepted."))
    caption = _caption(angular=every[0].angular, measured=measured)
    return Table(caption, columns, rows, tuple(notes))


def _caption(*, angular: bool, measured: bool) -> Text:
    if measured:
        return say("Decisions on angles") if angular else say("Decisions")
    return say("Angles that the rule will accept") if angular else say("What the rule will accept")


def _decision(one: CharacteristicFigures, nominal: float, *, measured: bool) -> tuple[Text, ...]:
    judged, (low, high) = one.judged, one.limits
    decided: tuple[Text, ...] = ()
    if measured and judged is not None:
        decided = (
            DASH if judged.outcome is None else OUTCOME_WORDS[judged.outcome],
            DASH if judged.probability is None else probability(judged.probability),
        )
    shown = DASH if one.zone else one.limit(nominal)
    return (
        one.number,
        one.beside,
        shown,
        one.limit(low),
        one.limit(high),
        one.accepted_of(None if judged is None else judged.accepted),
        *decided,
    )


def _margin(one: CharacteristicFigures) -> Margin:
    judged, (low, high) = one.judged, one.limits
    low = 0.0 if one.zone else low
    stated, accepted = one.stated, None if judged is None else judged.accepted
    if stated.value is None:
        middle = 0.5 * ((low or 0.0) + (high or 0.0))
        return Margin(one.titled, middle, (middle - one.expanded, middle + one.expanded), low, high, None, accepted)
    return Margin(
        one.titled, stated.value, stated.interval, low, high, None if judged is None else judged.outcome, accepted
    )


def correlation_section(found: PartMeasurement) -> Section:
    """What characteristics have in common: a table of few, a picture of many; nothing of one."""
    every = figures_of(found)
    if len(every) < 2:
        return Section(say("Correlations"), ())
    told = Paragraph(
        say("Errors that several characteristics have in common make them correlated; what is computed from several of them "
            "needs this. results.json has all figures."), "note",
    )  # fmt: skip
    if len(every) > FEW:
        return Section(say("Correlations"), (told, correlation_plot([one.number for one in every], found.correlation)))
    rows = tuple(
        (one.number, one.beside, *(_r(float(found.correlation[one.place, j]), one.place, j) for j in range(len(every))))
        for one in every
    )
    columns = (
        Column(say("No.")), Column(say("Characteristic"), numeric=False),
        *(Column(say("No. {number}", number=one.number)) for one in every),
    )  # fmt: skip
    return Section(say("Correlations"), (told, Table(say("Correlations between the characteristics"), columns, rows)))


def _r(value: float, row: int, column: int) -> Text:
    """Of a matrix that is the same below and above its diagonal, the lower half."""
    if column > row:
        return DASH
    return number(1) if column == row else signed(round(value, 2) + 0.0, ".2f")
