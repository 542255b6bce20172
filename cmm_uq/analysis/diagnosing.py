"""A job carried from data to diagnosis: read, screen, find what the model leaves out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cmm_uq.analysis.estimation import model_of, without_outliers
from cmm_uq.artefacts import artefact_of
from cmm_uq.errors import CmmUqError
from cmm_uq.inference.posterior import Progress
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.reading import read_job
from cmm_uq.mismatch.diagnosis import FALSE_ALARMS, Diagnosis, diagnose
from cmm_uq.mismatch.screening import Finding, screen
from cmm_uq.mismatch.suggestion import Suggestion, suggestions


@dataclass(frozen=True, eq=False)
class Diagnosed:
    """A job with its diagnosis.

    Parameters
    ----------
    job, findings : what was read, and what the screening found.
    diagnosis : what is missing.
    suggestions : what to measure next.
    """

    job: Job
    findings: tuple[Finding, ...]
    diagnosis: Diagnosis
    suggestions: tuple[Suggestion, ...]


def diagnose_job(
    folder: Path, *, seed: int = 0, alpha: float = FALSE_ALARMS, progress: Progress | None = None
) -> Diagnosed:
    """Diagnose a job.

    Parameters
    ----------
    folder : the job folder.
    seed : of everything random.
    alpha : rate of false alarms.

    Raises
    ------
    CmmUqError : the job cannot be diagnosed as it stands.
    """
    if not 1e-6 <= alpha <= 0.5:
        raise CmmUqError(f"a false-alarm rate of {alpha:g}", fix="Give one between 0.000001 and 0.5; 0.01 is usual")
    job = read_job(folder)
    artefact = artefact_of(job.facts.artefact, job.points, where=job.recording_path)
    model = model_of(job, artefact)
    needed = {column for effect in model.effects for column in effect.columns}
    found = screen(job.points, needed=needed, set_aside=job.facts.recording.set_aside, where=job.recording_path)
    model, outliers = without_outliers(model)
    stated = job.facts.recording.u_coordinate_um
    diagnosis = diagnose(model, stated_um=stated, alpha=alpha, seed=seed, progress=progress)
    return Diagnosed(job, (*found, *outliers), diagnosis, suggestions(diagnosis, job.facts.artefact))
