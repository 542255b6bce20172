"""Which parameter is out: every one over its tolerance, with its uncertainty."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from cmm_uq.base.messages import Text, say
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.plot_style import (
    ACCENT,
    BAND,
    DIVERGING,
    INK,
    MUTED,
    dots,
    drawn,
    finite,
    house_style,
    new_figure,
)

_FARTHEST = 3.0
"""Times the tolerance that the picture reaches; what lies beyond is drawn at its edge with its figure."""

_MANY = 8
"""Rows beyond which they stand closer together."""


def tolerance_plot(
    names: Sequence[Text], ratio: ArrayLike, low: ArrayLike, high: ArrayLike, *, caption: Text, alternative: Text
) -> Plot:
    """Parameters over their tolerances, one row each: inside the band is inside the tolerance.

    Parameters
    ----------
    ratio : (n,) estimate over tolerance, signed.
    low, high : (n,) ends of its coverage interval over the tolerance.
    """
    value = finite("ratio", ratio, (len(names),))
    ends = finite("low", low, value.shape), finite("high", high, value.shape)
    rows = np.arange(len(value), dtype=np.float64)
    reach = float(np.clip(1.15 * max(np.abs(ends[0]).max(), np.abs(ends[1]).max()), 1.3, _FARTHEST))
    out = np.minimum(np.abs(ends[0]), np.abs(ends[1])) > 1
    out &= np.sign(ends[0]) == np.sign(ends[1])
    with house_style():
        height = 14 + (5.5 if len(value) <= _MANY else 4.5) * len(value)
        figure = new_figure(height)
        ax = figure.subplots()
        figure.subplots_adjust(left=0.3, right=0.985, bottom=9 / height, top=1 - 2 / height)
        ax.axvspan(-1, 1, color=BAND, lw=0, zorder=0)
        ax.axvline(0, color=INK, lw=0.7, zorder=1)
        for chosen, colour in ((~out, ACCENT), (out, DIVERGING[-1])):
            inside = np.clip(value[chosen], -reach, reach)
            gaps = np.full(int(chosen.sum()), np.nan)
            across = np.column_stack([*(np.clip(end[chosen], -reach, reach) for end in ends), gaps]).ravel()
            up = np.column_stack([rows[chosen], rows[chosen], gaps]).ravel()
            ax.plot(across, up, lw=1.6, color=colour, solid_capstyle="butt", zorder=2)
            if colour == ACCENT:
                dots(ax, inside, rows[chosen], 4.0, colour)
            else:
                ax.plot(inside, rows[chosen], ls="", marker="x", ms=6.0, mec=colour, mew=1.6, zorder=4)
        for row in np.flatnonzero(np.abs(value) > reach):
            side = np.sign(value[row])
            text = f"{value[row]:+.1f}".replace("-", "−")
            ax.annotate(text, (side * reach, row), (-6 * side, 4), textcoords="offset points",
                        ha="right" if side > 0 else "left", color=MUTED)  # fmt: skip
        ax.set_yticks(rows, names)
        ax.set(
            xlim=(-1.02 * reach, 1.02 * reach),
            xlabel=say("Parameter over its tolerance (band: inside; cross: outside beyond doubt)"),
        )
        ax.invert_yaxis()
        ax.tick_params(left=False)
        ax.spines["left"].set_visible(False)
        return drawn(figure, caption, alternative)
