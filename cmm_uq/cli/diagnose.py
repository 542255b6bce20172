"""``cmm-uq diagnose JOB``: what a recording shows that its model leaves out."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from cmm_uq.cli.options import Json, Out, Quiet, Seed
from cmm_uq.cli.progress import shown


def command(
    job: Annotated[Path, typer.Argument(help="Job folder: job.toml and the recording that it names.")],
    out: Out = None,
    seed: Seed = 0,
    alpha: Annotated[float, typer.Option(help="Rate of false alarms.")] = 0.01,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Locate a mismatch, name the physics that was left out, and show what modelling it improves."""
    with shown(quiet=quiet or json) as stage:
        from cmm_uq.commands.report import write_diagnosis

        written = write_diagnosis(job, out, seed=seed, alpha=alpha, stage=stage)
    if json:
        sys.stdout.write(written.results.decode())
    elif not quiet:
        for row in written.summary:
            typer.echo("  ".join(row))
        for path in written.files.values():
            typer.echo(path)
