"""Correlations between many characteristics, as a picture: a dot for each two, larger where they hang together more."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.base.messages import Text, say, signed
from cmm_uq.base.points import Floats
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.plots.style import (
    DIVERGING,
    INK,
    RULE,
    TINY,
    WIDTH_MM,
    dots,
    drawn,
    finite,
    house_style,
    new_figure,
)

_SIDE_MM, _LEAST_MM = 5.0, 2.2
LEAST = 0.1
"""Correlation from which on there is a dot."""

_CLASSES = 5


def correlation_plot(numbers: Sequence[Text], correlation: Floats) -> Plot:
    """The lower half of the matrix.

    Parameters
    ----------
    numbers : (c,) short names of the characteristics, two at least.
    correlation : (c, c).
    """
    count = len(numbers)
    values = finite("correlation", correlation, (count, count))
    side = max(min(_SIDE_MM, (WIDTH_MM - 24.0) / count), _LEAST_MM)
    below, left = np.tril_indices(count, -1)
    sizes = values[below, left]
    with house_style():
        height = 11.0 + side * count
        figure = new_figure(height)
        edge = 0.5 * (WIDTH_MM - side * count)
        ax = figure.add_axes((edge / WIDTH_MM, 9.0 / height, side * count / WIDTH_MM, side * count / height))
        steps = np.ceil(np.abs(sizes) * _CLASSES)
        for step in range(1, _CLASSES + 1):
            for positive, colour in ((True, DIVERGING[-1]), (False, DIVERGING[0])):
                some = (steps == step) & (np.abs(sizes) >= LEAST) & ((sizes > 0) == positive)
                if some.any():
                    diameter = 0.92 * side * np.sqrt(step / _CLASSES) * 72 / 25.4
                    dots(ax, left[some], below[some], float(diameter), colour, hollow=not positive)
        ax.set(xlim=(-0.5, count - 0.5), ylim=(count - 0.5, -0.5))
        turned = 90 if side < 6.0 and any(len(name) > 2 for name in numbers) else 0
        ax.set_xticks(range(count), numbers, fontsize=TINY, rotation=turned)
        ax.set_yticks(range(count), numbers, fontsize=TINY)
        ax.tick_params(length=0, labelcolor=INK)
        for name in ("left", "bottom"):
            ax.spines[name].set_color(RULE)
        return drawn(
            figure,
            say("Correlations between the characteristics, by their numbers: full dots positive, hollow dots negative, the "
                "larger the stronger; those below {least:g} in size are left out.", least=LEAST),
            _told(numbers, sizes, below, left),
        )  # fmt: skip


def _told(numbers: Sequence[Text], sizes: Floats, below: np.ndarray, left: np.ndarray) -> Text:
    most = int(np.abs(sizes).argmax())
    return say(
        "{count} of {all} correlations are {least:g} or larger in size; the largest, {r}, is between {one} and {other}.",
        count=int((np.abs(sizes) >= LEAST).sum()), all=len(sizes), least=LEAST, r=signed(float(sizes[most]), ".2f"),
        one=numbers[int(left[most])], other=numbers[int(below[most])],
    )  # fmt: skip
