"""Jobs of every kind there is, read from their folders or from memory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from cmm_uq.analysis.conformity.standards import names as standard_names
from cmm_uq.analysis.conformity.standards import standard_named
from cmm_uq.artefacts import names, table_of
from cmm_uq.base.files.content import content_of
from cmm_uq.base.files.limits import TABLE_BYTES
from cmm_uq.base.languages.language import Code
from cmm_uq.base.plugins import naming_package
from cmm_uq.jobs import predicted, reading
from cmm_uq.jobs.conformity import Standards
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.reading import Nameable

NAMEABLE = Nameable(table_of, names, Standards(standard_named, standard_names))
"""Every kind and every standard that there is, of other packages too."""


@naming_package()
def read_job(folder: Path, *, recorded: bool = True) -> Job:
    """Read and check a job; see :func:`cmm_uq.jobs.reading.read_job`.

    Parameters
    ----------
    folder : the job folder, or its job.toml.
    recorded : whether the recording must be there; otherwise a job still to be measured has no points.

    Raises
    ------
    CmmUqError : a file is missing or unreadable, or says something unknown or contradictory.
    """
    return reading.read_job(folder, NAMEABLE, recorded=recorded)


@naming_package()
def read_machine(folder: Path) -> Job:
    """A job for its machine alone; see :func:`cmm_uq.jobs.reading.read_machine`."""
    return reading.read_machine(folder, NAMEABLE)


@naming_package()
def job_of(files: Mapping[str, bytes], *, recorded: bool = True) -> Job:
    """Read and check a job that lies in no folder yet; see :func:`cmm_uq.jobs.reading.job_of`.

    Parameters
    ----------
    files : contents of job.toml and of all that it names, by name.
    recorded : whether the recording must be there; otherwise a job still to be measured has no points.

    Raises
    ------
    CmmUqError : a file is missing, or says something unknown or contradictory.
    """
    return reading.job_of(files, NAMEABLE, recorded=recorded)


def in_language(job: Job, language: Code | None) -> Job:
    """A job whose documents are to be said in a language; without one as job.toml has it."""
    if language is None:
        return job
    told = job.facts.job.model_copy(update={"language": language})
    return replace(job, facts=job.facts.model_copy(update={"job": told}))


def compared_with(job: Job, prediction: Path) -> Job:
    """A job that was read, to be compared with a simulation's prediction in a file that may lie anywhere.

    Raises
    ------
    CmmUqError : the file is missing or no prediction.
    """
    content = content_of(prediction, TABLE_BYTES, "Give the file that the simulation wrote")
    return predicted.against(job, content, prediction.name, prediction)
