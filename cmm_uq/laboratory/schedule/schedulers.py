"""Ready files for what starts a scheduled run: a line of cron, two units of systemd, a task of Windows."""

from __future__ import annotations

import datetime as dt
import shlex
import subprocess
from collections.abc import Callable, Mapping, Sequence
from pathlib import PurePath
from types import MappingProxyType
from xml.sax.saxutils import escape

from cmm_uq.base.values import dataclass

DAYS = ("MON", "TUE", "WED", "THU", "FRI", "SAT", "SUN")  # days of the week, as they are given
UNIT = "cmm-uq-schedule"  # name of units and task
SECRETS = "schedule.env"  # file with the variables of secrets, beside schedule.toml
_OF_WINDOWS = ("Monday", "Tuesday", "Wednesday", "Thursday", "Friday", "Saturday", "Sunday")
_NAMESPACE = "http://schemas.microsoft.com/windows/2004/02/mit/task"


@dataclass(frozen=True)
class ScheduledCall:
    program: tuple[str, ...]  # that runs the command, and what comes before the subcommand
    folders: tuple[PurePath, ...]  # with job folders in them; absolute
    schedule: PurePath | None  # the file schedule.toml; ``None`` where there is none
    home: PurePath  # folder that it works in
    hour: int  # and minute: of the day
    minute: int
    days: tuple[str, ...] = ()  # of the week, as in :data:`DAYS`; empty for every day
    user: str = ""  # who it runs as, on systems with units

    def line(self, *further: str) -> list[str]:
        """The command line, word by word."""
        named = () if self.schedule is None else ("--schedule", str(self.schedule))
        return [*self.program, "report", "--scheduled", *map(str, self.folders), *named, *further]


def cron(call: ScheduledCall) -> dict[str, str]:
    """A line of a crontab; ``%`` would end the command there."""
    line = f"cd {shlex.quote(str(call.home))} && {shlex.join(call.line('--quiet'))}".replace("%", "\\%")
    days = ",".join(call.days).lower() or "*"
    told = (
        "# Put this line into your crontab: crontab -e. Errors of a run are mailed by cron; certificates that are no pass,\n"
        "# by schedule.toml. Variables of secrets stand above it, as NAME=value, and the crontab is yours alone to read.\n"
    )
    return {f"{UNIT}.crontab": f"{told}{call.minute} {call.hour} * * {days} {line}\n"}


def systemd(call: ScheduledCall) -> dict[str, str]:
    """A service and its timer; a run that was missed while the computer was off is made up for."""
    days = ",".join(day.capitalize() for day in call.days)
    home = _specified(str(call.home))
    secrets = _specified(str((call.home if call.schedule is None else call.schedule.parent) / SECRETS))
    user = [f"User={call.user}"] if call.user else []
    service = [
        "[Unit]", "Description=Certificates of new and changed CMM jobs", "Wants=network-online.target",
        "After=network-online.target", "", "[Service]", "Type=oneshot", *user, f"WorkingDirectory={home}",
        "# Variables of secrets, NAME=value a line; chmod 600", f"EnvironmentFile=-{secrets}",
        f"ExecStart={' '.join(map(_quoted, call.line()))}",
        "# Whatever is not 0 shows in systemctl --failed: 1 is also how a Python ends that cannot start",
        "# Longer than the longest night: what a run that was ended left, the next one does", "TimeoutStartSec=12h",
        "TimeoutStopSec=30s", "Nice=10", "NoNewPrivileges=true", "UMask=0027",
    ]  # fmt: skip
    timer = [
        "[Unit]", "Description=When certificates of new and changed CMM jobs are made", "", "[Timer]",
        f"OnCalendar={days + ' ' if days else ''}*-*-* {call.hour:02}:{call.minute:02}:00", "Persistent=true", "",
        "[Install]", "WantedBy=timers.target",
    ]  # fmt: skip
    return {f"{UNIT}.service": "\n".join(service) + "\n", f"{UNIT}.timer": "\n".join(timer) + "\n"}


def windows(call: ScheduledCall) -> dict[str, str]:
    """A task for ``schtasks /Create /XML``; a start that was missed is made up for, a second one beside it is not made."""
    chosen = [name for name, day in zip(_OF_WINDOWS, DAYS, strict=True) if day in call.days]
    when = (
        ["<ScheduleByWeek>", "<WeeksInterval>1</WeeksInterval>", "<DaysOfWeek>", *(f"<{day} />" for day in chosen),
         "</DaysOfWeek>", "</ScheduleByWeek>"]
        if chosen
        else ["<ScheduleByDay>", "<DaysInterval>1</DaysInterval>", "</ScheduleByDay>"]
    )  # fmt: skip
    command, *arguments = call.line("--quiet")
    lines = [
        '<?xml version="1.0" encoding="UTF-16"?>', f'<Task version="1.2" xmlns="{_NAMESPACE}">', "<RegistrationInfo>",
        "<Description>Certificates of new and changed CMM jobs</Description>", "</RegistrationInfo>", "<Triggers>",
        "<CalendarTrigger>", f"<StartBoundary>2026-01-01T{call.hour:02}:{call.minute:02}:00</StartBoundary>",
        "<Enabled>true</Enabled>", *when, "</CalendarTrigger>", "</Triggers>", "<Settings>",
        "<MultipleInstancesPolicy>IgnoreNew</MultipleInstancesPolicy>",
        "<DisallowStartIfOnBatteries>false</DisallowStartIfOnBatteries>",
        "<StopIfGoingOnBatteries>false</StopIfGoingOnBatteries>", "<StartWhenAvailable>true</StartWhenAvailable>",
        "<ExecutionTimeLimit>PT12H</ExecutionTimeLimit>", "<Priority>7</Priority>", "</Settings>",
        '<Actions Context="Author">', "<Exec>", f"<Command>{escape(command)}</Command>",
        f"<Arguments>{escape(subprocess.list2cmdline(arguments))}</Arguments>",
        f"<WorkingDirectory>{escape(str(call.home))}</WorkingDirectory>", "</Exec>", "</Actions>", "</Task>",
    ]  # fmt: skip
    return {f"{UNIT}.xml": "\n".join(_indented(lines)) + "\n"}


READY: Mapping[str, Callable[[ScheduledCall], dict[str, str]]] = MappingProxyType(
    {"cron": cron, "systemd": systemd, "windows": windows}
)
"""Files by the name of the scheduler, each with its text."""


def starts(after: dt.datetime, until: dt.datetime, at: str, days: Sequence[str]) -> list[dt.datetime]:
    """When runs are to start by the clock on the wall: an hour that comes twice counts once, one that is skipped does not."""
    of_day, found = dt.time.fromisoformat(at), []
    for ordinal in range(after.toordinal(), until.toordinal() + 1):
        time = dt.datetime.combine(dt.date.fromordinal(ordinal), of_day)
        exists = time.astimezone(dt.UTC).astimezone().replace(tzinfo=None) == time
        if exists and after < time <= until and (not days or DAYS[time.weekday()] in days):
            found.append(time)
    return found


def encoded(name: str, text: str) -> bytes:
    """Bytes of a ready file: the task of Windows is UTF-16, as its own are."""
    return text.encode("utf-16") if name.endswith(".xml") else text.encode()


def _specified(text: str) -> str:
    """A setting of a unit, where ``%`` would begin a specifier."""
    return text.replace("%", "%%")


def _quoted(word: str) -> str:
    """A word of ExecStart, where quotes, backslashes, ``$`` and ``%`` have a meaning of their own."""
    plain = _specified(word).replace("\\", "\\\\").replace('"', '\\"').replace("$", "$$")
    return plain if plain and not set(plain) & set(" \t'\"\\;") else f'"{plain}"'


def _indented(lines: Sequence[str]) -> list[str]:
    depth, shown = 0, []
    for line in lines:
        depth -= line.startswith("</")
        shown.append("  " * depth + line)
        depth += line.startswith("<") and "</" not in line and not line.endswith(("/>", "?>"))
    return shown
