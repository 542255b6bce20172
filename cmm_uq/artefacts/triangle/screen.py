"""What a triangle asks of a recording: its three corners keep their places to each other."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.screening.shape import ArtefactShape, Screening, body_misfit, rows_by
from cmm_uq.artefacts.triangle.facts import TriangleFacts
from cmm_uq.artefacts.triangle.standard import TriangleStandard, corners
from cmm_uq.base.points import Points


def shape_of(facts: TriangleFacts, points: Points) -> ArtefactShape | None:
    """Placings of the triangle; ``None`` where a point is no corner."""
    if not np.isin(points.point, (1, 2, 3)).all():
        return None
    sides = TriangleStandard.of(facts).sides
    body = corners(sides)[points.point - 1]
    return ArtefactShape(rows_by(points.measurement), body_misfit, np.nan, float(sides.max()), True, (), body)


SCREENING = Screening(shape_of, balls=True)
