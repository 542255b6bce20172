"""Errors against their limits, and parameters against their tolerances."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from cmm_uq.base.messages import Text, say, semicolons
from cmm_uq.base.points import Floats
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.plots import style
from cmm_uq.certificate.plots.style import ACCENT, BAND, DIVERGING, INK, MUTED

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def trumpet(
    length_mm: ArrayLike, error_um: ArrayLike, *, limit_um: ArrayLike, acceptance_um: Sequence[float | None],
    expanded_um: ArrayLike, outside: ArrayLike, quantity: Text, caption: Text, alternative: Text,
) -> Plot:  # fmt: skip
    """Errors against limits on both sides of zero, all (m,), µm; U with k = 2; ``acceptance_um`` None: none is accepted."""
    x = style.finite("length_mm", length_mm, (None,))
    y, top, U = (style.finite(name, values, x.shape) for name, values in
                 (("error_um", error_um), ("limit_um", limit_um), ("expanded_um", expanded_um)))  # fmt: skip
    accepted = np.array([np.nan if value is None else value for value in acceptance_um], dtype=np.float64)
    marked = np.asarray(outside, dtype=bool)
    size = float(np.clip(45.0 / len(x) ** 0.6, 1.6, 4.0))
    with style.picture(76, left=0.082, right=0.985, bottom=0.145, top=0.91) as (figure, ax):
        _limits(ax, x, top, accepted)
        ax.axhline(0, color=INK, lw=0.7, zorder=1)
        style.bars(ax, x, y - U, y + U, max(0.28 * size, 0.6), MUTED)
        style.dots(ax, x[~marked], y[~marked], size, ACCENT)
        style.crosses(ax, x[marked], y[marked], size + 2.5, 1.3)
        ax.set(xlabel=say("Length / mm"), ylabel=quantity, xlim=(0.0, 1.04 * float(x.max())))
        ax.margins(y=0.08)
        ax.grid(axis="y")
        parts = (
            (say("lines: ±MPE"), True),
            (say("dashed: limits of acceptance, with the guard band between"), np.isfinite(accepted).any()),
            (say("bars: U (k = 2)"), U.any()),
            (say("crosses: not accepted"), marked.any()),
        )
        style.note(figure, semicolons([part for part, drawn in parts if drawn]))
        return style.drawn(figure, caption, alternative)


def _limits(ax: Axes, x: Floats, top: Floats, accepted: Floats) -> None:
    """±MPE as lines, what lies between it and the acceptance limit as bands; level where only one length is there."""
    length, first = np.unique(x, return_index=True)
    limit, inner = top[first], accepted[first]
    if len(length) == 1:
        length, limit, inner = np.array([0.0, length[0]]), np.repeat(limit, 2), np.repeat(inner, 2)
    for side in (1.0, -1.0):
        known = np.isfinite(inner) & (inner < limit - 1e-9)
        ax.fill_between(length, side * np.where(known, inner, limit), side * limit, color=BAND, lw=0, zorder=0)
        ax.plot(length, side * limit, color=INK, lw=1.1, zorder=2)
        ax.plot(length, side * np.where(known, inner, np.nan), color=INK, lw=0.7, ls=(0, (4, 3)), zorder=2)


_FARTHEST = 3.0  # times the tolerance that the picture reaches; what lies beyond is drawn at its edge with its figure
_MANY = 8  # rows beyond which they stand closer together


def tolerance_plot(
    names: Sequence[Text], ratio: ArrayLike, low: ArrayLike, high: ArrayLike, *, caption: Text, alternative: Text
) -> Plot:
    """Parameters over their tolerances, (n,), a row each: the estimate, signed, and the ends of its coverage interval."""
    value = style.finite("ratio", ratio, (len(names),))
    ends = style.finite("low", low, value.shape), style.finite("high", high, value.shape)
    rows = np.arange(len(value), dtype=np.float64)
    reach = float(np.clip(1.15 * max(np.abs(ends[0]).max(), np.abs(ends[1]).max()), 1.3, _FARTHEST))
    out = (np.minimum(np.abs(ends[0]), np.abs(ends[1])) > 1) & (np.sign(ends[0]) == np.sign(ends[1]))
    height = 14 + (5.5 if len(value) <= _MANY else 4.5) * len(value)
    with style.picture(height, left=0.3, right=0.985, bottom=9 / height, top=1 - 2 / height) as (figure, ax):
        ax.axvspan(-1, 1, color=BAND, lw=0, zorder=0)
        ax.axvline(0, color=INK, lw=0.7, zorder=1)
        for chosen, colour in ((~out, ACCENT), (out, DIVERGING[-1])):
            inside, own = np.clip(value[chosen], -reach, reach), rows[chosen]
            left, right = (np.clip(end[chosen], -reach, reach) for end in ends)
            style.strokes(ax, left, right, own, own, lw=1.6, color=colour, solid_capstyle="butt", zorder=2)
            if colour == ACCENT:
                style.dots(ax, inside, own, 4.0, colour)
            else:
                style.crosses(ax, inside, own, 6.0, 1.6)
        for row in np.flatnonzero(np.abs(value) > reach):
            side = np.sign(value[row])
            ax.annotate(f"{value[row]:+.1f}".replace("-", "−"), (side * reach, row), (-6 * side, 4),
                        textcoords="offset points", ha="right" if side > 0 else "left", color=MUTED)  # fmt: skip
        ax.set_yticks(rows, names)
        label = say("Parameter over its tolerance (band: inside; cross: outside beyond doubt)")
        ax.set(xlim=(-1.02 * reach, 1.02 * reach), xlabel=label)
        ax.invert_yaxis()
        ax.tick_params(left=False)
        ax.spines["left"].set_visible(False)
        return style.drawn(figure, caption, alternative)
