"""The history of a machine: its values over time, on a page, on the terminal and as data."""

from __future__ import annotations

import datetime as dt
from calendar import isleap
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from cmm_uq.base import messages
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, commas, day, holding, number, plural, say, semicolons
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import unit_as_written
from cmm_uq.certificate import document as doc
from cmm_uq.certificate.origin import attributes
from cmm_uq.certificate.pages.doubt import doubt_data, doubt_section, part_data, parts_section
from cmm_uq.certificate.plots.style import ACCENT, BAD, BAND, INK, MUTED, bars, dots, drawn, note, picture
from cmm_uq.certificate.wording import OUTCOME_WORDS
from cmm_uq.jobs.verdicts import BEYOND, NONE
from cmm_uq.laboratory.due.drift import HORIZON, PARTS
from cmm_uq.laboratory.due.history import MachineHistory, ValueHistory, epochs
from cmm_uq.maths.uncertainty.quantity import limit_in_full, rounded

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from cmm_uq.laboratory.due.steps import DatedStep
    from cmm_uq.laboratory.records.facts import Series

SCHEMA = "cmm-uq/history/1"
COVERAGE = 2.0  # factor of every expanded uncertainty here: 95 %, as of a normal distribution

HEADINGS: tuple[Text, ...] = (
    say("Quantity"), say("Last value"), say("U"), say("Unit"), say("Change"), say("U of the change"), say("Trend per year"),
    say("U of the trend"), say("Limit"), say("Crosses its limit"),
)  # fmt: skip
WORDS = {say("Quantity"), say("Unit"), say("Crosses its limit")}  # headings of columns that hold no figures

STEPS_NOTE = say(
    "A step is one that the drift model finds more probable than not between two recordings, beside what the machine drifts, "
    "settles, follows the seasons and wanders: a collision, a move, an adjustment that nobody recorded. Its ± has k = 2."
)

STATE_WORDS: Mapping[str, Text] = {
    "draft": say("draft"), "released": say("released"), "withdrawn": say("withdrawn"), "replaced": say("replaced"),
}  # fmt: skip


def value_row(history: MachineHistory, one: ValueHistory) -> tuple[Text, ...]:
    series = one.series
    change: Text = DASH
    expanded: Text = DASH
    trend = (DASH, DASH) if one.line is None else rounded(one.line.slope, COVERAGE * one.line.u_slope)
    if one.change is not None:
        change, expanded = rounded(one.change.value, COVERAGE * one.change.u)
        if one.adjusted:
            change = say("{value} adjusted", value=change)
        elif history.significant(one):
            change = say("{value} significant", value=change)
    return (
        Verbatim(series.quantity), *rounded(float(series.value[-1]), COVERAGE * float(series.u[-1])),
        unit_as_written(series.unit), change, expanded, *trend,
        DASH if series.limit is None else limit_in_full(series.limit), meets(one, history.on),
    )  # fmt: skip


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


def step_words(one: ValueHistory, step: DatedStep) -> Text:
    size, expanded = rounded(step.size, COVERAGE * step.u)
    return say(
        "after a change of {size} ± {u} {unit} between {after} and {by} (probability {percent} %)", size=size, u=expanded,
        unit=unit_as_written(one.series.unit), after=_date(step.after), by=_date(step.by),
        percent=number(min(100 * step.probability, 99), ".0f"),
    )  # fmt: skip


def _date(ordinal: int) -> Text:
    return day(dt.date.fromordinal(ordinal))


def step_notes(history: MachineHistory) -> tuple[Text, ...]:
    """Steps of all values, a sentence each, and which certificates they put in doubt."""
    found: list[Text] = []
    for one, step in [(value, step) for value in history.values for step in value.steps]:
        name, doubtful = Verbatim(one.series.quantity), history.in_doubt(one, step)
        found.append(say("{name}: {change}.", name=name, change=step_words(one, step)))
        if doubtful:
            names = commas(Verbatim(certificate.number or certificate.job) for certificate in doubtful)
            words = say(
                "In doubt for what was measured after {day}: {certificates}.", day=_date(step.after), certificates=names
            )
            found[-1] = messages.sentences([found[-1], words])
    return tuple(found)


def model_note(history: MachineHistory) -> Text:
    learnt = {one.prior is not None for one in history.values if one.series.limit is not None}
    model = say("the drift model with its fleet") if True in learnt else say("the drift model without a fleet")
    if len(learnt) == 2:
        model = say("the drift model, with its fleet where that has the value")
    return say(
        "The day on which a limit is crossed is by {model} (about: with a probability of 50 %; not "
        "before: 5 %; by: 95 %; never: later than {horizon} years), not by the straight line.",
        model=model,
        horizon=number(HORIZON, "g"),
    )


def terminal_note(history: MachineHistory) -> Text:
    factor, foreseen = say("Every ± has k = 2."), any(one.crossing and not one.beyond for one in history.values)
    return say("{factor} {model}", factor=factor, model=model_note(history)) if foreseen else factor


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
        "machine": attributes(machine, "serial", "name", "manufacturer", "model", "place") | {
            "adjusted": [one.isoformat() for one in machine.adjusted],
        },
        "decision": history.decision,
        "remarks": [str.__str__(text) for text in history.remarks],
        **({"in_doubt": doubt_data(history)} if history.doubtful else {}),
        **({"parts": list(map(part_data, history.parts))} if history.parts else {}),
        "certificates": [
            {**attributes(one, "entry", "job", "number"), "date": one.day.isoformat(),
             **attributes(one, "state", "decision", "diagnosis", "interim", "artefact"),
             "adjusted_since": None if one.adjusted_since is None else one.adjusted_since.isoformat()}
            for one in history.certificates
        ],
        "values": {one.series.name: _value_data(history, one) for one in history.values},
    }  # fmt: skip


def recorded_rows(series: Series) -> Iterator[dict[str, Any]]:
    """What each certificate and interim check states of one value, by day."""
    columns = (series.day, series.value, series.u, series.u_artefact, series.artefact, series.entry, series.interim)
    for ordinal, value, u, common, artefact, entry, interim in zip(*columns, strict=True):
        yield {
            "date": dt.date.fromordinal(int(ordinal)), "value": float(value), "u": float(u), "u_artefact": float(common),
            "artefact": str(artefact), "entry": int(entry), "interim": bool(interim),
        }  # fmt: skip


def _value_data(history: MachineHistory, one: ValueHistory) -> dict[str, Any]:
    series, change, line, crossing = one.series, one.change, one.line, one.crossing
    return {
        **attributes(series, "quantity", "unit", "limit"), "beyond_limit": one.beyond, "outcome": one.outcome or None,
        "recorded": [{**row, "date": row["date"].isoformat()} for row in recorded_rows(series)],
        "change": None if change is None else {
            "value": change.value, "u": change.u, "p": change.chance, "adjusted_between": one.adjusted,
            "significant": history.significant(one),
        },
        "trend": None if line is None else {
            "date": dt.date.fromordinal(line.day).isoformat(), "value": line.value, "per_year": line.slope,
            "u_per_year": line.u_slope, "count": line.count, "birge_ratio": line.excess,
        },
        "steps": [
            {"after": dt.date.fromordinal(step.after).isoformat(), "by": dt.date.fromordinal(step.by).isoformat(),
             **attributes(step, "probability", "size", "u"),
             "in_doubt": [certificate.entry for certificate in history.in_doubt(one, step)]}
            for step in one.steps
        ],
        "crosses_limit": crossing and {"model": "drift", "fleet": one.prior is not None, **crossing.data()},
    }  # fmt: skip


_AHEAD = 2.0  # years after the last recording that are shown at least, where there is a trend


def trend_plot(history: MachineHistory, one: ValueHistory) -> doc.Plot:
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
        for step in one.steps:
            ax.axvspan(*_years(np.array([step.after, step.by])), color=BAND, lw=0, zorder=0)
        if series.limit is None:
            ax.margins(y=0.1)
        else:
            for side in (1.0, -1.0):
                ax.axhline(side * series.limit, color=BAD, lw=1.0, ls=(0, (4, 3)), zorder=2)
            top = 1.12 * max(series.limit, float(np.abs(np.concatenate([y - U, y + U])).max()))
            ax.set_ylim(-top, top)
        ax.set(xlabel=say("Year"), ylabel=Verbatim(series.unit), xlim=(left, right))
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        ax.ticklabel_format(axis="x", useOffset=False, style="plain")
        ax.grid(axis="y")
        note(figure, semicolons(holding(
            (True, say("bars: U (k = 2)")), (series.limit is not None, say("dashed: limits")),
            (one.line is not None, say("line: straight trend with its U")), (adjusted, say("dotted: adjusted")),
            (check.any(), say("hollow: interim checks")), (one.steps, say("shaded: a step")),
        )))  # fmt: skip
        return drawn(figure, say("{name} over time.", name=Verbatim(series.quantity)), _told(history, one), "trend")


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


def _told(history: MachineHistory, one: ValueHistory) -> Text:
    series = one.series
    first, last = (rounded(float(series.value[i]), COVERAGE * float(series.u[i]))[0] for i in (0, -1))
    what = say(
        "{name}: {count} recordings, from {first} to {last} {unit}", name=Verbatim(series.quantity), count=len(series.day),
        first=first, last=last, unit=Verbatim(series.unit),
    )  # fmt: skip
    if series.limit is not None:
        limit = limit_in_full(series.limit)
        what = say("{what}; limit {limit}: {meets}", what=what, limit=limit, meets=meets(one, history.on))
    return say("{what}.", what=commas([what, *(step_words(one, step) for step in one.steps)]))


def history_document(history: MachineHistory) -> doc.Document:
    machine = history.machine
    checks = sum(one.interim for one in history.certificates)
    count = len(history.certificates) - checks
    counted: Text = plural(count, one=say("one certificate"), many=say("{count} certificates", count=count))
    if checks:
        more = plural(checks, one=say("one interim check"), many=say("{count} interim checks", count=checks))
        counted = say("{certificates}, {checks}", certificates=counted, checks=more)
    serial, manufacturer = Verbatim("" if machine.by_name else machine.serial), Verbatim(machine.manufacturer)
    particulars = doc.facts(
        (say("Machine"), Verbatim(machine.name)), (say("Serial number"), serial), (say("Manufacturer"), manufacturer),
        (say("Model"), Verbatim(machine.model)), (say("Place"), Verbatim(machine.place)), (say("Recordings"), counted),
        (say("Adjusted"), commas(day(when) for when in machine.adjusted)),
    )  # fmt: skip
    heads = tuple(doc.Column(heading, numeric=heading not in WORDS) for heading in HEADINGS)
    rows, steps = [value_row(history, one) for one in history.values], step_notes(history)
    values = doc.table(say("Error factors and figures of performance"), heads, rows, *notes(history))
    sections = (
        doubt_section(history),
        doc.section(say("Values and trends"), values or doc.Paragraph(say("No value of this machine is recorded."))),
        doc.section(say("Steps"), *map(doc.Paragraph, steps), *([doc.Paragraph(STEPS_NOTE)] if steps else ())),
        doc.section(say("Over time"), *(trend_plot(history, one) for one in history.values)),
        doc.section(say("Certificates and interim checks"), _certificates(history)),
        parts_section(history),
    )
    subject = say("{name}, up to {on}", name=Verbatim(machine.name), on=day(history.on))
    return doc.program_page(
        say("History of a machine"), Verbatim(machine.serial), subject, (one for one in sections if one.blocks),
        "history.json", particulars=(particulars,), warnings=history.remarks, end=say("End of history"),
        overview=overview_of(history),
    )  # fmt: skip


def overview_of(history: MachineHistory) -> doc.Overview:
    beyond, probable, changed = (
        [Verbatim(one.series.quantity) for one in history.values if holds(one)]
        for holds in (lambda one: one.beyond, lambda one: one.probably_beyond(history.on), history.significant)
    )
    last = history.decision
    doubt = [one.found for one in history.doubtful if one.until is None]
    fails, open_ = bool(beyond) or last in BEYOND, last not in (*BEYOND, "pass", NONE)
    doubtful = open_ or probable or changed or not history.values
    standing: doc.Standing = "bad" if fails or doubt else "open" if doubtful else "good"
    verdict, *_ = holding(
        (not history.values, say("Nothing is recorded yet")), (fails, say("Beyond its limits")), (doubt, say("In doubt")),
        (open_, say("Its last certificate does not state that it conforms")),
        (probable, say("Probably beyond a limit by now")), (changed, say("Changed since the last time")),
        (True, say("No change that stands out")),
    )  # fmt: skip
    ahead = ((one.crossing.quantile(0.5), one) for one in history.values if one.crossing is not None and not one.beyond)
    known = sorted(((when, one) for when, one in ahead if when is not None), key=lambda pair: pair[0])
    first = [say("{name}: {when}", name=Verbatim(v.series.quantity), when=meets(v, history.on)) for _, v in known[:1]]
    return doc.Overview(verdict, standing, doc.facts(
        (say("Last decision"), OUTCOME_WORDS.get(last, Verbatim(last)) if last != NONE else NOTHING),
        (say("In doubt"), semicolons(commas([Verbatim(one.number or one.job), day(one.day)]) for one in doubt)),
        (say("Beyond a limit"), commas(beyond)), (say("Changed significantly"), commas(changed)),
        (say("First to cross its limit"), commas(first)),
    ).rows)  # fmt: skip


def _certificates(history: MachineHistory) -> doc.Table | None:
    adjusted = say("Adjusted before")
    heads = (say("Date"), say("No."), say("What"), say("State"), say("Artefact"), say("Decision"), adjusted)
    rows = (
        (
            day(one.day), Verbatim(one.number), say("interim check") if one.interim else say("certificate"),
            STATE_WORDS.get(one.state, Verbatim(one.state)), Verbatim(one.artefact) if one.artefact else DASH,
            OUTCOME_WORDS.get(one.decision, DASH), DASH if one.adjusted_since is None else day(one.adjusted_since),
        )
        for one in reversed(history.certificates)
    )  # fmt: skip
    return doc.table(say("Newest first"), heads, rows)
