"""``cmm-uq history MACHINE``: every value of a machine over time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cmm_uq.app.cli.options import Fleet, Force, Json, On, Quiet, ReadRecords, Verbose, day_of, examples
from cmm_uq.app.cli.summary import screen_layout
from cmm_uq.app.cli.terminal import put_data, show

if TYPE_CHECKING:
    from cmm_uq.laboratory.due.history import MachineHistory

EXAMPLES = examples("history 1102", "history 1102 --out DIR", "history 'CMM of hall 3' --on 2026-12-31 --json")


def command(
    machine: Annotated[str, typer.Argument(help="Serial number of the machine, or its name.", metavar="MACHINE")],
    records: ReadRecords = None,
    on: On = None,
    fleet: Fleet = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for history.html, with pictures, and history.json.", metavar="DIR", show_default="none"
        ),
    ] = None,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    json: Json = False,
) -> None:
    """Say how every error factor and figure of a machine has gone, what changed last, and when a limit will be crossed."""
    from cmm_uq.app.commands.laboratory.history import history_of, write_history

    found = history_of(machine, records, on=day_of(on), fleet=fleet)
    files = {} if out is None else write_history(found, out, force=force)
    if json:
        from cmm_uq.certificate.pages.history import history_data

        put_data(history_data(found))
    elif not quiet:
        _show(found, files, verbose=verbose)


def _show(found: MachineHistory, files: dict[str, Path], *, verbose: bool) -> None:
    from cmm_uq.app.cli.summary import COLOURS, HEADING, folder_of
    from cmm_uq.certificate.pages.history import summary_row, terminal_note

    machine = found.machine
    serial = "" if machine.by_name else f", serial number {machine.serial}"
    count = len(found.certificates)
    recordings = "one recording" if count == 1 else f"{count} recordings"
    show([((f"{machine.name}{serial}", HEADING), (f": {recordings} up to {found.on.isoformat()}", ""))])
    show(screen_layout(verbose=verbose).table([summary_row(found, one) for one in found.values]))
    if found.values:
        show([((terminal_note(found), ""),)])
    show([((text, COLOURS["open"]),) for text in found.remarks])
    if files:
        show([(("Written to ", HEADING), (folder_of(files), ""))])
