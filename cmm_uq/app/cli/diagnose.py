"""``cmm-uq diagnose JOB``: what a recording shows that its model leaves out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmm_uq.app.cli.jobs import show_imported
from cmm_uq.app.cli.options import Force, Job, Json, Language, Quiet, Records, Seed, Strict, Verbose, examples, out
from cmm_uq.app.cli.summary import conclude
from cmm_uq.app.cli.terminal import progress

EXAMPLES = examples(
    "diagnose examples/iota-1102-20C", "diagnose JOB --against predicted.csv", "diagnose JOB --strict --quiet"
)


def command(
    job: Job,
    out: Annotated[Path | None, out("reports/<job id>/diagnosis")] = None,
    seed: Seed = 0,
    alpha: Annotated[
        float, typer.Option(help="Rate of false alarms, a probability from 0.000001 to 0.5.", metavar="P")
    ] = 0.01,
    against: Annotated[
        Path | None,
        typer.Option(
            help="Coordinates or lengths that a simulation predicts, or an error map.",
            metavar="FILE",
            show_default="the job's model",
        ),
    ] = None,
    force: Force = False,
    strict: Strict = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    json: Json = False,
    language: Language = None,
    records: Records = None,
) -> None:
    """Locate a mismatch, name the physics that was left out, and show what modelling it improves."""
    with progress(quiet=quiet or json, verbose=verbose) as stage:
        from cmm_uq.app.commands.diagnose import write_diagnosis

        told = None if quiet or json else show_imported
        written = write_diagnosis(
            job, out, seed=seed, alpha=alpha, against=against, force=force, stage=stage, told=told, language=language,
            records=records,
        )  # fmt: skip
    conclude(written, json=json, quiet=quiet, strict=strict, verbose=verbose)
