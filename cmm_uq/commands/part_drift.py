"""How far the machine's errors have moved since its calibration, by its records, where there are some."""

from __future__ import annotations

import datetime as dt
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
    """A machine on the day of a part's measurement, and what is known of its changes, in a sentence."""

    state: MachineState
    told: Text


def with_drift(state: MachineState, serial: str, on: dt.date, records: str | Path | None, where: str) -> Aged:
    """The state of a machine on a day.

    Parameters
    ----------
    state : as its certificate states it, with the day of its calibration.
    serial : of the machine, or its name.
    on : day of the part's measurement.
    records : of its history; ``None`` for none.
    where : names the certificate, for messages.

    Raises
    ------
    CmmUqError : the records cannot be read, or the machine was adjusted after its calibration.
    """
    if records is None:
        found = aged(state, on)
        return Aged(found, _not_known(found))
    from cmm_uq.commands.history import history_of

    known = history_of(serial, records, on=on)
    since = state.calibrated or on
    late = max((day for day in known.machine.adjusted if since < day <= on), default=None)
    if late is not None:
        raise CmmUqError(
            f"the machine was adjusted on {late}, after its calibration of {since}: its certificate no longer holds",
            where=where, fix="Calibrate the machine, or give the certificate of after the adjustment",
        )  # fmt: skip
    found = aged(state, on, _change(known, since))
    return Aged(found, _known(found))


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
