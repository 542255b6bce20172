"""What is due for calibration, the history of a machine, and what machines have in common: from the records to files."""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import nullcontext
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from cmm_uq import __version__
from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.files.limits import TABLE_BYTES, check_permitted, content_of
from cmm_uq.base.values import dataclass, replace
from cmm_uq.laboratory.due.doubt import parts_measured, with_parts
from cmm_uq.laboratory.due.due import CalibrationRecord, DueItem, artefact_due, in_order, machine_due
from cmm_uq.laboratory.due.history import MachineHistory, machine_history
from cmm_uq.laboratory.due.kept import KeptDates
from cmm_uq.laboratory.due.rule import CompletedInterval, Pool, Rule, calibrations, ended_intervals, part_used
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.facts import STANDING, RecordedCertificate, RecordedMachine, Series
from cmm_uq.laboratory.records.listing import outcomes_of

if TYPE_CHECKING:
    from cmm_uq.app.commands.files import Stage
    from cmm_uq.certificate.document import Document
    from cmm_uq.laboratory.due.drift import DriftPrior as Prior
    from cmm_uq.laboratory.due.fleet import FleetMember, FleetResult
    from cmm_uq.laboratory.due.fleet_model import FleetPrior
    from cmm_uq.laboratory.records.store import Records

Where = str | Path | None  # the records: a file, a URL, or those of the environment


@lru_cache(maxsize=1000)
def _prior(fleet: FleetPrior, model: str, place: str) -> Prior:
    return fleet.prior(model, place)


def _priors(fleets: Mapping[str, FleetPrior], machine: RecordedMachine) -> dict[str, Prior]:
    """Of a machine, by value; its model and place may be new to the fleet."""
    return {name: _prior(fleet, machine.model, machine.place) for name, fleet in fleets.items()}


def read_fleet(file: Path | None) -> dict[str, FleetPrior]:
    """Priors of the machines of a fleet, by value; none where no file is named."""
    if file is None:
        return {}
    from cmm_uq.laboratory.due.fleet_model import FleetPrior

    fix = "Make it: cmm-uq fleet --out DIR, and name DIR/fleet.json"
    try:
        data = json.loads(content_of(file, TABLE_BYTES, fix))
        values = [(str(value["name"]), value["prior"]) for value in data["values"]]
    except (ValueError, KeyError, TypeError, RecursionError):
        raise CmmUqError("is no fleet.json", where=str(file), fix=fix) from None
    return {name: FleetPrior.from_data(prior, str(file)) for name, prior in values}


SCHEMA = "cmm-uq/due/1"
_FEW = 20  # machines of which whole histories are read
WITHIN = dt.timedelta(days=90)  # how far ahead something is due and no longer later, where nothing is said


@dataclass(frozen=True)
class WhatIsDue:
    """Machines and artefacts that were asked about, by the day on which they are due, and how far ahead is due."""

    on: dt.date
    within: dt.timedelta
    items: tuple[DueItem, ...]

    def of(self, *states: str) -> list[DueItem]:
        return [one for one in self.items if one.state(self.on, self.within) in states]

    def data(self) -> dict[str, Any]:
        items = [
            {
                "item": one.item, "serial": one.serial, "name": one.name, "model": one.model, "place": one.place,
                "state": one.state(self.on, self.within), "due": _iso(one.due), "last": _iso(one.last),
                "why": str.__str__(one.why), "remarks": [str.__str__(text) for text in one.remarks],
                "artefact": one.artefact or None, "blocked": str.__str__(one.blocked) if one.blocked else None,
            }
            for one in self.items
        ]  # fmt: skip
        return {
            "schema": SCHEMA, "software": {"name": "cmm-uq", "version": __version__}, "on": self.on.isoformat(),
            "within_days": self.within.days, "items": items,
        }  # fmt: skip


def what_is_due(
    where: Where = None,
    machines: Collection[str] = (),
    *,
    on: dt.date | None = None,
    within: dt.timedelta | None = None,
    fleet: Path | None = None,
) -> WhatIsDue:
    day, learnt = on or _today(), read_fleet(fleet)
    with open_records(where, read_only=True) as records:
        found = due_in(records, machines, day, learnt, within)
    kept = found if within is None else [one for one in found if one.due is None or one.due - day <= within]
    return WhatIsDue(day, WITHIN if within is None else within, tuple(kept))


def _today() -> dt.date:
    return dt.datetime.now().astimezone().date()


def due_in(
    records: Records, machines: Collection[str], on: dt.date, fleets: Mapping[str, FleetPrior] = MappingProxyType({}),
    within: dt.timedelta | None = None,
) -> list[DueItem]:  # fmt: skip
    """All that is asked about; ``within``: at least what is due within that time, or has no date."""
    artefacts, kept = {one.serial: one for one in records.artefacts(on)}, KeptDates()
    near: Collection[str] | None = None
    if machines:
        near = {records.machine(serial, on).serial for serial in machines}
    elif within is not None and not fleets:  # a fleet learns with every entry
        near = kept.near(records, on, on.toordinal() + within.days)
    asked = records.machines(on, near)
    if near is None and not asked and not artefacts:
        raise CmmUqError("no machine is recorded yet", where="records", fix="Record one: cmm-uq report JOB")
    reading = _Reading(records, on, fleets, near, whole=0 < len(machines) < _FEW)
    by_drift = any(Rule.of(one.calibrate).method == "drift" for one in asked)
    with kept.intervals() if by_drift else nullcontext():
        found = [machine_due(reading.known(one), artefacts, on, reading.pool(one)) for one in asked]
    kept.write(found)
    used = {one.artefact for one in found} if machines else set(artefacts)
    return in_order([*found, *(artefact_due(artefacts[serial]) for serial in used if serial in artefacts)])


class _Reading:
    """Certificates of machines: all newest ones in one query, whole histories only where something needs them.

    ``records, on, of``: where from, up to which day, of which machines; ``whole``: whether histories are read whole, of few.
    """

    def __init__(
        self,
        records: Records,
        on: dt.date,
        fleets: Mapping[str, FleetPrior],
        of: Collection[str] | None,
        *,
        whole: bool,
    ) -> None:
        self.records, self._on, self._fleets, self._late = records, on, fleets, records.dated_after(on)
        self._pasts: dict[str, list[RecordedCertificate]] = {}
        self._pools: dict[tuple[str, str], list[CompletedInterval]] = {}
        newest = [] if whole else records.latest(on, values=False, of=of)
        released = [] if whole else records.latest(on, values=False, states=("released",), of=of)
        checked = [] if whole else [one for one in records.checks(of) if one.day <= on]
        each = ({one.machine: one for one in of} for of in (newest, released, checked))
        self._newest, self._released, self._checked = each
        undecided = [one.entry for one in newest if one.decision == "none"]
        self._without = set(undecided) - records.limited(undecided)

    def known(self, machine: RecordedMachine) -> CalibrationRecord:
        """What its rule needs of a machine: its newest certificate where that will do."""
        rule, late = Rule.of(machine.calibrate), self._late.get(machine.serial)
        newest, checked = self._newest.get(machine.serial), self._checked.get(machine.serial)
        released = self._released.get(machine.serial, newest)
        later = checked is not None and (
            released is None or (checked.day, checked.entry) > (released.day, released.entry)
        )
        if newest is not None and released is not None and not later and rule.method == "fixed":
            newer = [newest] if released.entry != newest.entry else []
            return CalibrationRecord(machine, rule, [released, *newer], newest.entry not in self._without, late)
        past = self._past(machine.serial)
        limited = any(part_used(one) is not None or one.decision != "none" for one in calibrations(past)[-1:])
        priors = _priors(self._fleets, machine) if rule.method == "drift" else {}
        return CalibrationRecord(machine, rule, past, limited, late, priors)

    def pool(self, machine: RecordedMachine) -> Pool:
        """Intervals of all machines of its model; its own where its model is not known."""

        def pooled() -> Sequence[CompletedInterval]:
            key = (machine.manufacturer, machine.model)
            if not machine.model:
                return ended_intervals(self._past(machine.serial))
            if key not in self._pools:
                alike = [one for one in self.records.machines() if (one.manufacturer, one.model) == key]
                self._pools[key] = [interval for one in alike for interval in ended_intervals(self._past(one.serial))]
            return self._pools[key]

        return pooled

    def _past(self, serial: str) -> list[RecordedCertificate]:
        """Standing certificates and checks of a machine up to the day."""
        if serial not in self._pasts:
            known = self.records.certificates(serial, states=STANDING)
            self._pasts[serial] = [one for one in known if one.day <= self._on]
        return self._pasts[serial]


def _write(
    name: str, owner: str, folder: Path, document: Document, data: Mapping[str, Any], *, force: bool, **further: bytes
) -> dict[str, Path]:
    """Write ``NAME.html``, ``NAME.json`` and what else there is, by the ends of names, all or none."""
    from cmm_uq.base.output import Owner, staged
    from cmm_uq.certificate.origin import as_json
    from cmm_uq.certificate.render import render_html

    files = [f"{name}.{end}" for end in ("html", "json", *further)]
    with staged(folder, Owner(name, owner), force=force, expected=files) as place:
        contents = (render_html(document).encode(), as_json(data), *further.values())
        return place.write(dict(zip(files, contents, strict=True)))


def write_due(found: WhatIsDue, folder: Path, *, force: bool = False) -> dict[str, Path]:
    from cmm_uq.certificate.pages.fleet import due_document

    document = due_document(found.items, found.on, found.within)
    return _write("due", "records", folder, document, found.data(), force=force)


def _iso(day: dt.date | None) -> str | None:
    return None if day is None else day.isoformat()


def history_of(
    machine: str,
    where: Where = None,
    *,
    on: dt.date | None = None,
    fleet: Path | None = None,
    parts: Collection[Path] = (),
) -> MachineHistory:
    """``parts``: folders with reports of parts that are not recorded; beside the records, two folders deep, by default."""
    day, learnt = on or _today(), read_fleet(fleet)
    with open_records(where, read_only=True) as records:
        found = records.machine(machine)
        certificates, home = records.certificates(found.serial), records.home
        series = records.series(found.serial)
        entries = (one.entry[one.day <= day.toordinal()] for one in series.values())
        stated = outcomes_of(records, {int(until[-1]) for until in entries if len(until)})
        history = machine_history(found, certificates, series, day, _priors(learnt, found), stated)
        for folder in parts:
            if not folder.is_dir():
                raise CmmUqError("is no folder", where=str(folder), fix="Name a folder with reports of parts")
            check_permitted(folder, "Mend its permissions, or name another folder")
        below = [(home, f"{deep}results.json") for deep in ("*/", "*/*/") if home is not None]
        places = [(folder, "**/results.json") for folder in parts] or below
        reports = sorted({file for folder, names in places for file in folder.glob(names)}) if history.doubtful else []
        recorded = [one for one in records.parts(found.serial) if one.day <= day]
        every = (*recorded, *parts_measured(found, reports, records.has_results))
    return replace(history, doubtful=with_parts(history.doubtful, every, day), parts=tuple(recorded))


def write_history(found: MachineHistory, folder: Path, *, force: bool = False) -> dict[str, Path]:
    from cmm_uq.certificate.pages.history import history_data, history_document

    document, data = history_document(found), history_data(found)
    return _write("history", found.machine.serial, folder, document, data, force=force)


def fleet(
    where: Where = None, names: Collection[str] = (), *, seed: int = 1, stage: Stage = lambda what, part: None
) -> FleetResult:
    """Learn what drift is usual for the machines of the records, and which of them do not belong."""
    from cmm_uq.laboratory.due.fleet import fit_fleet, judged

    with open_records(where, read_only=True) as records:
        every, machines = records.all_series(names or None), {one.serial: one for one in records.machines()}
        known = [] if every else [name for of in records.all_series().values() for name in sorted(of)]
        stated = outcomes_of(records, {int(one.entry[-1]) for of in every.values() for one in of.values()})
    called: dict[str, tuple[str, str]] = {}
    for of in every.values():
        if of.keys() - called.keys():  # the first machine with a value says what it is called
            called |= {name: (series.quantity, series.unit) for name, series in of.items()}
    wanted = _wanted(every, names, known)
    learnt = []
    for i, name in enumerate(wanted):
        rows = {serial: of[name] for serial, of in every.items() if name in of}
        members = tuple(_members(rows, machines, stated))
        quantity, unit = called[name]
        stage(f"Sampling: {quantity}", i / len(wanted))
        if not members:
            fix = "Choose another --name"
            raise CmmUqError("no certificate states this value with an uncertainty", where=name, fix=fix)
        left = sum(len(one.day) for one in rows.values()) - sum(len(one.history.day) for one in members)
        learnt.append((name, quantity, unit, members, fit_fleet(members, seed), left))
    stage("Done", 1.0)
    return judged(learnt, seed)


def _wanted(every: Mapping[str, Mapping[str, Series]], names: Collection[str], known: Collection[str]) -> list[str]:
    there = list(dict.fromkeys(name for of in every.values() for name in sorted(of)))
    for name in names:
        if name not in there:
            known = known or there
            raise CmmUqError(f"no certificate states {name!r}", where="--name", fix=suggestion(name, known))
    if not there:
        raise CmmUqError("no certificate of a measured recording is recorded yet", where="records",
                         fix="Record some: cmm-uq report JOB, or cmm-uq records import")  # fmt: skip
    if names:
        return list(dict.fromkeys(names))
    limited = {name for of in every.values() for name, series in of.items() if series.limit is not None}
    return sorted(limited or there)


def _members(
    rows: Mapping[str, Series], machines: Mapping[str, RecordedMachine], stated: Mapping[int, Mapping[str, str]]
) -> Iterator[FleetMember]:
    """Machines with what their certificates say; the newest limit, model and place count, and the newest adjustment."""
    from cmm_uq.laboratory.due.drift import history
    from cmm_uq.laboratory.due.fleet import FleetMember

    for serial, whole in rows.items():
        of, machine = whole.where(np.isfinite(whole.value) & np.isfinite(whole.u) & (whole.u > 0)), machines[serial]
        if not len(of.day):
            continue
        # what certificates take from an artefact is at most their whole uncertainty
        shared = np.where(np.isnan(of.u_artefact), 0.0, of.u_artefact).clip(0.0, of.u)
        known = replace(of, u_artefact=shared, adjusted_since=np.minimum(of.adjusted_since, of.day))
        adjusted = machine.adjusted[-1].toordinal() if machine.adjusted else None
        limit = of.limit if of.limit is not None and of.limit > 0 else None
        decided = stated.get(int(of.entry[-1]), {}).get(of.name, "")
        yield FleetMember(serial, machine.model, machine.place, history(known, adjusted), limit, decided)


def write_fleet(found: FleetResult, folder: Path, *, force: bool = False) -> dict[str, Path]:
    from cmm_uq.certificate.pages.fleet import fleet_document
    from cmm_uq.certificate.pages.fleet_summary import fleet_csv, fleet_data

    data = fleet_data(found)
    return _write("fleet", "records", folder, fleet_document(found), data, force=force, csv=fleet_csv(data))
