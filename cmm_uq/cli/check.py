"""``cmm-uq check JOB…``: all that is wrong with jobs, without computing."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmm_uq.cli import BAD_INPUT
from cmm_uq.cli.deferred import defer_scipy
from cmm_uq.cli.options import Quiet
from cmm_uq.cli.printing import put, say


def command(
    jobs: Annotated[list[Path], typer.Argument(help="Job folders.")],
    json: Annotated[bool, typer.Option("--json", help="Print problems and warnings as JSON.")] = False,
    quiet: Quiet = False,
) -> None:
    """Say all that is wrong with each job at once: file, line, key, fix. Exit code 2 when something would stop report."""
    defer_scipy()
    from cmm_uq.commands.check import check_job

    found = [check_job(job) for job in jobs]
    if json:
        from json import dumps

        put(dumps([one.as_data() for one in found], indent=1, ensure_ascii=False) + "\n")
    elif not quiet:
        for one in found:
            for word, each in (("problem", one.problems), ("warning", one.warnings)):
                for said in each:
                    say(f"{word}: {said}")
            counted = f"{len(one.problems)} problems" if one.problems else "nothing would stop report"
            say(f"{one.job}: {counted}, {len(one.warnings)} warnings")
    if not all(one.sound for one in found):
        raise typer.Exit(BAD_INPUT)
