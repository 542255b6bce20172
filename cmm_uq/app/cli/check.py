"""``cmm-uq check JOB…``: all that is wrong with jobs, without computing."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cmm_uq.app.cli.options import Json, Quiet, examples, job_folders
from cmm_uq.app.cli.summary import screen_layout
from cmm_uq.app.cli.terminal import BAD_INPUT, put, put_data, show
from cmm_uq.base.errors import printable

if TYPE_CHECKING:
    from cmm_uq.app.commands.jobs.check import Checked
    from cmm_uq.certificate.in_short import Summary

EXAMPLES = examples("check JOB", "check jobs/a jobs/b", "check JOB --clauses", "check JOB --json")
SCHEMA = "cmm-uq/check/1"


def command(
    jobs: Annotated[list[Path], typer.Argument(help="Job folders.", metavar="JOB...", autocompletion=job_folders)],
    clauses: Annotated[
        bool,
        typer.Option("--clauses", help="Every clause of ISO/IEC 17025:2017, 7.8, and what of it is stated."),
    ] = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Say all that is wrong with each job at once: file, line, key, fix. Exit code 2 when something would stop report.

    What ISO/IEC 17025:2017, 7.8 asks for and a job does not state makes its certificate a draft, and is told with its key.
    """
    from cmm_uq.app.commands.jobs.check import check_job

    found = [check_job(job) for job in jobs]
    if json:
        put_data({"schema": SCHEMA, "jobs": [one.as_data() for one in found]})
    elif not quiet:
        for one in found:
            show(screen_layout(verbose=True).screen(_summary(one)))
            if clauses:
                _show_clauses(one)
    if not all(one.sound for one in found):
        raise typer.Exit(BAD_INPUT)


def _show_clauses(found: Checked) -> None:
    """Each clause on a line: what it asks for, and what satisfies it or would."""
    if not found.clauses:
        put("No calibration certificate is made of this job, so ISO/IEC 17025:2017, 7.8 asks nothing of it.\n")
    for one in found.clauses:
        content = {
            "stated": one.stated, "missing": f"MISSING: {one.key}", "not applicable": f"none stated ({one.key})",
            "laboratory": "of the laboratory, not of the certificate",
        }[one.status].removesuffix(" ()")  # fmt: skip
        put(printable(f"{one.clause:<11} {one.asks}: {content}") + "\n")


def _summary(found: Checked) -> Summary:
    """Whether anything would stop report, and all that is wrong."""
    from cmm_uq.base.messages import Verbatim, plural, say
    from cmm_uq.certificate.in_short import Summary, Verdict

    count = len(found.problems)
    stops = plural(count, one=say("1 problem"), many=say("{count} problems", count=count))
    verdict = (
        Verdict(
            "SOUND",
            "good",
            Verbatim(found.job),
            (say("nothing would stop {command}", command=Verbatim(found.command)),),
        )
        if found.sound
        else Verdict("STOPS", "bad", Verbatim(found.job), (stops,))
    )
    problems, warned = (tuple(Verbatim(each) for each in some) for some in (found.problems, found.warnings))
    return Summary(verdicts=(verdict,), remarks=problems, warnings=warned)
