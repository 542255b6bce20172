"""A job carried from data to diagnosis: read, screen, find what the model leaves out."""

from __future__ import annotations

from pathlib import Path

from cmm_uq.analysis.consequences import consequences
from cmm_uq.analysis.error_maps import MapsDiagnosed, diagnose_error_maps
from cmm_uq.analysis.estimation import model_of, without_outliers
from cmm_uq.analysis.refusals import refuse
from cmm_uq.analysis.result import Diagnosed
from cmm_uq.artefacts import artefact_of
from cmm_uq.errors import CmmUqError
from cmm_uq.inference.posterior import Progress
from cmm_uq.jobs.job import ERROR_MAP, Job
from cmm_uq.jobs.reading import read_job
from cmm_uq.measurement import MeasurementModel
from cmm_uq.mismatch.diagnosis import FALSE_ALARMS, diagnose
from cmm_uq.mismatch.screening import Finding, screened
from cmm_uq.mismatch.suggestion import suggestions
from cmm_uq.physics.catalogue import effects


def diagnose_folder(
    folder: Path, *, seed: int = 0, alpha: float = FALSE_ALARMS, progress: Progress | None = None
) -> Diagnosed | MapsDiagnosed:
    """Diagnose a job: a recording of an artefact, or the machine's error maps.

    Parameters
    ----------
    folder : the job folder.
    seed : of everything random.
    alpha : rate of false alarms.

    Raises
    ------
    CmmUqError : the job cannot be diagnosed as it stands.
    """
    return diagnose_read(read_job(folder), seed=seed, alpha=alpha, progress=progress)


def diagnose_read(
    job: Job, *, seed: int = 0, alpha: float = FALSE_ALARMS, progress: Progress | None = None
) -> Diagnosed | MapsDiagnosed:
    """Diagnose a job that was read; see :func:`diagnose_folder`.

    Raises
    ------
    CmmUqError : the job cannot be diagnosed as it stands.
    """
    _check_rate(alpha)
    if job.facts.artefact.kind == ERROR_MAP:
        return diagnose_error_maps(job, seed=seed, alpha=alpha, progress=progress)
    return _diagnose(job, seed, alpha, progress)


def diagnose_job(
    folder: Path, *, seed: int = 0, alpha: float = FALSE_ALARMS, progress: Progress | None = None
) -> Diagnosed:
    """Diagnose a recording of an artefact; see :func:`diagnose_folder`.

    Raises
    ------
    CmmUqError : the job cannot be diagnosed as it stands, or has no such recording.
    """
    _check_rate(alpha)
    return _diagnose(read_job(folder), seed, alpha, progress)


def _check_rate(alpha: float) -> None:
    if not 1e-6 <= alpha <= 0.5:
        raise CmmUqError(f"a false-alarm rate of {alpha:g}", fix="Give one between 0.000001 and 0.5; 0.01 is usual")


def _diagnose(job: Job, seed: int, alpha: float, progress: Progress | None) -> Diagnosed:
    refuse(job, "diagnosed as a recording of an artefact")
    model, findings = screened_model(job)
    return diagnosed(job, model, findings, seed=seed, alpha=alpha, progress=progress)


def screened_model(job: Job) -> tuple[MeasurementModel, tuple[Finding, ...]]:
    """The model that a job names, without gross outliers, and all that the screening found.

    Raises
    ------
    CmmUqError : the recording does not fit the model.
    """
    where = job.recording_path
    acting = effects(job.facts.model.effects, where="job.toml [model] effects")
    recording = screened(
        job.points, job.facts.artefact, needed={column for effect in acting for column in effect.columns},
        set_aside=job.facts.recording.set_aside, where=where,
    )  # fmt: skip
    model = model_of(job, artefact_of(job.facts.artefact, recording.points, where=where))
    model, outliers = without_outliers(model)
    return model, (*recording.findings, *outliers)


def diagnosed(
    job: Job,
    model: MeasurementModel,
    findings: tuple[Finding, ...],
    *,
    seed: int,
    alpha: float = FALSE_ALARMS,
    progress: Progress | None = None,
) -> Diagnosed:
    """Diagnose the screened model of a job."""
    stated = job.facts.recording.u_coordinate_um
    diagnosis = diagnose(model, stated_um=stated, alpha=alpha, seed=seed, progress=progress)
    changes = consequences(job, diagnosis, seed)
    return Diagnosed(job, findings, diagnosis, suggestions(diagnosis, job.facts.artefact, job.facts.plan), changes)
