"""The calls before there is anything to compute: a new job to start from, and what is wrong with one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cmm_uq.app.commands.check import Checked, check_job, check_read
from cmm_uq.app.commands.new import KEPT, PLAN, new_job, new_plan
from cmm_uq.app.commands.reading import job_of
from cmm_uq.jobs.job import Job


def new(kind: str, *, id: str = "job", **tables: Mapping[str, Any]) -> Job:  # noqa: A002
    """A new job of a kind, with a simulated recording at its usual set-ups; ``job.write(folder)`` makes it a folder.

    Parameters
    ----------
    kind : of measurement, ``"shift_plate"``, or ``"plan"`` for a job without a recording.
    id : of the job.
    tables : what job.toml is to say in place of what the kind begins with, by table: ``artefact={"length_mm": 500.0}``.

    Raises
    ------
    CmmUqError : no such kind, or what is given is refused by the readers of a job.

    Examples
    --------
    >>> import cmm_uq
    >>> cmm_uq.new("ballbar", machine={"name": "Bridge 7"}, artefact={"length_mm": 300.0})
    <Job job: ballbar on Bridge 7, 40 points, simulated>
    """
    files = new_plan(tables, id=id) if kind == PLAN else new_job(kind, tables, id=id)
    return job_of({name: content for name, content in files.items() if name not in KEPT}, recorded=kind != PLAN)


def check(job: Job | str | Path) -> Checked:
    """All that is wrong with a job, without computing.

    Parameters
    ----------
    job : a job, or its folder.

    Examples
    --------
    >>> import cmm_uq
    >>> cmm_uq.check("examples/iota-1102-20C").sound
    True
    """
    return check_read(job) if isinstance(job, Job) else check_job(Path(job))
