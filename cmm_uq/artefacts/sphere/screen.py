"""What a test sphere asks of a recording: points lie on a sphere, where their normals say."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.screening.shape import (
    ArtefactShape,
    Screening,
    ball_misfit,
    no_references,
    recentred,
    rows_by,
    samples_of,
    spread,  # fmt: skip
)
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.jobs.tables.artefact import ArtefactFacts

_NORMAL = 0.4
"""Part of the radius by which a recorded normal may miss the point: normals may be nominal, 20° off."""

_NORMALS = tuple(f"n{a}" for a in AXES)


def shape_of(facts: ArtefactFacts, points: Points) -> ArtefactShape | None:
    """Spheres, with normals where they are recorded; ``None`` where one has too few points."""
    rows, radius = rows_by(points.measurement), (facts.length_mm or np.nan) / 2
    if any(len(r) < 5 for r in rows):
        return None
    extent = radius if np.isfinite(radius) else 0.5 * float(np.median([spread(points.xyz[r]) for r in rows]))
    if not all(name in points.columns for name in _NORMALS):
        return ArtefactShape(rows, ball_misfit, radius, extent, False, (), no_references(points))
    normals = np.column_stack([points.columns[name] for name in _NORMALS])
    return ArtefactShape(rows, _ball_with_normals, radius, extent, False, _NORMALS, normals)


def _ball_with_normals(xyz: Floats, normals: Floats, radius: float) -> Floats:
    """Each normal says where the centre lies; their median does not follow a few."""
    if np.isnan(radius):
        i, j = samples_of(len(xyz), 2).T
        steps = normals[j] - normals[i]
        squares = np.sum(steps**2, axis=1)
        if not np.any(wide := squares > 0.5 * squares.max()):
            return np.zeros(len(xyz))
        radius = float(np.median(np.sum((xyz[j] - xyz[i]) * steps, axis=1)[wide] / squares[wide]))
    away = xyz - np.median(xyz - radius * normals, axis=0)
    away, radius = recentred(away, radius, free=False)  # nominal normals put it astray
    misses = np.linalg.norm(away - radius * normals, axis=1) - _NORMAL * abs(radius)
    return np.asarray(np.maximum(np.abs(np.linalg.norm(away, axis=1) - radius), misses), dtype=np.float64)


SCREENING = Screening(shape_of)
