"""``cmm-uq schedule new | test | print``: what a scheduled run goes by, whom it tells, and what starts it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmm_uq.app.cli.options import Json, examples
from cmm_uq.app.cli.terminal import NEEDS_A_PERSON, helped, put, put_data, say
from cmm_uq.base.errors import printable

app = typer.Typer(
    help="Scheduled runs: a schedule.toml, a trial of its messages, ready files for cron, systemd and Windows.",
    epilog=examples("schedule new jobs/schedule.toml", "schedule print systemd jobs --at 06:15"),
    rich_markup_mode=None,
)
app.callback(invoke_without_command=True)(helped)

Given = Annotated[
    Path | None,
    typer.Option("--schedule", help="File schedule.toml.", metavar="FILE", show_default="that in the first FOLDER"),
]


@app.command("new", epilog=examples("schedule new jobs/schedule.toml"))
def new(
    file: Annotated[Path, typer.Argument(help="New file: schedule.toml.", metavar="FILE")] = Path("schedule.toml"),
) -> None:
    """Write a schedule.toml with every key explained; never over anything."""
    from cmm_uq.app.commands.laboratory.schedule import write_schedule

    write_schedule(file)
    say(str(file))
    say(f"Whom it tells: [[email]] or [[webhook]] in it, then cmm-uq schedule test --schedule {file}")


@app.command("test", epilog=examples("schedule test jobs", "schedule test --schedule jobs/schedule.toml"))
def try_out(
    folders: Annotated[
        list[Path] | None, typer.Argument(help="Folders with jobs.", metavar="FOLDER", show_default="none")
    ] = None,
    schedule: Given = None,
    json: Json = False,
) -> None:
    """Send a trial message to everybody whom the schedule names. Exit code 1 when one did not go out."""
    from cmm_uq.app.commands.laboratory.schedule import schedule_of, send_trial

    told = send_trial(schedule_of(folders or (), schedule))
    if json:
        put_data({"channels": [{"channel": one.channel, "sent": one.sent, "why": one.why or None} for one in told]})
    for one in () if json else told:
        say(printable(f"{one.channel}: {'sent' if one.sent else 'not sent'}{'. ' if one.why else ''}{one.why}"))
    if not all(one.sent for one in told):
        raise typer.Exit(NEEDS_A_PERSON)


@app.command(
    "print",
    epilog=examples("schedule print cron jobs", "schedule print systemd jobs --at 06:15 --days MON,THU --out units"),
)
def ready(
    scheduler: Annotated[str, typer.Argument(help="cron, systemd or windows.", metavar="SCHEDULER")],
    folders: Annotated[list[Path], typer.Argument(help="Folders with jobs.", metavar="FOLDER")],
    schedule: Given = None,
    at: Annotated[str, typer.Option(help="Time of day.", metavar="HH:MM")] = "06:15",
    days: Annotated[
        str, typer.Option(help="Days of the week: MON,THU.", metavar="DAYS", show_default="every day")
    ] = "",
    out: Annotated[
        Path | None, typer.Option(help="Folder to write the files to.", metavar="DIR", show_default="printed")
    ] = None,
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
