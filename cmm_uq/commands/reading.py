"""Jobs of every kind there is, read from their folders or from memory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from cmm_uq.jobs import reading
from cmm_uq.jobs.job import Job
from cmm_uq.kinds import names, plugins, table_of


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
    return _with_plugins(reading.read_job(folder, table_of, names, recorded=recorded))


def read_machine(folder: Path) -> Job:
    """A job for its machine alone; see :func:`cmm_uq.jobs.reading.read_machine`."""
    return _with_plugins(reading.read_machine(folder, table_of, names))


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
    return _with_plugins(reading.job_of(files, table_of, names, recorded=recorded))


def _with_plugins(job: Job) -> Job:
    return replace(job, plugins=plugins(job.facts.artefact.kind))
