"""``cmm-uq qif REPORT``: values of tests and error factors as QIF 3.0, for quality management systems."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmm_uq.app.cli.options import Quiet, examples
from cmm_uq.app.cli.terminal import say
from cmm_uq.base.errors import printable

EXAMPLES = examples("qif reports/iota-1102-20C", "qif reports/iota-1102-20C/results.json --out iota.qif")


def command(
    report: Annotated[Path, typer.Argument(help="Folder of a report, or its results.json.", metavar="REPORT")],
    out: Annotated[
        Path | None, typer.Option(help="File to write.", metavar="FILE", show_default="<job id>.qif")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Write every value that a standard decided on, and the error factors, as QIF 3.0. Nothing is overwritten."""
    from cmm_uq.app.commands.jobs.exchange import write_qif

    file = write_qif(report, out)
    if not quiet:
        say(printable(str(file)))
