"""The history of a machine in figures and words: what its page, the terminal and a file of data say alike."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from typing import Any

from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, day, number, say
from cmm_uq.base.units import unit_as_written
from cmm_uq.laboratory.due.drift import HORIZON, PARTS
from cmm_uq.laboratory.due.history import MachineHistory, ValueHistory
from cmm_uq.maths.uncertainty.rounding import limit_in_full, rounded

SCHEMA = "cmm-uq/history/1"

COVERAGE = 2.0
"""Factor of every expanded uncertainty here: 95 %, as of a normal distribution."""

HEADINGS: tuple[Text, ...] = (
    say("Quantity"), say("Last value"), say("U"), say("Unit"), say("Change"), say("U of the change"), say("Trend per year"),
    say("U of the trend"), say("Limit"), say("Crosses its limit"),
)  # fmt: skip
WORDS = {say("Quantity"), say("Unit"), say("Crosses its limit")}
"""Headings of columns that hold no figures."""

STATE_WORDS: Mapping[str, Text] = {
    "draft": say("draft"), "released": say("released"), "withdrawn": say("withdrawn"), "replaced": say("replaced"),
}  # fmt: skip


def value_row(history: MachineHistory, one: ValueHistory) -> tuple[Text, ...]:
    """A value under :data:`HEADINGS`; U has k = 2."""
    series = one.series
    value, expanded = rounded(float(series.value[-1]), COVERAGE * float(series.u[-1]))
    limit = DASH if series.limit is None else limit_in_full(series.limit)
    return (
        Verbatim(series.quantity), value, expanded, unit_as_written(series.unit), *_change(history, one), *_trend(one), limit,
        meets(one, history.on),
    )  # fmt: skip


def _change(history: MachineHistory, one: ValueHistory) -> tuple[Text, Text]:
    if one.change is None:
        return DASH, DASH
    value, expanded = rounded(one.change.value, COVERAGE * one.change.u)
    if one.adjusted:
        return say("{value} adjusted", value=value), expanded
    return (say("{value} significant", value=value) if history.significant(one) else value), expanded


def _trend(one: ValueHistory) -> tuple[Text, Text]:
    if one.line is None:
        return DASH, DASH
    return rounded(one.line.slope, COVERAGE * one.line.u_slope)


def meets(one: ValueHistory, on: dt.date) -> Text:
    """When a value crosses its limit, by the drift model."""
    if one.series.limit is None:
        return DASH
    if one.beyond:
        return say("is beyond it")
    if one.crossing is None:
        return say("cannot be foreseen")
    early, middle, late = map(one.crossing.quantile, PARTS)
    if early is None:
        return say("not within {horizon} years", horizon=number(HORIZON, "g"))
    begins = say("perhaps already") if early <= on else say("not before {early}", early=day(early))
    if middle is None:
        return say("{begins}, perhaps never", begins=begins)
    if middle <= on:
        return say("probably already")
    about = say("about {middle}", middle=day(middle))
    if late is None:
        return say("{about}, {begins}, perhaps never", about=about, begins=begins)
    return say("{about}, {begins}, by {late}", about=about, begins=begins, late=day(late))


def model_note(history: MachineHistory) -> Text:
    """Which model the days of crossing are of."""
    learnt = {one.prior is not None for one in history.values if one.series.limit is not None}
    model = say("the drift model without a fleet")
    if True in learnt:
        model = say("the drift model with its fleet")
        if False in learnt:
            model = say("the drift model, with its fleet where that has the value")
    return say(
        "The day on which a limit is crossed is by {model} (about: with a probability of 50 %; not "
        "before: 5 %; by: 95 %; never: later than {horizon} years), not by the straight line.",
        model=model, horizon=number(HORIZON, "g"),
    )  # fmt: skip


def terminal_note(history: MachineHistory) -> Text:
    """What the rows of a terminal mean, in one line."""
    factor = say("Every ± has k = 2.")
    if all(one.crossing is None or one.beyond for one in history.values):
        return factor
    return say("{factor} {model}", factor=factor, model=model_note(history))


def notes(history: MachineHistory) -> tuple[Text, ...]:
    """What the columns of a history mean."""
    return (
        say("U has a coverage factor of 2, for 95 %."),
        say(
            "A change is that since the recording before. What comes from the artefact is in both and does not count where it "
            "was the same one. It is called significant where, had nothing changed, chance would call any of them so "
            "once in twenty times."
        ),
        say("The trend is a straight line through the recordings since the last adjustment."),
        model_note(history),
    )


def summary_row(history: MachineHistory, one: ValueHistory) -> tuple[Text, ...]:
    """A value for a terminal: what, value, change, trend, limit."""
    name, value, expanded, unit, change, change_u, slope, slope_u, limit, met = value_row(history, one)
    changed = NOTHING if one.change is None else say("change {change} ± {u}", change=change, u=change_u)
    trend = NOTHING if one.line is None else say("{slope} ± {u} a year", slope=slope, u=slope_u)
    bound = NOTHING if one.series.limit is None else say("limit {limit}: {met}", limit=limit, met=met)
    return name, say("{value} ± {u} {unit}", value=value, u=expanded, unit=unit), changed, trend, bound


def history_data(history: MachineHistory) -> dict[str, Any]:
    """For other programs."""
    machine = history.machine
    return {
        "schema": SCHEMA,
        "on": history.on.isoformat(),
        "machine": {
            "serial": machine.serial, "name": machine.name, "manufacturer": machine.manufacturer, "model": machine.model,
            "place": machine.place, "adjusted": [one.isoformat() for one in machine.adjusted],
        },
        "decision": history.decision,
        "remarks": [str.__str__(text) for text in history.remarks],
        "certificates": [
            {"entry": one.entry, "job": one.job, "number": one.number, "date": one.day.isoformat(), "state": one.state,
             "decision": one.decision, "diagnosis": one.diagnosis, "interim": one.interim, "artefact": one.artefact,
             "adjusted_since": None if one.adjusted_since is None else one.adjusted_since.isoformat()}
            for one in history.certificates
        ],
        "values": {one.series.name: _value_data(history, one) for one in history.values},
    }  # fmt: skip


def _value_data(history: MachineHistory, one: ValueHistory) -> dict[str, Any]:
    series = one.series
    dates = [dt.date.fromordinal(int(ordinal)).isoformat() for ordinal in series.day]
    rows = zip(
        dates, series.value, series.u, series.u_artefact, series.artefact, series.entry, series.interim, strict=True
    )
    found: dict[str, Any] = {
        "quantity": series.quantity, "unit": series.unit, "limit": series.limit, "beyond_limit": one.beyond,
        "outcome": one.outcome or None,
        "recorded": [
            {"date": date, "value": float(value), "u": float(u), "u_artefact": float(common), "artefact": str(artefact),
             "entry": int(entry), "interim": bool(interim)}
            for date, value, u, common, artefact, entry, interim in rows
        ],
        "change": None, "trend": None, "crosses_limit": None,
    }  # fmt: skip
    if one.change is not None:
        found["change"] = {
            "value": one.change.value, "u": one.change.u, "p": one.change.chance, "adjusted_between": one.adjusted,
            "significant": history.significant(one),
        }  # fmt: skip
    if one.line is not None:
        found["trend"] = {
            "date": dt.date.fromordinal(one.line.day).isoformat(), "value": one.line.value, "per_year": one.line.slope,
            "u_per_year": one.line.u_slope, "count": one.line.count, "birge_ratio": one.line.excess,
        }  # fmt: skip
    if one.crossing is not None:
        found["crosses_limit"] = {"model": "drift", "fleet": one.prior is not None, **one.crossing.data()}
    return found
