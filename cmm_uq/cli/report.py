"""``cmm-uq report JOB``: the certificate of a recording."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cmm_uq.cli.options import Json, Out, Quiet, Seed
from cmm_uq.cli.progress import shown

if TYPE_CHECKING:
    from cmm_uq.commands.report import Report


def command(
    job: Annotated[Path, typer.Argument(help="Job folder: job.toml and the recording that it names.")],
    out: Out = None,
    seed: Seed = 0,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Estimate, decide, and write certificate.html, certificate.pdf and results.json."""
    with shown(quiet=quiet or json) as stage:
        from cmm_uq.commands.report import write_report

        report = write_report(job, out, seed=seed, stage=stage)
    if json:
        sys.stdout.write(report.results.decode())
    elif not quiet:
        _summarise(report)


def _summarise(report: Report) -> None:
    rows = [*report.summary, *((name, str(path), "") for name, path in report.files.items())]
    if sys.stdout.isatty():
        from rich.console import Console
        from rich.markup import escape
        from rich.table import Table

        table = Table(title=escape(report.result.job.facts.job.id), show_header=False, title_justify="left")
        for i in range(3):
            table.add_column(overflow="fold", justify="left", style="bold" if i == 1 else None)
        for row in rows:
            table.add_row(*(escape(cell) for cell in row))
        Console().print(table)
    else:
        for row in rows:
            typer.echo("  ".join(cell for cell in row if cell))
