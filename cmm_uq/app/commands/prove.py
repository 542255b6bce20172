"""From a job to the proof of its diagnosis: draw, seal, diagnose and judge, then write.

``python -m cmm_uq.app.commands.prove`` is a process that diagnoses sealed cases, begun by ``answers``. What it says of a case
is what the diagnosis says of a recording, screening included, and nothing of the truth.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from functools import partial
from math import inf
from pathlib import Path

import numpy as np

from cmm_uq import __version__
from cmm_uq.analysis.diagnosis.diagnosis import Diagnosis
from cmm_uq.analysis.planning.setting import Setting
from cmm_uq.app.commands.diagnose import diagnose_read
from cmm_uq.app.commands.estimation import without_outliers
from cmm_uq.app.commands.files import REPORTS, Form, Stage, Written, silent
from cmm_uq.app.commands.model import OVERFLOW_FIX, model_of, recorded_model
from cmm_uq.app.commands.reading import in_language, job_of, read_job
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.languages.translation import Code
from cmm_uq.base.output import interruption
from cmm_uq.base.overflow import refusing_overflow
from cmm_uq.base.plugins import BrokenPluginError, naming_package
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.unused import lighten
from cmm_uq.base.values import dataclass, replace
from cmm_uq.certificate.proof.sections import DiagnosisProof
from cmm_uq.certificate.result import JobDiagnosis, Outcome, OwnAnalysis
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.recording.compared import KEY
from cmm_uq.jobs.source import sha256
from cmm_uq.laboratory.proving.answers import RECORDS, AnswersFolder, Record, answer_tasks
from cmm_uq.laboratory.proving.cases import Case, sha256_of, truth_file
from cmm_uq.laboratory.proving.design import Design
from cmm_uq.laboratory.proving.judgement import ANSWER, REFUSED, ProofJudgement, judge
from cmm_uq.laboratory.schedule.processes import check_workers, serve
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.machine.physics.catalogue import every, plugins, registered
from cmm_uq.machine.physics.stated import physics_of, with_own_physics
from cmm_uq.maths.inference.posterior import sample_with_noise
from cmm_uq.maths.uncertainty.quantity import Quantity

CASES, FEWEST, MOST = 200, 1, 20_000
_PROGRAM = "cmm_uq.app.commands.prove"
_OF_ARTEFACT = "artefact"  # mechanism of effects that a fault of the artefact may be called
_KIND, _EXPLAINED = "job.toml [artefact] kind", "Prove a job whose recording is explained by effects"
Sealed = Callable[[str], None]  # told the SHA-256 of the truth, before anything is diagnosed


@dataclass(frozen=True)
class ProofOptions:
    """How many cases, processes at once, seed of the cases, rate of false alarms of the diagnosis."""

    cases: int = CASES
    workers: int = 1
    seed: int = 0
    alpha: float = 0.01

    def __post_init__(self) -> None:
        for sound, problem, where, fix in (
            (FEWEST <= self.cases <= MOST, f"{self.cases} cases", "--cases",
             f"Give from {FEWEST} to {MOST}; {CASES} are usual"),
            (1e-6 <= self.alpha <= 0.5, f"a false-alarm rate of {self.alpha:g}", "--alpha",
             "Give one between 0.000001 and 0.5; 0.01 is usual"),
            (self.seed >= 0, f"a seed of {self.seed}", "--seed", "Give 0 or more"),
        ):  # fmt: skip
            if not sound:
                raise CmmUqError(problem, where=where, fix=fix)
        check_workers(self.workers)


def prove_job(
    job: Job, options: ProofOptions, *, folder: Path | None = None, stage: Stage = silent, sealed: Sealed | None = None
) -> tuple[DiagnosisProof, AnswersFolder | None]:
    """The diagnosis proved on the set-ups of a job, and the folder of answers, still open."""
    stage("Finding the noise of the job", 0.0)
    if registered():
        only_here = f"{', '.join(registered())}: registered in this process, and cases are diagnosed in others"
        raise CmmUqError(only_here, where="cmm_uq.register", fix="Make a package of them, or state them in [[effect]]")
    with refusing_overflow(job.recording_path, OVERFLOW_FIX):
        job, design = design_of(job)
        stage(f"Drawing {options.cases} cases", 0.02)
        cases = tuple(design.case(options.seed, number) for number in range(options.cases))
    named = true_values(design)
    common = {  # a run is the same where all of it is
        "program": f"cmm-uq {__version__}", "plugins": plugins(), "job": job.facts.job.id, "inputs_sha256": sha256(job.inputs),
        "seed": options.seed, "alpha": options.alpha, "count": options.cases, "accepted_by": job.facts.prove.model_dump(),
        "named": named,
    }  # fmt: skip
    truth = truth_file(cases, common)
    answers = None if folder is None else AnswersFolder(folder, truth)
    try:
        if sealed is not None:
            sealed(sha256_of(truth))
        records = _records(job, design, cases, options, answers, stage)
    except BaseException:
        if answers is not None:
            answers.close()
        raise
    of_artefact = {name for name, effect in every().items() if effect.mechanism == _OF_ARTEFACT}
    judged = tuple(judge(case, records[case.number], named, of_artefact.__contains__) for case in cases)
    ordered = tuple(records[case.number] for case in cases)
    return DiagnosisProof(job, design, options.seed, options.alpha, truth, ordered, ProofJudgement(judged)), answers


def _records(
    job: Job, design: Design,     cases: tuple[Case, ...], options: ProofOptions, answers: AnswersFolder | None, stage: Stage,
) -> dict[int, Record]:  # fmt: skip
    records = {} if answers is None else answers.records
    if answers is not None and any(REFUSED not in one and not one.keys() >= ANSWER for one in records.values()):
        raise CmmUqError("holds an answer that none of these processes gave", where=str(answers.folder / RECORDS),
                         fix="Remove the folder and begin again")  # fmt: skip
    todo = {case.number: case for case in cases if case.number not in records}

    def tell() -> None:
        stage(f"Diagnosing cases: {len(records)} of {len(cases)}", 0.03 + 0.9 * len(records) / len(cases))

    def keep(record: Record) -> None:
        if answers is None:
            records[record["number"]] = record
        else:
            answers.keep(record)
        tell()

    points = design.model.artefact.points
    points = replace(points, columns=dict(points.columns))  # without what it remembers, which cannot be sent
    values, noise, cte = design.values, design.noise, design.cte_per_k
    setting = CaseSetting(dict(job.inputs), points, values, noise, cte, design.dates, options.seed, options.alpha)
    tell()
    with contextlib.ExitStack() as stack:
        if answers is not None:
            kept = f"cases are kept in {answers.folder}: the same command goes on"
            stack.enter_context(interruption.keeping(lambda: f"{len(records)} of {len(cases)} {kept}"))
        answer_tasks(_PROGRAM, setting, todo, options.workers, keep=keep)
    return records


def design_of(job: Job) -> tuple[Job, Design]:
    """The job with the set-ups that cases are drawn on, and these, with the job's own errors and noise."""
    kind, facts = kind_of(job), job.facts
    offered = kind.offers("own", OwnAnalysis)
    if not kind.by_effects or (offered is not None and offered.diagnose is not None):
        kind_of_its_own = f"a job of kind {facts.artefact.kind!r} has an analysis of its own"
        raise CmmUqError(f"{kind_of_its_own}, which is not proved by cases of effects", where=_KIND, fix=_EXPLAINED)
    if facts.simulation is not None:
        raise CmmUqError("the diagnosis against a simulation is not proved: cases are drawn by the job's own model",
                         where=f"job.toml {KEY}", fix="Leave the simulation out")  # fmt: skip
    cte = facts.artefact.cte_per_k
    if len(job.points) and not job.planned:
        model, _ = recorded_model(job)
        used, _ = without_outliers(model)
        dates = 1 if facts.recording.earlier is None else 2
        design = Design(model, used.estimate().about, _recorded_noise(used), cte, dates)
        return replace(job, points=model.artefact.points), design
    if facts.recording.u_coordinate_um is None and facts.plan.noise_from is None:
        what = "nothing is measured and no noise is stated, so that there is nothing to draw cases with"
        fix = "State the standard uncertainty of a coordinate, or name an earlier recording in [plan] noise_from"
        raise CmmUqError(what, where="job.toml [recording] u_coordinate_um", fix=fix)
    points = job.points
    if not len(points):
        from cmm_uq.app.commands.planning import make_plan

        points = make_plan(job, power=False).outlook.points
    noise = Setting.of(replace(job, points=points), kind).noise
    if noise is None:
        raise CmmUqError("a plan of this kind states no noise", where="job.toml [plan]", fix="Record it first")
    job = replace(job, points=points, planned=False)
    model = model_on(job, points)
    return job, Design(model, np.array([unknown.prior_mean for unknown in model.unknowns]), noise.drawn, cte)


def _recorded_noise(model: RecordingModel) -> Noise:
    """What a recording shows of its noise: each component in its median size, absent where it is more probably so."""
    estimate, components = model.estimate(), noise_of(model)
    posterior = sample_with_noise(estimate.linear, components, estimate.least_squares, 0)
    sizes = posterior.sizes.typical
    x, y, z = sizes.reading[0].tolist()
    time = model.artefact.points.columns.get("time_s")
    duration = 0.0 if time is None else float(np.ptp(time))
    slow, rate = float(sizes.slow[0]) if duration > 0 else 0.0, float(sizes.rate[0])
    forgets = (duration / rate if rate else inf) if slow else Noise().slow_time_s
    set_up, growth = float(sizes.placing[0]), float(sizes.growth[0])
    return Noise((x, y, z), set_up, growth, slow, forgets, resolution=components.display)


def true_values(design: Design) -> dict[str, float]:
    values, left = dict[str, float](), list(design.coefficients)
    for effect in design.model.effects:
        own = np.array([left.pop(0) for _ in effect.coefficients])
        reported = effect.to_reported(own, np.zeros(0))
        values |= {f"{effect.name}.{name}": float(value) for name, value in reported.items()}
    return values


PROVE = Form("prove", ("validation.html", "validation.pdf"), "prove", ("truth.json", "cases.jsonl"))
UNFINISHED = "cases.unfinished"  # folder, beside the files, with truth and answers of a run that is under way


@naming_package()
@with_own_physics
def prove_outcome(
    job: Job, options: ProofOptions, *, stage: Stage = silent, folder: Path | None = None, sealed: Sealed | None = None,
    kept: list[AnswersFolder] | None = None,
) -> Outcome:  # fmt: skip
    """Prove the diagnosis on the set-ups of a job that was read; nothing is written but the answers that are ``kept``."""
    from cmm_uq.certificate.proof.page import proof_outcome

    proof, answers = prove_job(job, options, folder=folder, stage=stage, sealed=sealed)
    stage("Composing the page", 0.94)
    outcome = proof_outcome(proof)
    if answers is not None and kept is not None:
        kept.append(answers)
    return outcome


def write_proof(
    job: Path, options: ProofOptions, out: Path | None = None, *, force: bool = False, stage: Stage = silent,
    sealed: Sealed | None = None, language: Code | None = None,
) -> Written[Outcome]:  # fmt: skip
    """Prove the diagnosis on a job's set-ups and write page, truth, answers and ``results.json``, all or none.

    Truth and answers are kept in ``cases.unfinished`` while they come; the same call goes on with what an interrupted
    one left.
    """
    stage("Reading the job", 0.0)
    read = in_language(read_job(job, recorded=False), language)
    folder = (out or REPORTS / read.facts.job.id / PROVE.below) / UNFINISHED
    kept: list[AnswersFolder] = []
    outcome = partial(prove_outcome, read, options, stage=stage, folder=folder, sealed=sealed, kept=kept)
    try:
        written = PROVE.write(read, outcome, out, force=force, stage=stage)
    except BaseException:
        for answers in kept:
            answers.close()
        raise
    for answers in kept:
        answers.remove()
    return written


_DIGITS = 9  # significant digits that are kept: what differs beyond them says nothing


@dataclass(frozen=True, eq=False)
class CaseSetting:
    """What every process is told first.

    ``files`` of the job, by name; ``points`` the set-ups; ``values``, ``noise``, ``cte_per_k``, ``dates`` see
    :class:`~cmm_uq.laboratory.proving.design.Design`; ``seed``, ``alpha`` of the cases, and rate of false alarms.
    """

    files: dict[str, bytes]
    points: Points
    values: Floats
    noise: Noise
    cte_per_k: float
    dates: int
    seed: int
    alpha: float


def model_on(job: Job, points: Points) -> RecordingModel:
    artefact = kind_of(job).observing("proved")(job.facts.artefact, points, where=job.recording_path)
    return model_of(job, artefact)


def begin(setting: CaseSetting) -> Callable[[int, Case], Record]:
    job = replace(job_of(setting.files, recorded=False), points=setting.points, planned=False)
    with physics_of(job):
        model = model_on(job, setting.points)
    design = Design(model, setting.values, setting.noise, setting.cte_per_k, setting.dates)
    return lambda number, case: diagnosed_case(job, design, case, setting)


@with_own_physics
def diagnosed_case(job: Job, design: Design, case: Case, setting: CaseSetting) -> Record:
    """What is said of a case; what the diagnosis refuses, or breaks on, is an answer too."""
    points = design.recording(case, setting.seed, every())
    seed = int(np.random.SeedSequence(setting.seed, spawn_key=(case.number, 2)).generate_state(1)[0])
    try:
        found = diagnose_read(replace(job, points=points), seed=seed, alpha=setting.alpha)
    except BrokenPluginError:
        raise
    except CmmUqError as error:
        return {"number": case.number, REFUSED: str(error)}
    except Exception as error:
        return {"number": case.number, REFUSED: f"{type(error).__name__}: {error}"}
    if not isinstance(found, JobDiagnosis):
        kind = job.facts.artefact.kind
        raise CmmUqError(f"a diagnosis of a job of kind {kind!r} names no effects", where=_KIND, fix=_EXPLAINED)
    d = found.diagnosis
    return {
        "number": case.number, "verdict": d.verdict, "p_value": _rounded(d.p_value),
        "effects": [
            {"effect": str.__str__(each.effect), "probability": _rounded(each.probability),
             "together": _rounded(each.together), "parameters": _intervals(each.parameters)}
            for each in d.effects
        ],
        "groups": [[str.__str__(name) for name in group] for group in d.indistinguishable]
        + [[item.effect, *one.effects] for item in d.effects for one in item.alternatives],
        "named": _intervals(_named(d)),
        "heldout_um": [_rounded(d.improvement.heldout_rms_before_um), _rounded(d.improvement.heldout_rms_after_um)],
        "elpd_gain": [_rounded(d.improvement.elpd_gain), _rounded(d.improvement.elpd_gain_se)],
    }  # fmt: skip


def _named(d: Diagnosis) -> dict[str, Quantity]:
    """What the job names, as the model with all that was found estimates it, where the recording determines it."""
    posterior = d.posterior
    columns = {unknown.key: i for i, unknown in enumerate(posterior.unknowns)}
    found = d.after.estimate().least_squares
    fixed = {unknown.key for unknown, known in zip(found.unknowns, found.determined, strict=True) if known}
    told = {}
    for effect in d.before.effects:
        keys = [(effect.name, c.name) for c in effect.coefficients]
        if not set(keys) <= fixed:
            continue
        draws = posterior.draws[:, [columns[key] for key in keys]]
        units = {parameter.name: parameter.unit for parameter in effect.reported}
        for name, values in effect.to_reported(draws, np.zeros((len(draws), 0))).items():
            told[f"{effect.name}.{name}"] = Quantity.of_draws(values, units[name])
    return told


def _intervals(quantities: Mapping[str, Quantity]) -> dict[str, list[float | None]]:
    return {name: [_rounded(each) for each in (one.value, *one.interval95)] for name, one in quantities.items()}


def _rounded(value: float) -> float | None:
    return float(f"{value:.{_DIGITS}g}") if np.isfinite(value) else None


if __name__ == "__main__":
    lighten()
    serve(begin)
