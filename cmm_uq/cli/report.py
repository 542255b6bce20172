"""``cmm-uq report JOB``: the certificate of a recording."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cmm_uq.cli.importing import show_imported
from cmm_uq.cli.options import Force, Json, Quiet, Seed, Strict
from cmm_uq.cli.printing import conclude, table
from cmm_uq.cli.progress import shown

if TYPE_CHECKING:
    from cmm_uq.commands.written import Written


def command(
    job: Annotated[Path, typer.Argument(help="Job folder: job.toml and the recording that it names.")],
    out: Annotated[Path | None, typer.Option(help="Folder to write to.  [default: reports/<job id>]")] = None,
    seed: Seed = 0,
    force: Force = False,
    strict: Strict = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Estimate, decide, and write certificate.html, certificate.pdf and results.json."""
    with shown(quiet=quiet or json) as stage:
        from cmm_uq.commands.report import write_report

        report = write_report(
            job,
            out,
            seed=seed,
            force=force,
            stage=stage,
            told=None if quiet or json else show_imported,
        )
    conclude(report, _summarise, json=json, quiet=quiet, strict=strict)


def _summarise(report: Written) -> None:
    from cmm_uq.documents.origin import BANNERS
    from cmm_uq.jobs.origin import MEASURED

    job = report.found.job
    derived = [] if job.origin == MEASURED else [(BANNERS[job.origin], "", "")]
    rows = [*derived, *report.summary, *((name, str(path), "") for name, path in report.files.items())]
    table(rows, separator="  ", title=job.facts.job.id, bold=1)
