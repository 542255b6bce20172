"""``cmm-uq diagnose JOB``: what a recording shows that its model leaves out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cmm_uq.cli.importing import show_imported
from cmm_uq.cli.options import Force, Json, Quiet, Seed, Strict
from cmm_uq.cli.printing import conclude, say
from cmm_uq.cli.progress import shown

if TYPE_CHECKING:
    from cmm_uq.commands.written import Written


def command(
    job: Annotated[Path, typer.Argument(help="Job folder: job.toml and the recording that it names.")],
    out: Annotated[Path | None, typer.Option(help="Folder to write to.  [default: reports/<job id>/diagnosis]")] = None,
    seed: Seed = 0,
    alpha: Annotated[float, typer.Option(help="Rate of false alarms.")] = 0.01,
    force: Force = False,
    strict: Strict = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Locate a mismatch, name the physics that was left out, and show what modelling it improves."""
    with shown(quiet=quiet or json) as stage:
        from cmm_uq.commands.report import write_diagnosis

        written = write_diagnosis(
            job,
            out,
            seed=seed,
            alpha=alpha,
            force=force,
            stage=stage,
            told=None if quiet or json else show_imported,
        )
    conclude(written, _summarise, json=json, quiet=quiet, strict=strict)


def _summarise(written: Written) -> None:
    for row in written.summary:
        say("  ".join(row))
    for path in written.files.values():
        say(str(path))
