"""Many jobs to their reports: found, sent to processes or a cluster, and written here, one after the other as they come.

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
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmm_uq import __version__
from cmm_uq.app.commands.files import NOT_RECORDED, REPORTS, RESULTS, Stage, ledger_of, opened, silent
from cmm_uq.app.commands.laboratory import batch_jobs
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import REPORT
from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.languages.translation import ENGLISH
from cmm_uq.base.output import interruption, read_manifest, sha256_of, staged
from cmm_uq.base.output.manifest import journal_for
from cmm_uq.base.values import dataclass, field
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.source import sha256
from cmm_uq.laboratory.records.place import NONE
from cmm_uq.laboratory.schedule.processes import Pace, TaskAnswer, WorkerTask, answers, check_workers, processes

if TYPE_CHECKING:
    from cmm_uq.laboratory.records.store import Records

TIME_LIMIT_S, TRIES, MOST_TRIES = 1800.0, 3, 100
WRITERS = 4  # threads that write: most of the time each waits until the disk has what it was given
_AHEAD = 2  # reports for each of them that may wait

# what the system says where no other job could be written either
_NO_ROOM = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO})


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
        text = str(self.error)
        return text if self.folder in text else f"{self.folder}: {text}"


@dataclass
class Batch:
    """What came of a batch.

    ``planned``: further jobs that are still to be measured; ``not_conforming``: of those that are there, with a statement
    that is no pass, or a recording that contradicts its model; ``ended``: processes that ended over a job, which was then
    given to another; ``failed``: in the order of the jobs; ``parquet``: file with a row for each value, if one was asked
    for; ``records``: what they were recorded in, as it is shown; empty where they were not.
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


class BatchRun:
    """One batch on its way: what came of it so far, with the ``records`` that each report is recorded in."""

    def __init__(self, listed: list[batch_jobs.BatchJob], options: BatchOptions, batch: Batch, tell: Stage) -> None:
        self.listed, self.options, self.batch = listed, options, batch
        self.records: Records | None = None
        self.there = bytearray(len(listed))
        self._under_way: dict[int, Job] = {}
        self._writing: dict[Future[dict[str, Any]], int] = {}
        self._failed: dict[int, FailedJob] = {}
        self._pace, self._tell = Pace(len(listed)), tell

    def kept(self) -> str:
        done, out = sum(self.there), shlex.quote(str(self.batch.out))
        return f"{done} of {len(self.listed)} jobs are written in {out}: the same command with --resume goes on"

    def folders(self) -> Iterator[Path]:
        """Of the reports that are there, in the order of the jobs."""
        return (self.batch.out / one.id for one, there in zip(self.listed, self.there, strict=True) if there)

    def _progress(self) -> None:
        self._tell(f"Reporting jobs: {self._pace}", self._pace.part)

    def through(self) -> None:
        """Have every job that is not there computed, and write it; who computes waits where the disk does not follow."""
        self._progress()
        with closing(self._answers()) as found, ThreadPoolExecutor(WRITERS) as writers:
            for answer in found:
                job = self._under_way.pop(answer.number)
                self.batch.ended += len(answer.ended)
                if answer.failure is not None:
                    self._fail(answer.number, answer.failure)
                else:
                    self._writing[writers.submit(self._write, answer.number, job, answer.value)] = answer.number
                while len(self._writing) > _AHEAD * WRITERS:
                    self._settle()
                self._settle(timeout=0.0)
            while self._writing:
                self._settle()
        self.batch.failed = [self._failed[number] for number in sorted(self._failed)]
        self.batch.seconds = self._pace.seconds

    def _answers(self) -> Generator[TaskAnswer, None, None]:
        options = self.options
        work = WorkerTask(batch_jobs.PROGRAM, (options.seed, options.results_only), options.seconds, options.tries)
        if options.scheduler is None:
            return answers(work, self._tasks(), processes() if options.workers is None else options.workers)
        from cmm_uq.laboratory.schedule.cluster import cluster_answers

        return cluster_answers(options.scheduler, work, self._tasks(), len(self.listed))

    def _tasks(self) -> Iterator[tuple[int, batch_jobs.Task]]:
        """Jobs to be computed; what is there already, or cannot be, is counted."""
        for number, one in enumerate(self.listed):
            try:
                job = read_job(Path(one.folder))
                results = self._there(job) if self.options.resume else None
                if results is None:
                    self._check(job)
            except CmmUqError as error:
                self._fail(number, error, computed=False)
                continue
            if results is not None:
                self.batch.already += 1
                self.there[number] = 1
                self._count(results, computed=False)
                continue
            self._under_way[number] = job
            heads = NOT_RECORDED if self.records is None else self.records.heads(REPORT.command, job.facts.job.id)
            yield number, (one.folder, dict(job.inputs), heads)

    def _folder(self, job: Job) -> Path:
        return self.batch.out / job.facts.job.id

    def _names(self, job: Job) -> list[str]:
        """Of the files that are certain to be written."""
        return [RESULTS] if self.options.results_only else [*REPORT.names(job), RESULTS]

    def _check(self, job: Job) -> None:
        """Make sure, before a job is computed, that it can be written."""
        folder, owner = self._folder(job), REPORT.owner(job)
        there = read_manifest(folder)
        own = there is not None and there.owner == owner
        documents = [name for name in REPORT.names(job) if there is not None and name in there.files]
        if self.options.results_only and own and documents:
            raise CmmUqError("would be lost where figures alone are written again", where=str(folder / documents[0]),
                             fix="Leave --results-only out, or choose another --out")  # fmt: skip
        journal_for(folder, owner, dict.fromkeys(self._names(job), ""), inputs=job.paths, force=self.options.force)

    def _there(self, job: Job) -> dict[str, Any] | None:
        """Contents of results.json where the job's report is there, whole, from the same inputs by the same version."""
        folder, seed = self._folder(job), self.options.seed
        there = read_manifest(folder)
        if there is None or there.owner != REPORT.owner(job) or not there.files.keys() >= set(self._names(job)):
            return None
        if any(sha256_of(folder / name) != digest for name, digest in there.files.items()):
            return None
        data = batch_jobs.results_of(folder)
        same = (
            data is not None
            and data.get("software", {}).get("version") == __version__
            and data.get("job", {}).get("inputs_sha256") == sha256(job.inputs)
            and data.get("job", {}).get("language", ENGLISH) == job.facts.job.language
            and data.get("sampling", {}).get("seed", seed) == seed
        )
        return data if same else None

    def _write(self, number: int, job: Job, files: dict[str, bytes]) -> dict[str, Any]:
        folder, owner, records = self._folder(job), REPORT.owner(job), self.records
        with staged(folder, owner, inputs=job.paths, force=self.options.force) as place:
            ledger = None if records is None else ledger_of(records, job, REPORT.command, folder, files, RESULTS)
            place.write(files, ledger=ledger)
        self.there[number] = 1
        results: dict[str, Any] = json.loads(files[RESULTS])
        return results

    def _settle(self, timeout: float | None = None) -> None:
        """Count what is written, or why it is not; no other job could be if the disk is full, or the records are gone."""
        for one in wait(self._writing, timeout, FIRST_COMPLETED).done:
            number = self._writing.pop(one)
            try:
                results = one.result()
            except CmmUqError as error:
                lost = self.records is not None and error.where == self.records.shown
                no_room = getattr(error.__cause__, "errno", None) in _NO_ROOM
                if isinstance(error, OutputError) and (lost or no_room):
                    raise OutputError(error.problem, where=error.where, fix=f"Free the disk; {self.kept()}") from error
                self._fail(number, error)
            else:
                self.batch.written += 1
                self._count(results)

    def _count(self, results: dict[str, Any], *, computed: bool = True) -> None:
        self.batch.not_conforming += not batch_jobs.conforming(results)
        self._pace.add(computed=computed)
        self._progress()

    def _fail(self, number: int, error: CmmUqError, *, computed: bool = True) -> None:
        self._failed[number] = FailedJob(*self.listed[number], error)
        self._pace.add(computed=computed, failed=True)
        self._progress()


def write_batch(
    folders: Sequence[Path], out: Path | None = None, options: BatchOptions | None = None, *, parquet: Path | None = None,
    stage: Stage = silent, records: str | Path | None = NONE,
) -> Batch:  # fmt: skip
    """Report every job in folders and below them, as :func:`~cmm_uq.app.commands.report.write_report` reports one.

    ``records``: that reports are recorded in: file, URL, ``none``, or ``None`` for those of the environment, else
    ``reports/records.db``. Gives what came of it; a job that fails never stops the others.
    """
    options, place = options or BatchOptions(), out or REPORTS
    if parquet is not None:
        batch_jobs.check_parquet(parquet, force=options.force)
    stage("Looking for jobs", 0.0)
    listed, planned = batch_jobs.jobs_in(folders, place)
    batch = Batch(place, len(listed), planned)
    run = BatchRun(listed, options, batch, stage)
    with interruption.keeping(run.kept), opened(records, None if out is None else out / "job") as run.records:
        batch.records = "" if run.records is None else run.records.shown
        run.through()
        if parquet is not None:
            stage("Writing the table", 1.0)
            written = filter(None, map(batch_jobs.results_of, run.folders()))
            batch_jobs.write_table(parquet, written, force=options.force)
            batch.parquet = parquet
    return batch
