"""A job carried from data to diagnosis: read, screen, find what the model leaves out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from cmm_uq.analysis.conformity.accuracy import consequences, costs
from cmm_uq.analysis.conformity.as_recorded import OutsideReadings
from cmm_uq.analysis.diagnosis.diagnosis import FALSE_ALARMS, Diagnosis, diagnose
from cmm_uq.analysis.diagnosis.power import ALLOWED
from cmm_uq.analysis.diagnosis.simulation import simulation_mistakes
from cmm_uq.analysis.diagnosis.smallest import USUAL_LENGTH, SmallestEffect, smallest_effects
from cmm_uq.analysis.planning.set_up import DetectionGoal, suggestions
from cmm_uq.analysis.planning.setting import Planning
from cmm_uq.analysis.planning.suggestion import next_plan
from cmm_uq.analysis.screening.columns import Finding
from cmm_uq.app.commands.estimation import without_outliers
from cmm_uq.app.commands.files import Form, Stage, Told, Written, silent
from cmm_uq.app.commands.model import (
    OVERFLOW_FIX,
    Against,
    against_simulation,
    recipe_of,
    recorded_model,
    refuse_planned,
)
from cmm_uq.app.commands.reading import compared_with, in_language, read_job
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.languages.translation import Code
from cmm_uq.base.overflow import refusing_overflow
from cmm_uq.base.plugins import naming_package
from cmm_uq.certificate.diagnosis.empirical import EMPIRICAL, stated_functions
from cmm_uq.certificate.diagnosis.page import diagnosed_outcome
from cmm_uq.certificate.diagnosis.sections import TO_FILL_IN
from cmm_uq.certificate.result import AnalysisResult, JobDiagnosis, Outcome, Recipe
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.recording.compared import KEY
from cmm_uq.laboratory.records.place import NONE
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.stated import physics_of, with_own_physics
from cmm_uq.maths.inference.ensembles import Progress
from cmm_uq.maths.inference.posterior import NoisyPosterior

DIAGNOSE = Form("diagnose", ("diagnosis.html", "diagnosis.pdf"), "diagnosis", (TO_FILL_IN, EMPIRICAL), recorded=True)


@with_own_physics
def diagnose_read(
    job: Job, *, seed: int = 0, alpha: float = FALSE_ALARMS, progress: Progress | None = None
) -> AnalysisResult:
    if not 1e-6 <= alpha <= 0.5:
        raise CmmUqError(f"a false-alarm rate of {alpha:g}", fix="Give one between 0.000001 and 0.5; 0.01 is usual")
    with refusing_overflow(job.recording_path, OVERFLOW_FIX):
        return _recipe(job).analyse(job, seed=seed, alpha=alpha, progress=progress)


def _diagnose(job: Job, *, seed: int, alpha: float, progress: Progress | None = None) -> JobDiagnosis:
    refuse_planned(job)
    kind_of(job).observing("diagnosed as a recording of an artefact")
    simulation = job.facts.simulation
    against = None if simulation is None else against_simulation(job, simulation)
    if against is None:
        model, findings = screened_model(job)
    else:
        model, outliers = without_outliers(against.model)
        findings = (*against.findings, *outliers)
    return diagnose_model(job, model, findings, seed=seed, alpha=alpha, progress=progress, show=True, against=against)


def screened_model(job: Job) -> tuple[RecordingModel, tuple[Finding, ...]]:
    """The model that a job names, without gross outliers, and all that the screening found."""
    model, findings = recorded_model(job)
    model, outliers = without_outliers(model)
    return model, (*findings, *outliers)


def diagnose_model(
    job: Job, model: RecordingModel, findings: tuple[Finding, ...], *, seed: int, alpha: float = FALSE_ALARMS,
    progress: Progress | None = None, known: NoisyPosterior | None = None, show: bool = False,
    against: Against | None = None,
) -> JobDiagnosis:  # fmt: skip
    """Diagnose the screened model of a job, or what a simulation leaves of its recording.

    ``known`` is its posterior where it was sampled already; ``show``: what to measure next shall also show what this recording
    could not. Against a simulation, figures and decisions are the recording's own: none is corrected.
    """
    facts, kind = job.facts, kind_of(job)
    observe = kind.observing("diagnosed") if against is None else against.observe
    stated_um = facts.recording.u_coordinate_um if against is None else against.stated_um
    artefact_at = partial(observe, facts.artefact, where=job.recording_path)
    search = partial(diagnose, model, stated_um=stated_um, alpha=alpha, seed=seed, observe=artefact_at)
    diagnosis = search(progress=progress, known=known)
    unseen = smallest_effects(diagnosis.search, alpha, diagnosis.after)
    goals = detection_goals(job, diagnosis, unseen) if show else ()
    plan = next_plan(diagnosis, facts.artefact, observe, kind.offers("plan", Planning), facts.plan, goals)
    suggested = suggestions(plan, model.artefact.title)
    found = JobDiagnosis(job, findings, diagnosis, suggested, unseen=unseen, next_plan=plan)
    if against is not None:
        mistakes = simulation_mistakes(diagnosis.search, against.predicted, against.of, against.model)
        if mistakes.named:  # it explains what differs, whatever the machine alone could be blamed for
            found = replace(found, diagnosis=replace(diagnosis, verdict="explained"))
        return replace(found, simulated=against.simulated, mistakes=mistakes)
    outside = OutsideReadings.of(job.points, findings, artefact_at)
    corrected = consequences(job, diagnosis, artefact_at, kind.tested, seed, outside)
    each = costs(job, diagnosis, artefact_at, kind.tested, seed, outside)
    return replace(found, consequences=corrected, costs=each)


def detection_goals(job: Job, diagnosis: Diagnosis, unseen: Sequence[SmallestEffect]) -> tuple[DetectionGoal, ...]:
    """What further set-ups shall show: as the job says, else what a recording that agrees could not have shown.

    Of each effect all that physics allows, or half of what shows already.
    """
    show = job.facts.plan.unseen
    if not (diagnosis.agrees if show is None else show):
        return ()
    usual = max((row.length for row in unseen if row.length is not None), default=USUAL_LENGTH)
    goals = []
    for row in unseen:
        if row.blind and row.periods is None:
            part = 1.0 if row.detected is None or not row.shown else 0.5 * row.detected / row.allowed
            goals.append(DetectionGoal(row.effect, ALLOWED * part, row.length or usual))
    return tuple(goals)


def outcome_of(result: AnalysisResult, seed: int = 0) -> Outcome:
    with physics_of(result.job):
        return _recipe(result.job).outcome(result, seed)


def _recipe(job: Job) -> Recipe:
    if job.facts.simulation is not None and kind_of(job).own is not None:
        raise CmmUqError(f"a job of kind {job.facts.artefact.kind!r} is compared with no simulation: its analysis is its own",
                         where=f"job.toml {KEY}", fix="Leave the simulation out")  # fmt: skip

    def outcome(result: JobDiagnosis, seed: int) -> Outcome:
        from cmm_uq.app.commands.jobs.simulate import to_fill_in

        plan = result.next_plan
        files = {} if plan is None else {TO_FILL_IN: to_fill_in(plan.points)}
        if stated := stated_functions(result.diagnosis):
            files[EMPIRICAL] = stated.encode()
        return replace(diagnosed_outcome(result), files=files)

    usual = Recipe(_diagnose, outcome)
    return recipe_of(job, lambda own: own.diagnose, lambda kind: usual, "diagnosed as a recording of an artefact")


@naming_package()
@with_own_physics
def diagnosis_outcome(job: Job, *, seed: int = 0, alpha: float = FALSE_ALARMS, stage: Stage = silent) -> Outcome:
    """Diagnose a job that was read and compose the page; nothing is written."""
    readings = f": {len(job.points)} readings" if job.facts.artefact.with_recording else ""
    stage(f"Searching for what was left out{readings}", 0.0)
    found = diagnose_read(job, seed=seed, alpha=alpha,
                          progress=lambda part: stage(f"Sampling: {part:.0%} of the draws", 0.7 + 0.2 * part))  # fmt: skip
    stage("Composing the page", 0.9)
    return outcome_of(found, seed)


def write_diagnosis(
    job: Path, out: Path | None = None, *, seed: int = 0, alpha: float = FALSE_ALARMS, against: Path | None = None,
    force: bool = False, stage: Stage = silent, told: Told = lambda job: None, records: str | Path | None = NONE,
    language: Code | None = None,
) -> Written[Outcome]:  # fmt: skip
    """Diagnose a job and write ``diagnosis.html``, ``diagnosis.pdf`` and ``results.json``, all or none.

    Where further set-ups would tell more, ``next_plan.csv`` comes with them. ``against``: file of a simulation's prediction
    that the recording is compared with, whatever the job names; ``records``: file, URL, ``none``, or ``None`` for those of
    the environment, else ``reports/records.db``.
    """
    read = in_language(read_job(job), language)
    if against is not None:
        read = compared_with(read, against)
    told(read)
    outcome = partial(diagnosis_outcome, read, seed=seed, alpha=alpha, stage=stage)
    return DIAGNOSE.write(read, outcome, out, force=force, stage=stage, records=records)
