"""From a job to the proof of its diagnosis: draw, seal, diagnose and judge, then write."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path

import numpy as np

from cmm_uq import __version__
from cmm_uq.analysis.planning.setting import Setting
from cmm_uq.app.commands.estimation import without_outliers
from cmm_uq.app.commands.files import REPORTS, Form, Stage, Written, silent
from cmm_uq.app.commands.model import OVERFLOW_FIX, recorded_model
from cmm_uq.app.commands.prove_case import CaseSetting, model_on
from cmm_uq.app.commands.reading import in_language, read_job
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.languages.translation import Code
from cmm_uq.base.output import interruption
from cmm_uq.base.overflow import refusing_overflow
from cmm_uq.base.plugins import naming_package
from cmm_uq.base.points import Points
from cmm_uq.certificate.outcome import Outcome, OwnAnalysis
from cmm_uq.certificate.proof.words import DiagnosisProof
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.reading import sha256
from cmm_uq.jobs.recording.prediction import KEY
from cmm_uq.laboratory.proving.answers import RECORDS, AnswersFolder, Record, answer_tasks
from cmm_uq.laboratory.proving.cases import Case, sha256_of, truth_file
from cmm_uq.laboratory.proving.design import Design
from cmm_uq.laboratory.proving.judgement import ANSWER, REFUSED, ProofJudgement, judge
from cmm_uq.laboratory.schedule.processes import check_workers
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.machine.physics.catalogue import every, plugins
from cmm_uq.maths.inference.posterior import sample_with_noise

CASES, FEWEST, MOST = 200, 1, 20_000
_PROGRAM = "cmm_uq.app.commands.prove_case"
_OF_ARTEFACT = "artefact"  # mechanism of effects that a fault of the artefact may be called
Sealed = Callable[[str], None]  # told the SHA-256 of the truth, before anything is diagnosed


@dataclass(frozen=True)
class ProofOptions:
    """What was asked for.

    ``cases``, ``workers``, ``seed``, ``alpha`` how many cases, processes, seed of the cases, rate of false alarms of
    the diagnosis.
    """

    cases: int = CASES
    workers: int = 1
    seed: int = 0
    alpha: float = 0.01

    def __post_init__(self) -> None:
        if not FEWEST <= self.cases <= MOST:
            raise CmmUqError(
                f"{self.cases} cases", where="--cases", fix=f"Give from {FEWEST} to {MOST}; {CASES} are usual"
            )
        check_workers(self.workers)
        if not 1e-6 <= self.alpha <= 0.5:
            raise CmmUqError(
                f"a false-alarm rate of {self.alpha:g}",
                where="--alpha",
                fix="Give one between 0.000001 and 0.5; 0.01 is usual",
            )
        if self.seed < 0:
            raise CmmUqError(f"a seed of {self.seed}", where="--seed", fix="Give 0 or more")


def prove_job(
    job: Job, options: ProofOptions, *, folder: Path | None = None, stage: Stage = silent, sealed: Sealed | None = None
) -> tuple[DiagnosisProof, AnswersFolder | None]:
    """Prove the diagnosis on the set-ups of a job.

    Gives what was found, and what was kept of it, still open.
    """
    stage("Finding the noise of the job", 0.0)
    with refusing_overflow(job.recording_path, OVERFLOW_FIX):
        job, design = design_of(job)
        stage(f"Drawing {options.cases} cases", 0.02)
        cases = tuple(design.case(options.seed, number) for number in range(options.cases))
    named = true_values(design)
    truth = truth_file(cases, _common(job, options, named))
    kept = None if folder is None else AnswersFolder(folder, truth)
    try:
        if sealed is not None:
            sealed(sha256_of(truth))
        records = _records(job, design, cases, options, kept, stage)
    except BaseException:
        if kept is not None:
            kept.close()
        raise
    of_artefact = {name for name, effect in every().items() if effect.mechanism == _OF_ARTEFACT}
    judged = tuple(judge(case, records[case.number], named, of_artefact.__contains__) for case in cases)
    ordered = tuple(records[case.number] for case in cases)
    return DiagnosisProof(job, design, options.seed, options.alpha, truth, ordered, ProofJudgement(judged)), kept


def _records(
    job: Job,
    design: Design,
    cases: tuple[Case, ...],
    options: ProofOptions,
    answers: AnswersFolder | None,
    stage: Stage,
) -> dict[int, Record]:
    records = {} if answers is None else answers.records
    if answers is not None and any(REFUSED not in one and not one.keys() >= ANSWER for one in records.values()):
        raise CmmUqError("holds an answer that none of these processes gave", where=str(answers.folder / RECORDS),
                         fix="Remove the folder and begin again")  # fmt: skip
    todo = {case.number: case for case in cases if case.number not in records}

    def told() -> None:
        stage(f"Diagnosing cases: {len(records)} of {len(cases)}", 0.03 + 0.9 * len(records) / len(cases))

    def keep(record: Record) -> None:
        if answers is None:
            records[record["number"]] = record
        else:
            answers.keep(record)
        told()

    points = design.model.artefact.points
    points = replace(points, columns=dict(points.columns))  # without what it remembers, which cannot be sent
    setting = CaseSetting(
        dict(job.inputs),
        points,
        design.values,
        design.noise,
        design.cte_per_k,
        design.dates,
        options.seed,
        options.alpha,
    )
    told()
    with _saying(answers, records, len(cases)):
        answer_tasks(_PROGRAM, setting, todo, options.workers, keep=keep)
    return records


@contextlib.contextmanager
def _saying(answers: AnswersFolder | None, records: dict[int, Record], count: int) -> Iterator[None]:
    if answers is None:
        yield
        return
    with interruption.keeping(
        lambda: f"{len(records)} of {count} cases are kept in {answers.folder}: the same command goes on"
    ):
        yield


def design_of(job: Job) -> tuple[Job, Design]:
    """The job with the set-ups that cases are drawn on, and these, with the job's own errors and noise."""
    kind, facts = kind_of(job), job.facts
    offered = kind.offers("own", OwnAnalysis)
    if kind.observe is None or (offered is not None and offered.diagnose is not None):
        raise CmmUqError(
            f"a job of kind {facts.artefact.kind!r} has an analysis of its own, which is not proved by cases of effects",
            where="job.toml [artefact] kind",
            fix="Prove a job whose recording is explained by effects",
        )
    if facts.simulation is not None:
        raise CmmUqError("the diagnosis against a simulation is not proved: cases are drawn by the job's own model",
                         where=f"job.toml {KEY}", fix="Leave the simulation out")  # fmt: skip
    cte = facts.artefact.cte_per_k
    if len(job.points) and not job.planned:
        model, _ = recorded_model(job)
        used, _ = without_outliers(model)
        design = Design(
            model, used.estimate().about, _noise_found(used), cte, 1 if facts.recording.earlier is None else 2
        )
        return replace(job, points=model.artefact.points), design
    return _planned(job, cte)


def _planned(job: Job, cte: float) -> tuple[Job, Design]:
    """Of a job still to be measured: the set-ups of its plan, and the noise that it states."""
    plan = job.facts.plan
    if job.facts.recording.u_coordinate_um is None and plan.noise_from is None:
        raise CmmUqError(
            "nothing is measured and no noise is stated, so that there is nothing to draw cases with",
            where="job.toml [recording] u_coordinate_um",
            fix="State the standard uncertainty of a coordinate, or name an earlier recording in [plan] noise_from",
        )
    points = job.points if len(job.points) else _placings(job)
    noise = Setting.of(replace(job, points=points), kind_of(job)).noise
    if noise is None:
        raise CmmUqError("a plan of this kind states no noise", where="job.toml [plan]", fix="Record it first")
    job = replace(job, points=points, planned=False)
    model = model_on(job, points)
    return job, Design(model, np.array([unknown.prior_mean for unknown in model.unknowns]), noise.drawn, cte)


def _placings(job: Job) -> Points:
    from cmm_uq.app.commands.plans.planning import make_plan

    return make_plan(job, power=False).outlook.points


def _noise_found(model: RecordingModel) -> Noise:
    """What a recording shows of its noise: each component in its median size, absent where it is more probably so."""
    estimate, components = model.estimate(), noise_of(model)
    posterior = sample_with_noise(estimate.linear, components, estimate.least_squares, 0)
    sizes = posterior.sizes.typical
    x, y, z = sizes.reading[0].tolist()
    time = model.artefact.points.columns.get("time_s")
    duration = 0.0 if time is None else float(np.ptp(time))
    slow = float(sizes.slow[0]) if duration > 0 else 0.0
    rate = float(sizes.rate[0])
    forgets = (duration / rate if rate else inf) if slow else Noise().slow_time_s
    return Noise(
        (x, y, z), float(sizes.placing[0]), float(sizes.growth[0]), slow, forgets, resolution=components.display
    )


def true_values(design: Design) -> dict[str, float]:
    """True values of what the job names, ``effect.parameter``."""
    found: dict[str, float] = {}
    first = 0
    for effect in design.model.effects:
        own = design.coefficients[first : first + len(effect.coefficients)]
        first += len(effect.coefficients)
        told = effect.to_reported(own, np.zeros(0))
        found |= {f"{effect.name}.{name}": float(value) for name, value in told.items()}
    return found


def _common(job: Job, options: ProofOptions, named: dict[str, float]) -> dict[str, object]:
    """What the sealed file says of all cases: a run is the same where all of it is."""
    return {
        "program": f"cmm-uq {__version__}", "plugins": plugins(), "job": job.facts.job.id, "inputs_sha256": sha256(job.inputs),
        "seed": options.seed, "alpha": options.alpha, "count": options.cases, "accepted_by": job.facts.prove.model_dump(),
        "named": named,
    }  # fmt: skip


PROVE = Form("prove", ("validation.html", "validation.pdf"), "prove", ("truth.json", "cases.jsonl"))

UNFINISHED = "cases.unfinished"
"""Folder, inside that of the files, with the truth and the answers of a run that is under way."""


@naming_package()
def prove_outcome(job: Job, options: ProofOptions, *, stage: Stage = silent) -> Outcome:
    """Prove the diagnosis on the set-ups of a job that was read; nothing is written."""
    return _outcome(job, options, stage)[0]


def _outcome(
    job: Job, options: ProofOptions, stage: Stage, folder: Path | None = None, sealed: Sealed | None = None
) -> tuple[Outcome, AnswersFolder | None]:
    from cmm_uq.certificate.proof.results import proof_outcome

    proof, kept = prove_job(job, options, folder=folder, stage=stage, sealed=sealed)
    stage("Composing the page", 0.94)
    return proof_outcome(proof), kept


def write_proof(
    job: Path, options: ProofOptions, out: Path | None = None, *, force: bool = False, stage: Stage | None = None,
    sealed: Sealed | None = None, language: Code | None = None,
) -> Written:  # fmt: skip
    """Prove the diagnosis on a job's set-ups and write page, truth, answers and ``results.json``, all or none.

    Truth and answers are kept in ``cases.unfinished`` while they come; the same call goes on with what an interrupted
    one left.
    """
    tell = stage or silent
    tell("Reading the job", 0.0)
    read = in_language(read_job(job, recorded=False), language)
    folder = (out or REPORTS / read.facts.job.id / PROVE.below) / UNFINISHED
    open_: list[AnswersFolder] = []

    @naming_package()
    def outcome() -> Outcome:
        found, kept = _outcome(read, options, tell, folder, sealed)
        if kept is not None:
            open_.append(kept)
        return found

    try:
        written = PROVE.write(read, outcome, out, force=force, stage=tell)
    except BaseException:
        for kept in open_:
            kept.close()
        raise
    for kept in open_:
        kept.remove()
    return written
