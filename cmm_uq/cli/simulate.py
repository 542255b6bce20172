"""``cmm-uq simulate JOB --truth truth.toml --out DIR``: a recording drawn from known errors."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmm_uq.cli.options import Force, Quiet
from cmm_uq.cli.printing import say


def command(
    job: Annotated[Path, typer.Argument(help="Job folder whose recording gives the placings.")],
    truth: Annotated[Path, typer.Option(help="TOML file with the effects, the noise and the seed.")],
    out: Annotated[Path, typer.Option(help="Folder for the simulated job.")],
    seed: Annotated[int | None, typer.Option(help="Instead of the seed in the truth.", min=0)] = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Draw a recording from the same model that report fits, as a job folder of its own."""
    from cmm_uq.commands.simulate import write_simulation

    files = write_simulation(job, truth, out, seed=seed, force=force)
    if not quiet:
        for path in files.values():
            say(str(path))
