"""What a probed plane asks of a recording: points of contact lie in one plane."""

from __future__ import annotations

import numpy as np

from cmm_uq.jobs.job import ArtefactFacts
from cmm_uq.kinds.plane.observe import DIRECTION_POINT
from cmm_uq.points import Points
from cmm_uq.screening.shape import Screening, Shape, flat_misfit, no_references, spread


def shape_of(facts: ArtefactFacts, points: Points) -> Shape | None:
    """Planes; ``None`` where one has too few points of contact."""
    touched = points.point != DIRECTION_POINT
    rows = tuple(np.flatnonzero(touched & (points.measurement == m)) for m in np.unique(points.measurement[touched]))
    if not rows or any(len(r) < 4 for r in rows):
        return None
    extent = float(np.median([spread(points.xyz[r]) for r in rows]))
    return Shape(rows, flat_misfit, np.nan, extent, False, (), no_references(points))


SCREENING = Screening(shape_of)
