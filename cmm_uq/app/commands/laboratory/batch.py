"""Many jobs to their reports: found, sent to processes or a cluster, and written here, one after the other as they come.

Many jobs to their reports: found, sent to processes or a cluster, and written here, one after the other as they come.

Whoever computes is sent bytes and answers with bytes; one process writes. So the files are the same whatever computes them,
nothing is half-written where a process is killed, and a cluster needs no disk in common.
"""

from __future__ import annotations

import errno
import json
import shlex
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmm_uq.app.commands.files import REPORTS, RESULTS, Stage, ledger_of, opened, silent
from cmm_uq.app.commands.laboratory.batch_job import PROGRAM, Task
from cmm_uq.app.commands.laboratory.batch_jobs import (
    BatchJob,
    BatchOutput,
    conforming,
    jobs_in,
    results_of,
    write_table,
)
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import REPORT
from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.output import Ledger, Owner, interruption, staged
from cmm_uq.jobs.job import Job
from cmm_uq.laboratory.records.place import NONE
from cmm_uq.laboratory.schedule.parquet import check_parquet
from cmm_uq.laboratory.schedule.processes import TaskAnswer, WorkerTask, answers, check_workers, processes
from cmm_uq.laboratory.schedule.progress import Pace

if TYPE_CHECKING:
    from cmm_uq.laboratory.records.store import Records

TIME_LIMIT_S, TRIES, MOST_TRIES = 1800.0, 3, 100


@dataclass(frozen=True)
class BatchOptions:
    """How a batch is to be run; no figure depends on it but by ``seed``.

    ``workers``: processes at once; as many as there are processors where it is not said; ``scheduler``: address of a
    Dask cluster that computes instead; ``resume``: leave jobs alone whose report is there already, from the same
    inputs by the same version; ``force``: keep what stands in the way as ``NAME.previous`` instead of refusing;
    ``seconds``: that one job may take; ``tries``: processes that one job may end before it is given up.
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
    def work(self) -> WorkerTask:
        """What processes are begun for."""
        return WorkerTask(PROGRAM, (self.seed, self.results_only), self.seconds, self.tries)


@dataclass(frozen=True)
class FailedJob:
    """A job that was not reported."""

    folder: str
    id: str
    error: CmmUqError

    def as_data(self) -> dict[str, Any]:
        error = self.error
        return {"job": self.id, "folder": self.folder, "problem": error.problem, "where": error.where, "fix": error.fix}

    def __str__(self) -> str:
        told = str(self.error)
        return told if self.folder in told else f"{self.folder}: {told}"


@dataclass
class Batch:
    """What came of a batch.

    ``planned``: further ones that are still to be measured; ``not_conforming``: of both, those with a statement that
    is no pass, or a recording that contradicts its model; ``ended``: processes that ended over a job, which was then
    given to another; ``failed``: the others, in the order of the jobs; ``parquet``: file with a row for each value,
    if one was asked for; ``records``: what they were recorded in, as it is shown; empty where they were not.
    """

    out: Path
    count: int
    planned: int
    written: int = 0
    already: int = 0
    not_conforming: int = 0
    ended: int = 0
    failed: list[FailedJob] = field(default_factory=list)
    seconds: float = 0.0
    parquet: Path | None = None
    records: str = ""

    def as_data(self) -> dict[str, Any]:
        return {
            "schema": "cmm-uq/batch/1", "out": str(self.out), "jobs": self.count, "planned": self.planned,
            "written": self.written, "already": self.already, "not_conforming": self.not_conforming,
            "processes_ended": self.ended, "seconds": round(self.seconds, 3),
            "records": self.records or None, "parquet": None if self.parquet is None else str(self.parquet),
            "failed": [one.as_data() for one in self.failed],
        }  # fmt: skip


WRITERS = 4  # threads that write: most of the time each waits until the disk has what it was given
_AHEAD = 2  # reports for each of them that may wait

_NO_ROOM = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO})
"""What the system says where no other job could be written either."""


@dataclass(frozen=True, slots=True)
class _Place:
    """Where a report is written, by whom, and of which job."""

    folder: Path
    owner: Owner
    job: Job


class BatchRun:
    """One batch on its way.

    ``asked, wanted``: how, and what is written of each; ``batch``: what came of it so far; ``records``: that each
    report is recorded in with its files.
    """

    def __init__(
        self, listed: list[BatchJob], asked: BatchOptions, wanted: BatchOutput, batch: Batch, records: Records | None
    ) -> None:
        self.listed, self.asked, self.wanted, self.batch, self.records = listed, asked, wanted, batch, records
        self.there = bytearray(len(listed))
        self._under_way: dict[int, _Place] = {}
        self._writing: dict[Future[dict[str, Any]], int] = {}
        self._failed: dict[int, FailedJob] = {}
        self._pace = Pace(len(listed))

    def kept(self) -> str:
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
        with closing(self._answers()) as found, ThreadPoolExecutor(WRITERS) as writers:
            for answer in found:
                self._take(answer, writers)
            while self._writing:
                self._settle(FIRST_COMPLETED)
        self.batch.failed = [self._failed[number] for number in sorted(self._failed)]
        self.batch.seconds = self._pace.seconds

    def _answers(self) -> Generator[TaskAnswer, None, None]:
        if self.asked.scheduler is None:
            workers = processes() if self.asked.workers is None else self.asked.workers
            return answers(self.asked.work, self._tasks(), workers)
        from cmm_uq.laboratory.schedule.cluster import cluster_answers

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
                self.there[number] = 1
                self._count(results, computed=False)
                continue
            self._under_way[number] = _Place(self.wanted.folder(job), REPORT.owner(job), job)
            yield number, (one.folder, dict(job.inputs))

    def _take(self, answer: TaskAnswer, writers: ThreadPoolExecutor) -> None:
        """Begin to write what came, and see what is written; whoever computes waits where the disk does not follow."""
        where = self._under_way.pop(answer.number)
        self.batch.ended += len(answer.ended)
        if answer.failure is not None:
            self._fail(answer.number, answer.failure)
        else:
            self._writing[writers.submit(self._write, answer.number, where, answer.value)] = answer.number
        while len(self._writing) > _AHEAD * WRITERS:
            self._settle(FIRST_COMPLETED)
        self._settle(FIRST_COMPLETED, timeout=0.0)

    def _write(self, number: int, where: _Place, files: dict[str, bytes]) -> dict[str, Any]:
        """Contents of results.json, once all is in place."""
        with staged(where.folder, where.owner, inputs=where.job.paths, force=self.wanted.force) as place:
            place.write(files, ledger=self._ledger(where, files))
        self.there[number] = 1
        results: dict[str, Any] = json.loads(files[RESULTS])
        return results

    def _settle(self, until: str, timeout: float | None = None) -> None:
        """Count what is written, or why it is not."""
        for one in wait(self._writing, timeout, until).done:
            number = self._writing.pop(one)
            try:
                results = one.result()
            except CmmUqError as error:
                if isinstance(error, OutputError) and self._for_all(error):
                    raise OutputError(error.problem, where=error.where, fix=f"Free the disk; {self.kept()}") from error
                self._fail(number, error)
            else:
                self.batch.written += 1
                self._count(results)

    def _for_all(self, error: OutputError) -> bool:
        """Whether no other job could be written either: the disk is full, or the records are gone."""
        lost = self.records is not None and error.where == self.records.shown
        return lost or getattr(error.__cause__, "errno", None) in _NO_ROOM

    def _ledger(self, where: _Place, files: dict[str, bytes]) -> Ledger | None:
        if self.records is None:
            return None
        return ledger_of(self.records, where.job, REPORT.command, where.folder, files, RESULTS)

    def _count(self, results: dict[str, Any], *, computed: bool = True) -> None:
        self.batch.not_conforming += not conforming(results)
        self._pace.add(computed=computed)
        self._told()

    def _fail(self, number: int, error: CmmUqError, *, computed: bool = True) -> None:
        one = self.listed[number]
        self._failed[number] = FailedJob(one.folder, one.id, error)
        self._pace.add(computed=computed, failed=True)
        self._told()


def write_batch(
    folders: Sequence[Path], out: Path | None = None, asked: BatchOptions | None = None, *, parquet: Path | None = None,
    stage: Stage | None = None, records: str | Path | None = NONE,
) -> Batch:  # fmt: skip
    """Report every job in folders and below them, as :func:`~cmm_uq.app.commands.report.write_report` reports one.

    ``records``: that reports are recorded in: file, URL, ``none``, or ``None`` for those of the environment, else beside
    them. Gives what came of it; a job that fails never stops the others.
    """
    how, tell, place = asked or BatchOptions(), stage or silent, out or REPORTS
    if parquet is not None:
        check_parquet(parquet, force=how.force)
    tell("Looking for jobs", 0.0)
    listed, planned = jobs_in(folders, place)
    batch = Batch(place, len(listed), planned)
    with opened(records, None if out is None else out / "job") as history:
        run = BatchRun(listed, how, BatchOutput(place, how.seed, how.results_only, how.force), batch, history)
        batch.records = "" if history is None else history.shown
        with interruption.keeping(run.kept):
            run.through(tell)
            if parquet is not None:
                tell("Writing the table", 1.0)
                write_table(parquet, filter(None, map(results_of, run.folders())), force=how.force)
                batch.parquet = parquet
    return batch
