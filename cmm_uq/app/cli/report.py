"""``cmm-uq report JOB``: the certificate of a recording; with ``--scheduled`` of every one that is new or changed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmm_uq.app.cli.importing import show_imported
from cmm_uq.app.cli.options import (
    Force,
    Json,
    Language,
    Level,
    Quiet,
    Records,
    Seed,
    Sign,
    Strict,
    TimeServer,
    Trusted,
    Verbose,
    examples,
    job_folders,
    open_key,
    out,
    show_signatures,
)
from cmm_uq.app.cli.summary import conclude
from cmm_uq.app.cli.terminal import progress
from cmm_uq.base.errors import CmmUqError

EXAMPLES = examples(
    "report examples/iota-1102-20C", "report JOB --out DIR --seed 3", "report JOB --json --strict > results.json",
    "report JOB --sign laboratory.p12", "report --scheduled jobs --dry-run",
)  # fmt: skip


def command(
    job: Annotated[
        list[Path],
        typer.Argument(
            help="Job folder: job.toml and the recording that it names; with --scheduled folders that hold job folders.",
            metavar="JOB",
            autocompletion=job_folders,
        ),
    ],
    out: Annotated[Path | None, out("reports/<job id>")] = None,
    seed: Seed = 0,
    force: Force = False,
    strict: Strict = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    json: Json = False,
    language: Language = None,
    records: Records = None,
    sign: Sign = None,
    time_server: TimeServer = None,
    level: Level = None,
    trust: Trusted = None,
    scheduled: Annotated[
        bool,
        typer.Option(
            "--scheduled", help="Every job that is new or changed; a line of JSON for each; DIR holds them all."
        ),
    ] = False,
    schedule: Annotated[
        Path | None,
        typer.Option(
            help="With --scheduled: what the run goes by.",
            metavar="FILE",
            show_default="schedule.toml in the first JOB",
        ),
    ] = None,
    lines: Annotated[
        Path | None,
        typer.Option(
            help="With --scheduled: file that the lines are added to.", metavar="FILE", show_default="printed"
        ),
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="With --scheduled: say what would happen, and do nothing.")
    ] = False,
) -> None:
    """Estimate, decide, and write certificate.html, certificate.pdf, certificate.xml and results.json."""
    alone: dict[str, object] = {
        "--force": force, "--strict": strict, "--verbose": verbose, "--language": language, "--sign": sign,
    }  # fmt: skip
    many: dict[str, object] = {"--schedule": schedule, "--lines": lines, "--dry-run": dry_run}
    _check(job, alone if scheduled else many, scheduled=scheduled)
    if scheduled:
        from cmm_uq.app.cli.scheduled import STANDARD_OUTPUT, run
        from cmm_uq.app.commands.laboratory.scheduled import ScheduledOptions as Asked

        asked = Asked(tuple(job), out, schedule, records, seed or None, dry_run)
        raise typer.Exit(run(asked, None if quiet and lines is None else lines or STANDARD_OUTPUT))
    signing = None if sign is None else open_key(sign, time_server, level, trust)
    with progress(quiet=quiet or json, verbose=verbose) as stage:
        from cmm_uq.app.commands.report import write_report

        told = None if quiet or json else show_imported
        report = write_report(
            job[0], out, seed=seed, force=force, stage=stage, told=told, records=records, language=language,
            signing=signing,
        )  # fmt: skip
    try:
        conclude(report, json=json, quiet=quiet, strict=strict, verbose=verbose)
    finally:
        if signing is not None and not (quiet or json):
            show_signatures(signing, [path for path in report.files.values() if path.suffix in (".pdf", ".xml")])


def _check(jobs: list[Path], others: dict[str, object], *, scheduled: bool) -> None:
    """Refuse what belongs to the other way of the command."""
    for option, given in others.items():
        if given:
            fix = "Leave it out" if scheduled else "Add --scheduled"
            raise CmmUqError(f"goes {'without' if scheduled else 'with'} --scheduled", where=option, fix=fix)
    if len(jobs) > 1 and not scheduled:
        raise CmmUqError(f"{len(jobs)} jobs are named, and a report is of one", where=str(jobs[1]),
                         fix="Report them one after the other, or with --scheduled")  # fmt: skip
