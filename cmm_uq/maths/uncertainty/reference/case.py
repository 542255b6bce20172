"""A reference case: published or independently recomputed figures that the engine must reproduce.

Each case computes named figures; each figure has its expected value and the tolerance within which it must come out: half
a unit of the last printed digit, or the numerical tolerance of JCGM 101:2008 7.9.2 where trials are made. Where a source
prints a figure from rounded intermediate results, the recomputed one is expected.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

Figures = Mapping[str, float]
Expected = Mapping[str, tuple[float, float]]  # expected value and tolerance of each figure
SEED = 1  # of every case that makes trials


@dataclass(frozen=True, eq=False)
class ReferenceCase:
    """Figures with their source."""

    title: str  # what is computed
    source: str  # document and clause, or how the figures were recomputed
    expected: Expected  # value and tolerance by the name of the figure
    compute: Callable[[], Figures]  # gives the figures
