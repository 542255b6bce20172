"""``cmm-uq report --scheduled``: what a scheduled run goes by, joined."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.schedule import CLOCK, schedule_of
from cmm_uq.app.commands.scheduled_records import drift_notices, due_notices, opened
from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.messages import plural, say
from cmm_uq.base.output.interruption import keeping
from cmm_uq.jobs.job import Job
from cmm_uq.laboratory.records.place import NONE, beside, place_of
from cmm_uq.laboratory.schedule.found import Found
from cmm_uq.laboratory.schedule.log import Log
from cmm_uq.laboratory.schedule.notices import of_error
from cmm_uq.laboratory.schedule.outbox import Outbox
from cmm_uq.laboratory.schedule.problems import Problems
from cmm_uq.laboratory.schedule.run import Clock, Run
from cmm_uq.laboratory.schedule.state import InFolder, InRecords
from cmm_uq.laboratory.schedule.work import REPORTED, Work

Tell = Callable[[dict[str, Any]], None]

_RUN = "the run"
"""What an error is about that ends all of it."""


@dataclass(frozen=True)
class Asked:
    """A scheduled run, as it is asked for.

    Parameters
    ----------
    folders : job folders, or folders with job folders in them.
    out : folder of the reports; by default what the schedule says.
    schedule : the file; by default ``schedule.toml`` in the first folder.
    records : file, URL, or ``none``; by default what the schedule says, else ``records.db`` beside the reports.
    seed : of everything random; by default what the schedule says.
    dry : say what would happen, and do nothing.
    """

    folders: tuple[Path, ...]
    out: Path | None = None
    schedule: Path | None = None
    records: str | None = None
    seed: int | None = None
    dry: bool = False


def run_scheduled(asked: Asked, tell: Tell = lambda told: None, clock: Clock = CLOCK) -> int:
    """Report every job in folders that is new or changed, send what a person must hear of; the exit code.

    Parameters
    ----------
    asked : which folders, and how.
    tell : takes a line for each job, each message, and at the end.
    clock : time.

    Returns
    -------
    0 all is well, 1 something needs a person, 2 bad input, 3 output impossible.

    Raises
    ------
    CmmUqError : the schedule is wrong, or the records are another program's.
    OutputError : the records cannot be written to.
    """
    found = schedule_of(asked.folders, asked.schedule)
    facts, reports = found.facts, (asked.out or found.out).absolute()  # a message is read elsewhere
    place = place_of(asked.records or found.records, beside(reports / "x"))
    log = Log(reports / facts.log.file if facts.log.file else None, facts.log.largest_bytes, facts.log.kept)
    ways = found.channels()
    try:
        with opened(place, dry=asked.dry) as records:
            if not asked.dry:
                Problems(reports).mended(_RUN)
            state = InFolder(reports) if records is None else InRecords(records, reports)
            outbox = Outbox(reports, ways, state, clock.moment)
            seed = facts.run.seed if asked.seed is None else asked.seed
            work = Work(reports, state, lambda job: _reported(job, reports, seed, place or NONE), outbox.add,
                        lambda job: drift_notices(records, job.id, clock.now().date()))  # fmt: skip
            within = dt.timedelta(days=facts.run.due_within_days)
            roots = [folder.absolute() for folder in asked.folders]
            run = Run(roots, facts.run, work, outbox, lambda on: due_notices(records, on, within), tell, log.write, clock,
                      asked.dry)  # fmt: skip
            with keeping(lambda: _kept(run)):
                return run.through()
    except CmmUqError as error:  # of the records: without them nothing is made, and somebody has to hear of that too
        if not asked.dry:
            _send_alone(error, Outbox(reports, ways, InFolder(reports), clock.moment), log, clock)
        raise


def _kept(run: Run) -> str:
    """What a signal finds."""
    count = run.counted.get(REPORTED, 0)
    return str(plural(count, one=say("1 report was written"), many=say("{count} reports were written", count=count)))


def _send_alone(error: CmmUqError, outbox: Outbox, log: Log, clock: Clock) -> None:
    """Tell of an error that ended the whole run."""
    log.write(f"{clock.moment()} nothing was done: {error}")
    notice = of_error(error, _RUN, Problems(outbox.out).since(_RUN, str(error), clock.moment()))
    try:
        outbox.add([notice])
        outbox.deliver(patience_s=0.0)
    except OutputError:
        outbox.sent_at_once([notice])


def _reported(job: Found, out: Path, seed: int, records: str | Path) -> bytes:
    """Contents of results.json of a job, once its certificate is written."""
    from cmm_uq.app.commands.report import write_report

    if not job.id:
        read_job(job.folder)
        return b"{}"

    def same(read: Job) -> None:
        if read.facts.job.id != job.id:
            raise CmmUqError(f"its id {job.id!r} was changed while it was read", where=str(job.folder),
                             fix="The next run takes it")  # fmt: skip

    return write_report(job.folder, out / job.id, seed=seed, told=same, records=records).results
