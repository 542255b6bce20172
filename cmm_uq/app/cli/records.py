"""``cmm-uq records …``, the history itself; ``cmm-uq schedule …``, and where the lines of a scheduled run go."""

from __future__ import annotations

import contextlib
import datetime as dt
import json as json_text
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmm_uq.app.cli import options as opt, terminal
from cmm_uq.app.cli.options import Ending, argument, examples, flag, option
from cmm_uq.app.cli.terminal import NEEDS_A_PERSON, NOT_CONFORMING, closed, put, put_json, say
from cmm_uq.base.errors import CmmUqError, OutputError, printable

if TYPE_CHECKING:
    from cmm_uq.app.commands.laboratory.schedule import ScheduledOptions
    from cmm_uq.laboratory.records.store import Records


app = opt.group(
    "The history of machines and certificates: verified, backed up, imported, kept small, brought to a new version.",
    examples("records import reports", "records verify --head HASH", "records backup records-2026.db"),
)

SHOWN = 50  # findings that are printed


def opened_records(where: str | None, *, create: bool = False, read_only: bool = False) -> Records:
    from cmm_uq.laboratory.records import open_records

    return open_records(where, create=create, read_only=read_only)


def _entries(count: int) -> str:
    return "1 entry" if count == 1 else f"{count} entries"


_FORMS = "Certificates (PDF, XML, results.json, folders)"
_WITNESS = f"{_FORMS}: the records must have the entry that each states; again for more."
WITNESS = option(None, _WITNESS, "FILE|DIR", "none", "--witness")


@opt.command(app, "verify", "records verify", "records verify --head 5f2c… --no-files")
def verify(
    records: str | None = opt.RECORDS,
    head: str | None = option(None, "Hash that records head printed, filed elsewhere.", "HASH", "none", "--head"),
    files: bool = flag(True, "--files/--no-files", "Compare the files of the reports too."),
    witness: list[Path] | None = WITNESS,
    end: Ending = opt.ONLY_JSON,
) -> None:
    """Find every entry that was altered, deleted, exchanged or is out of time, every table, trigger and file that is another.

    Exit code 4 where something is wrong. Files that are gone are told; they may only have been moved.
    """
    from cmm_uq.certificate.verify.sources import witnesses_of

    stated, without = witnesses_of(witness) if witness else ([], [])
    with opened_records(records, read_only=True) as opened:
        disagreeing = opened.disagreements(stated)
        findings = [*disagreeing, *opened.verify(None if head is None else head.strip().lower(), files=files)]
        number, last = opened.head()
    sound = all(finding.kind == "missing" for finding in findings)
    lines = [f"{one.kind}: {f'entry {one.entry}: ' if one.entry else ''}{one.problem}" for one in findings[:SHOWN]]
    lines += [f"and {len(findings) - SHOWN} more"] if len(findings) > SHOWN else []
    told = [{"kind": one.kind, "entry": one.entry, "problem": one.problem} for one in findings]
    data = {"records": str(opened.shown), "entries": number, "head": last, "sound": sound, "findings": told}
    if witness:
        count, newest = len(stated), max(one.head.entries for one in stated)
        data["witnesses"] = {"certificates": count, "entries": newest, "passed_over": without}
        lines += [f"passed over: {one}" for one in without[:SHOWN]]
        lines.append(f"{count} certificates state heads up to entry {newest}; {len(disagreeing)} disagree")
    last_line = f"{_entries(number)}, {'sound' if sound else 'NOT sound'}; the last has the hash {last}"
    end.put(data, [*lines, last_line], 0 if sound else NOT_CONFORMING)


@opt.command(app, "head", "records head")
def head(records: str | None = opt.RECORDS, end: Ending = opt.ONLY_JSON) -> None:
    """Print number and hash of the last entry, to be filed elsewhere: on paper, in a mail, on another machine."""
    with opened_records(records, read_only=True) as opened:
        number, last = opened.head()
    end.put({"entries": number, "head": last}, [f"{number} {last}"])


@opt.command(app, "import", "records import reports", "records import /archive/2025 --records lab.db")
def import_reports(
    folders: list[Path] = argument(..., "Folders that hold reports, at any depth.", "FOLDER…"),
    records: str | None = opt.RECORDS,
    end: Ending = opt.BRIEF,
) -> None:
    """Record reports and diagnoses that were written before; what is recorded already is passed over."""
    from cmm_uq.app.commands.laboratory import records as commands

    reports, (place, _) = commands.reports_in(folders), _place(records)
    begun = not isinstance(place, Path) or os.path.exists(place)  # noqa: PTH110 - raises nothing below a closed folder
    with opened_records(records, create=True) if begun else contextlib.nullcontext(Path(place)) as history:
        done = commands.import_reports(history, reports)
    refused = [{"report": str(path), "error": str(error)} for path, error in done.refused]
    data = {"recorded": len(done.added), "recorded_before": len(done.known),
            "without_inputs": [str(path) for path in done.bare], "refused": refused}  # fmt: skip
    bare = [f"{path}: the inputs of its job cannot be read, so only results.json was gone by" for path in done.bare]
    count = f"{len(done.added)} recorded, {len(done.known)} recorded before, {len(done.refused)} refused"
    end.put(data, [count, *bare])
    for path, error in done.refused[1 : SHOWN + 1]:
        say(printable(f"{path}: not recorded: {error}"))
    if done.refused:
        raise done.refused[0][1]


@opt.command(app, "backup", "records backup records-2026-11-22.db")
def backup(
    file: Path = argument(..., "New file of the backup.", "FILE"),
    records: str | None = opt.RECORDS,
    end: Ending = opt.BRIEF,
) -> None:
    """Write everything into one new SQLite file, while others go on writing, and verify its chain."""
    from cmm_uq.laboratory.records.backup import back_up

    with opened_records(records) as opened:
        number, last = back_up(opened, file)
    data = {"backup": str(file), "entries": number, "head": last}
    end.put(data, [f"{_entries(number)} in {file}; the last has the hash {last}"])


def _place(records: str | None) -> tuple[str | Path, str]:
    """Where they are, and how that is shown: without a password."""
    from cmm_uq.laboratory.records.place import place_of, shown

    if (place := place_of(records)) is None:
        raise CmmUqError("no records are asked for", where="--records none", fix="Name a file or a URL")
    return place, shown(place)


@opt.command(app, "restore", "records restore records-2026-11-22.db --records reports/records.db")
def restore(
    file: Path = argument(..., "File of a backup.", "FILE"), records: str | None = opt.RECORDS, end: Ending = opt.BRIEF
) -> None:
    """Make records of a backup whose chain holds; a file in its place is kept as NAME.before-restore."""
    from cmm_uq.laboratory.records import backup as backups

    place, name = _place(records)
    number, last = backups.restore(file, place)
    data = {"records": name, "entries": number, "head": last}
    end.put(data, [f"{_entries(number)} restored; the last has the hash {last}"])


@opt.command(app, "retain", "records retain --keep-years 10 --dry-run")
def retain(
    keep_years: int = option(..., "Years for which files are kept.", "N", min=1, max=1000),
    records: str | None = opt.RECORDS,
    dry_run: bool = flag(False, "--dry-run", "Only say what would be removed."),
    end: Ending = opt.BRIEF,
) -> None:
    """Remove the files of older reports; what they stated stays in the records, and so does what was removed.

    Entries are never removed. Only files that are as they were written are; years count from the day of the measurement.
    """
    from cmm_uq.app.commands.laboratory.records import remove_retained, retention

    with opened_records(records, read_only=dry_run) as opened:
        found = retention(opened, keep_years, dt.datetime.now(dt.UTC).date())
        if not dry_run:
            remove_retained(opened, found, keep_years)
    paths, count = [str(path) for path in found.files], len(found.certificates)
    last = f"{len(paths)} files of {count} reports {'would be removed' if dry_run else 'removed'}"
    end.put({"removed": not dry_run, "files": paths, "certificates": count}, [*paths, last])


@opt.command(app, "migrate", "records backup before.db", "records migrate")
def migrate(records: str | None = opt.RECORDS, end: Ending = opt.BRIEF) -> None:
    """Bring the tables of an older version to this one; entries stay as they are. Back up first."""
    from cmm_uq.laboratory.records import backup as backups

    place, name = _place(records)
    before, after = backups.migrate(place)
    change = f"are of revision {after} already" if before == after else f"brought from revision {before} to {after}"
    end.put({"records": name, "from": before, "to": after}, [f"{name}: {change}"])


STANDARD_OUTPUT = Path("-")  # in place of a file for the lines

schedule_app = opt.group(
    "Scheduled runs: a schedule.toml, a trial of its messages, ready files for cron, systemd and Windows.",
    examples("schedule new jobs/schedule.toml", "schedule print systemd jobs --at 06:15"),
)
SCHEDULE = option(None, "File schedule.toml.", "FILE", "that in the first FOLDER", "--schedule")


@opt.command(schedule_app, "new", "schedule new jobs/schedule.toml")
def new(file: Path = argument(Path("schedule.toml"), "New file: schedule.toml.", "FILE")) -> None:
    """Write a schedule.toml with every key explained; never over anything."""
    from cmm_uq.app.commands.laboratory.schedule import write_schedule

    write_schedule(file)
    say(str(file))
    say(f"Whom it tells: [[email]] or [[webhook]] in it, then cmm-uq schedule test --schedule {file}")


@opt.command(schedule_app, "test", "schedule test jobs", "schedule test --schedule jobs/schedule.toml")
def try_out(
    folders: list[Path] | None = argument(None, "Folders with jobs.", "FOLDER", "none"),
    schedule: Path | None = SCHEDULE,
    end: Ending = opt.ONLY_JSON,
) -> None:
    """Send a trial message to everybody whom the schedule names. Exit code 1 when one did not go out."""
    from cmm_uq.app.commands.laboratory.schedule import schedule_of, send_trial

    trials = send_trial(schedule_of(folders or (), schedule))
    lines = (f"{name}: {'sent' if sent else 'not sent'}{'. ' if why else ''}{why}" for name, sent, why in trials)
    data = {"channels": [{"channel": name, "sent": sent, "why": why or None} for name, sent, why in trials]}
    end.put(data, lines, 0 if all(sent for _, sent, _ in trials) else NEEDS_A_PERSON)


_UNITS = "schedule print systemd jobs --at 06:15 --days MON,THU --out units"


@opt.command(schedule_app, "print", "schedule print cron jobs", _UNITS)
def ready(
    scheduler: str = argument(..., "cron, systemd or windows.", "SCHEDULER"),
    folders: list[Path] = argument(..., "Folders with jobs.", "FOLDER"),
    schedule: Path | None = SCHEDULE,
    at: str = option("", "Time of day.", "HH:MM", "that of the schedule, else 06:15"),
    days: str = option("", "Days of the week: MON,THU.", "DAYS", "those of the schedule, else every day"),
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

    ``lines``: file that they are added to, :data:`STANDARD_OUTPUT`, or ``None``: errors alone are told.
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
            elif lines is None:
                if error := event.get("error"):
                    terminal.tell(
                        CmmUqError(error["problem"], where=error["where"], fix=error["fix"]), event["exit_code"]
                    )
            else:
                whole = line.encode("utf-8", "backslashreplace")  # in one piece, so that two runs may write at once
                os.write(descriptor, whole)
        except OutputError as refused:
            failed.append(refused)
        except (OSError, ValueError) as refused:
            to_file = f"cannot be written: {getattr(refused, 'strerror', refused)}"
            failed.append(OutputError(to_file, where=str(lines)) if descriptor >= 0 else closed())

    code = run_scheduled(options, tell)
    if failed:
        raise failed[0]
    return code
