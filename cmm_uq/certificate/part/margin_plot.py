"""Every characteristic against its limits, a row each: where its value lies between them, and its 95 % interval."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cmm_uq.base.messages import Text, number, say
from cmm_uq.certificate.document import Outcome, Plot
from cmm_uq.certificate.plots.labels import NAMES_MM, told_apart
from cmm_uq.certificate.plots.style import (
    ACCENT,
    BAD,
    BAND,
    INK,
    MUTED,
    OPEN,
    RULE,
    dots,
    drawn,
    house_style,
    new_figure,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FARTHEST = 0.45
"""Of the distance of the limits, how far the picture goes beyond either."""

_TIMES = 2.0
"""A single limit stands so many intervals from where its picture ends, or as far as the value needs."""

A_PAGE = 40
"""Rows of one picture."""


@dataclass(frozen=True)
class Margin:
    """One characteristic.

    Parameters
    ----------
    name : of it.
    value : measured, in any unit; the middle of what is allowed where nothing was measured.
    interval : of the value, same unit.
    lower, upper : limits, same unit; ``None`` where there is none. At least one is there.
    outcome : of the decision; ``None`` where nothing was measured.
    accepted : least and largest value that the rule accepts; ``None`` where it accepts none or is not known.
    """

    name: Text
    value: float
    interval: tuple[float, float]
    lower: float | None
    upper: float | None
    outcome: Outcome | None
    accepted: tuple[float | None, float | None] | None = None

    @property
    def scale(self) -> tuple[float, float]:
        """Where the row has 0, and how much is 1 of it."""
        if self.lower is not None and self.upper is not None:
            return self.lower, self.upper - self.lower
        spread = _TIMES * (self.interval[1] - self.interval[0])
        if self.upper is not None:
            width = max(spread, 1.3 * (self.upper - self.interval[0])) or 1.0
            return self.upper - width, width
        lower = self.lower or 0.0
        return lower, max(spread, 1.3 * (self.interval[1] - lower)) or 1.0

    def of(self, value: float) -> float:
        """A value between the limits, 0 … 1."""
        zero, one = self.scale
        return (value - zero) / one


_COLOURS = {"pass": ACCENT, "conditional pass": ACCENT, "fail": BAD, "conditional fail": BAD}
_RULED = (0.0, 1.0)


def margin_plots(rows: Sequence[Margin]) -> list[Plot]:
    """The rows in order, forty a picture; none without rows."""
    parts = [rows[i : i + A_PAGE] for i in range(0, len(rows), A_PAGE)]
    return [margin_plot(part, _number(i, len(parts))) for i, part in enumerate(parts)]


def _number(place: int, count: int) -> tuple[int, int] | None:
    return (place + 1, count) if count > 1 else None


def margin_plot(rows: Sequence[Margin], part: tuple[int, int] | None = None) -> Plot:
    """One picture.

    Parameters
    ----------
    part : which of how many, where there are several.
    """
    height = 17.0 + 5.2 * len(rows)
    measured = any(row.outcome is not None for row in rows)
    with house_style():
        figure = new_figure(height)
        ax = figure.subplots()
        figure.subplots_adjust(left=0.34, right=0.985, bottom=12 / height, top=1 - 1.5 / height)
        for place, row in enumerate(rows):
            _band(ax, place, row)
            _interval(ax, place, row)
        ax.set_yticks(np.arange(len(rows)), told_apart([row.name for row in rows], NAMES_MM))
        ax.set_xticks([0.0, 0.5, 1.0], [say("lower limit"), say("middle"), say("upper limit")])
        ax.set(xlim=(-_FARTHEST, 1 + _FARTHEST), ylim=(len(rows) - 0.4, -0.6))
        ax.tick_params(left=False)
        ax.spines["left"].set_visible(False)
        ax.set_xlabel(
            say("full dot: conforms, cross: does not, hollow dot: undecided; dark: what is accepted")
            if measured
            else say("bar: 95 % interval about the middle, since nothing was measured; dark: what is accepted"),
            loc="right",  # towards the names: in some languages it is longer than the axis
        )
        caption = (
            say("The characteristics between their limits, with their 95 % intervals.")
            if measured
            else say("How much of the tolerance the uncertainty takes.")
        )
        if part:
            caption = say("{caption} Part {number} of {count}.", caption=caption, number=part[0], count=part[1])
        return drawn(figure, caption, _told(rows, measured=measured))


def _told(rows: Sequence[Margin], *, measured: bool) -> Text:
    if not measured:
        share = max((row.interval[1] - row.interval[0]) / row.scale[1] for row in rows)
        return say("{count} characteristics; the 95 % interval takes up to {share} % of what is allowed.",
                   count=len(rows), share=number(100 * share, ".0f"))  # fmt: skip
    inside = sum(row.outcome in ("pass", "conditional pass") for row in rows)
    out = sum(row.outcome in ("fail", "conditional fail") for row in rows)
    return say("{count} characteristics against their limits: {inside} conform, {out} do not, {rest} are undecided.",
               count=len(rows), inside=inside, out=out, rest=len(rows) - inside - out)  # fmt: skip


def _band(ax: Axes, place: int, row: Margin) -> None:
    """What is allowed, what the rule accepts, and the limits that there are."""
    ends = (0.0 if row.lower is not None else -_FARTHEST, 1.0 if row.upper is not None else 1 + _FARTHEST)
    ax.barh(place, ends[1] - ends[0], 0.72, left=ends[0], color=BAND, lw=0, alpha=0.55, zorder=0)
    if row.accepted is not None:
        low, high = (end if given is None else row.of(given) for given, end in zip(row.accepted, ends, strict=True))
        ax.barh(place, max(high - low, 0.0), 0.72, left=low, color=BAND, lw=0, zorder=1)
    for limit, at in zip((row.lower, row.upper), _RULED, strict=True):
        if limit is not None:
            ax.plot([at, at], [place - 0.36, place + 0.36], color=MUTED, lw=1.0, zorder=2)
    ax.axhline(place + 0.5, color=RULE, lw=0.3, zorder=0)


def _interval(ax: Axes, place: int, row: Margin) -> None:
    reach = -_FARTHEST, 1 + _FARTHEST
    low, high, at = (float(np.clip(row.of(value), *reach)) for value in (*row.interval, row.value))
    colour = MUTED if row.outcome is None else _COLOURS.get(row.outcome, OPEN)
    ax.plot([low, high], [place, place], color=colour, lw=1.8, solid_capstyle="butt", zorder=3)
    if row.outcome is not None and _COLOURS.get(row.outcome) == BAD:
        ax.plot([at], [place], ls="", marker="x", ms=5.5, mec=colour, mew=1.6, zorder=5)
    elif row.outcome is not None:
        dots(ax, np.array([at]), np.array([float(place)]), 4.6, colour, hollow=colour == OPEN, zorder=5)
    if not reach[0] <= row.of(row.value) <= reach[1]:
        side = 1 if at > 0.5 else -1
        text = say("{times} times the tolerance", times=number(row.of(row.value), ".1f"))
        ax.annotate(text, (at, place), (-7 * side, 0), textcoords="offset points", ha="right" if side > 0 else "left",
                    va="center", color=INK, fontsize=6.5, zorder=6,
                    bbox={"facecolor": "white", "alpha": 0.8, "lw": 0, "pad": 0.5})  # fmt: skip
