"""``cmm-uq due [MACHINE…]``: what is due for calibration when, and why."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cmm_uq.app.cli.options import Fleet, Force, Json, On, Quiet, ReadRecords, day_of, examples, time_of
from cmm_uq.app.cli.summary import screen_layout
from cmm_uq.app.cli.terminal import NOT_CONFORMING, put_data, show

if TYPE_CHECKING:
    from cmm_uq.app.commands.laboratory.due import WhatIsDue

EXAMPLES = examples("due", "due --within 90d", "due 1102 --on 2026-12-31 --json", "due --strict --out DIR")


def command(
    machines: Annotated[
        list[str] | None,
        typer.Argument(help="Serial numbers or names; all machines and artefacts without.", metavar="[MACHINE]..."),
    ] = None,
    records: ReadRecords = None,
    on: On = None,
    fleet: Fleet = None,
    within: Annotated[
        str | None,
        typer.Option(
            help="Only what is due that soon (90d, 12w, 3m, 1y), or has no date.", metavar="TIME", show_default="all"
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for due.html and due.json.", metavar="DIR", show_default="none")
    ] = None,
    force: Force = False,
    strict: Annotated[bool, typer.Option("--strict", help="Exit code 4 where anything is overdue.")] = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Say which machines and artefacts are due for calibration, when, and why."""
    from cmm_uq.app.commands.laboratory.due import what_is_due, write_due

    found = what_is_due(records, machines or (), on=day_of(on), within=time_of(within), fleet=fleet)
    files = {} if out is None else write_due(found, out, force=force)
    if json:
        put_data(found.data())
    elif not quiet:
        _show(found, files)
    if strict and found.of("overdue"):
        raise typer.Exit(NOT_CONFORMING)


def _show(found: WhatIsDue, files: dict[str, Path]) -> None:
    from cmm_uq.app.cli.summary import COLOURS, HEADING, folder_of
    from cmm_uq.certificate.pages.due import counts, due_row

    told, standing = counts(found.items, found.on, found.within)
    show([((f"{found.on.isoformat()}: ", HEADING), (told, COLOURS[standing]))])
    # every reason whole: a list that says why is what is asked for
    show(screen_layout(verbose=True).table([due_row(one, found.on, found.within) for one in found.items]))
    if files:
        show([(("Written to ", HEADING), (folder_of(files), ""))])
