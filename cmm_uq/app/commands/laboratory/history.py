"""The history of a machine: from the records to trends, and to written files where a folder is asked for."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

from cmm_uq.app.commands.laboratory.due import read_fleet
from cmm_uq.laboratory.due.history import MachineHistory, machine_history
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.listing import outcomes_of

FILES = ("history.html", "history.json")


def history_of(
    machine: str, where: str | Path | None = None, *, on: dt.date | None = None, fleet: Path | None = None
) -> MachineHistory:
    """The history of a machine."""
    day = on or dt.datetime.now().astimezone().date()
    learnt = read_fleet(fleet)
    with open_records(where, read_only=True) as records:
        found = records.machine(machine)
        certificates = records.certificates(found.serial, values=False)
        series = records.series(found.serial)
        entries = (one.entry[one.day <= day.toordinal()] for one in series.values())
        stated = outcomes_of(records, {int(until[-1]) for until in entries if len(until)})
        return machine_history(found, certificates, series, day, learnt.of(found), stated)


def write_history(found: MachineHistory, folder: Path, *, force: bool = False) -> dict[str, Path]:
    """Write ``history.html`` and ``history.json``, all or none."""
    from cmm_uq.base.output import Owner, staged
    from cmm_uq.certificate.pages.history import history_data, history_document
    from cmm_uq.certificate.render.html import render_html
    from cmm_uq.certificate.results.plain import as_json

    with staged(folder, Owner("history", found.machine.serial), force=force, expected=FILES) as place:
        page = render_html(history_document(found)).encode()
        return place.write({"history.html": page, "history.json": as_json(history_data(found))})
