"""``cmm-uq diagnose JOB``: what a recording shows that its model leaves out."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cmm_uq.cli.options import Json, Out, Quiet, Seed
from cmm_uq.cli.progress import shown

if TYPE_CHECKING:
    from cmm_uq.documents.result import Diagnosed
    from cmm_uq.kinds.error_maps.analysis import MapsDiagnosed


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
        _summarise(written.diagnosed)
        for path in written.files.values():
            typer.echo(path)


def _summarise(found: Diagnosed | MapsDiagnosed) -> None:
    d, told = found.diagnosis, _told(found)
    typer.echo(f"{d.verdict.upper()} (p = {d.p_value:.2g}). {told[0]}")
    for text in (*told[1:], *(f"{f.why[0].upper()}{f.why[1:]}." for f in found.findings)):
        typer.echo(text)


def _told(found: Diagnosed | MapsDiagnosed) -> list[str]:
    from cmm_uq.documents import diagnosis_words
    from cmm_uq.kinds.error_maps import words as map_words
    from cmm_uq.kinds.error_maps.analysis import MapsDiagnosed

    return map_words.lines(found) if isinstance(found, MapsDiagnosed) else diagnosis_words.lines(found)
