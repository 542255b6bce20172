"""What the uncertainty of every characteristic is made of: a bar each, parted by cause."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.base.messages import Text, commas, number, say, semicolons
from cmm_uq.base.points import Floats
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.part.margin_plot import A_PAGE
from cmm_uq.certificate.plots.labels import NAMES_MM, told_apart, width_mm
from cmm_uq.certificate.plots.style import INK, TINY, WIDTH_MM, drawn, house_style, lettered, new_figure

_SHADES = ("#0b5c7a", "#86b1c2", "#a84e08", "#e0b48a", "#5a666e", "#c3ccd0", "#3f86a0", "#cc7f3c")
"""Neighbours differ in lightness, so that they can be told apart without colour."""

_DARK = ("#0b5c7a", "#a84e08", "#5a666e")
_LEAST = 0.07
"""Share from which on a figure has room in its part."""

_LEFT_MM, _RIGHT_MM, _ROW_MM = 58.0, 2.5, 5.2


def shares_plots(names: Sequence[Text], causes: Sequence[Text], shares: Floats) -> list[Plot]:
    """The bars in order, forty a picture.

    Parameters
    ----------
    names : (c,) of the characteristics.
    causes : (g,) in words.
    shares : (g, c) of each, which add up to 1, or to 0 of one that has no uncertainty.
    """
    starts = range(0, len(names), A_PAGE)
    return [_bars(names[i : i + A_PAGE], causes, shares[:, i : i + A_PAGE]) for i in starts]


def _bars(names: Sequence[Text], causes: Sequence[Text], shares: Floats) -> Plot:
    rows = np.arange(len(names))
    with house_style():
        lines = _legend_lines(causes)
        top = 4.6 * len(lines) + 2.0
        height = top + _ROW_MM * len(names) + 3.0
        figure = new_figure(height)
        ax = figure.add_axes((_LEFT_MM / WIDTH_MM, 1.5 / height, 1 - (_LEFT_MM + _RIGHT_MM) / WIDTH_MM,
                              _ROW_MM * len(names) / height))  # fmt: skip
        before = np.zeros(len(names))
        for g in range(len(causes)):
            shade = _SHADES[g % len(_SHADES)]
            ax.barh(rows, shares[g], 0.7, left=before, color=shade, edgecolor="white", lw=0.6)
            for row in np.flatnonzero(shares[g] >= _LEAST).tolist():
                ax.text(before[row] + 0.5 * shares[g, row], row, number(100 * shares[g, row], ".0f"), fontsize=TINY,
                        color="white" if shade in _DARK else INK, ha="center", va="center_baseline")  # fmt: skip
            before = before + shares[g]
        ax.set_yticks(rows, told_apart(names, NAMES_MM))
        ax.set(xlim=(0, 1), ylim=(len(names) - 0.4, -0.6), xticks=[])
        ax.tick_params(left=False)
        for side in ("bottom", "left"):
            ax.spines[side].set_visible(False)
        for line, members in enumerate(lines):
            y = 1 - (2.6 + 4.6 * line) / height
            for g, left in members:
                figure.text(left / WIDTH_MM, y, "■", fontsize=8, color=_SHADES[g % len(_SHADES)], va="center")
                figure.text((left + 3.6) / WIDTH_MM, y, causes[g], fontsize=TINY, color=INK, va="center")
        return drawn(
            figure,
            say("What the variance of each characteristic is made of, %, by cause: total shares over their sum."),
            semicolons(_told(name, causes, shares[:, i]) for i, name in enumerate(names)),
        )


def _told(name: Text, causes: Sequence[Text], shares: Floats) -> Text:
    order = [int(g) for g in np.argsort(-shares, kind="stable")[:3] if shares[g] > 0]
    said = commas(say("{what:small} {share} %", what=causes[g], share=number(100 * shares[g], ".0f")) for g in order)
    return say("{name}: {shares}", name=name, shares=said)


def _legend_lines(causes: Sequence[Text]) -> list[list[tuple[int, float]]]:
    """Causes in lines, with where each begins, mm."""
    lines, left = [list[tuple[int, float]]()], 1.0
    for g, cause in enumerate(causes):
        width = 9.0 + width_mm(lettered(cause), TINY)
        if lines[-1] and left + width > WIDTH_MM:
            lines.append([])
            left = 1.0
        lines[-1].append((g, left))
        left += width
    return lines
