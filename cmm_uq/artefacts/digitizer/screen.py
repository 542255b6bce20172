"""What a digitizer asks of a recording: scans lie on a sphere, centres agree on one offset and one place of the sphere."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.screening.shape import (
    TOLERANCE_MM,
    ArtefactShape,
    Screening,
    ball_misfit,
    rows_by,
    samples_of,
    spread,
)
from cmm_uq.artefacts.digitizer.attitudes import ANGLES, scan_of
from cmm_uq.artefacts.digitizer.facts import AlignmentFacts
from cmm_uq.base.points import Floats, Points
from cmm_uq.machine.physics.effects.scanning import attitudes

_UNKNOWNS = 6
_SOUND = 1e-2
"""Least singular value, over the largest, of three attitudes that tell an offset."""


def shape_of(facts: AlignmentFacts, points: Points) -> ArtefactShape | None:
    """Spheres, one in each attitude, or centres; ``None`` without attitudes, or with scans of a few points."""
    if any(name not in points.columns for name in ANGLES):
        return None
    attitude, scan = attitudes(points), scan_of(points)
    if scan is None:
        everything = (np.arange(len(points)),)
        return ArtefactShape(everything, offset_misfit, np.nan, 0.0, reference=attitude.reshape(-1, 9))
    rows = rows_by(points.measurement)
    if any(len(one) < 5 for one in rows):
        return None
    seen = np.einsum("nij,nj->ni", attitude[:, :, :2], scan)
    radius = (facts.length_mm or np.nan) / 2
    extent = 0.5 * float(np.median([spread((points.xyz + seen)[one]) for one in rows]))
    return ArtefactShape(rows, scan_misfit, radius, radius if np.isfinite(radius) else extent, reference=seen)


def scan_misfit(xyz: Floats, seen: Floats, radius: float) -> Floats:
    """Points of one scan, relative to the mount plus what the scan plane shows (k, 3), against a sphere."""
    return ball_misfit(xyz + seen, seen, radius)


def offset_misfit(xyz: Floats, attitude: Floats, _: float) -> Floats:
    """By the three centres whose offset suits half of all best, then by all that agree with these."""
    count = len(xyz)
    if count < 3:
        return np.zeros(count)
    design = np.concatenate([attitude.reshape(count, 3, 3), np.broadcast_to(np.eye(3), (count, 3, 3))], axis=2)
    samples = np.array([np.arange(3)]) if count == 3 else samples_of(count, 3)
    some = design[samples].reshape(len(samples), 9, _UNKNOWNS)
    s = np.linalg.svd(some, compute_uv=False)
    sound = s[:, -1] > _SOUND * s[:, 0]
    if not sound.any():
        return np.zeros(count)
    found = np.linalg.pinv(some[sound]) @ xyz[samples[sound]].reshape(-1, 9, 1)
    misfits = np.linalg.norm(xyz - np.einsum("nij,sj->sni", design, found[:, :, 0]), axis=2)
    best = misfits[np.argmin(np.median(misfits, axis=1))]
    agree = best <= max(4 * float(np.median(best)), TOLERANCE_MM)
    fitted, *_rest = np.linalg.lstsq(design[agree].reshape(-1, _UNKNOWNS), xyz[agree].ravel(), rcond=None)
    return np.asarray(np.linalg.norm(xyz - design @ fitted, axis=1), dtype=np.float64)


SCREENING = Screening(shape_of)
