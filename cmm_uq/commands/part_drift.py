"""How far the machine's errors have moved since its calibration, by its records, where there are some."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cmm_uq.documents.effect_words import titles
from cmm_uq.errors import CmmUqError
from cmm_uq.messages import Text, commas, plural, say
from cmm_uq.parts.drift import Change, aged
from cmm_uq.parts.machine import MachineState
from cmm_uq.recertification.drift import history
from cmm_uq.recertification.history import MachineHistory, ValueHistory
from cmm_uq.recertification.since import change_since
from cmm_uq.records import Series

_COLUMNS = ("day", "value", "u", "u_artefact", "artefact", "entry", "adjusted_since", "interim")


@dataclass(frozen=True, eq=False)
class Aged:
    """A machine on the day of a part's measurement, what is known of its changes, in a sentence, and in figures."""

    state: MachineState
    told: Text
    changes: Mapping[str, float | None] | None = None


def with_drift(
    state: MachineState, serial: str, on: dt.date, records: str | Path | None, where: str, *,
    known: Mapping[str, float | None] | None = None,
) -> Aged:  # fmt: skip
    """The state of a machine on a day.

    Parameters
    ----------
    state : as its certificate states it, with the day of its calibration.
    serial : of the machine, or its name.
    on : day of the part's measurement.
    records : of its history; ``None`` for none.
    where : names the certificate, for messages.
    known : change of each reported parameter, as records said at an earlier time; ``None`` where these are to be asked.

    Raises
    ------
    CmmUqError : the records cannot be read, or the machine was adjusted after its calibration.
    """
    if known is not None:
        return _aged(state, on, lambda name, days: known.get(name))
    if records is None:
        found = aged(state, on)
        return Aged(found, _not_known(found))
    from cmm_uq.commands.history import history_of

    past = history_of(serial, records, on=on)
    since = state.calibrated or on
    late = max((day for day in past.machine.adjusted if since < day <= on), default=None)
    if late is not None:
        raise CmmUqError(
            f"the machine was adjusted on {late}, after its calibration of {since}: its certificate no longer holds",
            where=where, fix="Calibrate the machine, or give the certificate of after the adjustment",
        )  # fmt: skip
    return _aged(state, on, _change(past, since))


def _aged(state: MachineState, on: dt.date, change: Change) -> Aged:
    """With changes of ten digits, as ``results.json`` has them, so that they give the same figures once more."""
    changes: dict[str, float | None] = {}

    def kept(name: str, days: float) -> float | None:
        found = change(name, days)
        changes[name] = None if found is None else float(f"{found:.10g}")
        return changes[name]

    found = aged(state, on, kept)
    return Aged(found, _known(found), changes)


def _change(known: MachineHistory, calibrated: dt.date) -> Change:
    """By each value's certificates up to the calibration."""
    values = {one.series.name: one for one in known.values}

    def change(name: str, days: float) -> float | None:
        if name not in values:
            return None
        one: ValueHistory = values[name]
        until = _until(one.series, calibrated)
        try:
            return change_since(history(until, one.adjusted_after), days, prior=one.prior, limit=until.limit)
        except CmmUqError:
            return None

    return change


def _until(series: Series, day: dt.date) -> Series:
    rows = np.asarray(series.day) <= day.toordinal()
    return replace(series, **{name: getattr(series, name)[rows] for name in _COLUMNS})


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
