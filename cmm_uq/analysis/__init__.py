"""The recipe: a job carried from data to result. Read, screen, estimate, decide.

The command line, the Python interface and batches all call :func:`analyse`.
"""

from __future__ import annotations

from pathlib import Path

from cmm_uq.analysis.estimation import (
    accuracy,
    influences,
    model_of,
    noise,
    parameters,
    sizes,
    with_noise,
    without_outliers,
)
from cmm_uq.analysis.result import Result
from cmm_uq.artefacts import artefact_of
from cmm_uq.conformity.standards import statement
from cmm_uq.inference.posterior import Progress, sample
from cmm_uq.jobs.reading import read_job
from cmm_uq.mismatch.screening import screen

__all__ = ["Result", "analyse"]


def analyse(folder: Path, *, seed: int = 0, progress: Progress | None = None) -> Result:
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
    job = read_job(folder)
    artefact = artefact_of(job.facts.artefact, job.points, where=job.recording_path)
    model = model_of(job, artefact)
    needed = {column for effect in model.effects for column in effect.columns}
    found = screen(job.points, needed=needed, set_aside=job.facts.recording.set_aside, where=job.recording_path)
    model, outliers = without_outliers(model)
    model, estimate, p_value = with_noise(model)
    posterior = sample(estimate.linear, seed, progress)
    figures = accuracy(model, estimate, posterior, seed)
    statements = [
        statement(wish, artefact, figures, f"[[conformity]] {i}") for i, wish in enumerate(job.facts.conformity, 1)
    ]
    findings = (*found, *outliers)
    return Result(
        job, model, findings, influences(model, estimate, findings), estimate, posterior, parameters(model, posterior),
        sizes(artefact, posterior), noise(posterior, job.facts.recording.u_coordinate_um, p_value), figures,
        tuple(statements),
    )  # fmt: skip
