"""What a batch is asked for, and what came of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cmm_uq.app.commands.batch_job import PROGRAM
from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.schedule.pool import check_workers
from cmm_uq.laboratory.schedule.talking import Work

TIME_LIMIT_S, TRIES, MOST_TRIES = 1800.0, 3, 100


@dataclass(frozen=True)
class Asked:
    """How a batch is to be run; no figure depends on it but by ``seed``.

    Parameters
    ----------
    workers : processes at once; as many as there are processors where it is not said.
    scheduler : address of a Dask cluster that computes instead.
    results_only : write ``results.json`` alone.
    seed : of everything random.
    resume : leave jobs alone whose report is there already, from the same inputs by the same version.
    force : keep what stands in the way as ``NAME.previous`` instead of refusing.
    seconds : that one job may take.
    tries : processes that one job may end before it is given up.
    """

    workers: int | None = None
    scheduler: str | None = None
    results_only: bool = False
    seed: int = 0
    resume: bool = False
    force: bool = False
    seconds: float = TIME_LIMIT_S
    tries: int = TRIES

    def __post_init__(self) -> None:
        if self.workers is not None:
            check_workers(self.workers)
            if self.scheduler is not None:
                raise CmmUqError("a cluster has workers of its own", where="--workers",
                                 fix="Give --workers or --scheduler")  # fmt: skip
        if not self.seconds > 0:
            raise CmmUqError(f"a time limit of {self.seconds:g} s", where="--time-limit", fix="Give more than 0 s")
        if not 1 <= self.tries <= MOST_TRIES:
            raise CmmUqError(f"{self.tries} tries", where="--tries", fix=f"Give from 1 to {MOST_TRIES}")
        if self.seed < 0:
            raise CmmUqError(f"a seed of {self.seed}", where="--seed", fix="Give 0 or more")

    @property
    def work(self) -> Work:
        """What processes are begun for."""
        return Work(PROGRAM, (self.seed, self.results_only), self.seconds, self.tries)


@dataclass(frozen=True)
class Failed:
    """A job that was not reported.

    Parameters
    ----------
    folder, id : of the job.
    error : why.
    """

    folder: str
    id: str
    error: CmmUqError

    def as_data(self) -> dict[str, Any]:
        """For results in JSON."""
        error = self.error
        return {"job": self.id, "folder": self.folder, "problem": error.problem, "where": error.where, "fix": error.fix}

    def __str__(self) -> str:
        told = str(self.error)
        return told if self.folder in told else f"{self.folder}: {told}"


@dataclass
class Batch:
    """What came of a batch.

    Parameters
    ----------
    out : folder of the reports.
    count : jobs that were found.
    planned : further ones that are still to be measured.
    written : reports that were written.
    already : reports that were there.
    not_conforming : of both, those with a statement that is no pass, or a recording that contradicts its model.
    ended : processes that ended over a job, which was then given to another.
    failed : the others, in the order of the jobs.
    seconds : that it took.
    parquet : file with a row for each value, if one was asked for.
    records : what they were recorded in, as it is shown; empty where they were not.
    """

    out: Path
    count: int
    planned: int
    written: int = 0
    already: int = 0
    not_conforming: int = 0
    ended: int = 0
    failed: list[Failed] = field(default_factory=list)
    seconds: float = 0.0
    parquet: Path | None = None
    records: str = ""

    def as_data(self) -> dict[str, Any]:
        """For results in JSON."""
        return {
            "schema": "cmm-uq/batch/1", "out": str(self.out), "jobs": self.count, "planned": self.planned,
            "written": self.written, "already": self.already, "not_conforming": self.not_conforming,
            "processes_ended": self.ended, "seconds": round(self.seconds, 3),
            "records": self.records or None, "parquet": None if self.parquet is None else str(self.parquet),
            "failed": [one.as_data() for one in self.failed],
        }  # fmt: skip
