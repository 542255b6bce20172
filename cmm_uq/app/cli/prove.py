"""``cmm-uq prove JOB``: the diagnosis tried on sealed cases with the set-ups of a job."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from cmm_uq.app.cli.options import Force, Json, Language, Quiet, Verbose, examples, job_folders, out
from cmm_uq.app.cli.summary import conclude
from cmm_uq.app.cli.terminal import progress, say

EXAMPLES = examples(
    "prove examples/iota-1102-20C", "prove JOB --cases 400 --workers 8", "prove examples/plan-ballbar --strict"
)


def command(
    job: Annotated[
        Path,
        typer.Argument(
            help="Job folder; its recording may still be missing where its noise is stated.",
            metavar="JOB",
            autocompletion=job_folders,
        ),
    ],
    out: Annotated[Path | None, out("reports/<job id>/prove")] = None,
    cases: Annotated[int, typer.Option(help="How many sealed cases to draw.", metavar="N")] = 200,
    workers: Annotated[
        int | None,
        typer.Option(
            help="Processes at once; the figures do not depend on it.",
            metavar="N",
            show_default="as many as there are processors",
        ),
    ] = None,
    seed: Annotated[
        int, typer.Option(help="Seed of the cases; the same seed gives the same bytes.", metavar="N", min=0)
    ] = 0,
    alpha: Annotated[
        float, typer.Option(help="Rate of false alarms that the diagnosis is asked for.", metavar="P")
    ] = 0.01,
    force: Force = False,
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit code 4 where the cases show that an acceptance figure is missed.")
    ] = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    json: Json = False,
    language: Language = None,
) -> None:
    """Draw cases with known truth on a job's set-ups, diagnose them, and write what a laboratory files as validation."""
    with progress(quiet=quiet or json, verbose=verbose) as stage:
        from cmm_uq.app.commands.prove import ProofOptions, write_proof
        from cmm_uq.laboratory.schedule.processes import processes

        asked = ProofOptions(cases, processes() if workers is None else workers, seed, alpha)
        written = write_proof(
            job, asked, out, force=force, stage=stage, sealed=None if quiet or json else _tell, language=language
        )
    conclude(written, json=json, quiet=quiet, strict=strict, verbose=verbose)


def _tell(sha256: str) -> None:
    """Before the first diagnosis, so that nobody can say the truth was made to fit."""
    say(f"Truth sealed: sha256 {sha256}")
    sys.stdout.flush()
