"""A plan as a document for the operator and for whoever answers for it."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.diagnosis.diagnosis import FALSE_ALARMS
from cmm_uq.analysis.diagnosis.power import POWER, SIZES
from cmm_uq.app.commands.plans.planning import RECORDED, MeasurementPlan
from cmm_uq.app.commands.plans.words import (
    CRITERIA,
    STATUS,
    absorbed,
    combination,
    expected,
    expected_white,
    named,
    pairs,
    parameter_name,
    parameter_unit,
    smallest,
    title_of,
    unit_of,
)
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, commas, names, number, plural, say
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Block, Column, Document, Facts, Paragraph, Section, Table, working_page
from cmm_uq.certificate.origin import program
from cmm_uq.certificate.plots.plans import gain_plot, placing_pictures

SHOWN = 6  # repeats in the table; results.json has all that are compared
_PRIOR = say("not known: averaged over the prior")


def noise_facts(plan: MeasurementPlan) -> tuple[tuple[Text, Text], ...]:
    """Reading noise, set-up offset and growth, and where each is from."""
    setting, noise = plan.setting, plan.setting.noise
    source: Text = say("assumed: the job states none")
    if setting.plan.noise_from is not None:
        source = say("from {file}", file=Verbatim(setting.plan.noise_from))
    elif setting.stated is not None:
        source = NOTHING
    elif plan.name == RECORDED:
        source = say("from the recording's residuals")
    reading = _size(setting.sigma, source)
    if noise is None:
        return ((say("Noise of a coordinate"), reading), (say("Set-up offset"), say("taken as none")))
    known = NOTHING if setting.plan.noise_from is None else source
    return (
        (say("Noise of a coordinate"), reading), (say("Set-up offset"), _size(noise.placing, known)),
        (say("Noise that grows with length"), _size(noise.growth, known)),
    )  # fmt: skip


def _size(size: float | None, source: Text) -> Text:
    if size is None:
        return _PRIOR
    if not source:
        return say("{sigma:.2g} µm", sigma=size / MICROMETRE)
    return say("{sigma:.2g} µm ({source})", sigma=size / MICROMETRE, source=source)


_AVERAGED = say(
    "What is not known of the noise is averaged over its prior: no set-up offset with a probability of one half, "
    "else about as large as the noise of a reading (half-Cauchy); u is the geometric mean. Better placings are "
    "searched for, and smallest effects predicted, with an offset as large as the noise of a reading. [plan] "
    "noise_from or placing_um would say it."
)


def worth(plan: MeasurementPlan) -> tuple[Block, ...]:
    """Repeats against placings."""
    found = plan.worth
    if found is None:
        return ()
    rows = found.rows[:SHOWN]
    heads = (_words(say("Repeats of every point")), *(Column(number(row.repeats)) for row in rows), _words(say("Unit")))
    cells: list[tuple[Text, ...]] = [
        (say("Readings"), *(_pair(row.readings, row.readings_more, ".0f") for row in rows), NOTHING),
        (say("Time"), *(_pair(row.minutes, row.minutes_more, ".0f") for row in rows), unit("min")),
    ]
    for i, unknown in enumerate(found.unknowns):
        size = MICROMETRE if unknown.unit == "mm" else 1.0
        figures = (
            _pair(row.u[i] / size, row.u_more[i] / size, ".2g") if np.isfinite(row.u[i]) else DASH for row in rows
        )
        cells.append((parameter_name(unknown), *figures, parameter_unit(unknown)))
    note = say(
        "Expected u of each parameter with the {count} placings of the plan; in brackets with one more, which tells as "
        "much as they do on average. An offset of a set-up is shared by its repeats.",
        count=found.placings,
    )
    enough, most, repeats = found.enough, found.rows[-1].repeats, plan.setting.plan.repeats
    if enough is None:
        advice = say(
            "Up to {most} repeats, a minute of one more repeat lowers at least one expected uncertainty more than a minute "
            "of one more placing. The plan has {repeats}.",
            most=most - 1, repeats=repeats,
        )  # fmt: skip
    elif repeats > enough:
        advice = say(
            "With {enough} or more repeats, a minute of one more placing lowers every expected uncertainty more than a minute "
            "of one more repeat. The plan has {repeats}: fewer repeats and more placings would tell more in the same time.",
            enough=enough, repeats=repeats,
        )  # fmt: skip
    else:
        advice = say(
            "With {enough} or more repeats, a minute of one more placing lowers every expected uncertainty more than a minute "
            "of one more repeat. The plan has {repeats}.",
            enough=enough, repeats=repeats,
        )  # fmt: skip
    return (Table(say("Repeats and placings"), heads, tuple(cells), (note,)), Paragraph(advice))


def _words(heading: Text) -> Column:
    return Column(heading, numeric=False)


def _pair(one: float, other: float, form: str) -> Text:
    return say("{one} ({other})", one=number(one, form), other=number(other, form))


def plan_document(plan: MeasurementPlan) -> Document:
    """The page of a plan."""
    facts, findings = plan.job.facts, plan.outlook.identifiability
    artefact = Verbatim(facts.artefact.name or facts.artefact.kind.replace("_", " "))
    count = len(plan.start.placings)
    start = say("{name} ({count} placings)", name=plan.name, count=count)
    if plan.name == RECORDED:
        start = say("the recording ({count} placings)", count=count)
    warnings: list[Text] = [say("Not met: {what}.", what=each.what) for each in plan.conditions if not each.met]
    if findings is not None and not findings.complete:
        free = commas(named(p) for p in findings.parameters if p.status == "free")
        warnings.append(say("Not determined by these placings: {free}.", free=free))
    met, not_met = Verbatim("✓"), Verbatim("✗")
    conditions = tuple(
        Paragraph(say("{mark} {what}", mark=met if each.met else not_met, what=each.what)) for each in plan.conditions
    )
    pictures = placing_pictures(plan.to_measure, plan.setting.volume.box, plan.first) if plan.to_measure else ()
    return working_page(
        facts, say("Measurement plan"), artefact,
        particulars=(
            Facts((
                (say("Machine"), Verbatim(facts.machine.name)), (say("Artefact"), artefact),
                (say("Effects to determine"), (commas(names(facts.model.effects)) or say("the error of one axis"))),
            )),
            Facts((
                (say("Start from"), start), (say("To be measured"), to_measure_words(plan)), *noise_facts(plan),
            )),
        ),
        warnings=warnings,
        sections=(
            Section(say("Placings"), _placings(plan)),
            Section(say("Pictures of the placings"), tuple(pictures)),
            Section(say("What these placings determine"), _determined(plan)),
            Section(say("Repeats or placings"), worth(plan)),
            Section(say("What a better plan gains"), _gain(plan)),
            Section(say("Smallest effects that the diagnosis would find"), _smallest(plan)),
            Section(say("Conditions of the standard"), conditions),
        ),
        attachments=(*((Verbatim("plan.csv"),) if plan.to_measure else ()), Verbatim("results.json")),
        produced_by=program(plan.job), end=say("End of plan"),
    )  # fmt: skip


def to_measure_words(plan: MeasurementPlan) -> Text:
    """How many placings are still to be measured, and how long that takes."""
    count, total = len(plan.to_measure), sum(plan.minutes)
    if not count:
        return say("nothing more: the placings are recorded")
    one = say("{count} placing, about {total:.0f} min", count=count, total=total)
    return plural(count, one=one, many=say("{count} placings, about {total:.0f} min", count=count, total=total))


def placing_rows(plan: MeasurementPlan) -> list[tuple[Text, ...]]:
    """Number, title, from and to, points and time of every placing to be measured."""
    return [
        (number(first), placing.title, placing.ends, number(len(placing.points)), number(time, ".0f"))
        for first, (placing, time) in enumerate(zip(plan.to_measure, plan.minutes, strict=True), plan.first)
    ]


def _placings(plan: MeasurementPlan) -> tuple[Block, ...]:
    if not plan.to_measure:
        return ()
    heads = (
        Column(say("No.")), _words(say("Set up")), _words(say("From → to, scale readings in mm")), Column(say("Points")),
        Column(say("Time"), unit("min")),
    )  # fmt: skip
    notes = [say("Every point {repeats} times; points count repeats.", repeats=plan.setting.plan.repeats)]
    if plan.measured:
        notes.append(say("{measured} measurements are recorded already.", measured=plan.measured))
    return (Table(say("Placings in the order of measurement"), heads, tuple(placing_rows(plan)), tuple(notes)),)


def _determined(plan: MeasurementPlan) -> tuple[Block, ...]:
    found = plan.outlook.identifiability
    blocks: list[Block] = [Paragraph(say("No reading shows: {text}.", text=text)) for text in plan.free]
    if found is None:
        return tuple(blocks)
    heads = (
        _words(say("Parameter")), Column(say("Expected u")), Column(say("Under white noise")), _words(say("Unit")),
        Column(say("Allowed by physics")), _words(NOTHING),
    )  # fmt: skip
    rows = tuple(
        (named(p), expected(p), expected_white(p), unit_of(p),
         number(p.unknown.prior_sd, ".3g") if p.unknown.prior_sd < 1e6 else say("any"), STATUS[p.status])
        for p in found.parameters
    )  # fmt: skip
    note = say(
        "u is the standard uncertainty of the least-squares estimate, certificates included. "
        "“Allowed by physics” is the standard deviation that the effect may have before anything is "
        "measured."
    )
    noise = plan.setting.noise
    averaged = noise is not None and (noise.placing is None or noise.growth is None)
    blocks.append(Table(say("What to expect"), heads, rows, (note, _AVERAGED) if averaged else (note,)))
    blocks += [
        *(Paragraph(say("Stays free: {combination}.", combination=combination(parts)), tone="warning")
          for parts in found.free),
        *(Paragraph(say("Could not be told apart: {text}.", text=text)) for text in pairs(found)),
        *(Paragraph(say("If it acts, it will be taken for what the job names: {text}.", text=text))
          for text in absorbed(found)),
    ]  # fmt: skip
    if found.unseen:
        effects = commas(title_of(name) for name in found.unseen)
        blocks.append(Paragraph(say("Nothing would show of: {effects}.", effects=effects), tone="note"))
    return tuple(blocks)


def _gain(plan: MeasurementPlan) -> tuple[Block, ...]:
    start, better = plan.start.identifiability, plan.better.identifiability if plan.better else None
    criterion = plan.setting.plan.criterion
    if start is None or better is None or plan.better is None or criterion is None:
        return ()
    both = (say("the recording") if plan.name == RECORDED else plan.name, say("the better plan"))
    text = say(
        "Searched for: {criteria}, by greedy choice and exchange. {before} placings before, {better} "
        "in the better plan, {kept} of them kept. Pairs that could not be told apart: {alike_before} "
        "before, {alike_after} after; effects of which nothing shows, or that pass for named ones: "
        "{hidden_before} before, {hidden_after} after.",
        criteria=CRITERIA[criterion], before=len(plan.start.placings), better=len(plan.better.placings), kept=plan.kept,
        alike_before=len(start.alike), alike_after=len(better.alike),
        hidden_before=len(start.unseen) + len(start.absorbed), hidden_after=len(better.unseen) + len(better.absorbed),
    )  # fmt: skip
    blocks: list[Block] = [Paragraph(text)]
    blocks += _beside(
        [(named(p), p.u, q.u, unit_of(p), expected(p), expected(q))
         for p, q in zip(start.parameters, better.parameters, strict=True)],
        both, say("Expected standard uncertainty"),
    )  # fmt: skip
    if plan.start.powers and plan.better.powers:
        blocks += _beside(
            [(title_of(p.effect), p.identifiable, q.identifiable, p.unit, smallest(p.identifiable), smallest(q.identifiable))
             for p, q in zip(plan.start.powers, plan.better.powers, strict=True)
             if p.identifiable is not None or q.identifiable is not None],
            both, say("Smallest effect named rightly"),
        )  # fmt: skip
    return tuple(blocks)


def _beside(
    rows: list[tuple[Text, float | None, float | None, Text, Text, Text]], names: tuple[Text, Text], quantity: Text
) -> list[Block]:
    """Both plans beside each other as a picture and in numbers: label, both values, unit, both in words."""
    if not rows:
        return []
    labels, before, after, units, before_words, after_words = (list(column) for column in zip(*rows, strict=True))
    heads = (_words(quantity), Column(names[0]), Column(names[1]), _words(say("Unit")))
    cells = tuple(zip(labels, before_words, after_words, units, strict=True))
    picture = gain_plot(labels, before, after, names=names, quantity=quantity)
    return [picture, Table(say("{quantity} with both plans", quantity=quantity), heads, cells)]


def _smallest(plan: MeasurementPlan) -> tuple[Block, ...]:
    if not plan.outlook.powers:
        return ()
    heads = (_words(say("Effect not in the job's model")), _words(say("Parameter")), Column(say("Detected from")),
             Column(say("Named rightly from")), _words(say("Unit")))  # fmt: skip
    rows = tuple(
        (title_of(p.effect), Verbatim(p.parameter), smallest(p.detectable), smallest(p.identifiable), p.unit)
        for p in plan.outlook.powers
    )
    notes: list[Text] = [say(
        "Size found in {power:.0f} of 100 recordings, at {false_alarms:g} % of false alarms. Named "
        "rightly: the effect alone is more probable than any other and than none, and no other is "
        "left as possible. – where that is so for no size that physics allows, or for none up to "
        "{sizes:.0f} times the noise in all observations together.",
        power=100 * POWER, false_alarms=100 * FALSE_ALARMS, sizes=SIZES[-1],
    )]  # fmt: skip
    if plan.setting.plan.repeats > 1:
        notes.append(say(
            "With repeats, what changes from placing to placing looks in part like set-up offsets: such an effect may have to "
            "be larger than is said here."
        ))  # fmt: skip
    return (Table(say("Smallest effects"), heads, rows, tuple(notes)),)
