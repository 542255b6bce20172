"""The part as it is probed: its features, their points with normals, and the styli that reach them.

Errors of a part's points, magnified: where each is expected to be found, and how surely; and what form was measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from cmm_uq.analysis.parts.budget import PointErrors
from cmm_uq.analysis.parts.placing import PartPose
from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.base.messages import NOTHING, Text, after, number, plural, say, sentences, signed
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.part.views import draw_outlines, label, panels, segments, span_of
from cmm_uq.certificate.plots.residuals import shown, told
from cmm_uq.certificate.plots.style import (
    ACCENT,
    DIVERGING,
    INK,
    MUTED,
    TINY,
    WIDTH_MM,
    dots,
    drawn,
    house_style,
)
from cmm_uq.certificate.plots.vectors import round_length
from cmm_uq.maths.uncertainty.quantity import significant

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_NORMAL, _STEM = 0.05, 0.22  # of the largest span: how long a normal is drawn, and a stylus at most


def part_picture(plan: Plan, pose: PartPose, names: Sequence[Text]) -> Plot:
    """Four views of the part with all of its points."""
    points, normals = plan.points, plan.normals
    largest = span_of(plan)
    tips, roots = _stems(plan, pose, largest)
    rows = shown([points[:, 2]])
    everything = np.vstack([points, points + _NORMAL * largest * normals, tips, roots])
    count = plural(len(points), one=say("one point"), many=say("{count} points", count=len(points)))
    caption = told(
        after(
            say("The part as it is probed, {count}: dots are points with their normals.", count=count),
            say("Brown lines are styli.") if np.any(tips != roots) else NOTHING,
        ),
        len(rows), len(points),
    )  # fmt: skip
    with house_style():
        figure, seen = panels(everything, 0.05, 0.0)
        size = float(np.clip(30 / np.sqrt(len(rows)), 1.4, 3.4))
        for view, ax in seen:
            draw_outlines(ax, view, plan)
            at = view.of(points[rows])
            segments(ax, at, view.of(points[rows] + _NORMAL * largest * normals[rows]), ACCENT, 0.5)
            segments(ax, view.of(tips), view.of(roots), DIVERGING[-1], 1.1, 2)
            dots(ax, at[:, 0], at[:, 1], size, ACCENT, zorder=4)
            anchors = np.array([view.of(feature.points.mean(axis=0)) for feature in plan.features])
            label(ax, anchors, names, WIDTH_MM * ax.get_position().width)
        features = plural(
            len(plan.features), one=say("one feature"), many=say("{count} features", count=len(plan.features))
        )
        alternative = say(
            "The part from above, from the front, from the right and obliquely: {features} with {points}.",
            features=features, points=count,
        )  # fmt: skip
        return drawn(figure, caption, alternative)


def _stems(plan: Plan, pose: PartPose, largest: float) -> tuple[Floats, Floats]:
    """(f, 3) of each feature: the tip's centre at its first point, and where the stylus is cut off."""
    tips, roots = [], []
    for feature in plan.features:
        stylus = next(one for one in plan.styli if one.name == feature.stylus)
        tip = feature.points[0] + 0.5 * stylus.diameter_mm * feature.normals[0]
        up = -pose.back(np.asarray(stylus.offset_mm, dtype=np.float64))
        length = float(np.linalg.norm(up))
        tips.append(tip)
        roots.append(tip + up * min(1.0, _STEM * largest / length) if length else tip)
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
    factor = _factor(plan, longest)
    ends = plan.points + factor * mean
    with house_style():
        figure, seen = panels(_all(plan, ends, factor * u), 0.04, 6.0)
        for view, ax in seen:
            draw_outlines(ax, view, plan)
            at, tips = view.of(plan.points[rows]), view.of(ends[rows])
            _ellipses(ax, tips, factor**2 * view.spread(covariance[rows]))
            long = size[rows] > _SEEN * longest
            _arrows(ax, at[long], (tips - at)[long])
            dots(ax, at[:, 0], at[:, 1], 1.6, MUTED, zorder=2)
        _key(figure, seen[0][1], factor, longest)
        caption = told(
            sentences((
                say("Errors of the points as they are expected: arrows are mean errors, ellipses their standard uncertainty, "
                    "both magnified {times} times.", times=_times(factor)),
                say("A shift and a turn that all points have in common show in no result and are left out."),
            )),
            len(rows), len(plan.points),
        )  # fmt: skip
        alternative = say(
            "The part in four views with errors of its points: mean errors of up to {mean} µm, standard "
            "uncertainties of up to {u} µm.",
            mean=significant(float(size.max(initial=0.0))), u=significant(float(u.max(initial=0.0))),
        )  # fmt: skip
        return drawn(figure, caption, alternative)


def form_picture(plan: Plan, deviations: Floats) -> Plot:
    """Deviations (n,) of the measured points from their associated features along the normals, mm, magnified.

    Points of features that their number alone determines deviate by ``nan`` and are not drawn.
    """
    there = np.flatnonzero(np.isfinite(deviations))
    sizes = deviations[there] / MICROMETRE
    longest = float(np.abs(sizes).max(initial=0.0)) or 1.0
    rows = shown([sizes])
    factor = _factor(plan, longest)
    start = plan.points[there][rows]
    end = start + factor * sizes[rows, None] * plan.normals[there][rows]
    with house_style():
        figure, seen = panels(_all(plan, end, np.zeros(1)), 0.04, 6.0)
        for view, ax in seen:
            draw_outlines(ax, view, plan)
            for chosen, colour in ((sizes[rows] >= 0, ACCENT), (sizes[rows] < 0, DIVERGING[-1])):
                segments(ax, view.of(start[chosen]), view.of(end[chosen]), colour, 1.0)
                at = view.of(end[chosen])
                dots(ax, at[:, 0], at[:, 1], 2.2, colour, hollow=colour != ACCENT, zorder=4)
        _key(figure, seen[0][1], factor, longest)
        caption = told(
            say("The form as it was measured: distances of the points from their associated features, magnified {times} "
                "times; full dots out of the material, hollow dots into it.", times=_times(factor)),
            len(rows), len(there),
        )  # fmt: skip
        alternative = say(
            "The part in four views with the distances of its measured points from their features: {low} to {high} µm.",
            low=signed(float(sizes.min(initial=0.0)), ".1f"), high=signed(float(sizes.max(initial=0.0)), ".1f"),
        )  # fmt: skip
        return drawn(figure, caption, alternative)


def _factor(plan: Plan, longest_um: float) -> float:
    """Length drawn for one µm, mm."""
    return _LONGEST * span_of(plan) / longest_um


def _times(factor: float) -> Text:
    return number(float(f"{factor / MICROMETRE:.2g}"), "g")


def _all(plan: Plan, ends: Floats, radius: Floats) -> Floats:
    """Corners of all that is drawn."""
    reach = float(radius.max(initial=0.0))
    both = np.vstack([plan.points, ends])
    return np.vstack([both, ends + reach, ends - reach])


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
    ax.plot(joined[:, 0], joined[:, 1], lw=0.6, color=ACCENT, zorder=3)


def _arrows(ax: Axes, place: Floats, way: Floats) -> None:
    if len(place):
        ax.quiver(*place.T, *way.T, angles="xy", scale_units="xy", scale=1, color=DIVERGING[-1], units="dots", width=1.4,
                  headwidth=4, headlength=5, headaxislength=4.5, zorder=4)  # fmt: skip


def _key(figure: Figure, ax: Axes, factor: float, longest: float) -> None:
    """A round length to scale."""
    from matplotlib.lines import Line2D

    x0, x1 = ax.get_xlim()
    per_mm = ax.get_position().width / (x1 - x0)
    length = round_length(longest)
    height_mm = float(figure.get_size_inches()[1]) * 25.4
    start, y = 13.0 / WIDTH_MM, 2.6 / height_mm
    end = start + length * factor * per_mm
    figure.add_artist(Line2D([start, end], [y, y], color=INK, lw=1.8, solid_capstyle="butt"))
    figure.text(end + 0.008, y, say("{length:g} µm", length=length), ha="left", va="center", fontsize=TINY, color=INK)
