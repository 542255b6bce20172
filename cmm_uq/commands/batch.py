"""Many jobs to their reports: found, sent to processes or a cluster, and written here, one after the other as they come.

Whoever computes is sent bytes and answers with bytes; one process writes. So the files are the same whatever computes them,
nothing is half-written where a process is killed, and a cluster needs no disk in common.
"""

from __future__ import annotations

import errno
import json
import shlex
from collections.abc import Generator, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmm_uq.commands.batch_job import PROGRAM, Task
from cmm_uq.commands.batch_jobs import Listed, Wanted, conforming, jobs_in, results_of
from cmm_uq.commands.batch_table import write_table
from cmm_uq.commands.reading import read_job
from cmm_uq.commands.recording import ledger_of, opened
from cmm_uq.commands.report import REPORT
from cmm_uq.commands.written import REPORTS, RESULTS, Stage, silent
from cmm_uq.errors import CmmUqError, OutputError
from cmm_uq.jobs.job import Job
from cmm_uq.records.place import NONE
from cmm_uq.scheduling.parquet import check_parquet
from cmm_uq.scheduling.pool import answers, check_workers, processes
from cmm_uq.scheduling.progress import Pace
from cmm_uq.scheduling.talking import Answer, Work
from cmm_uq.writing import Ledger, Owner, interruption, staged

if TYPE_CHECKING:
    from cmm_uq.records.store import Records

TIME_LIMIT_S, TRIES, MOST_TRIES = 1800.0, 3, 100

_NO_ROOM = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO})
"""What the system says where no other job could be written either."""


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


def write_batch(
    folders: Sequence[Path], out: Path | None = None, asked: Asked | None = None, *, parquet: Path | None = None,
    stage: Stage | None = None, records: str | Path | None = NONE,
) -> Batch:  # fmt: skip
    """Report every job in folders and below them, as :func:`~cmm_uq.commands.report.write_report` reports one.

    Parameters
    ----------
    folders : job folders, or such as hold them.
    out : folder in which each job has one of its id; ``reports`` by default.
    asked : how.
    parquet : file to be written with a row for each value.
    stage : told of progress.
    records : that reports are recorded in: file, URL, ``none``, or ``None`` for those of the environment, else beside them.

    Returns
    -------
    what came of it; a job that fails never stops the others.

    Raises
    ------
    CmmUqError : no job was found, two of them have one id, or the cluster or the file cannot be used.
    OutputError : nothing more can be written; what was written stays.
    """
    how, tell, place = asked or Asked(), stage or silent, out or REPORTS
    if parquet is not None:
        check_parquet(parquet, force=how.force)
    tell("Looking for jobs", 0.0)
    listed, planned = jobs_in(folders, place)
    batch = Batch(place, len(listed), planned)
    with opened(records, None if out is None else out / "job") as history:
        run = _Run(listed, how, Wanted(place, how.seed, how.results_only, how.force), batch, history)
        batch.records = "" if history is None else history.shown
        with interruption.keeping(run.kept):
            run.through(tell)
            if parquet is not None:
                tell("Writing the table", 1.0)
                write_table(parquet, filter(None, map(results_of, run.folders())), force=how.force)
                batch.parquet = parquet
    return batch


@dataclass(frozen=True, slots=True)
class _Place:
    """Where a report is written, by whom, and of which job."""

    folder: Path
    owner: Owner
    job: Job


class _Run:
    """One batch on its way.

    Parameters
    ----------
    listed : its jobs.
    asked, wanted : how, and what is written of each.
    batch : what came of it so far.
    records : that each report is recorded in with its files.
    """

    def __init__(
        self, listed: list[Listed], asked: Asked, wanted: Wanted, batch: Batch, records: Records | None
    ) -> None:  # fmt: skip
        self.listed, self.asked, self.wanted, self.batch, self.records = listed, asked, wanted, batch, records
        self.there = bytearray(len(listed))
        self._under_way: dict[int, _Place] = {}
        self._failed: dict[int, Failed] = {}
        self._pace = Pace(len(listed))

    def kept(self) -> str:
        """What a signal says."""
        done, out = sum(self.there), shlex.quote(str(self.wanted.out))
        return f"{done} of {len(self.listed)} jobs are written in {out}: the same command with --resume goes on"

    def folders(self) -> Iterator[Path]:
        """Of the reports that are there, in the order of the jobs."""
        return (self.wanted.out / one.id for one, there in zip(self.listed, self.there, strict=True) if there)

    def through(self, tell: Stage) -> None:
        """Have every job that is not there computed, and write it."""

        def told() -> None:
            tell(f"Reporting jobs: {self._pace}", self._pace.part)

        self._told = told
        told()
        with closing(self._answers()) as found:
            for answer in found:
                self._take(answer)
        self.batch.failed = [self._failed[number] for number in sorted(self._failed)]
        self.batch.seconds = self._pace.seconds

    def _answers(self) -> Generator[Answer, None, None]:
        if self.asked.scheduler is None:
            workers = processes() if self.asked.workers is None else self.asked.workers
            return answers(self.asked.work, self._tasks(), workers)
        from cmm_uq.scheduling.cluster import cluster_answers

        return cluster_answers(self.asked.scheduler, self.asked.work, self._tasks(), len(self.listed))

    def _tasks(self) -> Iterator[tuple[int, Task]]:
        """Jobs to be computed; what is there already, or cannot be, is counted."""
        for number, one in enumerate(self.listed):
            try:
                job = read_job(Path(one.folder))
                results = self.wanted.done(job) if self.asked.resume else None
                if results is None:
                    self.wanted.check(job)
            except CmmUqError as error:
                self._fail(number, error, computed=False)
                continue
            if results is not None:
                self.batch.already += 1
                self._is_there(number, results, computed=False)
                continue
            self._under_way[number] = _Place(self.wanted.folder(job), REPORT.owner(job), job)
            yield number, (one.folder, dict(job.inputs))

    def _take(self, answer: Answer) -> None:
        where = self._under_way.pop(answer.number)
        self.batch.ended += len(answer.ended)
        if answer.failure is not None:
            self._fail(answer.number, answer.failure)
            return
        try:
            with staged(where.folder, where.owner, inputs=where.job.paths, force=self.wanted.force) as place:
                place.write(answer.value, ledger=self._ledger(where, answer.value))
        except OutputError as error:
            if self._for_all(error):
                raise OutputError(error.problem, where=error.where, fix=f"Free the disk; {self.kept()}") from error
            self._fail(answer.number, error)
            return
        except CmmUqError as error:
            self._fail(answer.number, error)
            return
        self.batch.written += 1
        self._is_there(answer.number, json.loads(answer.value[RESULTS]))

    def _for_all(self, error: OutputError) -> bool:
        """Whether no other job could be written either: the disk is full, or the records are gone."""
        lost = self.records is not None and error.where == self.records.shown
        return lost or getattr(error.__cause__, "errno", None) in _NO_ROOM

    def _ledger(self, where: _Place, files: dict[str, bytes]) -> Ledger | None:
        if self.records is None:
            return None
        return ledger_of(self.records, where.job, REPORT.command, where.folder, files, RESULTS)

    def _is_there(self, number: int, results: dict[str, Any], *, computed: bool = True) -> None:
        self.there[number] = 1
        self.batch.not_conforming += not conforming(results)
        self._pace.add(computed=computed)
        self._told()

    def _fail(self, number: int, error: CmmUqError, *, computed: bool = True) -> None:
        one = self.listed[number]
        self._failed[number] = Failed(one.folder, one.id, error)
        self._pace.add(computed=computed, failed=True)
        self._told()
