"""The recipe: a job carried from data to result. Read, screen, estimate, diagnose, decide.

The command line, the Python interface and batches all call :func:`analyse`.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

from cmm_uq.analysis.conformity.as_recorded import OutsideReadings as LeftOut
from cmm_uq.analysis.conformity.standards import statement
from cmm_uq.app.commands.diagnose import diagnose_model, screened_model
from cmm_uq.app.commands.estimation import (
    accuracy,
    contradictions,
    named_draws,
    noise,
    parameters,
    sizes,
    with_doubt,
    with_noise,
)
from cmm_uq.app.commands.model import OVERFLOW_FIX, recipe_of
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import kind_of
from cmm_uq.base.overflow import must_be_finite, refusing_overflow
from cmm_uq.certificate.certificate import certified
from cmm_uq.certificate.outcome import Found, Outcome, Page, Recipe
from cmm_uq.certificate.result import Result
from cmm_uq.jobs.job import Job
from cmm_uq.machine.model.bending import with_curvature
from cmm_uq.machine.model.doubt import causes_of
from cmm_uq.machine.model.kind import Kind
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.maths.inference.posterior import Progress
from cmm_uq.maths.inference.sampling import sample_with_noise

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
        return report_recipe(job).analyse(job, seed=seed, progress=progress)


def analyse_observations(job: Job, *, seed: int = 0, progress: Progress | None = None) -> Result:
    """Analyse a job whose observations are explained by named effects.

    Raises
    ------
    CmmUqError : the job cannot be analysed as it stands.
    """
    kind = kind_of(job)
    screened, findings = screened_model(job)
    model, estimate, p_value = with_noise(screened)
    components = noise_of(model)
    drawn = sample_with_noise(estimate.linear, components, estimate.least_squares, seed, progress)
    posterior = with_curvature(model, components, drawn)
    causes = causes_of(model.artefact, job.circumstances)
    figures = accuracy(model, estimate, posterior, causes, seed)
    made = partial(kind.observing("reported"), job.facts.artefact, where=job.recording_path)
    left_out = LeftOut.of(job.points, findings, made)
    statements = [
        statement(wish, model.artefact, figures, f"[[conformity]] {i}", kind.tested, None, job.circumstances, left_out)
        for i, wish in enumerate(job.facts.conformity, 1)
    ]
    found = diagnose_model(
        job, screened, findings, seed=seed, known=posterior if model.sigma == screened.sigma else None
    )
    averaged = found.diagnosis.remaining.draws
    values, doubt = with_doubt(model, estimate, posterior, posterior.draws if averaged is None else averaged, causes)
    denied = () if averaged is None else contradictions(model, estimate, posterior, averaged)
    result = Result(
        job, model, findings, estimate, posterior, values,
        named_draws(model, components, posterior, values, mixture=averaged is not None),
        parameters(model, values), sizes(model, values),
        noise(estimate, components, posterior, job.facts.recording.u_coordinate_um, p_value), figures, tuple(statements),
        found, causes=causes, doubt=doubt, contradictions=denied,
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
    return report_recipe(found.job).outcome(found, seed)


def report_recipe(job: Job) -> Recipe:
    """How a job is reported; see :func:`~cmm_uq.app.commands.model.recipe_of`.

    Raises
    ------
    CmmUqError : it cannot be, or nothing is measured yet.
    """
    return recipe_of(job, lambda own: own.report, _certified, "reported")


def _certified(kind: Kind) -> Recipe:
    page = kind.needs("page", Page, "reported")
    return Recipe(analyse_observations, lambda found, seed: certified(found, page))
