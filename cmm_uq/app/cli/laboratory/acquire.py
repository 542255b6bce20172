"""``cmm-uq acquire JOB``: a recording taken live, led by the plan; nothing that was accepted is lost."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmm_uq.app.cli.options import Quiet, examples, job_folders
from cmm_uq.base.errors import CmmUqError

EXAMPLES = examples("acquire JOB", "acquire examples/plan-ballbar --simulate --out trial", "acquire JOB --plain")


def command(
    job: Annotated[
        Path,
        typer.Argument(
            help="Job folder; its instruments are named in [acquire].", metavar="JOB", autocompletion=job_folders
        ),
    ],
    simulate: Annotated[
        bool, typer.Option(help="Try it without instruments: simulated ones, in a job so marked.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            help="With --simulate: folder for a copy of the job, so marked.",
            metavar="DIR",
            show_default="the job itself",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of what simulated instruments say.", metavar="N", min=0)] = 0,
    plain: Annotated[bool, typer.Option("--plain", help="Lines instead of a screen, as without a terminal.")] = False,
    skip_damaged: Annotated[
        bool,
        typer.Option(
            "--skip-damaged", help="Go on behind damaged lines of earlier journals; the recording then says so."
        ),
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Take the recording of a job from its instruments, a folder of results or the keyboard, point by point of its plan.

    Type help for the words; the same command goes on where the last session ended.
    """
    from cmm_uq.app.cli.operating import operated
    from cmm_uq.app.commands.laboratory.acquire import begin_acquisition, write_trial

    if out is not None and not simulate:
        raise CmmUqError(
            "--out is for a trial", fix="Add --simulate, or leave --out away: the recording goes into the job"
        )
    folder = job if out is None else write_trial(job, out)
    operated(
        begin_acquisition(folder, simulate=simulate, seed=seed, skip_damaged=skip_damaged), plain=plain, quiet=quiet
    )
