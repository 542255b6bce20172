"""What a ballbar asks of a recording: the distance of the two balls of each bar is the same everywhere."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.screening.shape import ArtefactShape, Screening, bar_misfit, common_length, no_references, rows_by
from cmm_uq.base.points import Points
from cmm_uq.jobs.tables.artefact import ArtefactFacts


def shape_of(facts: ArtefactFacts, points: Points) -> ArtefactShape | None:
    """Bars of one length; ``None`` where one has not two ends."""
    rows = rows_by(points.group)
    if any(sorted(points.point[r]) != [1, 2] for r in rows):
        return None
    length = facts.length_mm or np.nan
    return ArtefactShape(
        rows, bar_misfit, length, facts.length_mm or common_length(points.xyz, rows), True, (), no_references(points)
    )


SCREENING = Screening(shape_of, balls=True)
