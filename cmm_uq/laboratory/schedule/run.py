"""A scheduled run: every job folder that is new or changed, one after another; then what is due; then the messages.

Nothing that goes wrong with one job stops the others. What may pass (a full disk, locked records, a mail server that does
not answer) is tried again when everything else is done.
"""

from __future__ import annotations

import contextlib
import datetime as dt
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.laboratory.schedule import jobs as states
from cmm_uq.laboratory.schedule.jobs import JobFolder, JobOutcome, JobReporting, Snapshot, job_folders, quiet_since
from cmm_uq.laboratory.schedule.notices import Announcement, Delivery, Notice, Outbox, of_error, of_missed
from cmm_uq.laboratory.schedule.schedulers import starts
from cmm_uq.laboratory.schedule.settings import RunTable
from cmm_uq.laboratory.schedule.state import Problems, last_run, remember_run, running

SCHEMA = "cmm-uq/scheduled/1"
_IN_A_ROW = 3  # jobs one after another whose output is impossible: then it is so for the others too
_PATIENCE_S = 60.0  # how long to wait for another run that sends messages
_EARLY = dt.timedelta(minutes=10)  # by how much a run may begin before its time: clocks are set


@dataclass(frozen=True)
class RunClock:
    now: Callable[[], dt.datetime]  # the moment, UTC; it may jump
    passed: Callable[[], float]  # seconds from some moment on; they do not
    sleep: Callable[[float], None]  # waits so many seconds

    def moment(self) -> str:
        """ISO 8601, to the second."""
        return self.now().strftime("%Y-%m-%dT%H:%M:%SZ")


@dataclass(frozen=True)
class ScheduledRun:
    folders: Sequence[Path]  # with job folders in them
    settings: RunTable
    work: JobReporting  # how a job is reported
    outbox: Outbox
    due: Callable[[dt.date], Iterable[Notice]]  # what is due, or drifts, on a day
    tell: Callable[[dict[str, Any]], None]  # takes a line for a program
    log: Callable[[str], None]  # takes a line for a person
    clock: RunClock
    dry: bool = False  # say what would happen, and do nothing
    strict: bool = False  # end with 1 while anything stands
    counted: dict[str, int] = field(default_factory=dict)
    codes: set[int] = field(default_factory=lambda: {0})
    standing: list[Notice] = field(default_factory=list)

    @cached_property
    def problems(self) -> Problems:
        return Problems(self.work.out)

    def through(self) -> int:
        """The exit code: 0 all is well, 1 something needs a person, 2 bad input, 3 output impossible."""
        if self.dry:
            for job in self._distinct(self._found()):
                self._end(self._would(job))
            return self._conclude()
        with contextlib.ExitStack() as stack:
            with contextlib.suppress(OutputError):  # what cannot be written, jobs and messages say
                self.outbox.resumed = stack.enter_context(running(self.work.out))
            return self._through(self.clock.now().astimezone())

    def _through(self, begun: dt.datetime) -> int:
        last = last_run(self.work.out)
        jobs = self._distinct(self._found())
        self._send(1, last=False)
        ready, changing = self._parted(jobs)
        self._report_all(ready)
        self._report_all(self._settled(changing, {job.id.casefold() for job in jobs}))
        try:
            self._stand(self._missed(last, begun))
            for notice in self.due(self.clock.now().astimezone().date()):
                self._stand([notice])
        except CmmUqError as error:
            self._line({"due": None, "event": "error", "why": str(error)}, 3 if isinstance(error, OutputError) else 2)
        self._send(self.settings.tries, last=True)
        try:
            remember_run(self.work.out, begun, self.clock.now())
        except OutputError as error:
            self._line({"standing": None, "event": "error", "why": str(error)}, 3)
        return self._conclude(last)

    def _missed(self, last: dt.datetime | None, begun: dt.datetime) -> list[Notice]:
        """Starts since the last run without one; what was due then, this run does and says."""
        if last is not None and last > begun + _EARLY:
            return [of_missed(last, begun, ())]
        if last is None or not self.settings.at:
            return []
        # by the clock on the wall, wherever it hung; the last of them is this run
        after, until = (one.replace(tzinfo=None) for one in (last + _EARLY, begun))
        times = starts(after, until, self.settings.at, self.settings.days)
        return [of_missed(last, begun, times[:-1])] if len(times) > 1 else []

    def _found(self) -> list[JobFolder]:
        found: dict[Path, JobFolder] = {}
        for root in self.folders:
            try:
                inside = list(job_folders(root, self.work.out))
                if not inside and not self.settings.may_be_empty:
                    fix = "A job is a folder with a job.toml; [run] may_be_empty allows none"
                    raise CmmUqError("holds no job", where=str(root), fix=fix)
            except CmmUqError as error:
                self._end(JobOutcome.refused(JobFolder(root, root), error))
                continue
            self._mended(str(root))
            for job in inside:
                found.setdefault(job.folder.resolve(), job)
        return list(found.values())

    def _distinct(self, jobs: Sequence[JobFolder]) -> list[JobFolder]:
        """Jobs whose id no other one has; of the others neither is reported, or each would replace the other's."""
        by_id: dict[str, list[JobFolder]] = {}
        for job in jobs:
            by_id.setdefault(job.id.casefold() or str(job.folder), []).append(job)
        for same in (same for same in by_id.values() if len(same) > 1):
            for job, other in zip(same, [*same[1:], same[0]], strict=True):
                problem = f"its id {job.id!r} is that of {other.folder} too"
                error = CmmUqError(problem, where=str(job.folder), fix="Give each job an id of its own")
                self._end(JobOutcome.refused(job, error))
        # a job in which the last run ended comes last, so that it cannot keep the others from being reported
        return sorted((same[0] for same in by_id.values() if len(same) == 1), key=self.work.was_left)

    def _would(self, job: JobFolder) -> JobOutcome:
        if job.planned:
            return JobOutcome(job, states.WAITING, "not measured yet")
        try:
            why = self.work.reason(job)
        except CmmUqError as error:
            return JobOutcome.refused(job, error)
        if not why:
            return JobOutcome(job, states.UNCHANGED)
        if quiet_since(states.snapshot(job.folder), self.clock.now().timestamp()) < self.settings.quiet_s:
            return JobOutcome(job, states.WAITING, "changed a moment ago")
        return JobOutcome(job, states.WOULD, why)

    def _parted(self, jobs: Iterable[JobFolder]) -> tuple[list[JobFolder], dict[JobFolder, tuple[float, Snapshot]]]:
        """Jobs that can be taken, and those that somebody may still be copying, as they are now."""
        ready, changing = [], {}
        for job in jobs:
            would = self._would(job)
            if would.state == states.WOULD or (would.state == states.UNCHANGED and self.work.was_left(job)):
                ready.append(job)
            elif would.state == states.WAITING and not job.planned:
                changing[job] = (self.clock.passed(), states.snapshot(job.folder))
            else:
                self._end(would)
        return ready, changing

    def _settled(self, changing: Mapping[JobFolder, tuple[float, Snapshot]], ids: Collection[str]) -> list[JobFolder]:
        """Of the jobs that were changed a moment ago, or have times of the future, those that nobody changes now."""
        settled = []
        for job, (looked, seen) in changing.items():
            self.clock.sleep(max(0.0, looked + self.settings.quiet_s - self.clock.passed()))
            again = job  # it may have been read while it was being copied; where it went away, taking it says so
            with contextlib.suppress(CmmUqError):
                again = replace(next(job_folders(job.folder), job), root=job.root)
            same_id = again.id == job.id or again.id.casefold() not in ids
            if states.snapshot(job.folder) == seen and same_id and not again.planned:
                settled.append(again)
            else:
                self._end(JobOutcome(job, states.WAITING, "is still being changed: left for the next run"))
        return settled

    def _report_all(self, jobs: Sequence[JobFolder]) -> None:
        """Report jobs; those whose output is impossible now again after the others."""
        for attempt in range(1, self.settings.tries + 1):
            jobs = self._attempt(jobs, last=attempt == self.settings.tries)
            if not jobs:
                return
            self._back_off(attempt)

    def _attempt(self, jobs: Sequence[JobFolder], *, last: bool) -> list[JobFolder]:
        """Report jobs; those that are to be tried again."""
        again, in_a_row = list[JobFolder](), 0
        for i, job in enumerate(jobs):
            ended = self.work.take(job)
            if last or ended.state != states.FAILED:
                in_a_row = 0
                self._end(ended)
                continue
            again.append(job)
            in_a_row += 1
            self._log(f"will be tried again {ended.name}: {ended.why}")
            if in_a_row == _IN_A_ROW:  # whatever is wrong with these, it keeps none of the others from its turn
                return [*jobs[i + 1 :], *again]
        return again

    def _back_off(self, attempt: int) -> None:
        self.clock.sleep(float(self.settings.back_off_s * 2 ** (attempt - 1)))

    def _send(self, tries: int, *, last: bool) -> None:
        """Send what waits, again where a server does not answer; of the last failure a person must know."""
        for attempt in range(1, tries + 1):
            try:
                deliveries = self.outbox.deliver(_PATIENCE_S)
            except CmmUqError as error:
                self._line({"message": None, "why": str(error)}, 3)
                return
            for one in deliveries:
                if (attempt == tries and last) or not one.problem:
                    self._sent(one)
            if attempt == tries or not any(one.problem for one in deliveries):
                return
            self._back_off(attempt)

    def _sent(self, one: Delivery) -> None:
        why, sent = one.problem or one.remark or None, not one.problem
        self._line({"message": one.message.title, "channel": one.channel, "sent": sent, "why": why}, int(not sent))

    def _end(self, ended: JobOutcome) -> None:
        """Tell what came of a job; an error goes out once while it stands."""
        self.counted[ended.state] = self.counted.get(ended.state, 0) + 1
        age = {}
        if ended.error is not None and not self.dry:
            since = self.problems.since(ended.name, ended.why, self.clock.moment())
            age = self._age(dt.datetime.fromisoformat(since))
            self._queue([of_error(ended.error, ended.name, since)])
        elif ended.state not in (states.BUSY, states.WAITING, states.GONE):
            self._mended(ended.name)
            self._mended(str(ended.job.folder))
        self._tell({**ended.line(), **age}, ended.code)
        self.standing.extend(ended.notices)
        if ended.state == states.UNCHANGED and not self.dry:
            try:
                self._stand(self.work.standing(ended.job))
            except CmmUqError as error:
                self._line({"standing": ended.name, "event": "error", "why": str(error)}, 2)
        if ended.state != states.UNCHANGED:
            said = ended.why if ended.error is not None else ", ".join(filter(None, (ended.why, *ended.events)))
            self._log(f"{ended.state} {ended.name}" + (f": {said}" if said else ""))

    def _stand(self, notices: Sequence[Notice]) -> None:
        """Tell what stands, and for how long it has been known."""
        for one in self._queue(notices):
            key = "due" if one.notice.event == "due" else "standing"
            told = {key: one.notice.about, "event": one.notice.event, "why": str(one.notice.text)}
            self._line({**told, **self._age(one.since)}, int(one.counts or self.strict))
        self.standing.extend(notices)

    def _age(self, since: dt.datetime) -> dict[str, Any]:
        days = max(0, (self.clock.now().astimezone().date() - since.astimezone().date()).days)  # of the calendar
        return {"since": since.astimezone(dt.UTC).strftime("%Y-%m-%dT%H:%M:%SZ"), "days": days}

    def _mended(self, about: str) -> None:
        if not self.dry:
            self.problems.mended(about)

    def _queue(self, notices: Sequence[Notice]) -> list[Announcement]:
        """Let notices go out; where they cannot be kept they are sent at once, and again by the next run."""
        try:
            return self.outbox.announce(notices)
        except CmmUqError as error:  # a full disk, or records that were lost meanwhile
            self.codes.add(3)
            self._log(f"a message cannot be kept: {error}")
            for one in self.outbox.sent_at_once(notices):
                self._sent(one)
            return [Announcement(one, self.outbox.moment) for one in notices]

    def _line(self, told: dict[str, Any], code: int) -> None:
        self._tell({**told, "exit_code": code}, code)
        self._log(", ".join(f"{key} {value}" for key, value in told.items() if value not in (None, "")))

    def _tell(self, told: dict[str, Any], code: int) -> None:
        self.codes.add(code)
        self.tell({"schema": SCHEMA, "at": self.clock.moment(), **told})

    def _log(self, text: str) -> None:
        if not self.dry:
            self.log(f"{self.clock.moment()} {text}")

    def _conclude(self, last: dt.datetime | None = None) -> int:
        code = max(self.codes)
        told = {"run": self.counted, "dry": self.dry, "standing": len(self.standing)}
        told |= {"last_run": last and last.isoformat(), "messages_waiting": self.outbox.waiting()}
        self._tell({**told, "exit_code": code}, code)
        counts = ", ".join(f"{count} {state}" for state, count in self.counted.items()) or "nothing found"
        self._log(f"run ended with {code}: {counts}")
        return code
