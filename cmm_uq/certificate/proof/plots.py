"""Pictures of a proof: how finding grows with strength, and probabilities that were said against what was right."""

from __future__ import annotations

import numpy as np

from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.plot_style import ACCENT, BAND, INK, MUTED, bars, dots, drawn, house_style, new_figure
from cmm_uq.laboratory.proving.intervals import Rate, Tenth
from cmm_uq.laboratory.proving.smallest import OFTEN, Found

_HEIGHT_MM = 72


def strength_plot(in_bins: tuple[tuple[float, float, Rate], ...], found: Found) -> Plot:
    """Part of the hidden effects that is found, by their strength, with the fitted curve."""
    counted = [(low, high, rate) for low, high, rate in in_bins if rate.of]
    middle = np.array([0.5 * (low + high) for low, high, _ in counted])
    share, low, high = _rates([rate for _, _, rate in counted])
    with house_style():
        figure = new_figure(_HEIGHT_MM)
        ax = figure.subplots()
        figure.subplots_adjust(left=0.09, right=0.985, bottom=0.15, top=0.96)
        across = np.append(found.strengths, found.strengths[::-1])
        ax.fill(across, 100 * np.append(found.low, found.high[::-1]), color=BAND, lw=0, zorder=0)
        ax.plot(found.strengths, 100 * found.curve, color=ACCENT, lw=1.3)
        ax.axhline(100 * OFTEN, color=MUTED, lw=0.6, ls=(0, (4, 3)), zorder=1)
        bars(ax, middle, low, high, 1.0, INK)
        dots(ax, middle, share, 4.0, INK)
        ax.set(xlim=(found.strengths[0] - 0.5, found.strengths[-1] + 0.5), ylim=(-3, 103))
        ax.grid(axis="y")
        ax.set_xlabel(say("Strength √λ of the hidden effect"))
        ax.set_ylabel(say("Found / %"))
        return drawn(
            figure,
            say("Hidden effects that were found, by strength: counted with 95 % intervals, and the fitted curve with its "
                "band; the broken line is nine in ten."),
            say("Share of hidden effects found, growing with their strength from {low:g} to {high:g}.",
                low=float(found.strengths[0]), high=float(found.strengths[-1])),
        )  # fmt: skip


def said_plot(each: tuple[Tenth, ...]) -> Plot:
    """Probabilities of asserted effects, by tenths, against the share of them that act."""
    said = 100 * np.array([one.said for one in each])
    share, low, high = _rates([one.right for one in each])
    with house_style():
        figure = new_figure(_HEIGHT_MM)
        ax = figure.subplots()
        figure.subplots_adjust(left=0.09, right=0.985, bottom=0.15, top=0.96)
        ax.plot([0, 100], [0, 100], color=MUTED, lw=0.7, zorder=1)
        bars(ax, said, low, high, 1.0, ACCENT)
        dots(ax, said, share, 4.0, ACCENT)
        ax.set(xlim=(-2, 103), ylim=(-3, 103))
        ax.grid()
        ax.set_xlabel(say("Probability that was said / %"))
        ax.set_ylabel(say("Right / %"))
        return drawn(
            figure,
            say("Probability that was said of asserted effects against the share of them that act, by tenths, with 95 % "
                "intervals."),
            say("Probabilities said and shares right in {count} tenths.", count=len(each)),
        )  # fmt: skip


def _rates(rates: list[Rate]) -> tuple[Floats, Floats, Floats]:
    """Rates with the ends of their intervals, %."""
    ends = np.array([rate.interval for rate in rates]).reshape(-1, 2)
    share = np.array([rate.count / rate.of for rate in rates])
    return 100 * share, 100 * ends[:, 0], 100 * ends[:, 1]
