"""Jobs of every kind there is, read from their folders, from memory or from tables."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from cmm_uq.analysis.conformity.standards import names as standard_names, standard_named
from cmm_uq.artefacts import names, table_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import TABLE_BYTES, content_of
from cmm_uq.base.files.toml_file import as_toml
from cmm_uq.base.languages.translation import Code
from cmm_uq.base.plugins import naming_package
from cmm_uq.jobs import reading
from cmm_uq.jobs.derived_job import against
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.reading import Nameable
from cmm_uq.jobs.tables.conformity import Standards
from cmm_uq.jobs.tables.identification import NO_DATE

if TYPE_CHECKING:
    import pandas as pd

    from cmm_uq.jobs.part.job import PartJob

NAMEABLE = Nameable(table_of, names, Standards(standard_named, standard_names))
"""Every kind and every standard that there is, of other packages too."""


@naming_package()
def read_job(folder: Path, *, recorded: bool = True) -> Job:
    return reading.read_job(folder, NAMEABLE, recorded=recorded)


@naming_package()
def read_machine(folder: Path) -> Job:
    return reading.read_machine(folder, NAMEABLE)


@naming_package()
def job_of(files: Mapping[str, bytes], *, recorded: bool = True) -> Job:
    """Read and check a job that lies in no folder yet; see :func:`cmm_uq.jobs.reading.job_of`."""
    return reading.job_of(files, NAMEABLE, recorded=recorded)


@contextmanager
def unwritten() -> Iterator[None]:
    """Errors of a job.toml that lies nowhere yet name no line of it."""
    try:
        yield
    except CmmUqError as error:
        for each in (error, *error.also):
            each.where = re.sub(r"\Ajob\.toml line \d+", "job.toml", each.where or "")
            each.args = (str(each),)
        raise


Either = TypeVar("Either", Job, "PartJob")


def in_language(job: Either, language: Code | None) -> Either:
    """A job whose documents are to be said in a language; without one as job.toml has it."""
    if language is None:
        return job
    told = job.facts.job.model_copy(update={"language": language})
    return replace(job, facts=job.facts.model_copy(update={"job": told}))


RECORDING, PREDICTION = "recording.csv", "predicted.csv"
NO_DATE_REMARK = "The date of the measurement was not given."


def job_from_frames(
    points: pd.DataFrame | None,
    tables: Mapping[str, Mapping[str, Any] | Sequence[Mapping[str, Any]] | None],
    files: Mapping[str, pd.DataFrame],
) -> Job:
    """The job that a job.toml with these tables and a recording with these rows would be.

    points : the recording, one row a point; ``None`` for a kind without one, or where it is still to be measured; tables
    : of job.toml, by name; what is ``None`` or empty is left out.
    """
    told = {name: table for name, table in tables.items() if table}
    recording = dict(_mapping(told.get("recording", {}), "recording"))
    contents = {name: as_csv(frame, name) for name, frame in files.items()}
    if points is not None:
        recording.setdefault("file", RECORDING)
        contents[str(recording["file"])] = as_csv(points, str(recording["file"]))
    job = dict(_mapping(told.get("job", {}), "job"))
    if job.get("date") is None:
        remarks = "\n".join(filter(None, (str(job.get("remarks", "")), NO_DATE_REMARK)))
        job |= {"date": NO_DATE, "remarks": remarks}
    whole = {"job": job, **{name: table for name, table in told.items() if name not in ("job", "recording")}}
    if recording:
        whole["recording"] = recording
    return job_of({"job.toml": as_toml(whole, "job.toml"), **contents}, recorded=points is not None)


def compared_with(job: Job, prediction: Path) -> Job:
    """A job that was read, to be compared with a simulation's prediction in a file that may lie anywhere."""
    content = content_of(prediction, TABLE_BYTES, "Give the file that the simulation wrote")
    return against(job, content, prediction.name, prediction)


def compared_with_frame(job: Job, prediction: pd.DataFrame) -> Job:
    """A job that was read, to be compared with what a simulation predicts."""
    return against(job, as_csv(prediction, PREDICTION), PREDICTION)


def as_csv(frame: pd.DataFrame, name: str) -> bytes:
    """A table as CSV: each number in the fewest digits that give it back."""
    import pandas as pd

    try:
        text = pd.DataFrame(frame).to_csv(index=False, lineterminator="\n")
    except (TypeError, ValueError) as error:
        fix = "Give a DataFrame with the columns of the file"
        raise CmmUqError(f"is no table: {error}", where=name, fix=fix) from None
    return text.encode()


def _mapping(table: Any, name: str) -> Mapping[str, Any]:
    if not isinstance(table, Mapping):
        raise CmmUqError("must be a table of keys", where=f"job.toml [{name}]", fix="Give a dict")
    return table
