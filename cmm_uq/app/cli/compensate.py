"""``cmm-uq compensate JOB --out DIR``: the recording corrected by the machine's error maps."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from cmm_uq.app.cli.options import Force, Json, Quiet, Verbose, examples, job_folders
from cmm_uq.app.cli.summary import conclude_derived
from cmm_uq.app.cli.terminal import progress as shown
from cmm_uq.base.errors import CmmUqError

EXAMPLES = examples(
    "compensate JOB --out DIR", "compensate JOB --out DIR --map-text 20", "compensate JOB --cloud scan.csv --out DIR"
)


def command(
    job: Annotated[
        Path, typer.Argument(help="Job folder with [machine] error_map.", metavar="JOB", autocompletion=job_folders)
    ],
    out: Annotated[Path, typer.Option(help="Folder for the compensated job.", metavar="DIR")],
    extrapolate: Annotated[bool, typer.Option(help="Extrapolate beyond the maps, and flag those points.")] = False,
    map_text: Annotated[
        float | None,
        typer.Option(
            help="Also write the error map at this temperature, in °C, in the contractors' text form.", metavar="T",
            show_default="not written",
        ),
    ] = None,
    cloud: Annotated[
        Path | None,
        typer.Option(
            help="Cloud of a digitizer to correct instead: .csv, .parquet, .npy or a folder of them.", metavar="FILE",
            show_default="the job's recording",
        ),
    ] = None,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    json: Json = False,
) -> None:  # fmt: skip
    """Correct a recording by its machine's error maps, as a job folder of its own."""
    from cmm_uq.app.commands.jobs.compensate import write_compensated, write_compensated_cloud
    from cmm_uq.machine.physics.map_interpolation import Beyond

    beyond: Beyond = "extrapolate" if extrapolate else "refuse"
    if cloud is None:
        files = write_compensated(job, out, beyond=beyond, map_text_c=map_text, force=force)
    else:
        if map_text is not None:
            raise CmmUqError("--map-text goes with a recording, not with --cloud", fix="Leave out one of them")
        with shown(quiet=quiet or json, verbose=verbose) as stage:
            progress = None if stage is None else partial(stage, f"Compensating {cloud.name}")
            files = write_compensated_cloud(job, cloud, out, beyond=beyond, force=force, progress=progress)
    what = f"{'The recording' if cloud is None else cloud.name} of {job}, compensated by its error maps"
    conclude_derived(files, what, json=json, quiet=quiet, verbose=verbose, is_job=cloud is None)
