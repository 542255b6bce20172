"""A plan as a document for the operator and for whoever answers for it, and its results.json."""

from __future__ import annotations

from typing import Any

from cmm_uq.commands.plan_words import (
    CRITERIA,
    STATUS,
    absorbed,
    base_name,
    combination,
    expected,
    named,
    pairs,
    smallest,
    title_of,
    unit_of,
)
from cmm_uq.commands.planning import RECORDED, Outlook, Plan
from cmm_uq.diagnosis.diagnosis import FALSE_ALARMS
from cmm_uq.diagnosis.power import POWER, SIZES
from cmm_uq.documents.document import Block, Column, Document, Facts, Paragraph, Section, Table
from cmm_uq.documents.plan_picture import gain_plot, placing_pictures
from cmm_uq.documents.program import program
from cmm_uq.documents.results_file import head
from cmm_uq.documents.working_page import working_page
from cmm_uq.units import MICROMETRE

SCHEMA = "cmm-uq/plan/1"


def plan_results(plan: Plan) -> dict[str, Any]:
    """results.json of a plan."""
    better = None if plan.better is None or plan.scores is None else {
        "criterion": plan.setting.plan.criterion, "score_before": plan.scores[0], "score_after": plan.scores[1],
        "kept": plan.kept, "added": len(plan.better.placings) - plan.kept, **_outlook_data(plan.better),
    }  # fmt: skip
    return {
        **head(plan.job, SCHEMA),
        "noise": {"coordinate_um": plan.setting.sigma / MICROMETRE, "stated": plan.setting.stated is not None},
        "start": {"name": plan.name, "placings": len(plan.start.placings), **_outlook_data(plan.start)},
        "better": better,
        "free": list(plan.free),
        "conditions": [{"what": condition.what, "met": condition.met} for condition in plan.conditions],
        "placings": [
            {"measurement": number, "title": placing.title, "minutes": time,
             "middle_mm": placing.middle.tolist(), "points": len(placing.points)}
            for number, (placing, time) in enumerate(zip(plan.to_measure, plan.minutes, strict=True), plan.first)
        ],
        "minutes": sum(plan.minutes),
    }  # fmt: skip


def _outlook_data(outlook: Outlook) -> dict[str, Any]:
    found = outlook.identifiability
    if found is None:
        return {}
    return {
        "determined": [
            {"effect": p.unknown.key[0], "parameter": p.unknown.key[1], "unit": p.unknown.unit, "u": p.u,
             "u_with_prior": p.u_with_prior, "status": p.status}
            for p in found.parameters
        ],
        "undetermined": [
            {"parameters": {f"{owner}.{name}": part for (owner, name), part in parts.items()}, "words": combination(parts)}
            for parts in found.free
        ],
        "singular_values": found.singular_values.tolist(),
        "indistinguishable": [{"effects": [a, b], "cosine": cosine} for a, b, cosine in found.alike],
        "absorbed": [{"effect": name, "as": list(others)} for name, others in found.absorbed],
        "unseen": list(found.unseen),
        "smallest": [
            {"effect": power.effect, "parameter": power.parameter, "unit": power.unit,
             "detected": power.detectable, "named": power.identifiable}
            for power in outlook.powers
        ],
    }  # fmt: skip


def plan_document(plan: Plan) -> Document:
    """The page of a plan."""
    facts = plan.job.facts
    total = sum(plan.minutes)
    stated = "" if plan.setting.stated is not None else " (assumed: the job states none)"
    if plan.name == RECORDED and plan.setting.stated is None:
        stated = " (from the recording's residuals)"
    return working_page(
        facts, "Measurement plan", _artefact(plan),
        particulars=(
            Facts((("Machine", facts.machine.name), ("Artefact", _artefact(plan)),
                   ("Effects to determine", ", ".join(facts.model.effects) or "the error of one axis"))),
            Facts((("Start from", base_name(plan)), ("To be measured", _to_measure(plan, total)),
                   ("Noise of a coordinate", f"{plan.setting.sigma / MICROMETRE:.2g} µm{stated}"))),
        ),
        warnings=_warnings(plan),
        sections=_sections(plan),
        attachments=("plan.csv", "results.json") if plan.to_measure else ("results.json",),
        produced_by=program(plan.job),
        end="End of plan",
    )  # fmt: skip


def _artefact(plan: Plan) -> str:
    facts = plan.job.facts.artefact
    return facts.name or facts.kind.replace("_", " ")


def _to_measure(plan: Plan, total: float) -> str:
    count = len(plan.to_measure)
    if not count:
        return "nothing more: the placings are recorded"
    return f"{count} placing{'s' if count > 1 else ''}, about {total:.0f} min"


def _warnings(plan: Plan) -> list[str]:
    said = [f"Not met: {condition.what}." for condition in plan.conditions if not condition.met]
    found = plan.outlook.identifiability
    if found is not None and not found.complete:
        free = ", ".join(named(p) for p in found.parameters if p.status == "free")
        said.append(f"Not determined by these placings: {free}.")
    return said


def _sections(plan: Plan) -> tuple[Section, ...]:
    return (
        Section("Placings", _placings(plan)),
        Section("Pictures of the placings", tuple(
            placing_pictures(plan.to_measure, plan.setting.volume.box, plan.first) if plan.to_measure else ()
        )),
        Section("What these placings determine", _determined(plan)),
        Section("What a better plan gains", _gain(plan)),
        Section("Smallest effects that the diagnosis would find", _smallest(plan)),
        Section("Conditions of the standard", tuple(
            Paragraph(f"{'✓' if condition.met else '✗'} {condition.what}") for condition in plan.conditions
        )),
    )  # fmt: skip


def placing_rows(plan: Plan) -> list[tuple[str, ...]]:
    """Number, title, from and to, points and time of every placing to be measured."""
    return [
        (str(number), placing.title, placing.ends, str(len(placing.points)), f"{time:.0f}")
        for number, (placing, time) in enumerate(zip(plan.to_measure, plan.minutes, strict=True), plan.first)
    ]


def _placings(plan: Plan) -> tuple[Block, ...]:
    if not plan.to_measure:
        return ()
    heads = (Column("No."), Column("Set up", numeric=False), Column("From → to, scale readings in mm", numeric=False),
             Column("Points"), Column("Time", "min"))  # fmt: skip
    notes = [f"Every point {plan.setting.plan.repeats} times; points count repeats."]
    if plan.measured:
        notes.append(f"{plan.measured} measurements are recorded already.")
    return (Table("Placings in the order of measurement", heads, tuple(placing_rows(plan)), tuple(notes)),)


def _determined(plan: Plan) -> tuple[Block, ...]:
    found = plan.outlook.identifiability
    blocks: list[Block] = [Paragraph(f"No reading shows: {text}.") for text in plan.free]
    if found is None:
        return tuple(blocks)
    heads = (Column("Parameter", numeric=False), Column("Expected u"), Column("Unit", numeric=False),
             Column("Allowed by physics"), Column("", numeric=False))  # fmt: skip
    rows = tuple(
        (named(p), expected(p), unit_of(p), f"{p.unknown.prior_sd:.3g}" if p.unknown.prior_sd < 1e6 else "any",
         STATUS[p.status])
        for p in found.parameters
    )  # fmt: skip
    note = (
        "u is the standard uncertainty of the least-squares estimate, certificates included. “Allowed by physics” is the "
        "standard deviation that the effect may have before anything is measured."
    )
    blocks.append(Table("What to expect", heads, rows, (note,)))
    blocks += [Paragraph(f"Stays free: {combination(parts)}.", tone="warning") for parts in found.free]
    blocks += [Paragraph(f"Could not be told apart: {text}.") for text in pairs(found)]
    blocks += [Paragraph(f"If it acts, it will be taken for what the job names: {text}.") for text in absorbed(found)]
    if found.unseen:
        blocks.append(
            Paragraph(f"Nothing would show of: {', '.join(title_of(name) for name in found.unseen)}.", tone="note")
        )
    return tuple(blocks)


def _gain(plan: Plan) -> tuple[Block, ...]:
    start, better = plan.start.identifiability, plan.better.identifiability if plan.better else None
    criterion = plan.setting.plan.criterion
    if start is None or better is None or plan.better is None or criterion is None:
        return ()
    names = (base_name(plan).partition(" (")[0], "the better plan")
    count, before = len(plan.better.placings), len(plan.start.placings)
    blocks: list[Block] = [Paragraph(
        f"Searched for: {CRITERIA[criterion]}, by greedy choice and exchange. {before} placings before, {count} in the better "
        f"plan, {plan.kept} of them kept. Pairs that could not be told apart: {len(start.alike)} before, "
        f"{len(better.alike)} after; effects of which nothing shows, or that pass for named ones: "
        f"{len(start.unseen) + len(start.absorbed)} before, {len(better.unseen) + len(better.absorbed)} after."
    )]  # fmt: skip
    blocks += _beside(
        [(named(p), p.u, q.u, unit_of(p), expected(p), expected(q))
         for p, q in zip(start.parameters, better.parameters, strict=True)],
        names, "Expected standard uncertainty",
    )  # fmt: skip
    if plan.start.powers and plan.better.powers:
        blocks += _beside(
            [(title_of(p.effect), p.identifiable, q.identifiable, p.unit, smallest(p.identifiable), smallest(q.identifiable))
             for p, q in zip(plan.start.powers, plan.better.powers, strict=True)
             if p.identifiable is not None or q.identifiable is not None],
            names, "Smallest effect named rightly",
        )  # fmt: skip
    return tuple(blocks)


def _beside(
    rows: list[tuple[str, float | None, float | None, str, str, str]], names: tuple[str, str], quantity: str
) -> list[Block]:
    """Both plans beside each other as a picture and in numbers: label, both values, unit, both in words."""
    if not rows:
        return []
    heads = (Column(quantity, numeric=False), Column(names[0]), Column(names[1]), Column("Unit", numeric=False))
    table = Table(f"{quantity} with both plans", heads, tuple((row[0], row[4], row[5], row[3]) for row in rows))
    picture = gain_plot(
        [row[0] for row in rows], [row[1] for row in rows], [row[2] for row in rows], names=names, quantity=quantity
    )
    return [picture, table]


def _smallest(plan: Plan) -> tuple[Block, ...]:
    if not plan.outlook.powers:
        return ()
    heads = (Column("Effect not in the job's model", numeric=False), Column("Parameter", numeric=False),
             Column("Detected from"), Column("Named rightly from"), Column("Unit", numeric=False))  # fmt: skip
    rows = tuple(
        (title_of(p.effect), p.parameter, smallest(p.detectable), smallest(p.identifiable), p.unit)
        for p in plan.outlook.powers
    )
    note = (
        f"Size found in {100 * POWER:.0f} of 100 recordings, at {100 * FALSE_ALARMS:g} % of false alarms. Named rightly: the "
        "effect alone is more probable than any other and than none, and no other is left as possible. – where that is so "
        f"for no size that physics allows, or for none up to {SIZES[-1]:.0f} times the noise in all observations together."
    )
    return (Table("Smallest effects", heads, rows, (note,)),)
