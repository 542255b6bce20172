"""The recipe: a job carried from data to result. Read, screen, estimate, diagnose, decide.

The command line, the Python interface and batches all call :func:`analyse`.
"""

from __future__ import annotations

from pathlib import Path

from cmm_uq.commands.diagnosing import diagnosed, screened_model
from cmm_uq.commands.estimation import accuracy, named_draws, noise, parameters, sizes, with_noise
from cmm_uq.commands.reading import read_job
from cmm_uq.commands.refusals import OVERFLOW_FIX, refuse_planned
from cmm_uq.conformity.standards import statement
from cmm_uq.documents.compose import certified
from cmm_uq.documents.outcome import Found, Outcome, OwnAnalysis, Page, Recipe
from cmm_uq.documents.result import Result
from cmm_uq.inference.posterior import Progress, sample
from cmm_uq.jobs.job import Job
from cmm_uq.kinds import kind_of
from cmm_uq.overflow import must_be_finite, refusing_overflow

__all__ = ["Result", "analyse", "analyse_job", "analyse_observations", "outcome_of"]


def analyse(folder: Path, *, seed: int = 0, progress: Progress | None = None) -> Found:
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


def analyse_job(job: Job, *, seed: int = 0, progress: Progress | None = None) -> Found:
    """Analyse a job that was read; see :func:`analyse`.

    Raises
    ------
    CmmUqError : the job cannot be analysed as it stands.
    """
    with refusing_overflow(job.recording_path, OVERFLOW_FIX):
        return recipe_of(job).analyse(job, seed=seed, progress=progress)


def analyse_observations(job: Job, *, seed: int = 0, progress: Progress | None = None) -> Result:
    """Analyse a job whose observations are explained by named effects.

    Raises
    ------
    CmmUqError : the job cannot be analysed as it stands.
    """
    kind = kind_of(job)
    screened, findings = screened_model(job)
    model, estimate, p_value = with_noise(screened)
    posterior = sample(estimate.linear, seed, progress)
    figures = accuracy(model, estimate, posterior, seed)
    statements = [
        statement(wish, model.artefact, figures, f"[[conformity]] {i}", kind.standards)
        for i, wish in enumerate(job.facts.conformity, 1)
    ]
    result = Result(
        job, model, findings, estimate, posterior, named_draws(model, posterior),
        parameters(model, posterior), sizes(model, posterior),
        noise(posterior, job.facts.recording.u_coordinate_um, p_value), figures, tuple(statements),
        diagnosed(job, screened, findings, seed=seed),
    )  # fmt: skip
    for name, quantity in result.quantities():
        must_be_finite(
            (quantity.value, quantity.u, *quantity.interval95), f"{job.recording_path}: {name}", OVERFLOW_FIX
        )
    return result


def outcome_of(found: Found, seed: int = 0) -> Outcome:
    """What there is to write of what :func:`analyse` found.

    Raises
    ------
    CmmUqError : its kind has no page for a certificate.
    """
    return recipe_of(found.job).outcome(found, seed)


def recipe_of(job: Job) -> Recipe:
    """How a job is analysed: in its kind's own way, or as observations that named effects explain.

    Raises
    ------
    CmmUqError : in neither, or nothing is measured yet.
    """
    refuse_planned(job)
    kind = kind_of(job)
    own = kind.offers("own", OwnAnalysis)
    if own is not None and own.report is not None:
        return own.report
    kind.observing("reported")
    page = kind.needs("page", Page, "reported")
    return Recipe(analyse_observations, lambda found, seed: certified(found, page))
