"""What a laboratory's machines have in common: from the records to a fleet's model, and to written files where asked for."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cmm_uq.app.commands.files import Stage, silent
from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.laboratory.due.drift import history
from cmm_uq.laboratory.due.fleet import FleetMember, FleetResult, fit_fleet, judged
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.listing import outcomes_of

if TYPE_CHECKING:
    import pandas as pd

FILES = ("fleet.html", "fleet.json", "fleet.csv")


def fleet(
    where: str | Path | None = None, names: Collection[str] = (), *, seed: int = 1, stage: Stage = silent
) -> FleetResult:
    """Learn what drift is usual for the machines of the records, and which of them do not belong."""
    with open_records(where, read_only=True) as records:
        frame = records.all_series(names or None)
        adjusted = {one.serial: one.adjusted[-1].toordinal() for one in records.machines() if one.adjusted}
        known = set(frame["name"]) if not names else set(records.all_series()["name"]) if frame.empty else set()
        called = {
            name: (series.quantity, series.unit)
            for machine in frame.drop_duplicates("name")["machine"]
            for name, series in records.series(machine).items()
        }
        newest = frame.drop_duplicates(["machine", "name"], keep="last")
        stated = outcomes_of(records, set(newest["entry"].tolist()))
    wanted = _wanted(frame, names, known)
    learnt = []
    for i, name in enumerate(wanted):
        rows = frame[frame["name"] == name]
        usable = rows[np.isfinite(rows["value"]) & np.isfinite(rows["u"]) & (rows["u"] > 0)]
        members = tuple(_members(usable, adjusted, stated))
        quantity, unit = called.get(name, (name, ""))

        def told(part: float, i: int = i, quantity: str = quantity) -> None:
            stage(f"Sampling: {quantity}", (i + part) / len(wanted))

        if not members:
            fix = "Choose another --name"
            raise CmmUqError("no certificate states this value with an uncertainty", where=name, fix=fix)
        learnt.append((name, quantity, unit, members, fit_fleet(members, seed, told), len(rows) - len(usable)))
    stage("Done", 1.0)
    return judged(learnt, seed)


def _wanted(frame: pd.DataFrame, names: Collection[str], known: Collection[str]) -> list[str]:
    """Names of the values to be looked at."""
    there = list(dict.fromkeys(frame["name"]))
    for name in names:
        if name not in there:
            known = known or there
            raise CmmUqError(f"no certificate states {name!r}", where="--name", fix=suggestion(name, known))
    if not there:
        raise CmmUqError("no certificate of a measured recording is recorded yet", where="records",
                         fix="Record some: cmm-uq report JOB, or cmm-uq records import")  # fmt: skip
    if names:
        return list(dict.fromkeys(names))
    limited = set(frame.loc[frame["limit"].notna(), "name"])
    return sorted(limited or there)


def _members(
    rows: pd.DataFrame, adjusted: Mapping[str, int], stated: Mapping[int, Mapping[str, str]]
) -> Iterator[FleetMember]:
    """Machines with what their certificates say; the newest limit, model and place count, and the newest adjustment."""
    for machine, of in rows.groupby("machine", sort=True):
        last, known = of.iloc[-1], history(_Columns(of), adjusted.get(str(machine)))
        limits = of["limit"].dropna()
        yield FleetMember(
            str(machine), str(last["model"] or ""), str(last["place"] or ""), known,
            float(limits.iloc[-1]) if len(limits) and limits.iloc[-1] > 0 else None,
            stated.get(int(last["entry"]), {}).get(str(last["name"]), ""),
        )  # fmt: skip


class _Columns:
    """Rows of the records as a series; what certificates take from an artefact is at most their whole uncertainty."""

    def __init__(self, rows: pd.DataFrame) -> None:
        self.day, self.value, self.u = (rows[name].to_numpy(dtype=np.float64) for name in ("day", "value", "u"))
        shared = np.nan_to_num(rows["u_artefact"].to_numpy(dtype=np.float64))
        self.u_artefact = np.clip(shared, 0.0, self.u)
        self.artefact = rows["artefact"].to_numpy(dtype=np.str_)
        self.adjusted_since = np.minimum(rows["adjusted_since"].to_numpy(dtype=np.float64), self.day)


def write_fleet(found: FleetResult, folder: Path, *, force: bool = False) -> dict[str, Path]:
    """Write ``fleet.html``, ``fleet.json`` and ``fleet.csv``, all or none."""
    from cmm_uq.base.output import Owner, staged
    from cmm_uq.certificate.pages.fleet import fleet_document
    from cmm_uq.certificate.pages.fleet_summary import fleet_csv, fleet_data
    from cmm_uq.certificate.render.html import render_html
    from cmm_uq.certificate.results.plain import as_json

    with staged(folder, Owner("fleet", "records"), force=force, expected=FILES) as place:
        page = render_html(fleet_document(found)).encode()
        data = fleet_data(found)
        return place.write({"fleet.html": page, "fleet.json": as_json(data), "fleet.csv": fleet_csv(data)})
