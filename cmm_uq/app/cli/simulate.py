"""``cmm-uq simulate JOB --truth truth.toml --out DIR``: a recording drawn from known errors."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmm_uq.app.cli.options import Force, Json, Quiet, Verbose, examples, job_folders, toml_files
from cmm_uq.app.cli.summary import conclude_derived

EXAMPLES = examples("simulate JOB --truth truth.toml --out DIR", "simulate JOB --truth truth.toml --out DIR --seed 7")


def command(
    job: Annotated[
        Path,
        typer.Argument(
            help="Job folder whose recording gives the placings.", metavar="JOB", autocompletion=job_folders
        ),
    ],
    truth: Annotated[
        Path,
        typer.Option(
            help="TOML file with the effects, the noise and the seed.", metavar="FILE", autocompletion=toml_files
        ),
    ],
    out: Annotated[Path, typer.Option(help="Folder for the simulated job.", metavar="DIR")],
    seed: Annotated[
        int | None,
        typer.Option(help="Seed of everything random.", metavar="N", min=0, show_default="the truth's"),
    ] = None,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    json: Json = False,
) -> None:
    """Draw a recording from the same model that report fits, as a job folder of its own."""
    from cmm_uq.app.commands.jobs.simulate import write_simulation

    files = write_simulation(job, truth, out, seed=seed, force=force)
    conclude_derived(files, f"A recording of {job}, drawn from {truth}", json=json, quiet=quiet, verbose=verbose)
