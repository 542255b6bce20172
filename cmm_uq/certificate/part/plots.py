"""Every characteristic against its limits, a row each: where its value lies between them, and its 95 % interval.

What the uncertainty of every characteristic is made of: a bar each, parted by cause.

Correlations between many characteristics, as a picture: a dot for each two, larger where they hang together more.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from cmm_uq.base.messages import DASH, Text, Verbatim, commas, number, say, semicolons, signed
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass
from cmm_uq.certificate.document import Column, Outcome, Paragraph, Plot, Section, section, table
from cmm_uq.certificate.part.figures import figures_of
from cmm_uq.certificate.part.measurement import PartMeasurement
from cmm_uq.certificate.plots import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_FARTHEST = 0.45  # of the distance of the limits, how far the picture goes beyond either
_TIMES = 2.0  # A single limit stands so many intervals from where its picture ends, or as far as the value needs
A_PAGE = 40  # rows of one picture


@dataclass(frozen=True)
class Margin:
    name: Text
    value: float  # measured, in any unit; the middle of what is allowed where nothing was measured
    interval: tuple[float, float]  # of the value, same unit
    # lower, upper: limits, same unit; ``None`` where there is none. At least one is there.
    lower: float | None
    upper: float | None
    outcome: Outcome | None  # of the decision; ``None`` where nothing was measured
    # least and largest value that the rule accepts; ``None`` where it accepts none or is not known
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


_COLOURS = {"pass": style.ACCENT, "conditional pass": style.ACCENT, "fail": style.BAD, "conditional fail": style.BAD}


def margin_plots(rows: Sequence[Margin]) -> list[Plot]:
    """The rows in order, forty a picture; none without rows."""
    parts = [rows[i : i + A_PAGE] for i in range(0, len(rows), A_PAGE)]
    return [margin_plot(part, (i, len(parts)) if len(parts) > 1 else None) for i, part in enumerate(parts, 1)]


def margin_plot(rows: Sequence[Margin], part: tuple[int, int] | None = None) -> Plot:
    height, count = 17.0 + 5.2 * len(rows), len(rows)
    means = say("bar: 95 % interval about the middle, since nothing was measured; dark: what is accepted")
    caption: Text = say("How much of the tolerance the uncertainty takes.")
    share = max((row.interval[1] - row.interval[0]) / row.scale[1] for row in rows)
    told = say("{count} characteristics; the 95 % interval takes up to {share} % of what is allowed.", count=count,
               share=number(100 * share, ".0f"))  # fmt: skip
    if any(row.outcome is not None for row in rows):
        means = say("full dot: conforms, cross: does not, hollow dot: undecided; dark: what is accepted")
        caption = say("The characteristics between their limits, with their 95 % intervals.")
        inside = sum(row.outcome in ("pass", "conditional pass") for row in rows)
        out = sum(row.outcome in ("fail", "conditional fail") for row in rows)
        told = say("{count} characteristics against their limits: {inside} conform, {out} do not, {rest} are undecided.",
                   count=count, inside=inside, out=out, rest=count - inside - out)  # fmt: skip
    if part:
        caption = say("{caption} Part {number} of {count}.", caption=caption, number=part[0], count=part[1])
    with style.picture(height, left=0.34, right=0.985, bottom=12 / height, top=1 - 1.5 / height) as (figure, ax):
        for place, row in enumerate(rows):
            _band(ax, place, row)
            _interval(ax, place, row)
        style.named_rows(ax, np.arange(len(rows)), told_apart([row.name for row in rows], style.NAMES_MM))
        ax.set_xticks([0.0, 0.5, 1.0], [say("lower limit"), say("middle"), say("upper limit")])
        ax.set(xlim=(-_FARTHEST, 1 + _FARTHEST), ylim=(len(rows) - 0.4, -0.6))
        ax.set_xlabel(means, loc="right")  # towards the names: in some languages it is longer than the axis
        return style.drawn(figure, caption, told, "limits")


def _band(ax: Axes, place: int, row: Margin) -> None:
    """What is allowed, what the rule accepts, and the limits that there are."""
    ends = (0.0 if row.lower is not None else -_FARTHEST, 1.0 if row.upper is not None else 1 + _FARTHEST)
    ax.barh(place, ends[1] - ends[0], 0.72, left=ends[0], color=style.BAND, lw=0, alpha=0.55, zorder=0)
    if row.accepted is not None:
        low, high = (end if given is None else row.of(given) for given, end in zip(row.accepted, ends, strict=True))
        ax.barh(place, max(high - low, 0.0), 0.72, left=low, color=style.BAND, lw=0, zorder=1)
    for limit, at in zip((row.lower, row.upper), (0.0, 1.0), strict=True):
        if limit is not None:
            ax.plot([at, at], [place - 0.36, place + 0.36], color=style.MUTED, lw=1.0, zorder=2)
    ax.axhline(place + 0.5, color=style.RULE, lw=0.3, zorder=0)


def _interval(ax: Axes, place: int, row: Margin) -> None:
    reach = -_FARTHEST, 1 + _FARTHEST
    low, high, at = (float(np.clip(row.of(value), *reach)) for value in (*row.interval, row.value))
    colour = style.MUTED if row.outcome is None else _COLOURS.get(row.outcome, style.OPEN)
    ax.plot([low, high], [place, place], color=colour, lw=1.8, solid_capstyle="butt", zorder=3)
    if row.outcome is not None and _COLOURS.get(row.outcome) == style.BAD:
        ax.plot([at], [place], ls="", marker="x", ms=5.5, mec=colour, mew=1.6, zorder=5)
    elif row.outcome is not None:
        style.dots(ax, np.array([at]), np.array([float(place)]), 4.6, colour, hollow=colour == style.OPEN, zorder=5)
    if not reach[0] <= row.of(row.value) <= reach[1]:
        side = 1 if at > 0.5 else -1
        text = say("{times} times the tolerance", times=number(row.of(row.value), ".1f"))
        ax.annotate(text, (at, place), (-7 * side, 0), textcoords="offset points", ha="right" if side > 0 else "left",
                    va="center", color=style.INK, fontsize=6.5, zorder=6,
                    bbox={"facecolor": "white", "alpha": 0.8, "lw": 0, "pad": 0.5})  # fmt: skip


def told_apart(names: Sequence[Text], room_mm: float) -> list[Text]:
    """Names cut to their room; where the beginnings of two are the same, each with its end in place of its beginning."""
    short = [style.narrowed(name, room_mm) for name in names]
    again = list(map(str, short))
    return [
        _ending(name, room_mm) if again.count(text) > 1 and text != str(name) else beginning
        for name, beginning, text in zip(names, short, again, strict=True)
    ]


def _ending(text: Text, room_mm: float) -> Text:
    """The longest end of a text that has room, with what says that it began before."""
    whole = str.__str__(style.lettered(text))
    ends = ("…" + whole[i:].lstrip(" ,") for i in range(1, len(whole)))
    return Verbatim(next(end for end in ends if style.width_mm(end, style.SMALL) <= room_mm))


# neighbours differ in lightness, so that they can be told apart without colour
_SHADES = ("#0b5c7a", "#86b1c2", "#a84e08", "#e0b48a", "#5a666e", "#c3ccd0", "#3f86a0", "#cc7f3c")
_DARK = ("#0b5c7a", "#a84e08", "#5a666e")
_LEAST = 0.07  # share from which on a figure has room in its part
_LEFT_MM, _RIGHT_MM, _ROW_MM = 58.0, 2.5, 5.2


def shares_plots(names: Sequence[Text], causes: Sequence[Text], shares: Floats) -> list[Plot]:
    """The bars in order, forty a picture.

    ``names``: (c,) of the characteristics. ``causes``: (g,) in words. ``shares``: (g, c) of each, which add up to 1, or to 0
    of one that has no uncertainty.
    """
    starts = range(0, len(names), A_PAGE)
    return [_bars(names[i : i + A_PAGE], causes, shares[:, i : i + A_PAGE]) for i in starts]


def _bars(names: Sequence[Text], causes: Sequence[Text], shares: Floats) -> Plot:
    rows = np.arange(len(names))
    with style.house_style():
        lines = _legend_lines(causes)
        height = 4.6 * len(lines) + 2.0 + _ROW_MM * len(names) + 3.0
        figure = style.new_figure(height)
        ax = figure.add_axes((_LEFT_MM / style.WIDTH_MM, 1.5 / height, 1 - (_LEFT_MM + _RIGHT_MM) / style.WIDTH_MM,
                              _ROW_MM * len(names) / height))  # fmt: skip
        before = np.zeros(len(names))
        for g in range(len(causes)):
            shade = _SHADES[g % len(_SHADES)]
            ax.barh(rows, shares[g], 0.7, left=before, color=shade, edgecolor="white", lw=0.6)
            for row in np.flatnonzero(shares[g] >= _LEAST).tolist():
                ax.text(before[row] + 0.5 * shares[g, row], row, number(100 * shares[g, row], ".0f"), fontsize=style.TINY,
                        color="white" if shade in _DARK else style.INK, ha="center", va="center_baseline")  # fmt: skip
            before = before + shares[g]
        style.named_rows(ax, rows, told_apart(names, style.NAMES_MM))
        ax.set(xlim=(0, 1), ylim=(len(names) - 0.4, -0.6), xticks=[])
        ax.spines["bottom"].set_visible(False)
        for line, members in enumerate(lines):
            y = 1 - (2.6 + 4.6 * line) / height
            for g, left in members:
                figure.text(left / style.WIDTH_MM, y, "■", fontsize=8, color=_SHADES[g % len(_SHADES)], va="center")
                figure.text((left + 3.6) / style.WIDTH_MM, y, causes[g], fontsize=style.TINY, va="center")
        largest = [[int(g) for g in np.argsort(-own, kind="stable")[:3] if own[g] > 0] for own in shares.T]
        told = semicolons(
            say("{name}: {shares}", name=name, shares=commas(
                say("{what:small} {share} %", what=causes[g], share=number(100 * shares[g, i], ".0f")) for g in largest[i]
            ))
            for i, name in enumerate(names)
        )  # fmt: skip
        caption = say("What the variance of each characteristic is made of, %, by cause: total shares over their sum.")
        return style.drawn(figure, caption, told, "budget")


def _legend_lines(causes: Sequence[Text]) -> list[list[tuple[int, float]]]:
    """Causes in lines, with where each begins, mm."""
    lines, left = [list[tuple[int, float]]()], 1.0
    for g, cause in enumerate(causes):
        width = 9.0 + style.width_mm(style.lettered(cause), style.TINY)
        if lines[-1] and left + width > style.WIDTH_MM:
            lines.append([])
            left = 1.0
        lines[-1].append((g, left))
        left += width
    return lines


_SIDE_MM, _LEAST_MM = 5.0, 2.2
LEAST = 0.1  # correlation from which on there is a dot
_CLASSES = 5


def correlation_plot(numbers: Sequence[Text], correlation: Floats) -> Plot:
    """The lower half of the matrix.

    ``numbers``: (c,) short names of the characteristics, two at least. ``correlation``: (c, c).
    """
    count = len(numbers)
    values = style.finite("correlation", correlation, (count, count))
    side = max(min(_SIDE_MM, (style.WIDTH_MM - 24.0) / count), _LEAST_MM)
    below, left = np.tril_indices(count, -1)
    sizes = values[below, left]
    with style.house_style():
        height = 11.0 + side * count
        figure = style.new_figure(height)
        edge = 0.5 * (style.WIDTH_MM - side * count)
        ax = figure.add_axes(
            (edge / style.WIDTH_MM, 9.0 / height, side * count / style.WIDTH_MM, side * count / height)
        )
        steps = np.ceil(np.abs(sizes) * _CLASSES)
        for step in range(1, _CLASSES + 1):
            for positive, colour in ((True, style.DIVERGING[-1]), (False, style.DIVERGING[0])):
                some = (steps == step) & (np.abs(sizes) >= LEAST) & ((sizes > 0) == positive)
                if some.any():
                    diameter = 0.92 * side * np.sqrt(step / _CLASSES) * 72 / 25.4
                    style.dots(ax, left[some], below[some], float(diameter), colour, hollow=not positive)
        ax.set(xlim=(-0.5, count - 0.5), ylim=(count - 0.5, -0.5))
        turned = 90 if side < 6.0 and any(len(name) > 2 for name in numbers) else 0
        ax.set_xticks(range(count), numbers, fontsize=style.TINY, rotation=turned)
        ax.set_yticks(range(count), numbers, fontsize=style.TINY)
        ax.tick_params(length=0, labelcolor=style.INK)
        ax.spines[["left", "bottom"]].set_color(style.RULE)
        most = int(np.abs(sizes).argmax())
        caption = say("Correlations between the characteristics, by their numbers: full dots positive, hollow dots negative, "
                      "the larger the stronger; those below {least:g} in size are left out.", least=LEAST)  # fmt: skip
        return style.drawn(figure, caption, say(
            "{count} of {all} correlations are {least:g} or larger in size; the largest, {r}, is between {one} and {other}.",
            count=int((np.abs(sizes) >= LEAST).sum()), all=len(sizes), least=LEAST, r=signed(float(sizes[most]), ".2f"),
            one=numbers[int(left[most])], other=numbers[int(below[most])],
        ), "correlation")  # fmt: skip


FEW = 8  # characteristics up to which their correlations are a table


def correlation_section(found: PartMeasurement) -> Section:
    """What characteristics have in common: a table of few, a picture of many; nothing of one."""
    every, title = figures_of(found), say("Correlations")
    if len(every) < 2:
        return section(title)
    told = Paragraph(
        say("Errors that several characteristics have in common make them correlated; what is computed from several of them "
            "needs this. results.json has all figures."), "note",
    )  # fmt: skip
    if len(every) > FEW:
        return section(title, told, correlation_plot([one.number for one in every], found.correlation))
    # of a matrix that is the same below and above its diagonal, the lower half
    lower = [[DASH if j > i else number(1) if j == i else signed(round(float(found.correlation[i, j]), 2) + 0.0, ".2f")
              for j in range(len(every))] for i in range(len(every))]  # fmt: skip
    rows = ((one.number, one.beside, *lower[one.place]) for one in every)
    numbers = (Column(say("No. {number}", number=one.number)) for one in every)
    heads: tuple[Text | Column, ...] = (Column(say("No.")), say("Characteristic"), *numbers)
    return section(title, told, table(say("Correlations between the characteristics"), heads, rows))
