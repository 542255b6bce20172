"""``schedule.toml``: read, begun, its messages tried, and what starts the runs that go by it."""

from __future__ import annotations

import datetime as dt
import getpass
import json
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cmm_uq.app.commands.files import REPORTS
from cmm_uq.app.commands.jobs.schemas import shipped
from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.messages import say
from cmm_uq.base.output.new_file import write_new
from cmm_uq.jobs.schema import commented
from cmm_uq.laboratory.records.place import NONE, is_url
from cmm_uq.laboratory.schedule.channels import channels
from cmm_uq.laboratory.schedule.notices import Channel, Notice, OutgoingMessage, UndeliveredError
from cmm_uq.laboratory.schedule.run import RunClock
from cmm_uq.laboratory.schedule.schedulers import DAYS, READY, ScheduledCall, encoded
from cmm_uq.laboratory.schedule.settings import FILE, ScheduleFile, read_schedule

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

    def channels(self) -> list[Channel]:
        return channels(self.facts, self.home)


def schedule_of(folders: Sequence[Path], given: Path | None = None) -> Schedule:
    """The schedule that is named, else that in the first folder, else one that says nothing."""
    beside = [folder / FILE for folder in folders[:1] if (folder / FILE).exists()]
    path = given or next(iter(beside), None)
    if path is None:
        return Schedule(ScheduleFile(), Path())
    return Schedule(read_schedule(path), path.parent, path)


@dataclass(frozen=True)
class Tried:
    """What came of a trial message.

    ``why``: it did not, or what is to be remarked; empty where nothing is.
    """

    channel: str
    sent: bool
    why: str


def send_trial(found: Schedule, clock: RunClock = CLOCK) -> list[Tried]:
    """Send a trial message through every channel."""
    if not found.channels():
        raise CmmUqError("names nobody who is told of anything", where=str(found.path or FILE),
                         fix="Add [[email]] or [[webhook]]; cmm-uq schedule new FILE explains every key")  # fmt: skip
    text = say("A trial: messages of scheduled runs will come this way.")
    told = []
    for channel in found.channels():
        notice = Notice("error", "trial", say("trial"), text, clock.moment())
        try:
            remark = channel.send(OutgoingMessage.of(notice, channel.name, clock.moment()))
            told.append(Tried(channel.name, True, remark))
        except (UndeliveredError, CmmUqError) as error:
            told.append(Tried(channel.name, False, str(error)))
    return told


def write_schedule(path: Path) -> None:
    """Write a new ``schedule.toml`` with every key explained; never over anything."""
    schema = json.loads(shipped("schedule"))
    head = (
        "# What cmm-uq report --scheduled goes by. What stands behind # is the default, or what may be said besides.\n"
    )
    write_new(path, f"{head}\n{commented(schema, _BEGUN)}".encode())


_BEGUN: Mapping[str, Any] = {"run": {"out": "reports"}, "log": {"file": "schedule.log"}}


def ready_files(
    scheduler: str, folders: Sequence[Path], schedule: Path | None = None, *, at: str = "06:15", days: str = "",
    system: str = sys.platform,
) -> dict[str, str]:  # fmt: skip
    """Files for what starts a scheduled run, by name."""
    if scheduler not in READY:
        raise CmmUqError(f"there is no scheduler {scheduler!r}", fix=suggestion(scheduler, READY))
    for folder in folders:
        if not folder.is_dir():
            raise CmmUqError("no such folder", where=str(folder), fix="Name the folder that holds the job folders")
    found = schedule_of(folders, schedule)
    hour, minute = _time_of(at)
    home = (found.home if found.path is not None else Path()).resolve()
    path = None if schedule is None else schedule.resolve()
    program, user = (sys.executable, "-m", "cmm_uq"), getpass.getuser() if system != "win32" else ""
    whole = tuple(folder.resolve() for folder in folders)
    call = ScheduledCall(program, whole, path, home, hour, minute, _days_of(days), user)
    return READY[scheduler](call)


def write_ready(files: Mapping[str, str], folder: Path) -> list[Path]:
    """Write ready files into a folder; never over anything."""
    for name, text in files.items():
        write_new(folder / name, encoded(name, text))
    return [folder / name for name in files]


def _time_of(text: str) -> tuple[int, int]:
    try:
        found = dt.datetime.strptime(text, "%H:%M")
    except ValueError:
        raise CmmUqError(f"{text!r} is no time of day", where="--at", fix="Write it as 06:15") from None
    return found.hour, found.minute


def _days_of(text: str) -> tuple[str, ...]:
    given = [day.strip().upper() for day in text.split(",") if day.strip()]
    for day in given:
        if day not in DAYS:
            raise CmmUqError(f"{day!r} is no day of the week", where="--days", fix=f"Known: {', '.join(DAYS)}")
    return tuple(day for day in DAYS if day in given)
