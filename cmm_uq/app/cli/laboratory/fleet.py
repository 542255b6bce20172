"""``cmm-uq fleet``: what drift is usual for the machines of the records, and which do not belong."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmm_uq.app.cli.options import Force, Json, Quiet, ReadRecords, Seed, Verbose, examples
from cmm_uq.app.cli.summary import show_summary
from cmm_uq.app.cli.terminal import NOT_CONFORMING, progress, put_data

EXAMPLES = examples("fleet", "fleet --name scale_x.ppm --out DIR", "fleet --records lab.db --json")


def command(
    records: ReadRecords = None,
    name: Annotated[
        list[str] | None,
        typer.Option(
            "--name", help="Value to look at, such as scale_x.ppm; may be repeated.", metavar="NAME",
            show_default="all with a limit",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for fleet.html, fleet.json and fleet.csv.", metavar="DIR", show_default="none")
    ] = None,
    seed: Seed = 1,
    force: Force = False,
    strict: Annotated[bool, typer.Option("--strict", help="Exit code 4 where a machine does not belong.")] = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    json: Json = False,
) -> None:  # fmt: skip
    """Learn from all machines of the records what drift is usual for models and places, and which do not belong."""
    with progress(quiet=quiet or json, verbose=verbose) as stage:
        from cmm_uq.app.commands.files import silent
        from cmm_uq.app.commands.laboratory.fleet import fleet, write_fleet

        found = fleet(records, name or (), seed=seed, stage=stage or silent)
        files = {} if out is None else write_fleet(found, out, force=force)
    if json:
        from cmm_uq.certificate.pages.fleet_summary import fleet_data

        put_data(fleet_data(found))
    elif not quiet:
        from cmm_uq.certificate.pages.fleet_summary import fleet_summary

        show_summary(fleet_summary(found), files, verbose=verbose)
    if strict and found.outsiders:
        raise typer.Exit(NOT_CONFORMING)
