"""The profile of a mismatch along the covariate that carries it, with its band, and the data beneath."""

from __future__ import annotations

import numpy as np

from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import Floats
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.plot_style import ACCENT, BAND, DIVERGING, INK, dots, drawn, finite, house_style, new_figure
from cmm_uq.certificate.shown import shown, told


def profile_plot(
    curve: tuple[Floats, Floats, Floats],
    data: tuple[Floats, Floats, Floats],
    region: tuple[float, float],
    *,
    x_label: Text,
    y_label: Text,
    caption: Text,
    alternative: Text,
) -> Plot:
    """A function with its band above, what each observation leaves below, the region where it matters shaded in both.

    Parameters
    ----------
    curve : covariate, function in µm and its expanded uncertainty, each (p,).
    data : lowest and highest covariate of each observation, and its residual in µm, each (m,).
    region : of the covariate.
    """
    x = finite("x", curve[0], (None,))
    y, half = (finite("curve", values, x.shape) for values in curve[1:])
    low = finite("data", data[0], (None,))
    high, residual = (finite("data", values, low.shape) for values in data[1:])
    rows = shown([residual])
    caption = told(caption, len(rows), len(low))
    low, high, residual = low[rows], high[rows], residual[rows]
    with house_style():
        figure = new_figure(90)
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1.0, 0.8))
        figure.subplots_adjust(left=0.105, right=0.985, bottom=0.115, top=0.94, hspace=0.22)
        for ax in (above, below):
            ax.axvspan(*_widened(region, x), color=BAND, lw=0, zorder=0)
            ax.axhline(0, color=INK, lw=0.6, zorder=1)
            ax.grid(axis="y")
        above.fill(
            np.append(x, x[::-1]), np.append(y - half, (y + half)[::-1]), color=ACCENT, alpha=0.18, lw=0, zorder=2
        )
        above.plot(x, y, color=ACCENT, lw=1.4, zorder=3)
        above.set_ylabel(y_label)
        above.set_title(say("What the observations show together, with U"), loc="left", fontsize=8, color=ACCENT,
                        fontweight="bold", pad=4)  # fmt: skip
        size = float(np.clip(60.0 / len(low) ** 0.75, 1.3, 3.6))
        wide = high - low > 1e-3 * np.ptp(x)
        if wide.any():
            gaps = np.full(int(wide.sum()), np.nan)
            below.plot(
                np.column_stack([low[wide], high[wide], gaps]).ravel(),
                np.column_stack([residual[wide], residual[wide], gaps]).ravel(), color=DIVERGING[-1], lw=0.6, zorder=2,
            )  # fmt: skip
        dots(below, 0.5 * (low + high), residual, size, DIVERGING[-1], hollow=True)
        below.set(xlabel=x_label, ylabel=say("Residual / µm"))
        below.set_title(say("What each observation leaves"), loc="left", fontsize=8, color=DIVERGING[-1],
                        fontweight="bold", pad=4)  # fmt: skip
        below.margins(x=0.02, y=0.1)
        figure.align_ylabels((above, below))
        return drawn(figure, caption, alternative)


def _widened(region: tuple[float, float], x: Floats) -> tuple[float, float]:
    """A region that would be too narrow to see, as a hundredth of the picture."""
    middle, half = 0.5 * (region[0] + region[1]), 0.5 * (region[1] - region[0])
    half = max(half, 0.005 * float(np.ptp(x)))
    return middle - half, middle + half
