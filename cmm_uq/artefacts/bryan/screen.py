"""What a Bryan gauge asks of a recording: the swept ball lies on a sphere about the fixed one."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.screening.shape import ArtefactShape, Screening, ball_misfit, no_references
from cmm_uq.base.points import Points
from cmm_uq.jobs.tables.artefact import ArtefactFacts


def shape_of(facts: ArtefactFacts, points: Points) -> ArtefactShape | None:
    """One sphere; ``None`` with few points, or others than the swept ball."""
    if len(points) < 8 or np.any(points.point != 1):
        return None
    about = points.xyz - np.median(points.xyz, axis=0)
    extent = facts.length_mm or float(np.median(np.linalg.norm(about, axis=1)))
    return ArtefactShape(
        (np.arange(len(points)),), ball_misfit, facts.length_mm or np.nan, extent, False, (), no_references(points)
    )


SCREENING = Screening(shape_of, balls=True)
