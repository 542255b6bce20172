"""Arrows at the balls of a plate: where each was found against where it belongs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from cmm_uq.base.messages import Text, say
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.plot_style import ACCENT, MUTED, RULE, TINY, dots, drawn, finite, house_style, new_figure
from cmm_uq.certificate.shown import shown, told

_ROUND = (1.0, 2.0, 5.0)


def vector_plot(
    position_mm: ArrayLike,
    series: Sequence[tuple[Text, ArrayLike]],
    *,
    axis_labels: tuple[Text, Text] = (say("x / mm"), say("y / mm")),
    caption: Text,
    alternative: Text,
) -> Plot:
    """Vectors in a plane, one panel a series, all magnified alike, with a scale arrow of a round length.

    Parameters
    ----------
    position_mm : (n, 2) where each vector stands.
    series : title and (n, 2) vectors in µm; one to three of them.
    axis_labels : of the plane.
    """
    place = finite("position_mm", position_mm, (None, 2))
    vectors = [(title, finite("vectors", values, place.shape)) for title, values in series]
    rows = shown([np.linalg.norm(values, axis=1) for _, values in vectors])
    caption = told(caption, len(rows), len(place))
    place, vectors = place[rows], [(title, values[rows]) for title, values in vectors]
    longest = max(float(np.linalg.norm(values, axis=1).max(initial=0.0)) for _, values in vectors) or 1.0
    low, high = place.min(axis=0), place.max(axis=0)
    span = np.maximum(high - low, 1e-3 * float(np.ptp(place)) + 1.0)
    factor = 0.14 * float(span.max()) / longest  # mm drawn for one µm
    margin = 0.2 * float(span.max())
    width = 170.0 / len(vectors)
    height = min(22 + (width - 16) * float((span[1] + 2 * margin) / (span[0] + 2 * margin)), 150.0)
    with house_style():
        figure = new_figure(height)
        axes = figure.subplots(1, len(vectors), squeeze=False, sharex=True, sharey=True)[0]
        figure.subplots_adjust(left=0.085, right=0.995, bottom=12 / height, top=1 - 8 / height, wspace=0.08)
        for ax, (title, values), colour in zip(axes, vectors, (MUTED, ACCENT, ACCENT), strict=False):
            dots(ax, place[:, 0], place[:, 1], 2.0, RULE)
            tips = place + factor * values
            ax.quiver(*place.T, *(tips - place).T, angles="xy", scale_units="xy", scale=1, color=colour, width=0.006)
            ax.set_title(title, loc="left", fontsize=8, color=colour, fontweight="bold", pad=4)
            ax.set_aspect("equal")
            ax.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin))
            ax.set_xlabel(axis_labels[0])
            ax.locator_params(nbins=5)
        axes[0].set_ylabel(axis_labels[1])
        unit = round_length(longest)
        at = (high[0] + 0.9 * margin - factor * unit, low[1] - 0.75 * margin)
        axes[-1].plot([at[0], at[0] + factor * unit], [at[1], at[1]], color=ACCENT, lw=1.6, solid_capstyle="butt")
        axes[-1].annotate(
            say("{length:g} µm", length=unit),
            (at[0] + factor * unit / 2, at[1]),
            (0, 3),
            textcoords="offset points",
            ha="center",
            va="bottom",
            fontsize=TINY,
        )
        return drawn(figure, caption, alternative)


def round_length(longest: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not longer than the longest vector."""
    power = 10.0 ** np.floor(np.log10(longest))
    return float(max(step * power for step in _ROUND if step * power <= longest))
