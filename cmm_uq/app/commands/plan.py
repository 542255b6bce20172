"""From a job still to be measured to its plan: search and compose, then write."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cmm_uq.analysis.diagnosis.held_out import with_quantities
from cmm_uq.analysis.machine.recordings import FurtherRecording, doubted, mean_noise, model_of_machine
from cmm_uq.analysis.parts.foreseen import foreseen_measurement
from cmm_uq.analysis.planning.set_up import join
from cmm_uq.analysis.planning.setting import white_noise
from cmm_uq.app.commands import plan_page as words
from cmm_uq.app.commands.certificates.further import MOST_FURTHER
from cmm_uq.app.commands.files import Form, Stage, Written, silent
from cmm_uq.app.commands.jobs.simulate import to_fill_in
from cmm_uq.app.commands.parts.part import PartOptions, evaluate_part
from cmm_uq.app.commands.planning import MeasurementPlan, Outlook, make_plan
from cmm_uq.app.commands.reading import in_language, read_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.languages.translation import Code
from cmm_uq.base.messages import Text, say
from cmm_uq.base.plugins import naming_package
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE
from cmm_uq.certificate.document import Standing
from cmm_uq.certificate.part.budget_section import foreseen_words
from cmm_uq.certificate.part.measurement import PartMeasurement, foreseen_data, in_unit, unit_of
from cmm_uq.certificate.plots.style import lettered_in
from cmm_uq.certificate.result import Outcome
from cmm_uq.certificate.results.contents import head
from cmm_uq.certificate.wording import Figure, Headline, Summary
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.part.job import PartJob, read_part
from cmm_uq.machine.model.artefact_doubt import causes_of
from cmm_uq.machine.physics.stated import with_own_physics

TO_FILL_IN = "plan.csv"
PLAN = Form("plan", ("plan.html",), "plan", (TO_FILL_IN,))


@naming_package()
@with_own_physics
def plan_outcome(
    job: Job, *, power: bool = True, seed: int = 0, stage: Stage = silent, for_part: PartJob | None = None
) -> Outcome:
    """Plan a job that was read, whose recording may be missing; nothing is written.

    ``for_part``: on whose uncertainty it is told what the set-ups will do.
    """
    plan = make_plan(job, power=power, seed=seed, progress=stage)
    if for_part is not None:
        plan = replace(plan, part=with_plan(for_part, plan, seed, stage))
    stage("Drawing the placings", 0.95)
    with lettered_in(job.facts.job.language):
        document = words.plan_document(plan)
    return Outcome(
        plan, lambda: document, plan_results(plan), plan_summary(plan), document.warnings,
        {TO_FILL_IN: recording_to_be(plan)} if plan.to_measure else {},
        in_order=all(condition.met for condition in plan.conditions),
    )  # fmt: skip


def with_plan(job: PartJob, plan: MeasurementPlan, seed: int, stage: Stage = silent) -> PartMeasurement:
    """A part, and what the set-ups of a plan that are still to be measured will do to its uncertainty."""
    found, setting, where = evaluate_part(job, PartOptions(seed), stage), plan.setting, str(job.folder / "job.toml")
    if found.recordings is None:
        raise CmmUqError(
            "the errors of its machine do not follow from recordings alone",
            where=where,
            fix="Give the machine's certificate as PDF, and leave out tests that it passed",
        )
    machine, own = setting.machine, found.given.machine.machine
    if machine.chain != own.chain or not np.array_equal(machine.travel_mm, own.travel_mm, equal_nan=True):
        raise CmmUqError(
            "was measured on another machine than the plan's, by its chain and travel",
            where=where,
            fix="Plan a measurement of the machine that measured the part",
        )
    if not plan.to_measure or setting.observe is None:
        raise CmmUqError(
            "nothing is left to be measured whose effect on a part could be told",
            where="job.toml [plan]",
            fix="Plan set-ups; a recording that is there is a further certificate of the part's job",
        )
    first, beside = found.recordings
    whole = model_of_machine(first, setting.model(setting.joined(plan.to_measure)))
    model = with_quantities(whole, setting.observed, seed, MOST_FURTHER)
    noise = setting.noise or white_noise(model)
    factor = mean_noise(noise.components(model, np.array([one.prior_mean for one in model.unknowns])), noise.typical)
    doubt = doubted(model, causes_of(model.artefact, plan.job.circumstances))
    further = replace(beside, recordings=(*beside.recordings, FurtherRecording(model, np.hstack([factor, doubt]))))
    name = say("the set-ups of this plan")
    U = np.array([one.U for one in found.stated])
    return replace(found, foreseen=(foreseen_measurement(name, found.virtual, found.given, first, further, U, seed),))


def write_plan(
    job: Path, out: Path | None = None, *, power: bool = True, seed: int = 0, force: bool = False,
    stage: Stage = silent, language: Code | None = None, for_part: Path | None = None,
) -> Written[Outcome]:  # fmt: skip
    """Plan a job and write ``plan.csv``, ``plan.html`` and ``results.json``, all or none.

    ``plan.csv`` has the columns of a recording of the artefact, at nominal coordinates; it is left out where nothing is left
    to measure.
    """
    read = in_language(read_job(job, recorded=False), language)
    of = None if for_part is None else read_part(for_part)
    outcome = partial(plan_outcome, read, power=power, seed=seed, stage=stage, for_part=of)
    return PLAN.write(read, outcome, out, force=force, stage=stage)


def recording_to_be(plan: MeasurementPlan) -> bytes:
    """The placings that are still to be measured, as the CSV of a recording at nominal coordinates."""
    each = {name: getattr(plan.setting.plan, name) for name in ("seconds_per_point", "minutes_per_placing")}
    planned, number = join(plan.to_measure, first=plan.first, **each), plan.setting.planning.numbered
    recorded = plan.start.points if plan.measured else plan.job.points
    return to_fill_in(planned if number is None else number(recorded, planned))


SCHEMA = "cmm-uq/plan/1"


def plan_results(plan: MeasurementPlan) -> dict[str, Any]:
    better = None if plan.better is None or plan.scores is None else {
        "criterion": plan.setting.plan.criterion, "score_before": plan.scores[0], "score_after": plan.scores[1],
        "kept": plan.kept, "added": len(plan.better.placings) - plan.kept, **_outlook_data(plan.better),
    }  # fmt: skip
    return {
        **head(plan.job, SCHEMA),
        "noise": noise_data(plan),
        "start": {"name": plan.name, "placings": len(plan.start.placings), **_outlook_data(plan.start)},
        "better": better, "repeats": worth_data(plan), "free": list(plan.free),
        "conditions": [{"what": each.what, "met": each.met, "missing": list(each.missing)} for each in plan.conditions],
        "placings": [
            {"measurement": number, "title": placing.title, "minutes": time,
             "middle_mm": placing.middle.tolist(), "points": len(placing.points)}
            for number, (placing, time) in enumerate(zip(plan.to_measure, plan.minutes, strict=True), plan.first)
        ],
        "minutes": sum(plan.minutes), **({} if plan.part is None else {"for_part": part_data(plan.part)}),
    }  # fmt: skip


def part_data(found: PartMeasurement) -> dict[str, Any]:
    """For results.json: U of each characteristic as it is, and as it will be."""
    now = [
        {"name": one.name, "unit": unit_of(one), "U": in_unit(one, stated.U)}
        for one, stated in zip(found.characteristics, found.stated, strict=True)
    ]
    return {"job": found.job.facts.job.id, "characteristics": now, "foreseen": foreseen_data(found, found.foreseen)}


def _outlook_data(outlook: Outlook) -> dict[str, Any]:
    found = outlook.identifiability
    if found is None:
        return {}
    return {
        "determined": [
            {"effect": p.unknown.key[0], "parameter": p.unknown.key[1], "unit": p.unknown.unit, "u": p.u,
             "u_with_prior": p.u_with_prior, "u_white": p.u_white, "status": p.status}
            for p in found.parameters
        ],
        "undetermined": [
            {"parameters": {f"{owner}.{name}": part for (owner, name), part in parts.items()},
             "words": words.combination(parts)}
            for parts in found.free
        ],
        "singular_values": found.singular_values.tolist(),
        "indistinguishable": [{"effects": [a, b], "cosine": cosine} for a, b, cosine in found.alike],
        "absorbed": [{"effect": name, "as": list(others)} for name, others in found.absorbed],
        "unseen": list(found.unseen),
        **({} if outlook.predicted is None else {"held_out": outlook.held_out}),
        "smallest": [
            {"effect": power.effect, "parameter": power.parameter, "unit": power.unit, "detected": power.detectable,
             "named": power.identifiable}
            for power in outlook.powers
        ],
    }  # fmt: skip


def noise_data(plan: MeasurementPlan) -> dict[str, Any]:
    """For results.json: sizes in µm, ``null`` where they are averaged over."""
    setting, noise = plan.setting, plan.setting.noise
    each = {"coordinate_um": setting.sigma / MICROMETRE, "stated": setting.stated is not None}
    if noise is None:
        return each
    sizes = dict(zip("xyz", noise.reading, strict=True)) | {"placing": noise.placing, "growth": noise.growth}
    known = {f"{name}_um": None if size is None else size / MICROMETRE for name, size in sizes.items()}
    return {**each, **known, "from": setting.plan.noise_from}


def worth_data(plan: MeasurementPlan) -> dict[str, Any] | None:
    """For results.json: uncertainties in the unit of each parameter, ``null`` where it stays free."""
    if plan.worth is None:
        return None
    keys = [".".join(one.key) for one in plan.worth.unknowns]

    def by_name(u: Floats) -> dict[str, float | None]:
        return {key: float(each) if np.isfinite(each) else None for key, each in zip(keys, u, strict=True)}

    rows = [
        {"repeats": row.repeats, "readings": row.readings, "minutes": row.minutes, "u": by_name(row.u),
         "one_placing_more": {"readings": row.readings_more, "minutes": row.minutes_more, "u": by_name(row.u_more)}}
        for row in plan.worth.rows
    ]  # fmt: skip
    return {"from_repeats": plan.worth.enough, "rows": rows}


def plan_summary(plan: MeasurementPlan) -> Summary:
    """For the end of the command; its details are the placings, below their headings."""
    found = plan.outlook.identifiability
    words_of: dict[bool, tuple[str, Standing]] = {True: ("MET", "good"), False: ("NOT MET", "open")}
    met = tuple(Headline(*words_of[one.met], one.what, ()) for one in plan.conditions)
    heads = (say("No."), say("Set up"), say("From → to / mm"), say("Points"), say("min"))
    placings = tuple(words.placing_rows(plan))
    figures: tuple[Figure, ...] = ()
    remarks: list[Text] = [say("No reading shows: {what}.", what=text) for text in plan.free]
    if found is not None:
        us = (say("u = {u} {unit}", u=words.expected(p, p.u), unit=words.unit_of(p.unknown)) for p in found.parameters)
        each = zip(found.parameters, us, strict=True)
        figures = tuple((words.named(p.unknown), u, words.STATUS[p.status]) for p, u in each)
        remarks += [say("Stays free: {what}.", what=words.combination(parts)) for parts in found.free]
        remarks += [say("Could not be told apart: {effects}.", effects=text) for text in words.pairs(found)]
        alike = words.absorbed(found)
        remarks += [say("Would be taken for what the job names: {effects}.", effects=text) for text in alike]
    if plan.part is not None:
        remarks += foreseen_words(plan.part)
    return Summary(
        words.to_measure_words(plan), verdicts=met, figures=figures, remarks=tuple(remarks),
        details=(heads, *placings) if placings else (),
    )  # fmt: skip
