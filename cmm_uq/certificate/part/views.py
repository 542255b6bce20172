"""A part as it is seen: from above, from the front, from the side and obliquely, four panels to one scale.

The first three are placed as on a drawing: what stands below the view from above is its front, with the same x, and beside
that its side, with the same z. Axes are those of the part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cmm_uq.analysis.parts.outlines import outline
from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import Floats
from cmm_uq.certificate.plots.plans import DEPTH
from cmm_uq.certificate.plots.style import INK, MUTED, TINY, WIDTH_MM, lettered, new_figure, width_mm

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

AXES = (say("x / mm"), say("y / mm"), say("z / mm"))
# mm: beside the left panels, right of the others, above, between the rows besides what stands under each, between columns
_LEFT, _RIGHT, _TOP, _GAP, _UNDER, _BETWEEN = 13.0, 2.0, 5.0, 8.0, 9.5, 14.0
_HIGHEST = 118.0  # mm that both rows may take together
# least span of a part that is drawn, mm, and of a panel, of the largest span: its axis must find room
_SMALLEST, _NARROWEST = 10.0, 0.16
_OUTLINE = "#a9b4ba"


@dataclass(frozen=True, eq=False)
class View:
    """One of them."""

    name: Text  # of the view, above its panel
    matrix: Floats  # (2, 3) from the part to the panel
    axes: tuple[int, int] | None  # numbers of the axes that it shows along x and y; none of the oblique one

    @property
    def along(self) -> Floats:
        """(3,) direction along which one looks."""
        found = np.cross(self.matrix[0], self.matrix[1])
        return np.asarray(found / np.linalg.norm(found))

    def of(self, points: Floats) -> Floats:
        """Points (…, 3) in the panel (…, 2)."""
        return np.asarray(points @ self.matrix.T)

    def spread(self, covariance: Floats) -> Floats:
        """Covariances (…, 3, 3) in the panel (…, 2, 2)."""
        return np.asarray(self.matrix @ covariance @ self.matrix.T)


ABOVE = View(say("From above"), np.array([[1.0, 0, 0], [0, 1.0, 0]]), (0, 1))
OBLIQUE = View(say("Obliquely"), np.array([[1.0, DEPTH[0], 0], [0, DEPTH[1], 1.0]]), None)
FRONT = View(say("From the front"), np.array([[1.0, 0, 0], [0, 0, 1.0]]), (0, 2))
SIDE = View(say("From the right"), np.array([[0, 1.0, 0], [0, 0, 1.0]]), (1, 2))
VIEWS = (ABOVE, OBLIQUE, FRONT, SIDE)


def panels(points: Floats, room: float, note_mm: float) -> tuple[Figure, list[tuple[View, Axes]]]:
    """A figure with the four views.

    ``points``: (n, 3) all that is to be seen.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    corners = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T
    largest = max(float((high - low).max()), _SMALLEST)
    seen = [view.of(corners) for view in VIEWS]
    spans = [np.maximum(np.ptp(each, axis=0) + 2 * room * largest, _NARROWEST * largest) for each in seen]
    lows = [0.5 * (each.min(axis=0) + each.max(axis=0) - span) for each, span in zip(seen, spans, strict=True)]
    columns = [max(float(spans[i][0]), float(spans[i + 2][0])) for i in (0, 1)]
    rows = [max(float(spans[i][1]), float(spans[i + 1][1])) for i in (0, 2)]
    width = WIDTH_MM - _LEFT - _RIGHT - _BETWEEN
    scale = min(width / sum(columns), _HIGHEST / sum(rows))
    tall = [scale * each for each in rows]
    height = _TOP + tall[0] + _GAP + _UNDER + tall[1] + _UNDER + note_mm
    figure = new_figure(height)
    second = min(_LEFT + max(scale * columns[0], 0.5 * width) + _BETWEEN, WIDTH_MM - _RIGHT - scale * columns[1])
    bottoms = (height - _TOP - tall[0], note_mm + _UNDER)
    found = []
    for i, view in enumerate(VIEWS):
        left, bottom = (_LEFT, second)[i % 2], bottoms[i // 2]
        across, up = scale * spans[i]
        base = bottom + tall[i // 2] - up if i < 2 else bottom  # panels of the upper row hang, those of the lower stand
        ax = figure.add_axes((left / WIDTH_MM, base / height, across / WIDTH_MM, up / height))
        ax.set(xlim=(lows[i][0], lows[i][0] + spans[i][0]), ylim=(lows[i][1], lows[i][1] + spans[i][1]))
        _lettered(ax, view, float(across), float(up))
        found.append((view, ax))
    return figure, found


def _lettered(ax: Axes, view: View, across_mm: float, up_mm: float) -> None:
    ax.set_title(view.name, loc="left", fontsize=8, color=INK, fontweight="bold", pad=3)
    if view.axes is None:
        ax.axis("off")
        return
    from matplotlib.ticker import MaxNLocator

    ax.xaxis.set_major_locator(MaxNLocator(int(np.clip(across_mm / 14, 1, 6)), min_n_ticks=1))
    ax.yaxis.set_major_locator(MaxNLocator(int(np.clip(up_mm / 8, 1, 6)), min_n_ticks=1))
    ax.set_xlabel(AXES[view.axes[0]], labelpad=1, fontsize=TINY)
    ax.set_ylabel(AXES[view.axes[1]], labelpad=2, fontsize=TINY)
    ax.tick_params(labelsize=TINY)


def span_of(plan: Plan) -> float:
    """The largest extent of a part's points, mm, or what it is drawn as if it is less."""
    return max(float(np.ptp(plan.points, axis=0).max()), _SMALLEST)


def draw_outlines(ax: Axes, view: View, plan: Plan) -> None:
    """Every feature as a thin line, all as one path."""
    lines = [line for feature in plan.features for line in outline(feature, view.along)]
    if lines:
        joined = np.vstack([part for line in lines for part in (view.of(line), [[np.nan, np.nan]])])
        ax.plot(joined[:, 0], joined[:, 1], lw=0.8, color=_OUTLINE, zorder=1)


def segments(ax: Axes, start: Floats, end: Floats, colour: str, width: float, zorder: float = 3) -> None:
    """Lines from (n, 2) to (n, 2), as one path."""
    gaps = np.full((len(start), 1), np.nan)
    across, up = (np.hstack([start[:, i : i + 1], end[:, i : i + 1], gaps]).ravel() for i in (0, 1))
    ax.plot(across, up, lw=width, color=colour, solid_capstyle="round", zorder=zorder)


# mm from its anchor where a label is tried, in this order
_PLACES = ((0, 1.6), (1.6, 0), (0, -1.6), (-1.6, 0), (1.3, 1.3), (-1.3, 1.3), (1.3, -1.3), (-1.3, -1.3), (0, 0))
_LETTER_MM = 2.7


def label(ax: Axes, anchors: Floats, names: Sequence[Text], across_mm: float) -> list[Text]:
    """Names beside their anchors (n, 2), those that find room; which they are."""
    (x0, x1), (y0, y1) = ax.get_xlim(), ax.get_ylim()
    scale, taken, found = across_mm / (x1 - x0), list[tuple[float, float, float, float]](), list[Text]()
    wide, high = across_mm, scale * (y1 - y0)
    for anchor, name in zip((anchors - [x0, y0]) * scale, names, strict=True):
        size = width_mm(lettered(name), TINY, "bold") + 0.8, _LETTER_MM
        for dx, dy in _PLACES:
            left = anchor[0] + dx + (0 if dx > 0 else -size[0] if dx < 0 else -0.5 * size[0])
            low = anchor[1] + dy + (0 if dy > 0 else -size[1] if dy < 0 else -0.5 * size[1])
            box = (left, low, left + size[0], low + size[1])
            if left < 0 or low < 0 or box[2] > wide or box[3] > high or any(_meet(box, other) for other in taken):
                continue
            taken.append(box)
            found.append(name)
            at = x0 + (left + 0.5 * size[0]) / scale, y0 + (low + 0.5 * size[1]) / scale
            ax.text(*at, name, fontsize=TINY, color=MUTED, fontweight="bold", ha="center", va="center", zorder=6,
                    bbox={"facecolor": "white", "alpha": 0.7, "lw": 0, "pad": 0.3})  # fmt: skip
            break
    return found


def _meet(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]
