"""Positions of an artefact in the measured volume, and what further ones gain."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from cmm_uq.analysis.planning.set_up import SetUp
from cmm_uq.base.messages import Text, number, say, semicolons
from cmm_uq.base.points import AXES, Floats
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.plots import style
from cmm_uq.certificate.plots.style import ACCENT, INK, MUTED, RULE, SMALL, TINY, WIDTH_MM, folded, width_mm

if TYPE_CHECKING:
    from matplotlib.axes import Axes

A_ROW = 3  # pictures side by side
DEPTH = 0.5 * np.array([np.cos(np.radians(38.0)), np.sin(np.radians(38.0))])  # how the y axis runs into the picture
_REACH, _BELOW = 0.04, 0.064
"""Distance of the axes' names from the frame, and of that of X below it, in parts of the travel of X."""

_LABEL_MM = 1.7  # half the height of a name, with some room
_ROOM_MM = WIDTH_MM * (1 / A_ROW - 0.05)
_TEXT_MM = 15.0


def placing_pictures(placings: Sequence[SetUp], box: Floats, first: int) -> list[Plot]:
    """Set-ups in the machine's volume, (3, 2) scale readings in mm, seen from the front, three in a row."""
    rows = [placings[i : i + A_ROW] for i in range(0, len(placings), A_ROW)]
    return [_row(row, box, first + A_ROW * i) for i, row in enumerate(rows)]


def _row(placings: Sequence[SetUp], box: Floats, first: int) -> Plot:
    corners = _seen(np.array(list(product(*box))))
    low, high = corners.min(axis=0), corners.max(axis=0)
    span = 1.22 * (high - low)
    width = WIDTH_MM / A_ROW
    below = _BELOW * float(np.ptp(box[0])) + _LABEL_MM * float(span[0]) / width
    span[1] = max(span[1], high[1] - low[1] + 2 * below)  # the name of X needs more room than a share of a low volume
    height = min(width * float(span[1] / span[0]), 75.0) + _TEXT_MM
    with style.house_style():
        figure = style.new_figure(height)
        for i, placing in enumerate(placings):
            ax = figure.add_axes((i / A_ROW, 0.0, 1 / A_ROW, 1 - _TEXT_MM / height))
            _draw(ax, placing, box)
            middle = 0.5 * (low + high)
            ax.set(xlim=middle[0] + np.array([-0.5, 0.5]) * span[0], ylim=middle[1] + np.array([-0.5, 0.5]) * span[1])
            ax.set_aspect("equal")
            ax.axis("off")
            left = i / A_ROW + 0.008
            figure.text(left, 1 - 4.5 / height, f"{first + i}", fontsize=10, color=ACCENT, fontweight="bold")
            lines = _title(placing.title)
            size = min(map(_size, lines))
            for line, below in zip(lines, (4.5,) if len(lines) == 1 else (3.6, 6.4), strict=True):
                figure.text(left + 0.035, 1 - below / height, line, fontsize=size, color=INK, fontweight="bold")
            figure.text(left, 1 - 9.5 / height, placing.ends, fontsize=TINY, color=MUTED)
        last, numbers = first + len(placings) - 1, say("Placing {first}", first=first)
        if last > first:
            numbers = say("Placings {first} to {last}", first=first, last=last)
        told = say(
            "{numbers}: scale readings in mm; ○ is the first point, dashed lines drop to the table.", numbers=numbers
        )
        words = [say("{first}: {title}, {ends} mm", first=first + i, title=p.title, ends=p.ends)
                 for i, p in enumerate(placings)]  # fmt: skip
        return style.drawn(figure, told, semicolons(words))


def _seen(xyz: Floats) -> Floats:
    """Points (n, 3) as drawn (n, 2): x to the right, z up, y into the picture."""
    return np.asarray(xyz[:, [0, 2]] + xyz[:, 1:2] * DEPTH)


def _draw(ax: Axes, placing: SetUp, box: Floats) -> None:
    _frame(ax, box)
    readings = placing.points.machine_xyz[placing.points.repeat == placing.points.repeat.min()]
    floor = readings.copy()
    floor[:, 2] = box[2, 0]
    outline = _outline(readings)
    _line(ax, floor[outline], RULE, 2.0)
    for row in outline[:-1] if len(outline) > 2 else outline:
        _line(ax, np.vstack([readings[row], floor[row]]), MUTED, 0.5, dashed=True)
    _line(ax, readings[outline], ACCENT, 1.6)
    seen = _seen(readings)
    style.dots(ax, seen[:, 0], seen[:, 1], 4.6 if len(readings) <= 3 else 2.2, ACCENT, zorder=5)
    style.dots(ax, seen[:1, 0], seen[:1, 1], 6.0, ACCENT, hollow=True, zorder=6)


def _frame(ax: Axes, box: Floats) -> None:
    """Edges of the volume, those behind lighter, and the names of the axes."""
    x, y, z = box
    floor = np.array([[x[i], y[j], z[0]] for i, j in ((0, 0), (1, 0), (1, 1), (0, 1), (0, 0))])
    polygon = _seen(floor)
    ax.fill(polygon[:, 0], polygon[:, 1], color="#f4f7f8", zorder=0)
    _line(ax, floor, MUTED, 0.6)
    _line(ax, floor + np.array([0.0, 0.0, z[1] - z[0]]), RULE, 0.6)
    for i in range(4):
        _line(ax, np.vstack([floor[i], floor[i] + [0.0, 0.0, z[1] - z[0]]]), RULE, 0.6)
    reach = _REACH * (x[1] - x[0])
    at = _seen(np.array([[x.mean(), y[0], z[0]], [x[1], y.mean(), z[0]], [x[0], y[0], z.mean()]]))
    for (across, up), name, shift in zip(at, AXES, ((0.0, -_BELOW / _REACH), (1.4, -1.0), (-1.4, 0.0)), strict=True):
        ax.text(across + shift[0] * reach, up + shift[1] * reach, name.upper(), fontsize=TINY, color=MUTED, ha="center",
                va="center")  # fmt: skip


def _outline(readings: Floats) -> list[int]:
    """Rows to join: along a line from end to end, about a surface through its outermost points."""
    if len(readings) == 1:
        return [0, 0]
    about = readings - readings.mean(axis=0)
    _, size, axes = np.linalg.svd(about, full_matrices=False)
    if len(size) < 2 or size[1] < 1e-3 * size[0]:
        along = about @ axes[0]
        return [int(np.argmin(along)), int(np.argmax(along))]
    from scipy.spatial import ConvexHull

    hull = [int(row) for row in ConvexHull(about @ axes[:2].T).vertices]
    return [*hull, hull[0]]


def _line(ax: Axes, xyz: Floats, colour: str, width: float, *, dashed: bool = False) -> None:
    ax.plot(*_seen(xyz).T, lw=width, color=colour, ls=(0, (3, 2)) if dashed else "-", zorder=2)


def gain_plot(
    labels: Sequence[Text], before: Sequence[float | None], after: Sequence[float | None], *, names: tuple[Text, Text],
    quantity: Text,
) -> Plot:  # fmt: skip
    """Before and after, smaller is better, over the larger of the two; ``None``, infinite, stands at the right edge."""
    pairs = np.array(
        [[np.inf if v is None or not np.isfinite(v) else v for v in series] for series in (before, after)]
    ).T
    largest = np.where(np.isfinite(pairs), pairs, 0.0).max(axis=1)
    ratio = pairs / np.where(largest > 0, largest, 1.0)[:, None]
    shown = np.where(np.isfinite(ratio), ratio, 1.3)
    height, never = 20.0 + 5.2 * len(labels), say("not at all")
    with style.picture(height, left=0.36, right=0.98, bottom=11 / height, top=1 - 8 / height) as (figure, ax):
        y = np.arange(len(labels), dtype=np.float64)[::-1]
        for i, row in enumerate(y):
            ax.plot(shown[i], [row, row], color=RULE, lw=2.2, solid_capstyle="butt", zorder=1)
        style.dots(ax, shown[:, 0], y, 5.0, MUTED, hollow=True)
        style.dots(ax, shown[:, 1], y, 5.0, ACCENT, zorder=4)
        ax.set_yticks(y, labels)
        ax.set(xlim=(0.0, _edge(never)), ylim=(-0.7, len(labels) - 0.3))
        ax.set_xticks([0, 0.25, 0.5, 0.75, 1.0, 1.3], ["0", "¼", "½", "¾", "1", never])
        ax.grid(axis="x")
        ax.set_xlabel(say("{quantity}, over the larger of the two", quantity=quantity))
        figure.text(0.36, 1 - 4.5 / height, say("○ {plan}", plan=names[0]), color=MUTED, fontsize=8)
        figure.text(0.66, 1 - 4.5 / height, say("● {plan}", plan=names[1]), color=ACCENT, fontsize=8, fontweight="bold")
        words = semicolons(
            say("{label}: {before} before, {after} after", label=label, before=_figure(a), after=_figure(b))
            for label, a, b in zip(labels, before, after, strict=True)
        )
        both = say("{quantity} with {one} and with {other}.", quantity=quantity, one=names[0], other=names[1])
        return style.drawn(figure, both, words)


def _title(title: Text) -> list[Text]:
    """In two lines where one would have to be of smaller letters than are used anywhere."""
    return [title] if _size(title) >= TINY else folded(title, _ROOM_MM, TINY, "bold")


def _size(title: Text) -> float:
    """Of the letters of a placing's title, smaller where it is longer than its picture is wide."""
    return SMALL * min(1.0, _ROOM_MM / width_mm(style.lettered(title), SMALL, "bold"))


def _edge(last: Text) -> float:
    """Right end of the axis, so that the text of its last tick, at 1.3, has room."""
    axis, beside = 0.62 * WIDTH_MM, width_mm(style.lettered(last), SMALL) / 2 - 0.02 * WIDTH_MM
    return max(1.38, 1.3 * axis / (axis - beside))


def _figure(value: float | None) -> Text:
    return say("not at all") if value is None or not np.isfinite(value) else number(value, ".2g")
