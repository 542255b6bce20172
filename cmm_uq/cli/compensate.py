"""``cmm-uq compensate JOB --out DIR``: the recording corrected by the machine's error maps."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from cmm_uq.cli.options import Force, Quiet
from cmm_uq.cli.printing import say
from cmm_uq.cli.progress import shown
from cmm_uq.errors import CmmUqError


def command(
    job: Annotated[Path, typer.Argument(help="Job folder with [machine] error_map.")],
    out: Annotated[Path, typer.Option(help="Folder for the compensated job.")],
    extrapolate: Annotated[bool, typer.Option(help="Extrapolate beyond the maps, and flag those points.")] = False,
    map_text: Annotated[
        float | None,
        typer.Option(help="Also write the error map at this temperature, °C, in the contractors' text form."),
    ] = None,
    cloud: Annotated[
        Path | None,
        typer.Option(help="Cloud of a digitizer to correct instead: .csv, .parquet, .npy or a folder of them."),
    ] = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Correct a recording by its machine's error maps, as a job folder of its own."""
    from cmm_uq.commands.compensate import write_compensated
    from cmm_uq.commands.compensate_cloud import write_compensated_cloud
    from cmm_uq.physics.map_interpolation import Beyond

    beyond: Beyond = "extrapolate" if extrapolate else "refuse"
    if cloud is None:
        files = write_compensated(job, out, beyond=beyond, map_text_c=map_text, force=force)
    else:
        if map_text is not None:
            raise CmmUqError("--map-text goes with a recording, not with --cloud", fix="Leave out one of them")
        with shown(quiet=quiet) as stage:
            progress = None if stage is None else partial(stage, "Compensating")
            files = write_compensated_cloud(job, cloud, out, beyond=beyond, force=force, progress=progress)
    if not quiet:
        for path in files.values():
            say(str(path))
