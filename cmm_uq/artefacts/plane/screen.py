"""What a probed plane asks of a recording: points of contact lie in one plane."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.screening.shape import ArtefactShape, Screening, flat_misfit, no_references, spread
from cmm_uq.artefacts.plane.observe import DIRECTION_POINT, LEAST_POINTS
from cmm_uq.base.points import Points
from cmm_uq.jobs.tables.artefact import ArtefactFacts


def shape_of(facts: ArtefactFacts, points: Points) -> ArtefactShape | None:
    """Planes of four points of contact or more, since three always lie in one; ``None`` where there are none."""
    touched = points.point != DIRECTION_POINT
    rows = tuple(np.flatnonzero(touched & (points.measurement == m)) for m in np.unique(points.measurement[touched]))
    rows = tuple(r for r in rows if len(r) > LEAST_POINTS)
    if not rows:
        return None
    extent = float(np.median([spread(points.xyz[r]) for r in rows]))
    return ArtefactShape(rows, flat_misfit, np.nan, extent, False, (), no_references(points))


SCREENING = Screening(shape_of)
