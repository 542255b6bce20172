"""The machine's history that its drift was read from: what of the records goes into a part's report, and comes out of it.

How far the machine's errors have moved since its calibration, by its records, where there are some.
"""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cmm_uq.analysis.parts.machine.state import MachineState, aged
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, commas, plural, say
from cmm_uq.certificate.wording import titles
from cmm_uq.laboratory.due.drift import DriftHistory, history
from cmm_uq.laboratory.due.drift_filter import change_since
from cmm_uq.laboratory.due.history import MachineHistory
from cmm_uq.laboratory.records.facts import Series
from cmm_uq.laboratory.records.place import NONE

FILE = "machine-records/history.json"  # by its name among the inputs of a part's report
SCHEMA = "cmm-uq/machine-history/1"

_COLUMNS: Mapping[str, type] = {
    "day": np.int64, "value": np.float64, "u": np.float64, "u_artefact": np.float64, "artefact": np.str_,
    "entry": np.int64, "adjusted_since": np.int64, "interim": np.bool_,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class KnownChanges:
    """What records say of how a machine changes."""

    adjusted: tuple[dt.date, ...]  # days of its adjustments
    # each over time, up to the calibration, by name, with the ordinal of the newest adjustment
    values: Mapping[str, tuple[Series, int | None]]

    def change(self, name: str, days: float) -> float | None:
        """Root mean square change of a value by so many days after the calibration, in its unit; ``None`` if nobody knows."""
        if name not in self.values:
            return None
        series, adjusted_after = self.values[name]
        try:
            of: DriftHistory = history(series, adjusted_after)
            return change_since(of, days, limit=series.limit)
        except CmmUqError:
            return None


def attached_history(past: MachineHistory, until: dt.date) -> bytes:
    """The history up to the calibration, as JSON whose numbers are those of the records to the bit."""
    values = []
    for one in past.values:
        series, rows = one.series, np.asarray(one.series.day) <= until.toordinal()
        columns = {name: np.asarray(getattr(series, name))[rows].tolist() for name in _COLUMNS}
        values.append({
            "name": series.name, "quantity": series.quantity, "unit": series.unit, "limit": series.limit,
            "adjusted_after": one.adjusted_after, **columns,
        })  # fmt: skip
    said = {"schema": SCHEMA, "adjusted": [day.isoformat() for day in past.machine.adjusted], "values": values}
    return (json.dumps(said, ensure_ascii=False, indent=1, sort_keys=True) + "\n").encode()


def known_of(content: bytes) -> KnownChanges:
    """The history that :func:`attached_history` wrote."""
    try:
        said = json.loads(content)
        if said["schema"] != SCHEMA:
            raise ValueError(said["schema"])
        adjusted = tuple(map(dt.date.fromisoformat, said["adjusted"]))
        return KnownChanges(
            adjusted, {str(one["name"]): (_series(one), one["adjusted_after"]) for one in said["values"]}
        )
    except (ValueError, KeyError, TypeError, RecursionError, OverflowError) as error:
        raise CmmUqError("is no history of a machine", where=FILE,
                         fix="Evaluate the part again, with --records") from error  # fmt: skip


def _series(one: Mapping[str, Any]) -> Series:
    columns: dict[str, Any] = {name: np.asarray(one[name], dtype=sort) for name, sort in _COLUMNS.items()}
    if len({column.shape for column in columns.values()}) != 1 or columns["day"].ndim != 1:
        raise ValueError("columns of different length")
    limit = None if one["limit"] is None else float(one["limit"])
    return Series(name=str(one["name"]), quantity=str(one["quantity"]), unit=str(one["unit"]), limit=limit, **columns)


@dataclass(frozen=True, eq=False)
class AgedMachine:
    """A machine on the day of a part's measurement, what is known of its changes, in a sentence, and in figures."""

    state: MachineState
    told: Text
    changes: Mapping[str, float | None] | None = None
    # that the changes follow from, as it is attached to the report; ``None`` without records
    history: bytes | None = None


def with_drift(
    state: MachineState, serial: str, on: dt.date, records: str | Path | None, where: str, *, kept: bytes | None = None
) -> AgedMachine:
    """The state of a machine on a day.

    ``records``: of its history; ``None`` or ``none`` for none. ``kept``: the history that an earlier report has inside
    (:mod:`cmm_uq.app.commands.parts.drift`); then records are not asked.
    """
    since = state.calibrated or on
    if kept is None and (records is None or str(records) == NONE):
        found = aged(state, on)
        return AgedMachine(found, _not_known(found))
    if kept is None:
        from cmm_uq.app.commands.laboratory.due import history_of

        kept = attached_history(history_of(serial, records, on=on), since)
    known = known_of(kept)
    late = max((day for day in known.adjusted if since < day <= on), default=None)
    if late is not None:
        raise CmmUqError(
            f"the machine was adjusted on {late}, after its calibration of {since}: its certificate no longer holds",
            where=where, fix="Calibrate the machine, or give the certificate of after the adjustment",
        )  # fmt: skip
    changes: dict[str, float | None] = {}

    def change(name: str, days: float) -> float | None:
        changes[name] = found = known.change(name, days)
        return found

    found = aged(state, on, change)
    return AgedMachine(found, _known(found), changes, kept)


def _not_known(state: MachineState) -> Text:
    days = state.age_days or 0
    if not days:
        return say("The machine was calibrated on the day of the measurement.")
    return plural(
        days,
        one=say("What changed in the day since the calibration is not known and not reckoned with."),
        many=say(
            "What changed in the {count} days since the calibration is not known and not reckoned with.", count=days
        ),
    )


def _known(state: MachineState) -> Text:
    """What the records say, and of which errors they say nothing."""
    days = state.age_days or 0
    if not days:
        return _not_known(state)
    if len(state.drift_unknown) == len(state.effects):
        return say("The machine's records do not say how its errors change; {days} days have passed since the calibration.",
                   days=days)  # fmt: skip
    told = say(
        "Changes in the {days} days since the calibration are drawn as the machine's records let expect.", days=days
    )
    if not state.drift_unknown:
        return told
    return say("{told} They say nothing of {effects}.", told=told, effects=commas(titles(state.drift_unknown)))
