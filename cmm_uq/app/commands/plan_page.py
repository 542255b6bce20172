"""A plan in words, and as a document for the operator and for whoever answers for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cmm_uq.analysis.diagnosis.diagnosis import FALSE_ALARMS
from cmm_uq.analysis.diagnosis.power import POWER, SIZES
from cmm_uq.analysis.planning.identifiability import Determination, Identifiability
from cmm_uq.app.commands.planning import RECORDED, MeasurementPlan
from cmm_uq.base.messages import DASH, NOTHING, Message, Text, Verbatim, after, commas, listed, number, plural, say
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import (
    Block,
    Column,
    Document,
    Facts,
    Paragraph,
    Table,
    columns,
    section,
    table,
    working_page,
)
from cmm_uq.certificate.origin import program
from cmm_uq.certificate.part.budget_section import foreseen_section
from cmm_uq.certificate.plots.volume import gain_plot, placing_pictures
from cmm_uq.certificate.wording import effect_title, stated_physics
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.maths.inference.linear_model import Unknown
from cmm_uq.maths.uncertainty.quantity import significant

STATUS = {
    "determined": say("determined"),
    "weak": say("weakly: hardly better than physics allows"),
    "free": say("not determined"),
}

CRITERIA = {
    "separation": say("effects told apart best"),
    "D": say("smallest volume of uncertainty (D)"),
    "A": say("smallest mean variance (A)"),
    "worst": say("smallest of the largest uncertainties (worst case)"),
}


def combination(parts: Mapping[tuple[str, str], float]) -> Text:
    """A free combination in words: ``scale error of X, Y and Z together, with the artefact's own length``."""
    effects = list(dict.fromkeys(owner for owner, _ in parts if owner != ARTEFACT))
    sizes = [name for owner, name in parts if owner == ARTEFACT]
    one = len(sizes) == 1
    if not effects:
        return say("The artefact's own length") if one else say("The artefact's own dimensions")
    words = listed(_families([effect_title(effect) for effect in effects]))
    together = say("{effects} together", effects=words) if len(effects) > 1 else words
    if sizes:
        own = say("the artefact's own length") if one else say("the artefact's own dimensions")
        return say("{effects}, with {own}", effects=together, own=own)
    return together if len(effects) > 1 else say("{effect}: nothing shows of it", effect=words)


def _families(titles: Sequence[Text]) -> list[Text]:
    """Titles that differ in their last argument alone as one, in the order of the first: ``scale error of X, Y and Z``."""
    families: dict[tuple[object, ...], list[Text]] = {}
    for title in titles:
        key: tuple[object, ...] = (title,)
        if isinstance(title, Message) and title.pattern.endswith("}"):
            key = (title.pattern, *list(title.arguments.values())[:-1])
        families.setdefault(key, []).append(title)
    words: list[Text] = []
    for first, *others in families.values():
        if others and isinstance(first, Message):
            name = first.pattern.rpartition("{")[2].removesuffix("}")
            last = [member.arguments[name] for member in (first, *others) if isinstance(member, Message)]
            merged = listed([one for one in last if isinstance(one, Text)])
            words.append(Message(first.pattern, {**first.arguments, name: merged}))
        else:
            words.append(first)
    return words


def expected(parameter: Determination, u: float | None) -> Text:
    """An expected standard uncertainty, in the unit of :func:`unit_of`."""
    return DASH if u is None else significant(u / (MICROMETRE if parameter.unknown.unit == "mm" else 1.0))


def unit_of(unknown: Unknown) -> Text:
    """Unit of an expected uncertainty: sizes of the artefact in micrometres."""
    return unit("µm") if unknown.unit == "mm" else unknown.unit


def named(unknown: Unknown) -> Text:
    """A parameter in words; a size of the artefact by its name, which a kind of another package may choose as it likes."""
    owner, name = unknown.key
    if owner != ARTEFACT:
        effect = every()[owner]
        if len(effect.coefficients) == 1:
            return effect.title
        return say("{title}, {name}", title=effect.title, name=Verbatim(name))
    plain = name.removesuffix("_mm")
    what, _, which = plain.partition("_")
    size: Text = say("length") if plain == "length" else Verbatim(plain.replace("_", " "))
    if which.isdigit():
        block, cylinder = say("block {which}", which=Verbatim(which)), say("cylinder {which}", which=Verbatim(which))
        size = {"block": block, "cylinder": cylinder}.get(what, size)
    return say("Artefact, {size}", size=size)


def pairs(found: Identifiability) -> list[Text]:
    """Effects that could not be told apart, grouped where they all resemble each other."""
    groups: list[set[str]] = []
    for first, second, _ in found.alike:
        joined = [group for group in groups if first in group or second in group]
        merged = {first, second}.union(*joined)
        groups = [group for group in groups if group not in joined] + [merged]
    return [listed([effect_title(name) for name in every() if name in group]) for group in groups]


def absorbed(found: Identifiability) -> list[Text]:
    """Effects that would be taken for others: ``sag of the artefact for scale error of X and scale error of Y``."""
    own = say("the artefact's own size")
    each = [(effect_title(name), [own if other == ARTEFACT else effect_title(other) for other in others])
            for name, others in found.absorbed if others]  # fmt: skip
    return [say("{effect} for {others}", effect=effect, others=listed(others)) for effect, others in each]


def smallest(amplitude: float | None) -> Text:
    return DASH if amplitude is None else significant(amplitude)


SHOWN = 6  # repeats in the table; results.json has all that are compared


def noise_facts(plan: MeasurementPlan) -> tuple[tuple[Text, Text], ...]:
    setting, noise = plan.setting, plan.setting.noise
    source: Text = say("assumed: the job states none")
    if setting.plan.noise_from is not None:
        source = say("from {file}", file=Verbatim(setting.plan.noise_from))
    elif setting.stated is not None:
        source = NOTHING
    elif plan.name == RECORDED:
        source = say("from the recording's residuals")
    reading = (say("Noise of a coordinate"), _size(setting.sigma, source))
    if noise is None:
        return (reading, (say("Set-up offset"), say("taken as none")))
    known = NOTHING if setting.plan.noise_from is None else source
    growth = (say("Noise that grows with length"), _size(noise.growth, known))
    return (reading, (say("Set-up offset"), _size(noise.placing, known)), growth)


def _size(size: float | None, source: Text) -> Text:
    if size is None:
        return say("not known: averaged over the prior")
    if not source:
        return say("{sigma:.2g} µm", sigma=size / MICROMETRE)
    return say("{sigma:.2g} µm ({source})", sigma=size / MICROMETRE, source=source)


_AVERAGED = say(
    "What is not known of the noise is averaged over its prior: no set-up offset with a probability of one half, "
    "else about as large as the noise of a reading (half-Cauchy); u is the geometric mean. Better set-ups are "
    "searched for, and smallest effects predicted, with an offset as large as the noise of a reading. [plan] "
    "noise_from or placing_um would say it."
)


def worth(plan: MeasurementPlan) -> tuple[Block, ...]:
    found = plan.worth
    if found is None:
        return ()
    rows = found.rows[:SHOWN]
    each = [Column(number(row.repeats)) for row in rows]
    cells: list[tuple[Text, ...]] = [
        (say("Readings"), *(_pair(number(row.readings), number(row.readings_more, ".0f")) for row in rows), NOTHING),
        (
            say("Time"),
            *(_pair(number(row.minutes, ".0f"), number(row.minutes_more, ".0f")) for row in rows),
            unit("min"),
        ),
    ]
    for i, unknown in enumerate(found.unknowns):
        size = MICROMETRE if unknown.unit == "mm" else 1.0
        figures = (
            _pair(significant(row.u[i] / size), significant(row.u_more[i] / size)) if np.isfinite(row.u[i]) else DASH
            for row in rows
        )
        cells.append((named(unknown), *figures, unit_of(unknown)))
    note = say(
        "Expected u of each parameter with the {count} set-ups of the plan; in brackets with one more, which tells as "
        "much as they do on average. An offset of a set-up is shared by its repeats.",
        count=found.placings,
    )
    enough, most, repeats = found.enough, found.rows[-1].repeats, plan.setting.plan.repeats
    if enough is None:
        advice = say(
            "Up to {most} repeats, a minute of one more repeat lowers at least one expected uncertainty more than a minute "
            "of one more set-up. The plan has {repeats}.", most=most - 1, repeats=repeats,
        )  # fmt: skip
    else:
        advice = say(
            "With {enough} or more repeats, a minute of one more set-up lowers every expected uncertainty more than a minute "
            "of one more repeat. The plan has {repeats}.",
            enough=enough, repeats=repeats,
        )  # fmt: skip
    fewer = say("Fewer repeats and more set-ups would tell more in the same time.")
    return Table(
        say("Repeats and set-ups"), columns((say("Repeats of every point"), *each, say("Unit"))), tuple(cells), (note,)
    ), Paragraph(after(advice, fewer if enough is not None and repeats > enough else NOTHING))


def _pair(one: Text, other: Text) -> Text:
    return say("{one} ({other})", one=one, other=other)


def plan_document(plan: MeasurementPlan) -> Document:
    facts, findings = plan.job.facts, plan.outlook.identifiability
    artefact = Verbatim(facts.artefact.name or facts.artefact.kind.replace("_", " "))
    count = len(plan.start.placings)
    recording = say("the recording ({count} set-ups)", count=count)
    start = recording if plan.name == RECORDED else say("{name} ({count} set-ups)", name=plan.name, count=count)
    warnings: list[Text] = [say("Not met: {what}.", what=each.what) for each in plan.conditions if not each.met]
    if findings is not None and not findings.complete:
        free = commas(named(p.unknown) for p in findings.parameters if p.status == "free")
        warnings.append(say("Not determined by these set-ups: {free}.", free=free))
    marks = ((Verbatim("✓" if each.met else "✗"), each.what) for each in plan.conditions)
    conditions = (Paragraph(say("{mark} {what}", mark=mark, what=what)) for mark, what in marks)
    setting, own = plan.setting, plan.setting.planning.pictures
    box = setting.volume.box
    pictures = own(setting, plan.to_measure) if own else placing_pictures(plan.to_measure, box, plan.first)
    return working_page(
        facts, say("Measurement plan"), artefact,
        particulars=(
            Facts((
                (say("Machine"), Verbatim(facts.machine.name)), (say("Artefact"), artefact),
                (say("Effects to determine"), commas(map(effect_title, facts.model.effects)) or say("the error of one axis")),
                *stated_physics(),
            )),
            Facts((
                (say("Start from"), start), (say("To be measured"), to_measure_words(plan)), *noise_facts(plan),
            )),
        ),
        warnings=warnings,
        sections=(
            section(say("Set-ups"), _placings(plan)), section(say("Pictures of the set-ups"), *pictures),
            section(say("What these set-ups determine"), *_determined(plan)),
            section(say("Repeats or set-ups"), *worth(plan)),
            section(say("What a better plan gains"), *_gain(plan)),
            section(say("Smallest effects that the diagnosis would find"), _smallest(plan)),
            section(say("Conditions of the standard"), *conditions),
            *([] if plan.part is None else [foreseen_section(plan.part)]),
        ),
        attachments=(*((Verbatim("plan.csv"),) if plan.to_measure else ()), Verbatim("results.json")),
        produced_by=program(plan.job), end=say("End of plan"),
    )  # fmt: skip


def to_measure_words(plan: MeasurementPlan) -> Text:
    """How many placings are still to be measured, and how long that takes."""
    count, total = len(plan.to_measure), sum(plan.minutes)
    if not count:
        return say("nothing more: the set-ups are recorded")
    one = say("{count} set-up, about {total:.0f} min", count=count, total=total)
    return plural(count, one=one, many=say("{count} set-ups, about {total:.0f} min", count=count, total=total))


def placing_rows(plan: MeasurementPlan) -> list[tuple[Text, ...]]:
    """Number, title, from and to, points and time of every placing to be measured."""
    return [
        (number(first), placing.title, placing.ends, number(len(placing.points)), number(time, ".0f"))
        for first, (placing, time) in enumerate(zip(plan.to_measure, plan.minutes, strict=True), plan.first)
    ]


def _placings(plan: MeasurementPlan) -> Table | None:
    heads = (
        Column(say("No.")), say("Set up"), say("From → to, scale readings in mm"), Column(say("Points")),
        Column(say("Time"), unit("min")),
    )  # fmt: skip
    notes: list[Text] = [say("Every point {repeats} times; points count repeats.", repeats=plan.setting.plan.repeats)]
    if plan.measured:
        notes.append(say("{measured} measurements are recorded already.", measured=plan.measured))
    notes += plan.setting.planning.notes(plan.setting) if plan.setting.planning.notes else ()
    return table(say("Set-ups in the order of measurement"), heads, placing_rows(plan), *notes)


def _determined(plan: MeasurementPlan) -> tuple[Block, ...]:
    found = plan.outlook.identifiability
    blocks: list[Block] = [Paragraph(say("No reading shows: {text}.", text=text)) for text in plan.free]
    if found is None:
        return tuple(blocks)
    heads = (
        say("Parameter"), Column(say("Expected u")), Column(say("Under white noise")), say("Unit"),
        Column(say("Allowed by physics")), say("Status"),
    )  # fmt: skip
    rows = tuple(
        (named(p.unknown), expected(p, p.u), expected(p, p.u_white), unit_of(p.unknown),
         number(p.unknown.prior_sd, ".3g") if p.unknown.prior_sd < 1e6 else say("any"), STATUS[p.status])
        for p in found.parameters
    )  # fmt: skip
    note = say(
        "u is the standard uncertainty of the least-squares estimate, certificates included. “Allowed by physics” is the "
        "standard deviation that the effect may have before anything is measured."
    )
    noise = plan.setting.noise
    averaged = noise is not None and (noise.placing is None or noise.growth is None)
    blocks.append(Table(say("What to expect"), columns(heads), rows, (note, _AVERAGED) if averaged else (note,)))
    blocks += [
        *(Paragraph(say("Stays free: {combination}.", combination=combination(parts)), tone="warning")
          for parts in found.free),
        *(Paragraph(say("Could not be told apart: {text}.", text=text)) for text in pairs(found)),
        *(Paragraph(say("If it acts, it will be taken for what the job names: {text}.", text=text))
          for text in absorbed(found)),
    ]  # fmt: skip
    if (further := plan.outlook.held_out) is not None:
        u, largest = (significant(further[name]) for name in ("u_rms_um", "u_largest_um"))
        text = say(
            "At {count} further poses the place of the point is expected within u = {rms} µm along each axis (root mean "
            "square), {largest} µm at most, beside the noise of a reading.",
            count=further["poses"],
            rms=u,
            largest=largest,
        )
        blocks.append(Paragraph(text))
    if found.unseen:
        effects = commas(effect_title(name) for name in found.unseen)
        blocks.append(Paragraph(say("Nothing would show of: {effects}.", effects=effects), tone="note"))
    return tuple(blocks)


def _gain(plan: MeasurementPlan) -> tuple[Block | None, ...]:
    start, better = plan.start.identifiability, plan.better.identifiability if plan.better else None
    criterion = plan.setting.plan.criterion
    if start is None or better is None or plan.better is None or criterion is None:
        return ()
    both = (say("the recording") if plan.name == RECORDED else plan.name, say("the better plan"))
    text = say(
        "Searched for: {criteria}, by greedy choice and exchange. {before} set-ups before, {better} in the better plan, "
        "{kept} of them kept. Pairs that could not be told apart: {alike_before} before, {alike_after} after; effects of "
        "which nothing shows, or that pass for named ones: {hidden_before} before, {hidden_after} after.",
        criteria=CRITERIA[criterion], before=len(plan.start.placings), better=len(plan.better.placings), kept=plan.kept,
        alike_before=len(start.alike), alike_after=len(better.alike),
        hidden_before=len(start.unseen) + len(start.absorbed), hidden_after=len(better.unseen) + len(better.absorbed),
    )  # fmt: skip
    blocks: list[Block | None] = [Paragraph(text)]
    compared = [
        (named(p.unknown), p.u, q.u, unit_of(p.unknown), expected(p, p.u), expected(q, q.u))
        for p, q in zip(start.parameters, better.parameters, strict=True)
    ]
    if plan.start.held_out and plan.better.held_out:
        u, v = (each.held_out["u_rms_um"] for each in (plan.start, plan.better) if each.held_out)
        compared.append((say("Place at further poses"), u, v, unit("µm"), significant(u), significant(v)))
    blocks += _beside(
        compared, both, say("Expected standard uncertainty"),
    )  # fmt: skip
    if plan.start.powers and plan.better.powers:
        sizes = (
            (p, p.identifiable, q.identifiable) for p, q in zip(plan.start.powers, plan.better.powers, strict=True)
        )
        rows = [(effect_title(p.effect), one, other, p.unit, smallest(one), smallest(other))
                for p, one, other in sizes if (one, other) != (None, None)]  # fmt: skip
        blocks += _beside(rows, both, say("Smallest effect named rightly"))
    return tuple(blocks)


def _beside(
    rows: Sequence[tuple[Text, float | None, float | None, Text, Text, Text]], names: tuple[Text, Text], quantity: Text
) -> list[Block | None]:
    """Both plans beside each other as a picture and in numbers: label, both values, unit, both in words."""
    if not rows:
        return []
    labels, before, after, units, before_words, after_words = map(list, zip(*rows, strict=True))
    heads = (quantity, Column(names[0]), Column(names[1]), say("Unit"))
    cells = zip(labels, before_words, after_words, units, strict=True)
    both = table(say("{quantity} with both plans", quantity=quantity), heads, cells)
    return [gain_plot(labels, before, after, names=names, quantity=quantity), both]


def _smallest(plan: MeasurementPlan) -> Table | None:
    figures = Column(say("Detected from")), Column(say("Named rightly from"))
    heads = (say("Effect not in the job's model"), *figures, say("Unit"))
    rows = (
        (effect_title(p.effect), smallest(p.detectable), smallest(p.identifiable), p.unit) for p in plan.outlook.powers
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
            "With repeats, what changes from set-up to set-up looks in part like set-up offsets: such an effect may have to "
            "be larger than is said here."
        ))  # fmt: skip
    return table(say("Smallest effects"), heads, rows, *notes)
