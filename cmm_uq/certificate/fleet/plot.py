"""The usual drift of models and places, each with its interval."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.base.messages import Text
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.plot_style import ACCENT, INK, dots, drawn, house_style, new_figure
from cmm_uq.laboratory.due.fleet import UsualRate


def fleet_plot(
    rows: Sequence[UsualRate], names: Sequence[Text], *, axis: Text, caption: Text, alternative: Text
) -> Plot:
    """One row each, from the first down.

    Parameters
    ----------
    rows, names : groups of machines and what each is called.
    axis : what the rates are, with their unit.
    caption, alternative : of the picture.
    """
    rate, low, high = (np.array([getattr(row, name) for row in rows]) for name in ("rate", "lower", "upper"))
    at = np.arange(len(rows), dtype=np.float64)
    with house_style():
        height = 14 + 5.5 * len(rows)
        figure = new_figure(height)
        ax = figure.subplots()
        figure.subplots_adjust(left=0.3, right=0.985, bottom=9 / height, top=1 - 2 / height)
        ax.axvline(0, color=INK, lw=0.7, zorder=1)
        gaps = np.full(len(rows), np.nan)
        ax.plot(np.column_stack([low, high, gaps]).ravel(), np.column_stack([at, at, gaps]).ravel(), lw=1.6, color=ACCENT,
                solid_capstyle="butt", zorder=2)  # fmt: skip
        dots(ax, rate, at, 4.0, ACCENT)
        ax.set_yticks(at, names)
        ax.set(xlabel=axis)
        ax.invert_yaxis()
        ax.tick_params(left=False)
        ax.spines["left"].set_visible(False)
        return drawn(figure, caption, alternative)
