"""A value of a machine over the years: its intervals, its limits, adjustments, and the line since the last one."""

from __future__ import annotations

import datetime as dt
from typing import TYPE_CHECKING

import numpy as np

from cmm_uq.base.messages import NOTHING, Text, Verbatim, say, semicolons
from cmm_uq.base.points import Floats, Ints
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.history_words import COVERAGE, meets
from cmm_uq.certificate.plot_style import (
    ACCENT,
    BAD,
    BAND,
    INK,
    MUTED,
    TINY,
    bars,
    dots,
    drawn,
    house_style,
    new_figure,
)
from cmm_uq.laboratory.due.history import MachineHistory, ValueHistory, epochs
from cmm_uq.laboratory.records.facts import Series
from cmm_uq.maths.uncertainty.rounding import limit_in_full, rounded

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_AHEAD = 2.0
"""Years after the last recording that are shown at least, where there is a trend."""


def trend_plot(history: MachineHistory, one: ValueHistory) -> Plot:
    """One value over time.

    Parameters
    ----------
    history : of the machine.
    one : of its values.
    """
    series = one.series
    x, y, U = _years(series.day), series.value, COVERAGE * series.u
    from matplotlib.ticker import MaxNLocator

    with house_style():
        figure = new_figure(52)
        ax = figure.subplots()
        figure.subplots_adjust(left=0.09, right=0.985, bottom=0.16, top=0.88)
        ax.axhline(0, color=INK, lw=0.5, zorder=1)
        right = _line(ax, one, float(x[-1]))
        for rows in epochs(series):
            ax.plot(x[rows], y[rows], color=MUTED, lw=0.6, zorder=2)
        bars(ax, x, y - U, y + U, 0.9, ACCENT)
        check = np.asarray(series.interim, dtype=bool)
        dots(ax, x[~check], y[~check], 3.6, ACCENT, zorder=3)
        dots(ax, x[check], y[check], 3.6, ACCENT, hollow=True, zorder=3)
        left = float(x[0]) - 0.04 * (right - float(x[0])) - 0.05
        adjusted = _adjustments(ax, series.adjusted_since, left)
        _limit(ax, series.limit, float(np.abs(np.concatenate([y - U, y + U])).max()))
        ax.set(xlabel=say("Year"), ylabel=_label(one), xlim=(left, right))
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        ax.ticklabel_format(axis="x", useOffset=False, style="plain")
        ax.grid(axis="y")
        figure.text(0.985, 0.975, _legend(one, adjusted=adjusted, checked=bool(check.any())), ha="right", va="top",
                    fontsize=TINY, color=MUTED)  # fmt: skip
        name = Verbatim(series.quantity)
        caption = say("{name} over time.", name=name)
        return drawn(figure, caption, _told(history, one))


def _years(day: Floats | Ints) -> Floats:
    """Ordinals as years with decimals."""
    dates = [dt.date.fromordinal(int(one)) for one in day]
    return np.array([one.year + (one.timetuple().tm_yday - 1) / (365 + _leap(one.year)) for one in dates])


def _leap(year: int) -> int:
    return int(year % 4 == 0 and (year % 100 != 0 or year % 400 == 0))


def _label(one: ValueHistory) -> Text:
    return Verbatim(one.series.unit)


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


def _adjustments(ax: Axes, since: Ints, left: float) -> bool:
    days = np.unique(since[since > 0])
    shown = [one for one in _years(days) if one > left]
    for one in shown:
        ax.axvline(one, color=MUTED, lw=0.9, ls=(0, (1, 2)), zorder=1)
    return bool(shown)


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


def _stated(series: Series, place: int) -> Text:
    """A value, to the digits of its U."""
    return rounded(float(series.value[place]), COVERAGE * float(series.u[place]))[0]


def _told(history: MachineHistory, one: ValueHistory) -> Text:
    """The picture in a sentence."""
    series = one.series
    what = say(
        "{name}: {count} recordings, from {first} to {last} {unit}", name=Verbatim(series.quantity), count=len(series.day),
        first=_stated(series, 0), last=_stated(series, -1), unit=Verbatim(series.unit),
    )  # fmt: skip
    if series.limit is None:
        return say("{what}.", what=what)
    return say(
        "{what}; limit {limit}: {meets}.", what=what, limit=limit_in_full(series.limit), meets=meets(one, history.on)
    )
