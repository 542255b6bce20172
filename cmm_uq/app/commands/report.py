"""From a recording to its certificate: read, screen, model, estimate, figures, decide, diagnose, certificate."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

from cmm_uq.analysis.machine.regions import FactorRegions, factor_regions
from cmm_uq.app.commands.certificates.further import JointRecordings, together_of
from cmm_uq.app.commands.certificates.release import reissued, with_replaced
from cmm_uq.app.commands.diagnose import diagnose_model, screened_model
from cmm_uq.app.commands.estimation import (
    accuracy,
    contradictions,
    decision,
    named_draws,
    noise,
    parameters,
    sizes,
    with_doubt,
    with_noise,
)
from cmm_uq.app.commands.files import Form, Stage, Told, Written, silent
from cmm_uq.app.commands.model import OVERFLOW_FIX, recipe_of
from cmm_uq.app.commands.reading import in_language, read_job
from cmm_uq.artefacts import kind_of
from cmm_uq.base.arm import Arm
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.languages.translation import Code
from cmm_uq.base.messages import NOTHING, Text, Verbatim
from cmm_uq.base.overflow import must_be_finite, refusing_overflow
from cmm_uq.base.plugins import naming_package
from cmm_uq.certificate.certificate import certified
from cmm_uq.certificate.origin import DIGITAL
from cmm_uq.certificate.result import AnalysisResult, Outcome, Page, Recipe, Result
from cmm_uq.certificate.results.provenance import FILE as PROVENANCE
from cmm_uq.jobs.job import Job
from cmm_uq.laboratory.records.place import NONE
from cmm_uq.machine.model.artefact_doubt import causes_of
from cmm_uq.machine.model.kind import Kind, Observed
from cmm_uq.machine.model.measurement import RecordingModel, with_curvature
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.machine.physics.stated import physics_of, with_own_physics
from cmm_uq.maths.inference.ensembles import Progress
from cmm_uq.maths.inference.posterior import Doubt, NoisyPosterior, sample_with_noise

if TYPE_CHECKING:
    from cmm_uq.app.commands.certificates.signing import Signing

REPORT = Form("report", ("certificate.html", DIGITAL, "certificate.pdf"), further=(PROVENANCE,), recorded=True)


def evaluate(job: Job, *, seed: int = 0, progress: Progress | None = None) -> Result:
    """What is measured of a machine whose errors are named effects, with its uncertainty, its decisions and what is left out.

    The recording is ``y = f(x, θ) + ε``: artefact and set-ups f, effects θ with the range that physics allows, noise ε of
    readings, set-ups, length and time. Estimates are draws of θ (JCGM 101, 6), figures of performance are those of lengths as
    recorded (ISO 10360-2, 6), and decisions go by the rule that the job names (ISO 14253-1, JCGM 106).
    """
    kind = kind_of(job)
    observe = partial(kind.observing("reported"), job.facts.artefact, where=job.recording_path)

    # screen, and model: damaged rows refused, exchanged and copied points named, gross errors set aside
    screened, findings = screened_model(job)
    for i, _ in enumerate(job.facts.conformity, 1):
        decision(job, screened, findings, i)  # what cannot be decided is refused before anything is sampled

    # estimate: least squares, a stated noise held against the residuals (χ²), then the posterior with the noise unknown
    model, estimate, p_value = with_noise(screened)
    components = noise_of(model, in_turn=True)
    draws = sample_with_noise(estimate.linear, components, estimate.least_squares, seed, progress)
    posterior = with_curvature(model, components, draws)
    causes = causes_of(model.artefact, job.circumstances)

    # figures of performance of the lengths as recorded, and decisions
    figures = accuracy(model, estimate, posterior, causes, seed)
    returning = accuracy(model, estimate, posterior, causes, seed, returning=True)
    statements = tuple(decision(job, model, findings, i, figures) for i, _ in enumerate(job.facts.conformity, 1))

    # diagnose: where several explanations remain, estimates are averages over them
    known = posterior if model.sigma == screened.sigma else None
    diagnosis = diagnose_model(job, screened, findings, seed=seed, known=known)
    averaged = diagnosis.diagnosis.remaining.draws
    values, doubt = with_doubt(model, estimate, posterior, posterior.draws if averaged is None else averaged, causes)
    denied = () if averaged is None else contradictions(model, estimate, posterior, averaged)

    # all errors of the machine, by further certificates of it too: where the factors hold, computed once it is asked for
    together = together_of(job, model, posterior, doubt, seed)
    all_errors = regions_of(model, posterior, doubt, observe, seed, together)

    result = Result(
        job, model, findings, estimate, posterior, values,
        named_draws(model, components, posterior, values, mixture=averaged is not None),
        parameters(model, values), sizes(model, values),
        noise(estimate, components, posterior, job.facts.recording.u_coordinate_um, p_value), figures, statements,
        diagnosis, returning=returning, causes=causes, doubt=doubt, contradictions=denied, all_errors=all_errors,
        further=lambda: together().told,
    )  # fmt: skip
    for name, quantity in result.quantities():
        figures_of = (quantity.value, quantity.u, *quantity.interval95)
        must_be_finite(figures_of, f"{job.recording_path}: {name}", OVERFLOW_FIX)
    return result


def regions_of(
    model: RecordingModel,
    posterior: NoisyPosterior,
    doubt: Doubt,
    observe: Observed,
    seed: int,
    together: Callable[[], JointRecordings],
) -> Callable[[], FactorRegions | Text]:
    """What computes once, when it is first asked for, where the error factors hold, or says why that is not to be had."""

    @cache
    def regions() -> FactorRegions | Text:
        if isinstance(model.artefact.points.machine, Arm):  # rows hold wherever the tool is
            return NOTHING
        try:
            return factor_regions(model, posterior, doubt, observe, seed, together().taken)
        except CmmUqError as error:
            return error.problem if isinstance(error.problem, Text) else Verbatim(error.problem)

    return regions


def report_recipe(job: Job) -> Recipe:
    """How a job is reported: in its kind's own way, or as observations that named effects explain."""

    def usual(kind: Kind) -> Recipe:
        page = kind.needs("page", Page, "reported")
        return Recipe(evaluate, lambda found, seed: certified(found, page))

    return recipe_of(job, lambda own: own.report, usual, "reported")


@with_own_physics
def evaluate_job(job: Job, *, seed: int = 0, progress: Progress | None = None) -> AnalysisResult:
    """What the analysis of a job finds, of any kind; the same seed gives the same result."""
    with refusing_overflow(job.recording_path, OVERFLOW_FIX):
        return report_recipe(job).analyse(job, seed=seed, progress=progress)


def analyse(folder: Path, *, seed: int = 0, progress: Progress | None = None) -> AnalysisResult:
    return evaluate_job(read_job(folder), seed=seed, progress=progress)


def outcome_of(found: AnalysisResult, seed: int = 0) -> Outcome:
    with physics_of(found.job):
        return report_recipe(found.job).outcome(found, seed)


@naming_package()
@with_own_physics
def report_outcome(job: Job, *, seed: int = 0, stage: Stage = silent, composed: bool = True) -> Outcome:
    """Analyse a job that was read and compose its certificate; nothing is written."""

    def sampling(part: float) -> None:
        stage(f"Sampling the posterior: {part:.0%} of the draws", 0.1 + 0.4 * part)

    found = evaluate_job(job, seed=seed, progress=sampling)
    stage("Composing the certificate", 0.5)
    outcome = reissued(outcome_of(found, seed))
    if composed:
        outcome.document  # noqa: B018 - composed when it is first asked for
    return outcome


def write_report(
    job: Path, out: Path | None = None, *, seed: int = 0, force: bool = False, stage: Stage = silent,
    told: Told = lambda job: None, records: str | Path | None = NONE, language: Code | None = None,
    signing: Signing | None = None,
) -> Written[Outcome]:  # fmt: skip
    """Analyse a job and write its certificate (HTML, PDF, DCC), ``results.json`` and ``provenance.json``, all or none.

    A kind may add files of its own. Documents of a recording that was not measured carry its origin in their names.

    records : that it is recorded in: file, URL, ``none``, or ``None`` for those of the environment, else beside the
    folder; signing : who signs the certificate; ``None`` for nobody.
    """
    stage("Reading the job", 0.0)
    read = with_replaced(in_language(read_job(job), language), records, out)
    report_recipe(read)  # refused before anything is made
    told(read)
    outcome = partial(report_outcome, read, seed=seed, stage=stage)
    return REPORT.write(read, outcome, out, force=force, stage=stage, records=records, signing=signing)
