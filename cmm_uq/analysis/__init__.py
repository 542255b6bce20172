"""The recipe: a job carried from data to result. Read, screen, estimate, diagnose, decide.

The command line, the Python interface and batches all call :func:`analyse`.
"""

from __future__ import annotations

from pathlib import Path

from cmm_uq.analysis.diagnosing import diagnosed, screened_model
from cmm_uq.analysis.estimation import accuracy, influences, noise, parameters, sizes, with_noise
from cmm_uq.analysis.plane_shifting import PlaneShiftResult, analyse_plane
from cmm_uq.analysis.refusals import refuse
from cmm_uq.analysis.result import Result
from cmm_uq.analysis.shifting import ShiftResult, analyse_shift
from cmm_uq.conformity.standards import statement
from cmm_uq.inference.posterior import Progress, sample
from cmm_uq.jobs.job import SHIFT, Job
from cmm_uq.jobs.reading import read_job

__all__ = ["PlaneShiftResult", "Result", "ShiftResult", "analyse", "analyse_job", "analyse_observations"]


def analyse(
    folder: Path, *, seed: int = 0, progress: Progress | None = None
) -> Result | ShiftResult | PlaneShiftResult:  # fmt: skip
    """Analyse a job.

    Parameters
    ----------
    folder : the job folder.
    seed : of everything random; the same seed gives the same result.
    progress : told the part of the sampling done, from 0 to 1.

    Raises
    ------
    CmmUqError : the job cannot be analysed as it stands.
    """
    return analyse_job(read_job(folder), seed=seed, progress=progress)


def analyse_job(
    job: Job, *, seed: int = 0, progress: Progress | None = None
) -> Result | ShiftResult | PlaneShiftResult:  # fmt: skip
    """Analyse a job that was read; see :func:`analyse`.

    Raises
    ------
    CmmUqError : the job cannot be analysed as it stands.
    """
    refuse(job, "reported", but=SHIFT)
    if job.facts.artefact.plane is not None:
        return analyse_plane(job, seed=seed, progress=progress)
    if job.facts.artefact.kind == SHIFT:
        return analyse_shift(job, seed=seed, progress=progress)
    return analyse_observations(job, seed=seed, progress=progress)


def analyse_observations(job: Job, *, seed: int = 0, progress: Progress | None = None) -> Result:
    """Analyse a job whose observations are explained by named effects: every kind but shift.

    Raises
    ------
    CmmUqError : the job cannot be analysed as it stands.
    """
    screened, findings = screened_model(job)
    model, estimate, p_value = with_noise(screened)
    posterior = sample(estimate.linear, seed, progress)
    figures = accuracy(model, estimate, posterior, seed)
    statements = [
        statement(wish, model.artefact, figures, f"[[conformity]] {i}")
        for i, wish in enumerate(job.facts.conformity, 1)
    ]
    return Result(
        job, model, findings, influences(model, estimate, findings), estimate, posterior, parameters(model, posterior),
        sizes(model.artefact, posterior), noise(posterior, job.facts.recording.u_coordinate_um, p_value), figures,
        tuple(statements), diagnosed(job, screened, findings, seed=seed),
    )  # fmt: skip
