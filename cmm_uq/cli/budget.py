"""``cmm-uq budget FILE``: the uncertainty of any measurement model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmm_uq.cli import NOT_CONFORMING
from cmm_uq.cli.options import Force, Json, Quiet, Settled
from cmm_uq.cli.printing import put, say


def command(
    file: Annotated[Path, typer.Argument(help="Measurement model: outputs, inputs, correlations, in TOML.")],
    out: Annotated[Path | None, typer.Option(help="Folder to write to.  [default: reports/<name of the file>]")] = None,
    seed: Annotated[int | None, typer.Option(help="Instead of the file's seed.", min=0)] = None,
    force: Force = False,
    strict: Settled = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Propagate uncertainty by the GUM and by Monte Carlo, and write budget.html, budget.pdf and results.json."""
    from cmm_uq.commands.budget import write_budget
    from cmm_uq.uncertainty.budget_results import summary_rows

    written = write_budget(file, out, seed=seed, force=force)
    if json:
        put(written.results.decode())
    elif not quiet:
        for row in summary_rows(written.evaluation):
            say("  ".join(row))
        for path in written.files.values():
            say(str(path))
    if strict and not written.evaluation.stable:
        raise typer.Exit(NOT_CONFORMING)
