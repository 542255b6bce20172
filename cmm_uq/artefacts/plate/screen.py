"""What a plate asks of a recording: balls keep their places to each other."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.screening.shape import ArtefactShape, Screening, body_misfit, rows_by, spread
from cmm_uq.artefacts.plate.observe import REFERENCES
from cmm_uq.base.points import Points
from cmm_uq.jobs.tables.artefact import ArtefactFacts


def shape_of(facts: ArtefactFacts, points: Points) -> ArtefactShape | None:
    """Placings of the plate; ``None`` without references."""
    if any(name not in points.columns for name in REFERENCES):
        return None
    reference = np.column_stack([points.columns[name] for name in REFERENCES])
    return ArtefactShape(
        rows_by(points.measurement), body_misfit, np.nan, spread(reference), False, REFERENCES, reference
    )


SCREENING = Screening(shape_of, balls=True)
