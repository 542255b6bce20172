"""What a step gauge or gauge blocks ask of a recording: faces lie along each line where their references say."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.screening.shape import ArtefactShape, Screening, line_misfit, rows_by
from cmm_uq.base.points import Points
from cmm_uq.jobs.tables.artefact import ArtefactFacts


def shape_of(facts: ArtefactFacts, points: Points) -> ArtefactShape | None:
    """Lines of faces; ``None`` without references, or with a line of a single face."""
    if "reference_mm" not in points.columns:
        return None
    reference = points.columns["reference_mm"][:, None]
    rows = rows_by(points.measurement)
    if any(np.ptp(reference[r]) == 0 for r in rows):
        return None
    extent = float(np.median([np.ptp(reference[r]) for r in rows]))
    return ArtefactShape(rows, line_misfit, np.nan, extent, False, ("reference_mm",), reference)


SCREENING = Screening(shape_of)
