"""Repeated readings of the same point in the same placing: their means, and what is known of each mean."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Ints, Points

NOISE_RATIO = "noise_ratio"  # optional column: standard uncertainty of this reading over that of an ordinary one


@dataclass(frozen=True, eq=False)
class Means:
    """One row a (measurement, point), in this order."""

    measurement: Ints  # measurement, point: (m,) as recorded
    point: Ints
    readings: Floats  # (m, 3) scale readings of x, y, z, mm, weighted by the noise of each repeat
    noise_scale: Floats  # (m,) standard uncertainty of each mean over that of one ordinary reading
    time: Floats | None  # (m,) s; ``None`` where it was not recorded
    line: Ints  # (m,) of the first repeat in its file; 0 where there is none
    of: Ints  # (n,) row that each recorded point went into
    ratio: Floats  # (n,) noise of each recorded point over an ordinary one's


def means_over_repeats(points: Points, where: str = "") -> Means:
    """Means of a recording."""
    ratio = points.columns.get(NOISE_RATIO, np.ones(len(points)))
    if (ratio <= 0).any():
        raise CmmUqError(
            "noise_ratio must be positive", where=where, fix="1 is an ordinary reading, 2 one twice as noisy"
        )
    keys, first, of = np.unique(
        np.column_stack([points.measurement, points.point]), axis=0, return_index=True, return_inverse=True
    )
    of = of.ravel()
    weight = 1 / ratio**2
    total = np.bincount(of, weight)
    readings = np.column_stack([np.bincount(of, weight * x) / total for x in points.carriages.T])
    time = points.columns.get("time_s")
    line = points.lines[first] if len(points.lines) else np.zeros(len(keys), dtype=np.int64)
    return Means(
        keys[:, 0], keys[:, 1], readings, 1 / np.sqrt(total),
        None if time is None else np.asarray(np.bincount(of, weight * time) / total), line, of, ratio,
    )  # fmt: skip
