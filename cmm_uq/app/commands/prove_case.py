"""A process that diagnoses sealed cases: ``python -m cmm_uq.app.commands.prove_case``.

It is begun by ``answers``. What it says of a case is what the diagnosis says of a recording, screening
included, and nothing of the truth.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from cmm_uq.analysis.diagnosis.diagnosis import Diagnosis
from cmm_uq.app.commands.diagnose import diagnose_read
from cmm_uq.app.commands.model import model_of
from cmm_uq.app.commands.reading import job_of
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.plugins import BrokenPluginError
from cmm_uq.base.points import Floats, Points
from cmm_uq.certificate.result import JobDiagnosis
from cmm_uq.jobs.job import Job
from cmm_uq.laboratory.proving.answers import Record
from cmm_uq.laboratory.proving.cases import Case
from cmm_uq.laboratory.proving.design import Design
from cmm_uq.laboratory.proving.judgement import REFUSED
from cmm_uq.laboratory.schedule.processes import serve
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.maths.uncertainty.quantity import Quantity

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
    """What a job names, of its artefact at points."""
    artefact = kind_of(job).observing("proved")(job.facts.artefact, points, where=job.recording_path)
    return model_of(job, artefact)


def begin(setting: CaseSetting) -> Callable[[int, Case], Record]:
    job = replace(job_of(setting.files, recorded=False), points=setting.points, planned=False)
    design = Design(model_on(job, setting.points), setting.values, setting.noise, setting.cte_per_k, setting.dates)
    return lambda number, case: diagnosed_case(job, design, case, setting)


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
        raise CmmUqError(f"a diagnosis of a job of kind {kind!r} names no effects", where="job.toml [artefact] kind",
                         fix="Prove a job whose recording is explained by effects")  # fmt: skip
    d = found.diagnosis
    return {
        "number": case.number, "verdict": d.verdict, "p_value": _rounded(d.p_value),
        "effects": [
            {"effect": str.__str__(each.effect), "probability": _rounded(each.probability),
             "together": _rounded(each.together), "parameters": _intervals(each.parameters)}
            for each in d.effects
        ],
        "groups": [[str.__str__(name) for name in group] for group in d.indistinguishable],
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


def main() -> None:
    serve(begin)


if __name__ == "__main__":
    main()
