"""The history of a machine: its values over time, on a page, on the terminal and as data."""

from __future__ import annotations

import datetime as dt
from calendar import isleap
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from cmm_uq import __version__
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, commas, day, number, plural, say, semicolons
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import unit_as_written
from cmm_uq.certificate.document import (
    Block,
    Column,
    Document,
    Facts,
    Overview,
    Paragraph,
    Plot,
    Section,
    Standing,
    Table,
    text_columns,
)
from cmm_uq.certificate.plots.style import ACCENT, BAD, BAND, INK, MUTED, bars, dots, drawn, note, picture
from cmm_uq.certificate.wording import OUTCOME_WORDS
from cmm_uq.jobs.verdicts import BEYOND, NONE
from cmm_uq.laboratory.due.drift import HORIZON, PARTS
from cmm_uq.laboratory.due.history import MachineHistory, ValueHistory, epochs
from cmm_uq.maths.uncertainty.quantity import limit_in_full, rounded

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SCHEMA = "cmm-uq/history/1"
COVERAGE = 2.0  # factor of every expanded uncertainty here: 95 %, as of a normal distribution

HEADINGS: tuple[Text, ...] = (
    say("Quantity"), say("Last value"), say("U"), say("Unit"), say("Change"), say("U of the change"), say("Trend per year"),
    say("U of the trend"), say("Limit"), say("Crosses its limit"),
)  # fmt: skip
WORDS = {say("Quantity"), say("Unit"), say("Crosses its limit")}  # headings of columns that hold no figures

STATE_WORDS: Mapping[str, Text] = {
    "draft": say("draft"), "released": say("released"), "withdrawn": say("withdrawn"), "replaced": say("replaced"),
}  # fmt: skip


def value_row(history: MachineHistory, one: ValueHistory) -> tuple[Text, ...]:
    series = one.series
    value, expanded = rounded(float(series.value[-1]), COVERAGE * float(series.u[-1]))
    limit = DASH if series.limit is None else limit_in_full(series.limit)
    trend = (DASH, DASH) if one.line is None else rounded(one.line.slope, COVERAGE * one.line.u_slope)
    return (
        Verbatim(series.quantity), value, expanded, unit_as_written(series.unit), *_change(history, one), *trend, limit,
        meets(one, history.on),
    )  # fmt: skip


def _change(history: MachineHistory, one: ValueHistory) -> tuple[Text, Text]:
    if one.change is None:
        return DASH, DASH
    value, expanded = rounded(one.change.value, COVERAGE * one.change.u)
    if one.adjusted:
        return say("{value} adjusted", value=value), expanded
    return (say("{value} significant", value=value) if history.significant(one) else value), expanded


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


_AHEAD = 2.0  # years after the last recording that are shown at least, where there is a trend


def trend_plot(history: MachineHistory, one: ValueHistory) -> Plot:
    from matplotlib.ticker import MaxNLocator

    series = one.series
    x, y, U = _years(series.day), series.value, COVERAGE * series.u
    with picture(52, left=0.09, right=0.985, bottom=0.16, top=0.88) as (figure, ax):
        ax.axhline(0, color=INK, lw=0.5, zorder=1)
        right = _line(ax, one, float(x[-1]))
        for rows in epochs(series):
            ax.plot(x[rows], y[rows], color=MUTED, lw=0.6, zorder=2)
        bars(ax, x, y - U, y + U, 0.9, ACCENT)
        check = np.asarray(series.interim, dtype=bool)
        dots(ax, x[~check], y[~check], 3.6, ACCENT, zorder=3)
        dots(ax, x[check], y[check], 3.6, ACCENT, hollow=True, zorder=3)
        left = float(x[0]) - 0.04 * (right - float(x[0])) - 0.05
        since = series.adjusted_since
        adjusted = [when for when in _years(np.unique(since[since > 0])) if when > left]
        for when in adjusted:
            ax.axvline(when, color=MUTED, lw=0.9, ls=(0, (1, 2)), zorder=1)
        _limit(ax, series.limit, float(np.abs(np.concatenate([y - U, y + U])).max()))
        ax.set(xlabel=say("Year"), ylabel=Verbatim(series.unit), xlim=(left, right))
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        ax.ticklabel_format(axis="x", useOffset=False, style="plain")
        ax.grid(axis="y")
        note(figure, _legend(one, adjusted=bool(adjusted), checked=bool(check.any())))
        return drawn(figure, say("{name} over time.", name=Verbatim(series.quantity)), _told(history, one))


def _years(day: Floats | Ints) -> Floats:
    dates = [dt.date.fromordinal(int(one)) for one in day]
    return np.array([one.year + (one.timetuple().tm_yday - 1) / (365 + isleap(one.year)) for one in dates])


def _line(ax: Axes, one: ValueHistory, last: float) -> float:
    """The line with its band, and how far to the right it is shown."""
    if one.line is None:
        return last + 0.5
    series, line = one.series, one.line
    first = int(series.day[epochs(series)[-1]][0])
    middle = one.crossing.quantile(0.5) if one.crossing is not None else None
    ahead = middle.toordinal() - line.day if middle is not None else 0
    end = line.day + int(max(_AHEAD * 365.25, min(ahead + 180, 3 * (line.day - first))))
    days = np.linspace(first, end, 60)
    value, u = line.at(days)
    x = _years(days)
    ax.fill_between(x, value - COVERAGE * u, value + COVERAGE * u, color=BAND, lw=0, zorder=0)
    ax.plot(x, value, color=ACCENT, lw=1.0, zorder=2)
    return float(x[-1])


def _limit(ax: Axes, limit: float | None, largest: float) -> None:
    """Limits as lines, the lower one only where values are near it; without any the values fill the picture."""
    if limit is None:
        ax.margins(y=0.1)
        return
    for side in (1.0, -1.0):
        ax.axhline(side * limit, color=BAD, lw=1.0, ls=(0, (4, 3)), zorder=2)
    top = 1.12 * max(limit, largest)
    ax.set_ylim(-top, top)


def _legend(one: ValueHistory, *, adjusted: bool, checked: bool) -> Text:
    parts = [
        say("bars: U (k = 2)"),
        say("dashed: limits") if one.series.limit is not None else NOTHING,
        say("line: straight trend with its U") if one.line is not None else NOTHING,
        say("dotted: adjusted") if adjusted else NOTHING,
        say("hollow: interim checks") if checked else NOTHING,
    ]
    return semicolons([part for part in parts if part])


def _told(history: MachineHistory, one: ValueHistory) -> Text:
    series = one.series
    first, last = (rounded(float(series.value[i]), COVERAGE * float(series.u[i]))[0] for i in (0, -1))
    what = say(
        "{name}: {count} recordings, from {first} to {last} {unit}", name=Verbatim(series.quantity), count=len(series.day),
        first=first, last=last, unit=Verbatim(series.unit),
    )  # fmt: skip
    if series.limit is None:
        return say("{what}.", what=what)
    limit = limit_in_full(series.limit)
    return say("{what}; limit {limit}: {meets}.", what=what, limit=limit, meets=meets(one, history.on))


def history_document(history: MachineHistory) -> Document:
    machine = history.machine
    sections = (
        Section(say("Values and trends"), _values(history)),
        Section(say("Over time"), tuple(trend_plot(history, one) for one in history.values)),
        Section(say("Certificates and interim checks"), _certificates(history)),
    )
    return Document(
        title=say("History of a machine"),
        number=Verbatim(machine.serial),
        subject=say("{name}, up to {on}", name=Verbatim(machine.name), on=day(history.on)),
        particulars=(Facts(_particulars(history)),),
        warnings=history.remarks,
        sections=tuple(section for section in sections if section.blocks),
        attachments=(Verbatim("history.json"),),
        produced_by=say("cmm-uq {version}", version=Verbatim(__version__)),
        end=say("End of history"),
        overview=overview_of(history),
    )


def overview_of(history: MachineHistory) -> Overview:
    """Whether anything is beyond its limit, and what changed."""
    beyond = [Verbatim(one.series.quantity) for one in history.values if one.beyond]
    probable = [Verbatim(one.series.quantity) for one in history.values if one.probably_beyond(history.on)]
    changed = [Verbatim(one.series.quantity) for one in history.values if history.significant(one)]
    last = history.decision
    fails, open_ = bool(beyond) or last in BEYOND, last not in (*BEYOND, "pass", NONE)
    standing: Standing = "bad" if fails else "open" if open_ or probable or changed or not history.values else "good"
    verdicts = (
        (not history.values, say("Nothing is recorded yet")), (fails, say("Beyond its limits")),
        (open_, say("Its last certificate does not state that it conforms")),
        (bool(probable), say("Probably beyond a limit by now")), (bool(changed), say("Changed since the last time")),
    )  # fmt: skip
    verdict = next((text for holds, text in verdicts if holds), say("No change that stands out"))
    rows: list[tuple[Text, Text]] = []
    if last != NONE:
        rows.append((say("Last decision"), OUTCOME_WORDS.get(last, Verbatim(last))))
    if beyond:
        rows.append((say("Beyond a limit"), commas(beyond)))
    if changed:
        rows.append((say("Changed significantly"), commas(changed)))
    nearest = min(
        (
            (day, i) for i, one in enumerate(history.values)
            if one.crossing is not None and not one.beyond and (day := one.crossing.quantile(0.5)) is not None
        ), default=None,
    )  # fmt: skip
    if nearest is not None:
        first = history.values[nearest[1]]
        rows.append((say("First to cross its limit"), say(
            "{name}: {when}", name=Verbatim(first.series.quantity), when=meets(first, history.on),
        )))  # fmt: skip
    return Overview(verdict, standing, tuple(rows))


def _particulars(history: MachineHistory) -> tuple[tuple[Text, Text], ...]:
    machine = history.machine
    said = (
        (say("Machine"), machine.name), (say("Serial number"), "" if machine.by_name else machine.serial),
        (say("Manufacturer"), machine.manufacturer), (say("Model"), machine.model), (say("Place"), machine.place),
    )  # fmt: skip
    rows: list[tuple[Text, Text]] = [(label, Verbatim(text)) for label, text in said if text]
    rows.append((say("Recordings"), _counted(history)))
    if machine.adjusted:
        rows.append((say("Adjusted"), commas([day(one) for one in machine.adjusted])))
    return tuple(rows)


def _counted(history: MachineHistory) -> Text:
    checks = sum(one.interim for one in history.certificates)
    count = len(history.certificates) - checks
    told = plural(count, one=say("one certificate"), many=say("{count} certificates", count=count))
    if not checks:
        return told
    more = plural(checks, one=say("one interim check"), many=say("{count} interim checks", count=checks))
    return say("{certificates}, {checks}", certificates=told, checks=more)


def _values(history: MachineHistory) -> tuple[Block, ...]:
    if not history.values:
        return (Paragraph(say("No value of this machine is recorded.")),)
    columns = tuple(Column(heading, numeric=heading not in WORDS) for heading in HEADINGS)
    rows = tuple(value_row(history, one) for one in history.values)
    return (Table(say("Error factors and figures of performance"), columns, rows, notes(history)),)


def _certificates(history: MachineHistory) -> tuple[Block, ...]:
    if not history.certificates:
        return ()
    columns = text_columns(say("Date"), say("Number"), say("What"), say("State"), say("Artefact"), say("Decision"),
                           say("Adjusted before"))  # fmt: skip
    rows = tuple(
        (
            day(one.day), Verbatim(one.number), say("interim check") if one.interim else say("certificate"),
            STATE_WORDS.get(one.state, Verbatim(one.state)), Verbatim(one.artefact) if one.artefact else DASH,
            OUTCOME_WORDS.get(one.decision, DASH), DASH if one.adjusted_since is None else day(one.adjusted_since),
        )
        for one in reversed(history.certificates)
    )  # fmt: skip
    return (Table(say("Newest first"), columns, rows),)
