"""A report of a plate, made once for all processes of a run, and forgeries of it in which all documents agree."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.analysis.parts.virtual import MeasurementConditions, Virtual
from cmm_uq.analysis.parts.ways import Way, spread
from cmm_uq.app.commands.files import Stage, silent
from cmm_uq.app.commands.parts.part import PartOptions, contents_of, evaluate_part
from cmm_uq.base.messages import say
from cmm_uq.certificate.part.measurement import PartMeasurement
from cmm_uq.jobs.part.job import PartJob
from cmm_uq.maths.inference.families import FieldModel
from cmm_uq.maths.inference.family_sizes import USUAL, Effort, FieldSizes, sample_sizes
from cmm_uq.maths.inference.noise import Sizes
from tests.part_machines import by_certificate, plate_of
from tests.shared import shared_files

TRIALS = 1000  # enough to be computed again to the byte; how near draws come to the truth is looked at elsewhere


@cache
def plate_found() -> PartMeasurement:
    """Its bore measured 20 µm off along x."""
    off = np.zeros((60, 3))
    off[-8:, 0] = 0.02
    return evaluate_part(plate_of(by_certificate(), off), PartOptions(trials=TRIALS))


@shared_files
def plate_report() -> Mapping[str, bytes]:
    """Its files, by name."""
    return contents_of(plate_found())


_AGAIN: dict[tuple[object, ...], PartMeasurement] = {}
_SIZES: dict[bytes, FieldSizes] = {}


def sampled_once(
    model: FieldModel, draws: int, seed: int, known: Sizes | None = None, effort: Effort = USUAL
) -> FieldSizes:
    """Sizes of a machine's errors and noise, sampled once for all tests that are not about sampling them again."""
    columns = [one.columns for one in model.errors]
    key = hashlib.sha256(
        pickle.dumps((model.linear, model.noise, columns, model.limit, draws, seed, known, effort))
    ).digest()
    if key not in _SIZES:
        _SIZES[key] = sample_sizes(model, draws, seed, known, effort)
    return _SIZES[key]


def unchanged(
    plan: Plan, given: MeasurementConditions, draws: int, seed: int, *, planned: Virtual, **_: object
) -> list[Way]:
    """The measurement as planned alone, for tests that are not about what would change its uncertainty."""
    return [Way(say("as planned"), spread(planned, draws, seed), draws)]


def drawn_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """For tests that are neither about sampling a machine again nor about what would change a part's uncertainty."""
    monkeypatch.setattr("cmm_uq.analysis.machine.conditional.sample_sizes", sampled_once)
    monkeypatch.setattr("cmm_uq.app.commands.parts.part.ways", unchanged)


def nothing_foreseen(monkeypatch: pytest.MonkeyPatch) -> None:
    """For tests that are not about what further measurements would do either."""
    drawn_once(monkeypatch)
    monkeypatch.setattr("cmm_uq.app.commands.parts.part.foresee", lambda found, stage: found)


def found_again_once(job: PartJob, asked: PartOptions, stage: Stage = silent) -> PartMeasurement:
    """What a report's inputs give when computed again, once for all reports that have the very same inside and asked the same.

    Reports that differ in what they state alone are each held to it. It is never what the report itself was made of.
    """
    key = (asked, job.facts.model_dump_json(), *sorted(job.inputs.items()))
    if key not in _AGAIN:
        _AGAIN[key] = evaluate_part(job, asked, stage)
    return _AGAIN[key]


def with_inputs(**changed: bytes) -> dict[str, bytes]:
    """The report as if it had been made of other inputs: hashes and attachments are theirs, figures are not."""
    found = plate_found()
    inputs = {name: changed.get(Path(name).stem.partition("-")[0], data) for name, data in found.job.inputs.items()}
    return contents_of(replace(found, job=replace(found.job, inputs=inputs)))
