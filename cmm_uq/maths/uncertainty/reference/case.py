"""A reference case: published or independently recomputed figures that the engine must reproduce.

The tolerance of a figure is half a unit of the last printed digit, or the numerical tolerance of JCGM 101:2008 7.9.2 where
trials are made. Where a source prints a figure from rounded intermediate results, the recomputed one is expected.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

SEED = 1  # of every case that makes trials


@dataclass(frozen=True, eq=False)
class ReferenceCase:
    title: str  # what is computed
    source: str  # document and clause, or how the figures were recomputed
    expected: Mapping[str, tuple[float, float]]  # value and tolerance by the name of the figure
    compute: Callable[[], Iterable[float]]  # gives the figures, in the same order
