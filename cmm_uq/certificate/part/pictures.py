"""A part as it is seen from above, from the front, from the side and obliquely, four panels to one scale.

The first three are placed as on a drawing: what stands below the view from above is its front, with the same x, and beside
that its side, with the same z. Axes are those of the part. Drawn are its features with their points, normals and styli; errors
of its points, magnified: where each is expected to be found, and how surely; and what form was measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from cmm_uq.analysis.parts.budget import PointErrors
from cmm_uq.analysis.parts.plan import PartPose, Plan
from cmm_uq.analysis.parts.setup import outline
from cmm_uq.base.messages import NOTHING, Text, after, number, plural, say, sentences, signed
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE
from cmm_uq.base.values import dataclass
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.plots import style
from cmm_uq.certificate.plots.residuals import shown, told
from cmm_uq.certificate.plots.volume import DEPTH, arrows, scale_bar
from cmm_uq.maths.uncertainty.quantity import significant

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
    width = style.WIDTH_MM - _LEFT - _RIGHT - _BETWEEN
    scale = min(width / sum(columns), _HIGHEST / sum(rows))
    tall = [scale * each for each in rows]
    height = _TOP + tall[0] + _GAP + _UNDER + tall[1] + _UNDER + note_mm
    figure = style.new_figure(height)
    second = min(_LEFT + max(scale * columns[0], 0.5 * width) + _BETWEEN, style.WIDTH_MM - _RIGHT - scale * columns[1])
    bottoms = (height - _TOP - tall[0], note_mm + _UNDER)
    found = []
    for i, view in enumerate(VIEWS):
        left, bottom = (_LEFT, second)[i % 2], bottoms[i // 2]
        across, up = scale * spans[i]
        base = bottom + tall[i // 2] - up if i < 2 else bottom  # panels of the upper row hang, those of the lower stand
        ax = figure.add_axes((left / style.WIDTH_MM, base / height, across / style.WIDTH_MM, up / height))
        ax.set(xlim=(lows[i][0], lows[i][0] + spans[i][0]), ylim=(lows[i][1], lows[i][1] + spans[i][1]))
        _lettered(ax, view, float(across), float(up))
        found.append((view, ax))
    return figure, found


def _lettered(ax: Axes, view: View, across_mm: float, up_mm: float) -> None:
    ax.set_title(view.name, loc="left", fontsize=8, color=style.INK, fontweight="bold", pad=3)
    if view.axes is None:
        ax.axis("off")
        return
    from matplotlib.ticker import MaxNLocator

    ax.xaxis.set_major_locator(MaxNLocator(int(np.clip(across_mm / 14, 1, 6)), min_n_ticks=1))
    ax.yaxis.set_major_locator(MaxNLocator(int(np.clip(up_mm / 8, 1, 6)), min_n_ticks=1))
    ax.set_xlabel(AXES[view.axes[0]], labelpad=1, fontsize=style.TINY)
    ax.set_ylabel(AXES[view.axes[1]], labelpad=2, fontsize=style.TINY)
    ax.tick_params(labelsize=style.TINY)


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
    style.strokes(ax, start[:, 0], end[:, 0], start[:, 1], end[:, 1], lw=width, color=colour, solid_capstyle="round",
                  zorder=zorder)  # fmt: skip


# mm from its anchor where a label is tried, in this order
_PLACES = ((0, 1.6), (1.6, 0), (0, -1.6), (-1.6, 0), (1.3, 1.3), (-1.3, 1.3), (1.3, -1.3), (-1.3, -1.3), (0, 0))
_LETTER_MM = 2.7


def label(ax: Axes, anchors: Floats, names: Sequence[Text], across_mm: float) -> list[Text]:
    """Names beside their anchors (n, 2), those that find room; which they are."""
    (x0, x1), (y0, y1) = ax.get_xlim(), ax.get_ylim()
    scale, taken, found = across_mm / (x1 - x0), list[tuple[float, float, float, float]](), list[Text]()
    wide, high = across_mm, scale * (y1 - y0)
    for anchor, name in zip((anchors - [x0, y0]) * scale, names, strict=True):
        size = style.width_mm(style.lettered(name), style.TINY, "bold") + 0.8, _LETTER_MM
        for dx, dy in _PLACES:
            left = anchor[0] + dx + (0 if dx > 0 else -size[0] if dx < 0 else -0.5 * size[0])
            low = anchor[1] + dy + (0 if dy > 0 else -size[1] if dy < 0 else -0.5 * size[1])
            box = (left, low, left + size[0], low + size[1])
            if left < 0 or low < 0 or box[2] > wide or box[3] > high or any(
                box[0] < b[2] and b[0] < box[2] and box[1] < b[3] and b[1] < box[3] for b in taken
            ):  # fmt: skip
                continue
            taken.append(box)
            found.append(name)
            at = x0 + (left + 0.5 * size[0]) / scale, y0 + (low + 0.5 * size[1]) / scale
            ax.text(*at, name, fontsize=style.TINY, color=style.MUTED, fontweight="bold", ha="center", va="center", zorder=6,
                    bbox={"facecolor": "white", "alpha": 0.7, "lw": 0, "pad": 0.3})  # fmt: skip
            break
    return found


_NORMAL, _STEM = 0.05, 0.22  # of the largest span: how long a normal is drawn, and a stylus at most


def part_picture(plan: Plan, pose: PartPose, names: Sequence[Text]) -> Plot:
    points, normals = plan.points, plan.normals
    largest = span_of(plan)
    tips, roots = _stems(plan, pose, largest)
    rows = shown([points[:, 2]])
    everything = np.vstack([points, points + _NORMAL * largest * normals, tips, roots])
    count = plural(len(points), one=say("one point"), many=say("{count} points", count=len(points)))
    caption = told(
        after(
            say("The part as it is probed, {count}: dots are points with their normals.", count=count),
            say("Thick lines are styli.") if np.any(tips != roots) else NOTHING,
        ),
        len(rows),
        len(points),
    )
    with style.house_style():
        figure, seen = panels(everything, 0.05, 0.0)
        size = float(np.clip(30 / np.sqrt(len(rows)), 1.4, 3.4))
        for view, ax in seen:
            draw_outlines(ax, view, plan)
            at = view.of(points[rows])
            segments(ax, at, view.of(points[rows] + _NORMAL * largest * normals[rows]), style.ACCENT, 0.5)
            segments(ax, view.of(tips), view.of(roots), style.DIVERGING[-1], 1.1, 2)
            style.dots(ax, at[:, 0], at[:, 1], size, style.ACCENT, zorder=4)
            anchors = np.array([view.of(feature.points.mean(axis=0)) for feature in plan.features])
            label(ax, anchors, names, style.WIDTH_MM * ax.get_position().width)
        features = plural(
            len(plan.features), one=say("one feature"), many=say("{count} features", count=len(plan.features))
        )
        alternative = say(
            "The part from above, from the front, from the right and obliquely: {features} with {points}.",
            features=features,
            points=count,
        )
        return style.drawn(figure, caption, alternative, "part")


def _stems(plan: Plan, pose: PartPose, largest: float) -> tuple[Floats, Floats]:
    """(f, 3) of each feature: the tip's centre at its first point, and where the stylus is cut off."""
    tips, roots, styli = [], [], {one.name: one for one in plan.styli}
    for feature in plan.features:
        stylus = styli[feature.stylus]
        up = -pose.back(np.asarray(stylus.offset_mm, dtype=np.float64))
        length = float(np.linalg.norm(up))
        tips.append(feature.points[0] + 0.5 * stylus.diameter_mm * feature.normals[0])
        roots.append(tips[-1] + up * min(1.0, _STEM * largest / length) if length else tips[-1])
    return np.array(tips), np.array(roots)


_LONGEST = 0.13  # of the largest span, the largest error as it is drawn
_STEPS = 20
_SEEN = 0.02  # of the longest, an arrow that can be seen as one
MOST = 150  # ellipses in one view: more run into each other


def errors_picture(plan: Plan, errors: PointErrors) -> Plot:
    """The expected error of each point as an arrow, its standard uncertainty as an ellipse about the arrow's end."""
    mean, covariance = errors.mean / MICROMETRE, errors.covariance / MICROMETRE**2
    u = np.sqrt(np.linalg.eigvalsh(covariance)[:, -1].clip(0))
    size = np.linalg.norm(mean, axis=1)
    longest = float((size + u).max(initial=0.0)) or 1.0
    rows = shown([size + u], most=MOST)
    factor = _LONGEST * span_of(plan) / longest  # mm drawn for one µm
    times = number(float(f"{factor / MICROMETRE:.2g}"), "g")
    ends = plan.points + factor * mean
    with style.house_style():
        figure, seen = panels(_all(plan, ends, factor * u), 0.04, 6.0)
        for view, ax in seen:
            draw_outlines(ax, view, plan)
            at, tips = view.of(plan.points[rows]), view.of(ends[rows])
            _ellipses(ax, tips, factor**2 * view.spread(covariance[rows]))
            long = size[rows] > _SEEN * longest
            if long.any():
                arrows(ax, at[long], (tips - at)[long], style.DIVERGING[-1], units="dots", width=1.4, headwidth=4,
                             headlength=5, headaxislength=4.5, zorder=4)  # fmt: skip
            style.dots(ax, at[:, 0], at[:, 1], 1.6, style.MUTED, zorder=2)
        scale_bar(figure, seen[0][1], 13.0, 2.6, factor, longest, style.INK)
        caption = told(
            sentences((
                say("Errors of the points as they are expected: arrows are mean errors, ellipses their standard uncertainty, "
                    "both magnified {times} times.", times=times),
                say("A shift and a turn that all points have in common show in no result and are left out."),
            )),
            len(rows), len(plan.points),
        )  # fmt: skip
        alternative = say(
            "The part in four views with errors of its points: mean errors of up to {mean} µm, standard "
            "uncertainties of up to {u} µm.",
            mean=significant(float(size.max(initial=0.0))),
            u=significant(float(u.max(initial=0.0))),
        )
        return style.drawn(figure, caption, alternative, "errors")


def form_picture(plan: Plan, deviations: Floats) -> Plot:
    """Deviations (n,) of the measured points from their associated features along the normals, mm, magnified.

    Points of features that their number alone determines deviate by ``nan`` and are not drawn.
    """
    there = np.flatnonzero(np.isfinite(deviations))
    sizes = deviations[there] / MICROMETRE
    longest = float(np.abs(sizes).max(initial=0.0)) or 1.0
    rows = shown([sizes])
    factor = _LONGEST * span_of(plan) / longest  # mm drawn for one µm
    times = number(float(f"{factor / MICROMETRE:.2g}"), "g")
    start = plan.points[there][rows]
    end = start + factor * sizes[rows, None] * plan.normals[there][rows]
    with style.house_style():
        figure, seen = panels(_all(plan, end, np.zeros(1)), 0.04, 6.0)
        for view, ax in seen:
            draw_outlines(ax, view, plan)
            for chosen, colour in ((sizes[rows] >= 0, style.ACCENT), (sizes[rows] < 0, style.DIVERGING[-1])):
                at = view.of(end[chosen])
                segments(ax, view.of(start[chosen]), at, colour, 1.0)
                style.dots(ax, at[:, 0], at[:, 1], 2.2, colour, hollow=colour != style.ACCENT, zorder=4)
        scale_bar(figure, seen[0][1], 13.0, 2.6, factor, longest, style.INK)
        caption = told(
            say("The form as it was measured: distances of the points from their associated features, magnified {times} "
                "times; full dots out of the material, hollow dots into it.", times=times),
            len(rows), len(there),
        )  # fmt: skip
        alternative = say(
            "The part in four views with the distances of its measured points from their features: {low} to {high} µm.",
            low=signed(float(sizes.min(initial=0.0)), ".1f"),
            high=signed(float(sizes.max(initial=0.0)), ".1f"),
        )
        return style.drawn(figure, caption, alternative, "form")


def _all(plan: Plan, ends: Floats, radius: Floats) -> Floats:
    reach = float(radius.max(initial=0.0))
    return np.vstack([plan.points, ends, ends + reach, ends - reach])


def _ellipses(ax: Axes, centres: Floats, covariance: Floats) -> None:
    """Of one standard deviation in each panel's directions, all as one path."""
    if not len(centres):
        return
    values, axes = np.linalg.eigh(covariance)
    half = axes * np.sqrt(values.clip(0))[:, None, :]
    angle = np.linspace(0, 2 * np.pi, _STEPS + 1)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    drawn_rings = centres[:, None, :] + np.einsum("sk,nik->nsi", ring, half)
    joined = np.concatenate([drawn_rings, np.full((len(centres), 1, 2), np.nan)], axis=1).reshape(-1, 2)
    ax.plot(joined[:, 0], joined[:, 1], lw=0.6, color=style.ACCENT, zorder=3)
