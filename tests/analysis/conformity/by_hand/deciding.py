"""A job folder decided by the functions of ``report``: all of it, or without what estimates the machine's errors."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from cmm_uq.analysis.conformity.accuracy import figures
from cmm_uq.analysis.conformity.as_recorded import OutsideReadings
from cmm_uq.analysis.conformity.standards import statement
from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.estimation import decision
from cmm_uq.app.commands.reading import job_of, read_job
from cmm_uq.app.commands.report import evaluate_job as analyse_job
from cmm_uq.artefacts import kind_of
from cmm_uq.base.units import unit
from cmm_uq.certificate.results.contents import statement_data
from cmm_uq.maths.uncertainty.quantity import Quantity


def decided(files: Mapping[str, bytes], characteristic: str = "") -> Statement:
    """Read, screened and decided: the first characteristic, or that of a name."""
    job = job_of(files)
    asked = next(one for one in job.facts.conformity if characteristic in ("", one.characteristic))
    kind, (model, findings) = kind_of(job), screened_model(job)
    made = partial(kind.observing("reported"), job.facts.artefact, where=job.recording_path)
    lengths = model.artefact.lengths()
    value = 0.0 if lengths is None else float(figures(lengths)["b89_range_um"])
    return statement(
        asked, model.artefact,
        {"b89_range_um": Quantity(value, 1.0, (value - 2.0, value + 2.0), unit("µm"))}, "[[conformity]] 1", kind.tested, None,
        job.circumstances, OutsideReadings.of(job.points, findings, made),
    )  # fmt: skip


def reported(files: Mapping[str, bytes]) -> Statement:
    """The statement as the whole analysis has it."""
    found: Any = analyse_job(job_of(files))
    (only,) = found.statements
    return only  # type: ignore[no-any-return]


def statement_of_job(folder: Path) -> Statement:
    """The first of a job, of a standard that needs no estimate of the machine's errors."""
    job = read_job(folder)
    return decision(job, *screened_model(job), 1)


def data_of_job(folder: Path) -> dict[str, Any]:
    """The same as in results.json."""
    return statement_data(statement_of_job(folder))
