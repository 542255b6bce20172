"""``cmm-uq plan JOB``: which placings to measure, and what they will tell."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmm_uq.app.cli.options import Force, Json, Language, Quiet, Strict, Verbose, examples, job_folders, out
from cmm_uq.app.cli.summary import conclude
from cmm_uq.app.cli.terminal import progress

EXAMPLES = examples("plan examples/plan-ballbar", "plan JOB --no-power", "plan JOB --verbose")


def command(
    job: Annotated[
        Path,
        typer.Argument(
            help="Job folder; its recording may still be missing.", metavar="JOB", autocompletion=job_folders
        ),
    ],
    out: Annotated[Path | None, out("reports/<job id>/plan")] = None,
    power: Annotated[
        bool,
        typer.Option(help="Predict how large an effect must be for the diagnosis to find it; takes most of the time."),
    ] = True,
    seed: Annotated[int, typer.Option(help="Seed of the recordings drawn for that.", metavar="N", min=0)] = 0,
    force: Force = False,
    strict: Strict = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    json: Json = False,
    language: Language = None,
) -> None:
    """Say what placings determine, search for better ones, and write plan.csv, plan.html and results.json."""
    with progress(quiet=quiet or json, verbose=verbose) as stage:
        from cmm_uq.app.commands.plans.plan import write_plan

        written = write_plan(job, out, power=power, seed=seed, force=force, stage=stage, language=language)
    conclude(written, json=json, quiet=quiet, strict=strict, verbose=verbose)
