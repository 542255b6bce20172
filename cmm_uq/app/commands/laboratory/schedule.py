"""Scheduled runs: what they go by, whom they tell, what starts them, and the run itself."""

from __future__ import annotations

import contextlib
import datetime as dt
import getpass
import json
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmm_uq.app.commands.files import REPORTS, opened
from cmm_uq.app.commands.forms import shipped
from cmm_uq.app.commands.laboratory.due import due_in
from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.errors import CmmUqError, OutputError, suggestion
from cmm_uq.base.messages import Verbatim, plural, say
from cmm_uq.base.output.interruption import keeping
from cmm_uq.base.output.manifest import write_new
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.schema import commented
from cmm_uq.laboratory.due.history import machine_history
from cmm_uq.laboratory.records.place import NONE, beside, is_url, place_of
from cmm_uq.laboratory.schedule import notices
from cmm_uq.laboratory.schedule.jobs import REPORTED, JobFolder, JobReporting
from cmm_uq.laboratory.schedule.run import RunClock, ScheduledRun
from cmm_uq.laboratory.schedule.schedulers import DAYS, READY, ScheduledCall, encoded
from cmm_uq.laboratory.schedule.settings import FILE, ScheduleFile, channels, read_schedule
from cmm_uq.laboratory.schedule.state import AHEAD, FolderState, Log, Problems, RecordsState

if TYPE_CHECKING:
    from cmm_uq.laboratory.records.store import Records

CLOCK = RunClock(lambda: dt.datetime.now(dt.UTC), time.monotonic, time.sleep)


@dataclass(frozen=True)
class Schedule:
    """What a schedule says, and the folder that its paths are relative to.

    ``home``: its folder; the working folder where there is none; ``path``: the file itself, where there is one.
    """

    facts: ScheduleFile
    home: Path
    path: Path | None = None

    @property
    def out(self) -> Path:
        return REPORTS if self.path is None else self.home / self.facts.run.out

    @property
    def records(self) -> str | None:
        """Records that it names: a file relative to it, a URL, or ``none``."""
        given = self.facts.run.records
        return given if not given or given == NONE or is_url(given) else str(self.home / given)

    def channels(self) -> list[notices.Channel]:
        return channels(self.facts, self.home)


def schedule_of(folders: Sequence[Path], given: Path | None = None) -> Schedule:
    """The schedule that is named, else that in the first folder, else one that says nothing."""
    beside = [folder / FILE for folder in folders[:1] if (folder / FILE).exists()]
    path = given or next(iter(beside), None)
    if path is None:
        return Schedule(ScheduleFile(), Path())
    return Schedule(read_schedule(path), path.parent, path)


def send_trial(found: Schedule, clock: RunClock = CLOCK) -> list[tuple[str, bool, str]]:
    """Of each channel its name, whether a trial message was sent, and why not, or what is to be remarked."""
    if not found.channels():
        raise CmmUqError("names nobody who is told of anything", where=str(found.path or FILE),
                         fix="Add [[email]] or [[webhook]]; cmm-uq schedule new FILE explains every key")  # fmt: skip
    text = say("A trial: messages of scheduled runs will come this way.")
    told = []
    for channel in found.channels():
        notice = notices.Notice("error", "trial", say("trial"), text, clock.moment())
        try:
            remark = channel.send(notices.OutgoingMessage.of(notice, channel.name, clock.moment()))
            told.append((channel.name, True, remark))
        except (notices.UndeliveredError, CmmUqError) as error:
            told.append((channel.name, False, str(error)))
    return told


def write_schedule(path: Path) -> None:
    """Write a new ``schedule.toml`` with every key explained; never over anything."""
    head = "# What cmm-uq report --scheduled goes by. What stands behind # is the default, or what may be said besides."
    begun = {"run": {"out": "reports"}, "log": {"file": "schedule.log"}}
    write_new(path, f"{head}\n\n{commented(json.loads(shipped('schedule')), begun)}".encode())


def ready_files(
    scheduler: str, folders: Sequence[Path], schedule: Path | None = None, *, at: str = "", days: str = "",
    system: str = sys.platform,
) -> dict[str, str]:  # fmt: skip
    """Files for what starts a scheduled run, by name; when, the schedule says where nothing else does, else 06:15 each day."""
    if scheduler not in READY:
        raise CmmUqError(f"there is no scheduler {scheduler!r}", fix=suggestion(scheduler, READY))
    for folder in folders:
        if not folder.is_dir():
            raise CmmUqError("no such folder", where=str(folder), fix="Name the folder that holds the job folders")
    found, named = schedule_of(folders, schedule), [day.strip().upper() for day in days.split(",") if day.strip()]
    run = found.facts.run
    at, named = at or run.at or "06:15", named or list(run.days)
    try:
        time_of_day = dt.datetime.strptime(at, "%H:%M")
    except ValueError:
        raise CmmUqError(f"{at!r} is no time of day", where="--at", fix="Write it as 06:15") from None
    if unknown := next((day for day in named if day not in DAYS), None):
        raise CmmUqError(f"{unknown!r} is no day of the week", where="--days", fix=f"Known: {', '.join(DAYS)}")
    if run.at and (f"{time_of_day:%H:%M}", set(named)) != (run.at, set(run.days)):
        what = "names another time, by which it tells which runs were missed"
        raise CmmUqError(what, where=str(found.path), fix="Leave --at and --days away, or mend at and days there")
    home = (found.home if found.path is not None else Path()).resolve()
    path = None if schedule is None else schedule.resolve()
    program, user = (sys.executable, "-m", "cmm_uq"), getpass.getuser() if system != "win32" else ""
    whole, chosen = tuple(folder.resolve() for folder in folders), tuple(day for day in DAYS if day in named)
    call = ScheduledCall(program, whole, path, home, time_of_day.hour, time_of_day.minute, chosen, user)
    return READY[scheduler](call)


def write_ready(files: Mapping[str, str], folder: Path) -> list[Path]:
    """Write ready files into a folder; never over anything."""
    for name, text in files.items():
        write_new(folder / name, encoded(name, text))
    return [folder / name for name in files]


def due_notices(records: Records | None, on: dt.date, within: dt.timedelta) -> Iterable[notices.Notice]:
    """What is to be calibrated soon, or should have been."""
    if records is None or (latest := records.last_moment) is None or not (records.machines() or records.artefacts()):
        return
    wrong = latest.date() > on + AHEAD
    for one in due_in(records, (), max(on, latest.date()) if wrong else on):  # with all certificates that there are
        if one.due is not None and one.due <= on + within:
            yield notices.of_due(one.item, one.serial, one.due, on, one.why, beyond=one.beyond)
    if wrong:
        what = f"the newest entry is of {latest.date()}, and the clock says {on}: more may be due than is said"
        fix = "Set the clock; where it is right, cmm-uq records verify says which entry is not"
        raise CmmUqError(what, where="records", fix=fix)


def _newest_jobs(records: Records | None, on: dt.date) -> set[str]:
    return set() if records is None else {one.job for one in (*records.latest(on, values=False), *records.checks())}


def drift_notices(records: Records | None, job: str, on: dt.date) -> Iterable[notices.Notice]:
    """Whether a machine changed by more than chance since the recording before that of a job."""
    newest = [] if records is None else records.certificates(job=job, limit=1, values=False)
    if records is None or not newest:
        return
    machine = records.machine(newest[-1].machine)
    certificates = records.certificates(machine.serial, values=False)
    history = machine_history(machine, certificates, records.series(machine.serial), on)
    changed = [Verbatim(one.series.quantity) for one in history.values if history.significant(one)
               and int(one.series.entry[-1]) == newest[-1].entry]  # fmt: skip
    if changed:
        yield notices.of_drift(machine.serial, changed, newest[-1].entry)


Tell = Callable[[dict[str, Any]], None]
_RUN = "the run"  # what an error is about that ends all of it


@dataclass(frozen=True)
class ScheduledOptions:
    """A scheduled run, as it is asked for.

    ``folders``: job folders, or folders with job folders in them; ``out``: folder of the reports; by default what the
    schedule says; ``schedule``: the file; by default ``schedule.toml`` in the first folder; ``records``: file, URL,
    or ``none``; by default what the schedule says, else ``records.db`` beside the reports; ``seed``: of everything
    random; by default what the schedule says; ``dry``: say what would happen, and do nothing; ``strict``: exit code 1
    while anything stands.
    """

    folders: tuple[Path, ...]
    out: Path | None = None
    schedule: Path | None = None
    records: str | None = None
    seed: int | None = None
    dry: bool = False
    strict: bool = False


def run_scheduled(asked: ScheduledOptions, tell: Tell = lambda told: None, clock: RunClock = CLOCK) -> int:
    """Report every job in folders that is new or changed, send what a person must hear of; the exit code.

    Gives 0 all is well, 1 something needs a person, 2 bad input, 3 output impossible.
    """
    found = schedule_of(asked.folders, asked.schedule)
    facts, reports = found.facts, (asked.out or found.out).absolute()  # a message is read elsewhere
    place = place_of(asked.records or found.records, beside(reports / "x"))
    log = Log(reports / facts.log.file if facts.log.file else None, facts.log.largest_bytes, facts.log.kept)
    ways = found.channels()
    run: ScheduledRun | None = None

    def kept() -> str:
        count = 0 if run is None else run.counted.get(REPORTED, 0)
        many = say("{count} reports were written", count=count)
        return str(plural(count, one=say("1 report was written"), many=many))

    try:
        make = not asked.dry
        with keeping(kept), opened(place or NONE, None, make=make, create=make, read_only=asked.dry) as records:
            if make:
                with contextlib.nullcontext() if records is None else records.writing():
                    Problems(reports).mended(_RUN)
            state = FolderState(reports) if records is None else RecordsState(records, reports)
            outbox = notices.Outbox(reports, ways, state, clock.moment)
            seed = facts.run.seed if asked.seed is None else asked.seed
            today = clock.now().astimezone().date()
            newest = _newest_jobs(records, today)
            work = JobReporting(
                reports, state, lambda job: _reported(job, reports, seed, place or NONE), outbox.announce,
                lambda job: drift_notices(records, job.id, today),
                lambda job: drift_notices(records, job.id, today) if job.id in newest else (),
            )  # fmt: skip
            within = dt.timedelta(days=facts.run.due_within_days)
            roots = [folder.absolute() for folder in asked.folders]
            due = partial(due_notices, records, within=within)
            run = ScheduledRun(roots, facts.run, work, outbox, due, tell, log.write, clock, asked.dry, asked.strict)
            return run.through()
    except CmmUqError as error:  # of the records: without them nothing is made, and somebody has to hear of that too
        if not asked.dry:
            since = Problems(reports).since(_RUN, str(error), clock.moment())
            log.write(f"{clock.moment()} nothing was done, since {since}: {error}")
            notice = notices.of_error(error, _RUN, since)
            outbox = notices.Outbox(reports, ways, FolderState(reports), clock.moment)
            try:
                outbox.add([notice])
                outbox.deliver(patience_s=0.0)
            except OutputError:
                outbox.sent_at_once([notice])
        raise


def _reported(job: JobFolder, out: Path, seed: int, records: str | Path) -> bytes:
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
