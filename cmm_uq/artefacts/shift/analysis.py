"""Shifted artefacts: their analysis along an axis or in a plane, the series of an axis as a plan, what they leave open."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from cmm_uq import __version__
from cmm_uq.analysis.planning.set_up import Pattern, SetUp
from cmm_uq.analysis.planning.setting import Planning, Setting, Start
from cmm_uq.artefacts.gauge_lines import faces_of
from cmm_uq.artefacts.kinds import ShiftFacts
from cmm_uq.artefacts.shift import axis_page, plane_page
from cmm_uq.artefacts.shift.axis import ShiftResult, analyse_shift, checked_series, recorded_series
from cmm_uq.artefacts.shift.plane import PlaneShiftResult, analyse_plane, checked_plate
from cmm_uq.artefacts.shift.result import shift_facts, table_file, table_text
from cmm_uq.artefacts.shift.series import undetermined
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, day, names, say
from cmm_uq.base.points import AXES, Points
from cmm_uq.certificate.certificate import certificate_of
from cmm_uq.certificate.clauses import clauses_data, formal_warnings
from cmm_uq.certificate.document import Document
from cmm_uq.certificate.origin import posterior_file
from cmm_uq.certificate.result import Outcome, OwnAnalysis, Recipe
from cmm_uq.certificate.sections.conformity import conformity_section
from cmm_uq.certificate.sections.results import as_found_data, as_found_section, headlines, overview_of
from cmm_uq.certificate.wording import Summary, figure_row
from cmm_uq.jobs.job import Job
from cmm_uq.maths.inference.ensembles import Progress


def refuse_unfit(job: Job) -> None:
    if shift_facts(job).plane is not None:
        checked_plate(job)
    else:
        checked_series(job)


def analyse(job: Job, *, seed: int = 0, progress: Progress | None = None) -> ShiftResult | PlaneShiftResult:
    if shift_facts(job).plane is not None:
        return analyse_plane(job, seed=seed, progress=progress)
    return analyse_shift(job, seed=seed, progress=progress)


def outcome(found: ShiftResult | PlaneShiftResult, seed: int) -> Outcome:
    page: Any = axis_page if isinstance(found, ShiftResult) else plane_page
    job, left = found.job, page.quantities(found)
    told = [*page.warnings(found), *found.stating.warnings()]
    if job.circumstances.uncertainty.of_artefact:
        told.append(
            say(
                "What is stated of the artefact's temperature, expansion, alignment and fixturing is in no figure here."
            )
        )
    warned = (*told, *formal_warnings(job))
    figures = tuple(figure_row(name, quantity) for _, _, name, quantity in left)
    short = Summary(
        page.measured(found),
        day(job.facts.job.date),
        headlines(found),
        figures,
        warnings=warned,
    )
    draws, table = posterior_file(found.draws, job.origin), table_file(job)
    results = page.shift_results(found) | as_found_data(job) | clauses_data(job) | found.stating.data()
    results["posterior"] = draws.entry
    files = {table: table_text(found.table), draws.name: draws.content}

    def certificate() -> Document:
        sections = page.sections(found)
        sections[1:1] = [conformity_section(found.statements), as_found_section(job, left)]
        produced_by = say(
            "cmm-uq {version}, {sampler}, seed {seed}",
            version=Verbatim(__version__), sampler=Verbatim(found.estimate.chains.sampler), seed=found.estimate.seed,
        )  # fmt: skip
        overview = overview_of(found)
        return certificate_of(job, sections, tuple(told), produced_by, tuple(names(files)), overview)

    return Outcome(found, certificate, results, short, warned, files, draws=found.draws, verdicts=found.verdicts)


OWN = OwnAnalysis(report=Recipe(analyse, outcome))


def shift_series(setting: Setting) -> tuple[SetUp, ...]:
    """The artefact's points along its axis, once for each shift."""
    facts, plan, volume = _facts(setting), setting.plan, setting.volume
    if facts.axis is None or not facts.shifts_mm:
        raise CmmUqError("axis and shifts_mm are needed", where="job.toml [artefact]",
                         fix='Give axis = "x" and shifts_mm = [0.0, 20.0], one shift a series')  # fmt: skip
    known = facts.known.length_mm if facts.known else plan.length_mm
    if known is None and not plan.lengths_mm:
        raise CmmUqError("the length of the artefact is needed", where="job.toml [plan] length_mm",
                         fix="Give it, with pitch_mm, or all distances as lengths_mm")  # fmt: skip
    places = np.concatenate([[0.0], faces_of(facts, plan.model_copy(update={"length_mm": known}))])
    i = AXES.index(facts.axis)
    reach = float(places[-1] + np.ptp(facts.shifts_mm))
    if reach > volume.size[i]:
        raise volume.too_small(np.outer([0.0, reach], np.eye(3)[i]), say("with its farthest shift"))
    start = volume.box.mean(axis=1)
    start[i] = volume.box[i, 0] - min(facts.shifts_mm)
    n = len(places)
    body = np.outer(places, np.eye(3)[i])
    pattern = Pattern(body, np.arange(1, n + 1), np.ones(n, dtype=np.int64)).repeated(plan.repeats)
    return tuple(
        pattern.placed(
            setting.machine, np.eye(3), start + shift * np.eye(3)[i], say("shifted by {shift:g} mm", shift=shift)
        )
        for shift in facts.shifts_mm
    )


def candidates(setting: Setting, start: Start | None) -> tuple[SetUp, ...]:
    _facts(setting)
    raise CmmUqError("a shift job has its series, and no other placings to choose from",
                     where="job.toml [plan] criterion", fix="Leave it out; shifts_mm says what is measured")  # fmt: skip


def free(setting: Setting, points: Points, where: str) -> tuple[Text, ...]:
    """What no reading of these series shows."""
    facts = _facts(setting)
    left = undetermined(recorded_series(facts, points, where), scale_known=facts.known is not None)
    found = [
        say(
            "errors that repeat every {period:.4g} mm, or a half, a third … of it: every shift is a multiple of it",
            period=left.period,
        )
    ]
    if facts.known is None:
        found.append(say("the mean scale of the axis: no length of the artefact is known"))
    if left.patterns.shape[1]:
        found.append(
            say(
                "{shape} independent patterns of error at the places read, unless errors are smooth",
                shape=left.patterns.shape[1],
            )
        )
    return tuple(found)


def _facts(setting: Setting) -> ShiftFacts:
    facts = cast("ShiftFacts", setting.artefact)
    if facts.plane is not None:
        problem = "the placings of a plate shifted in a plane are not planned"
        fix = "cmm-uq report says what those of a recording leave open"
        raise CmmUqError(problem, where="job.toml [artefact] plane", fix=fix)
    return facts


PLANNING = Planning({"shift series": shift_series}, candidates, free=free)
