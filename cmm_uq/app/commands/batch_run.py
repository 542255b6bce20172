"""A batch on its way: jobs are read and sent, what comes back is written by a few threads, since a disk takes its time."""

from __future__ import annotations

import errno
import json
import shlex
from collections.abc import Generator, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmm_uq.app.commands.batch_asked import Asked, Batch, Failed
from cmm_uq.app.commands.batch_job import Task
from cmm_uq.app.commands.batch_jobs import Listed, Wanted, conforming
from cmm_uq.app.commands.files import RESULTS, Stage, ledger_of
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import REPORT
from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.output import Ledger, Owner, staged
from cmm_uq.jobs.job import Job
from cmm_uq.laboratory.schedule.pool import answers, processes
from cmm_uq.laboratory.schedule.progress import Pace
from cmm_uq.laboratory.schedule.talking import Answer

if TYPE_CHECKING:
    from cmm_uq.laboratory.records.store import Records

WRITERS = 4
"""Threads that write: most of the time each waits until the disk has what it was given."""

_AHEAD = 2
"""Reports for each of them that may wait."""

_NO_ROOM = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO})
"""What the system says where no other job could be written either."""


@dataclass(frozen=True, slots=True)
class _Place:
    """Where a report is written, by whom, and of which job."""

    folder: Path
    owner: Owner
    job: Job


class Run:
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
        self._writing: dict[Future[dict[str, Any]], int] = {}
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
        with closing(self._answers()) as found, ThreadPoolExecutor(WRITERS) as writers:
            for answer in found:
                self._take(answer, writers)
            while self._writing:
                self._settle(FIRST_COMPLETED)
        self.batch.failed = [self._failed[number] for number in sorted(self._failed)]
        self.batch.seconds = self._pace.seconds

    def _answers(self) -> Generator[Answer, None, None]:
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

    def _take(self, answer: Answer, writers: ThreadPoolExecutor) -> None:
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
        self._failed[number] = Failed(one.folder, one.id, error)
        self._pace.add(computed=computed, failed=True)
        self._told()
