"""A job carried from data to diagnosis: read, screen, find what the model leaves out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from cmm_uq.analysis.conformity.as_recorded import OutsideReadings as LeftOut
from cmm_uq.analysis.conformity.consequences import consequences, costs
from cmm_uq.analysis.diagnosis.diagnosis import FALSE_ALARMS, Diagnosis, diagnose
from cmm_uq.analysis.diagnosis.power import ALLOWED
from cmm_uq.analysis.diagnosis.smallest import USUAL_LENGTH, SmallestEffect, smallest_effects
from cmm_uq.analysis.planning.advice import DetectionGoal, NextPlan, suggestions
from cmm_uq.analysis.planning.setting import Planning
from cmm_uq.analysis.planning.suggestion import next_plan
from cmm_uq.analysis.screening.finding import Finding
from cmm_uq.app.commands.against import Against, against_simulation
from cmm_uq.app.commands.estimation import without_outliers
from cmm_uq.app.commands.model import OVERFLOW_FIX, recipe_of, recorded_model, refuse_planned
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.overflow import refusing_overflow
from cmm_uq.certificate.diagnosis.page import diagnosed_outcome
from cmm_uq.certificate.diagnosis.sections import TO_FILL_IN
from cmm_uq.certificate.outcome import Found, Outcome, Recipe
from cmm_uq.certificate.result import Diagnosed
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.simulation import KEY
from cmm_uq.machine.model import MeasurementModel
from cmm_uq.machine.model.kind import Kind, Observe
from cmm_uq.maths.inference.posterior import NoisyPosterior, Progress


def diagnose_read(job: Job, *, seed: int = 0, alpha: float = FALSE_ALARMS, progress: Progress | None = None) -> Found:
    """Diagnose a job that was read, in the way of its kind."""
    _check_rate(alpha)
    with refusing_overflow(job.recording_path, OVERFLOW_FIX):
        return _recipe(job).analyse(job, seed=seed, alpha=alpha, progress=progress)


def diagnose_job(
    folder: Path, *, seed: int = 0, alpha: float = FALSE_ALARMS, progress: Progress | None = None
) -> Diagnosed:
    """Diagnose a recording of an artefact; see :func:`diagnose_read`."""
    _check_rate(alpha)
    return _diagnose(read_job(folder), seed=seed, alpha=alpha, progress=progress)


def _check_rate(alpha: float) -> None:
    if not 1e-6 <= alpha <= 0.5:
        raise CmmUqError(f"a false-alarm rate of {alpha:g}", fix="Give one between 0.000001 and 0.5; 0.01 is usual")


def _diagnose(job: Job, *, seed: int, alpha: float, progress: Progress | None = None) -> Diagnosed:
    refuse_planned(job)
    kind_of(job).observing("diagnosed as a recording of an artefact")
    simulation = job.facts.simulation
    if simulation is not None:
        return _against(job, against_simulation(job, simulation), seed=seed, alpha=alpha, progress=progress)
    model, findings = screened_model(job)
    return diagnosed(job, model, findings, seed=seed, alpha=alpha, progress=progress, show=True)


def _against(job: Job, compared: Against, *, seed: int, alpha: float, progress: Progress | None) -> Diagnosed:
    """Diagnose what a simulation leaves of a recording. Figures and decisions are the recording's own: none is corrected."""
    facts = job.facts.artefact
    model, outliers = without_outliers(compared.model)
    made = partial(compared.observe, facts, where=job.recording_path)
    diagnosis = diagnose(model, stated_um=compared.stated_um, alpha=alpha, seed=seed, progress=progress, observe=made)
    findings = (*compared.findings, *outliers)
    unseen = smallest_effects(diagnosis.found, alpha, diagnosis.after)
    plan = _next(job, diagnosis, compared.observe, _wanted(job, diagnosis, unseen))
    next_ones = suggestions(plan, model.artefact.title)
    return Diagnosed(job, findings, diagnosis, next_ones, simulated=compared.simulated, unseen=unseen, next_plan=plan)


def screened_model(job: Job) -> tuple[MeasurementModel, tuple[Finding, ...]]:
    """The model that a job names, without gross outliers, and all that the screening found."""
    model, findings = recorded_model(job)
    model, outliers = without_outliers(model)
    return model, (*findings, *outliers)


def diagnosed(
    job: Job,
    model: MeasurementModel,
    findings: tuple[Finding, ...],
    *,
    seed: int,
    alpha: float = FALSE_ALARMS,
    progress: Progress | None = None,
    known: NoisyPosterior | None = None,
    show: bool = False,
) -> Diagnosed:
    """Diagnose the screened model of a job."""
    stated = job.facts.recording.u_coordinate_um
    kind, facts = kind_of(job), job.facts.artefact
    observe = kind.observing("diagnosed")
    made = partial(observe, facts, where=job.recording_path)
    diagnosis = diagnose(model, stated_um=stated, alpha=alpha, seed=seed, progress=progress, known=known, observe=made)
    left_out = LeftOut.of(job.points, findings, made)
    changes = consequences(job, diagnosis, made, kind.tested, seed, left_out)
    unseen = smallest_effects(diagnosis.found, alpha, diagnosis.after)
    plan = _next(job, diagnosis, observe, _wanted(job, diagnosis, unseen) if show else ())
    next_ones = suggestions(plan, model.artefact.title)
    cost = costs(job, diagnosis, made, kind.tested, seed, left_out)
    return Diagnosed(job, findings, diagnosis, next_ones, changes, unseen=unseen, next_plan=plan, costs=cost)


def _wanted(job: Job, diagnosis: Diagnosis, unseen: Sequence[SmallestEffect]) -> tuple[DetectionGoal, ...]:
    """What further set-ups shall show: as the job says, else what a recording that agrees could not have shown."""
    asked = job.facts.plan.unseen
    if not (diagnosis.verdict == "consistent" if asked is None else asked):
        return ()
    blind = [row for row in unseen if row.blind and row.periods is None]
    needed = max((row.length for row in unseen if row.length is not None), default=USUAL_LENGTH)
    return tuple(DetectionGoal(row.effect, ALLOWED * _enough(row), row.length or needed) for row in blind)


def _enough(row: SmallestEffect) -> float:
    """Part of what physics allows that further set-ups shall show: all of it, or half of what shows already."""
    return 1.0 if row.detected is None or not row.shown else 0.5 * row.detected / row.allowed


def _next(job: Job, diagnosis: Diagnosis, observe: Observe, wanted: tuple[DetectionGoal, ...]) -> NextPlan | None:
    facts = job.facts
    return next_plan(diagnosis, facts.artefact, observe, kind_of(job).offers("plan", Planning), facts.plan, wanted)


def outcome_of(found: Found, seed: int = 0) -> Outcome:
    """What there is to write of what :func:`diagnose_read` found."""
    return _recipe(found.job).outcome(found, seed)


def _recipe(job: Job) -> Recipe:
    """How a job is diagnosed; see :func:`~cmm_uq.app.commands.model.recipe_of`."""
    if job.facts.simulation is not None and kind_of(job).observe is None:
        raise CmmUqError(f"a job of kind {job.facts.artefact.kind!r} is compared with no simulation: its analysis is its own",
                         where=f"job.toml {KEY}", fix="Leave the simulation out")  # fmt: skip
    return recipe_of(job, lambda own: own.diagnose, _usual, "diagnosed as a recording of an artefact")


def _usual(kind: Kind) -> Recipe:
    return Recipe(_diagnose, lambda found, seed: _outcome(found))


def _outcome(found: Diagnosed) -> Outcome:
    from cmm_uq.app.commands.jobs.simulate import to_fill_in

    plan = found.next_plan
    files = {} if plan is None else {TO_FILL_IN: to_fill_in(plan.points)}
    return replace(diagnosed_outcome(found), files=files)
