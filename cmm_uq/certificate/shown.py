"""What a picture shows of more than it can: the largest values, and the others evenly; its caption says how many."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import Floats, Ints

MOST = 1500
"""Marks of one series: more would run into each other, and a page with them would take a browser seconds."""

_LARGEST = 300


def shown(sizes: Sequence[Floats], flagged: NDArray[np.bool_] | None = None, most: int = MOST) -> Ints:
    """Rows to draw, ascending: all where there are no more than ``most``.

    Parameters
    ----------
    sizes : (n,) each; the largest of every one are drawn.
    flagged : (n,) what is drawn before anything else.
    """
    count = len(sizes[0])
    if count <= most:
        return np.arange(count)
    largest = min(_LARGEST, most // 2)
    each = largest // len(sizes)
    first = [np.argsort(-np.abs(size), kind="stable")[:each] for size in sizes]
    marked = np.flatnonzero(flagged)[:largest] if flagged is not None else np.zeros(0, dtype=np.int64)
    chosen = np.unique(np.concatenate([*first, marked]))
    rest = np.setdiff1d(np.arange(count), chosen, assume_unique=True)
    evenly = np.linspace(0, len(rest) - 1, most - len(chosen)).astype(np.int64)
    return np.sort(np.concatenate([chosen, rest[evenly]]))


def told(caption: Text, drawn: int, count: int) -> Text:
    """A caption that says how many of all are drawn, where it is not all."""
    if drawn == count:
        return caption
    return say(
        "{caption} Drawn are {drawn} of {count}: the largest, and some of the others from all over the recording.",
        caption=caption, drawn=drawn, count=count,
    )  # fmt: skip
