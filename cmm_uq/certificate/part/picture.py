"""The part as it is probed: its features, their points with normals, and the styli that reach them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.analysis.parts.placing import Pose
from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.base.messages import NOTHING, Text, after, plural, say
from cmm_uq.base.points import Floats
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.part.views import draw_outlines, label, panels, segments, span_of
from cmm_uq.certificate.plots.labels import shown, told
from cmm_uq.certificate.plots.style import ACCENT, DIVERGING, WIDTH_MM, dots, drawn, house_style

_NORMAL, _STEM = 0.05, 0.22
"""Of the largest span: how long a normal is drawn, and a stylus at most."""


def part_picture(plan: Plan, pose: Pose, names: Sequence[Text]) -> Plot:
    """Four views of the part with all of its points.

    Parameters
    ----------
    plan : of the measurement.
    pose : in which the styli reach it.
    names : of the features, as the pictures letter them.
    """
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


def _stems(plan: Plan, pose: Pose, largest: float) -> tuple[Floats, Floats]:
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
