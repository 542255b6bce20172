"""How far the machine's errors have moved since its calibration, by its records, where there are some."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from cmm_uq.analysis.parts.drift import aged
from cmm_uq.analysis.parts.machine import MachineState
from cmm_uq.app.commands import part_history
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, commas, plural, say
from cmm_uq.certificate.effect_words import titles
from cmm_uq.laboratory.records.place import NONE


@dataclass(frozen=True, eq=False)
class Aged:
    """A machine on the day of a part's measurement, what is known of its changes, in a sentence, and in figures.

    Parameters
    ----------
    history : that the changes follow from, as it is attached to the report; ``None`` without records.
    """

    state: MachineState
    told: Text
    changes: Mapping[str, float | None] | None = None
    history: bytes | None = None


def with_drift(
    state: MachineState, serial: str, on: dt.date, records: str | Path | None, where: str, *, kept: bytes | None = None
) -> Aged:  # fmt: skip
    """The state of a machine on a day.

    Parameters
    ----------
    state : as its certificate states it, with the day of its calibration.
    serial : of the machine, or its name.
    on : day of the part's measurement.
    records : of its history; ``None`` or ``none`` for none.
    where : names the certificate, for messages.
    kept : the history that an earlier report has inside (:mod:`cmm_uq.app.commands.part_history`); then records are not asked.

    Raises
    ------
    CmmUqError : the records cannot be read, or the machine was adjusted after its calibration.
    """
    since = state.calibrated or on
    if kept is None and (records is None or str(records) == NONE):
        found = aged(state, on)
        return Aged(found, _not_known(found))
    if kept is None:
        from cmm_uq.app.commands.laboratory.history import history_of

        kept = part_history.kept(history_of(serial, records, on=on), since)
    known = part_history.known_of(kept)
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
    return Aged(found, _known(found), changes, kept)


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
