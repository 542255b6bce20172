"""The machine's history that a part's report takes in and brings along, and what to measure on the machine.

How far its errors have moved since the calibration is known by its records, where there are some. What the calibration did not
see is planned to be measured as by ``plan``.
"""

from __future__ import annotations

import datetime as dt
import json
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cmm_uq.analysis.machine.state import FREE, MachineState, aged
from cmm_uq.app.commands.planning import MeasurementPlan, make_plan
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.toml_file import as_toml
from cmm_uq.base.messages import NOTHING, Text, commas, plural, say, semicolons, sentences
from cmm_uq.base.values import dataclass, replace
from cmm_uq.certificate.part.measurement import FurtherSetUps, UnseenError
from cmm_uq.certificate.wording import titles
from cmm_uq.jobs.job import Job
from cmm_uq.laboratory.due.drift import DriftHistory, history
from cmm_uq.laboratory.due.drift_filter import change_since
from cmm_uq.laboratory.due.history import MachineHistory
from cmm_uq.laboratory.records.facts import Series
from cmm_uq.laboratory.records.place import NONE
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.effects.rigid_body import SCALE

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
    def series(one: Mapping[str, Any]) -> Series:
        named: dict[str, Any] = {key: str(one[key]) for key in ("name", "quantity", "unit")}
        columns: dict[str, Any] = {name: np.asarray(one[name], dtype=sort) for name, sort in _COLUMNS.items()}
        if len({column.shape for column in columns.values()}) != 1 or columns["day"].ndim != 1:
            raise ValueError("columns of different length")
        limit = None if one["limit"] is None else float(one["limit"])
        return Series(limit=limit, **named, **columns)

    try:
        said = json.loads(content)
        if said["schema"] != SCHEMA:
            raise ValueError(said["schema"])
        values = {str(one["name"]): (series(one), one["adjusted_after"]) for one in said["values"]}
        return KnownChanges(tuple(map(dt.date.fromisoformat, said["adjusted"])), values)
    except (ValueError, KeyError, TypeError, RecursionError, OverflowError) as error:
        fix = "Evaluate the part again, with --records"
        raise CmmUqError("is no history of a machine", where=FILE, fix=fix) from error


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
        return AgedMachine(found, _drift(found, known=False))
    if kept is None:
        from cmm_uq.app.commands.laboratory.due import history_of, what_is_due

        found_so = next(one for one in what_is_due(records, [serial], on=on).items if one.item == "machine")
        if found_so.beyond:
            raise CmmUqError(
                f"the records say that the machine is overdue: {str.__str__(found_so.why)}",
                where=where,
                fix="Calibrate the machine, and measure the part again",
            )
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
    return AgedMachine(found, _drift(found, known=True), changes, kept)


def _drift(state: MachineState, *, known: bool) -> Text:
    """What the records say of the days since the calibration, where there are some, and of which errors they say nothing."""
    days = state.age_days or 0
    if not days:
        return say("The machine was calibrated on the day of the measurement.")
    if not known:
        one = say("What changed in the day since the calibration is not known and not reckoned with.")
        many = say(
            "What changed in the {count} days since the calibration is not known and not reckoned with.", count=days
        )
        return plural(days, one=one, many=many)
    if len(state.drift_unknown) == len(state.effects):
        return say("The machine's records do not say how its errors change; {days} days have passed since the calibration.",
                   days=days)  # fmt: skip
    told = say(
        "Changes in the {days} days since the calibration are drawn as the machine's records let expect.", days=days
    )
    if not state.drift_unknown:
        return told
    return say("{told} They say nothing of {effects}.", told=told, effects=commas(titles(state.drift_unknown)))


FOLDER = "further"  # of the job that plans them, beside the part's page
# errors that are planned for together, set-ups that are searched, and candidates that they are chosen from
MOST, SET_UPS, CANDIDATES = 5, 4, 60

_SHOWN_BY: tuple[tuple[str, Text], ...] = (
    ("approach_", say("a gauge whose faces are met from both sides, such as a step gauge, would show this")),
    ("tip_", say("the artefact probed with a stylus to the side would show this")),
    ("time_s", say("it shows where the time of each point is recorded")),
    ("temp_", say("it shows where the temperatures of the scales are recorded")),
    ("n", say("points probed on surfaces, with their normals, would show this")),
)
"""By the beginning of a column that an error needs and the recording lacks."""


def further_of(
    calibrated: Job | None, unseen: Iterable[UnseenError]
) -> tuple[FurtherSetUps | None, Mapping[str, bytes]]:
    """Further set-ups of the calibration's artefact for errors that it left free or did not see, and files of their job.

    ``calibrated``: job of the calibration; ``None`` where it is not at hand: then, and where nothing is unseen, ``None``.
    """
    shares: dict[str, float] = {}  # the largest of any characteristic
    for one in unseen:
        if one.effect in every():
            shares[one.effect] = max(shares.get(one.effect, 0.0), one.share)
    wanted = [every()[name] for name in sorted(shares, key=lambda name: -shares[name])]
    if not wanted or calibrated is None or not kind_of(calibrated).by_effects:
        return None, {}
    here = [effect for effect in wanted if _why_not(calibrated, effect) is None][:MOST]
    plan = _plan(calibrated, here)
    found = () if plan is None else _found_by(plan, here)
    names = tuple(effect.name for effect in wanted)
    missed = tuple(name for name in names if name not in found)
    text = sentences([part for part in (_setups(plan, found), _missed(calibrated, missed)) if part])
    if plan is None or not found:
        return FurtherSetUps(names, 0, text, missed=missed), {}
    command, file = f"cmm-uq plan {FOLDER}", f"{FOLDER}/job.toml"
    return FurtherSetUps(names, len(plan.to_measure), text, command, file, missed), _files(calibrated, found)


def _why_not(calibrated: Job, effect: Effect) -> Text | None:
    """Why no set-up of the artefact, recorded as it was, shows an error; ``None`` where one may."""
    if effect.shape:
        return say("positions that lie closer than the period would show this")
    lacks = [name for name in effect.columns if name not in calibrated.points.columns]
    if not lacks:
        return None
    shown_by = (text for begin, text in _SHOWN_BY if lacks[0].startswith(begin))
    return next(shown_by, say("another artefact may show this"))


def _asked(calibrated: Job, names: Iterable[str]) -> list[str]:
    return list(dict.fromkeys([*calibrated.facts.model.effects, *names]))


def _plan(calibrated: Job, wanted: Sequence[Effect]) -> MeasurementPlan | None:
    facts = calibrated.facts
    wishes = {"criterion": "separation", "more": SET_UPS, "number": None, "candidates": CANDIDATES}
    model = facts.model.model_copy(update={"effects": _asked(calibrated, (one.name for one in wanted))})
    changed = facts.model_copy(update={"model": model, "plan": facts.plan.model_copy(update=wishes)})
    try:
        return make_plan(replace(calibrated, facts=changed), power=False) if wanted else None
    except CmmUqError:  # no room for further set-ups
        return None


def _found_by(plan: MeasurementPlan, wanted: Sequence[Effect]) -> tuple[str, ...]:
    """Errors that are then no longer left free: each parameter known to half of what physics allows."""
    if plan.better is None or plan.better.identifiability is None:
        return ()
    seen: dict[str, bool] = {}
    for one in plan.better.identifiability.parameters:
        name = one.unknown.key[0]
        seen[name] = seen.get(name, True) and one.u_with_prior <= FREE * one.unknown.prior_sd
    return tuple(one.name for one in wanted if seen.get(one.name, False))


def _setups(plan: MeasurementPlan | None, found: Sequence[str]) -> Text:
    if plan is None or not found:
        return NOTHING
    ends = semicolons(say("{ends} mm", ends=placing.ends) for placing in plan.to_measure)
    return plural(
        len(plan.to_measure),
        one=say("One further set-up of the artefact shows {effects}: in scale readings at {ends}.",
                effects=commas(titles(found)), ends=ends),
        many=say("{count} further set-ups of the artefact show {effects}: in scale readings at {ends}.",
                 count=len(plan.to_measure), effects=commas(titles(found)), ends=ends),
    )  # fmt: skip


def _missed(calibrated: Job, missed: Sequence[str]) -> Text:
    if not missed:
        return NOTHING
    told: dict[Text, list[str]] = {}
    for name in missed:
        may = say("an artefact of calibrated length would show this") if every()[name] in SCALE.values() else None
        how = _why_not(calibrated, every()[name]) or may or say("another artefact, or more set-ups, may show this")
        told.setdefault(how, []).append(name)
    each = (say("{title} ({how})", title=commas(titles(names)), how=how) for how, names in told.items())
    return say("Set-ups of the artefact as it was recorded do not show: {effects}.", effects=semicolons(each))


def _files(calibrated: Job, found: Sequence[str]) -> dict[str, bytes]:
    """The calibration's job with these errors in its model, to be planned and then measured."""
    tables = tomllib.loads(calibrated.inputs["job.toml"].decode("utf-8-sig"))
    tables["job"]["id"] = f"{tables['job']['id']}-{FOLDER}"[:100]
    tables["model"] = {**tables.get("model", {}), "effects": _asked(calibrated, found)}
    plan = {key: value for key, value in tables.get("plan", {}).items() if key != "number"}
    tables["plan"] = {**plan, "criterion": "separation", "more": SET_UPS}
    others = {f"{FOLDER}/{name}": content for name, content in calibrated.inputs.items() if name != "job.toml"}
    return {f"{FOLDER}/job.toml": as_toml(tables, f"{FOLDER}/job.toml"), **others}
