"""``cmm-uq schedule new | test | print``, and where the lines of a scheduled run go."""

from __future__ import annotations

import json as json_text
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from cmm_uq.app.cli import options as opt
from cmm_uq.app.cli.options import argument, examples, option
from cmm_uq.app.cli.terminal import NEEDS_A_PERSON, closed, put, put_data, put_json, say
from cmm_uq.base.errors import OutputError, printable

if TYPE_CHECKING:
    from cmm_uq.app.commands.laboratory.schedule import ScheduledOptions

STANDARD_OUTPUT = Path("-")  # in place of a file for the lines

app = opt.group(
    "Scheduled runs: a schedule.toml, a trial of its messages, ready files for cron, systemd and Windows.",
    examples("schedule new jobs/schedule.toml", "schedule print systemd jobs --at 06:15"),
)
SCHEDULE = option(None, "File schedule.toml.", "FILE", "that in the first FOLDER", "--schedule")


@app.command("new", epilog=examples("schedule new jobs/schedule.toml"))
def new(file: Path = argument(Path("schedule.toml"), "New file: schedule.toml.", "FILE")) -> None:
    """Write a schedule.toml with every key explained; never over anything."""
    from cmm_uq.app.commands.laboratory.schedule import write_schedule

    write_schedule(file)
    say(str(file))
    say(f"Whom it tells: [[email]] or [[webhook]] in it, then cmm-uq schedule test --schedule {file}")


@app.command("test", epilog=examples("schedule test jobs", "schedule test --schedule jobs/schedule.toml"))
def try_out(
    folders: list[Path] | None = argument(None, "Folders with jobs.", "FOLDER", "none"),
    schedule: Path | None = SCHEDULE,
    json: bool = opt.JSON,
) -> None:
    """Send a trial message to everybody whom the schedule names. Exit code 1 when one did not go out."""
    from cmm_uq.app.commands.laboratory.schedule import schedule_of, send_trial

    trials = send_trial(schedule_of(folders or (), schedule))
    if json:
        put_data({"channels": [{"channel": one.channel, "sent": one.sent, "why": one.why or None} for one in trials]})
    for one in () if json else trials:
        say(printable(f"{one.channel}: {'sent' if one.sent else 'not sent'}{'. ' if one.why else ''}{one.why}"))
    if not all(one.sent for one in trials):
        raise typer.Exit(NEEDS_A_PERSON)


@app.command(
    "print",
    epilog=examples("schedule print cron jobs", "schedule print systemd jobs --at 06:15 --days MON,THU --out units"),
)
def ready(
    scheduler: str = argument(..., "cron, systemd or windows.", "SCHEDULER"),
    folders: list[Path] = argument(..., "Folders with jobs.", "FOLDER"),
    schedule: Path | None = SCHEDULE,
    at: str = option("06:15", "Time of day.", "HH:MM"),
    days: str = option("", "Days of the week: MON,THU.", "DAYS", "every day"),
    out: Path | None = option(None, "Folder to write the files to.", "DIR", "printed"),
) -> None:
    """Print what starts a scheduled run: a line of cron, a service and a timer of systemd, a task of Windows."""
    from cmm_uq.app.commands.laboratory.schedule import ready_files, write_ready

    files = ready_files(scheduler, folders, schedule, at=at, days=days)
    if out is not None:
        for path in write_ready(files, out):
            say(str(path))
        return
    for name, text in files.items():
        if len(files) > 1:
            say(f"# {name}")
        put(text)


def run(options: ScheduledOptions, lines: Path | None) -> int:
    """A scheduled run from the command line; its exit code. A line that cannot be written never stops it.

    ``lines``: file that they are added to, :data:`STANDARD_OUTPUT`, or ``None`` for nowhere.
    """
    from cmm_uq.app.commands.laboratory.schedule import run_scheduled

    failed: list[OutputError] = []
    descriptor = -1
    if lines is not None and lines != STANDARD_OUTPUT:
        try:
            descriptor = os.open(lines, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
        except (OSError, ValueError) as error:
            raise OutputError(f"cannot be written: {error}", where=str(lines), fix="Name another file") from error

    def tell(event: dict[str, Any]) -> None:
        line = json_text.dumps(event, ensure_ascii=False) + "\n"
        try:
            if lines == STANDARD_OUTPUT:
                put_json(line)
                sys.stdout.flush()  # a line that a program waits for, whatever comes of the next job
            elif lines is not None:
                os.write(
                    descriptor, line.encode("utf-8", "backslashreplace")
                )  # whole, so that two runs may write at once
        except OutputError as error:
            failed.append(error)
        except (OSError, ValueError) as error:
            to_file = f"cannot be written: {getattr(error, 'strerror', error)}"
            failed.append(OutputError(to_file, where=str(lines)) if descriptor >= 0 else closed())

    code = run_scheduled(options, tell)
    if failed:
        raise failed[0]
    return code
