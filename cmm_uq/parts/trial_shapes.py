"""What of a part's deviations makes a zone: trial parts by which it is inferred have more or less of that, and of no more.

Deviations as measured are also where the part was taken to lie, sizes, and places that the zone leaves free. Multiplied until
the zone is as wide as it may be, these would move a bore by millimetres, and the trial part would be none. They are taken out
by least squares along the normals.
"""

from __future__ import annotations

import numpy as np

from cmm_uq.parts.characteristics import Evaluation
from cmm_uq.parts.datums import BEST_FIT
from cmm_uq.parts.plan import FORMS, ORIENTATIONS, Feature
from cmm_uq.points import Floats, Ints

_FREE = 1e-9
"""Of the largest, a singular value of motions that points do not tell from others."""


def shape_of(one: Evaluation, deviations: Floats) -> Floats:
    """(n, 3) deviations that make the zone of a characteristic, of those (n, 3) of all points of its plan, mm.

    Free are a common motion of its features and the size of each; of an orientation also where each lies.
    """
    plan, names = one.plan, [name for name, _ in one.keys]
    if one.characteristic.what not in FORMS:
        datums = [feature.name for feature in plan.features] if one.frame_of == BEST_FIT else [n for n, _ in one.datums]
        names = list(dict.fromkeys(member for name in (*names, *datums) for member in plan.members(name)))
    rows, along = _probed([plan.feature(name) for name in names], [plan.rows[name] for name in names])
    points = plan.points[rows] - plan.points[rows].mean(axis=0)
    points = points / max(float(np.abs(points).max(initial=0.0)), 1.0)
    motions = [along, np.cross(points, along)]
    for name in names:
        own = (plan.rows[name].start <= rows) & (rows < plan.rows[name].stop)
        if plan.feature(name).nominal.diameter_mm is not None:
            motions.append(1.0 * own[:, None])
        if one.characteristic.what in (*ORIENTATIONS, "angle"):
            motions.append(own[:, None] * along)
    away = np.einsum("mi,mi->m", deviations[rows], along)
    away = away - _explained(np.column_stack(motions), away)
    found = np.zeros_like(deviations)
    np.add.at(found, rows, away[:, None] * along)
    return found


def _probed(features: list[Feature], rows: list[slice]) -> tuple[Ints, Floats]:
    """Rows (m,) of the points and the directions (m, 3) along which they count: normals, of a point every axis."""
    where, along = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 3))]
    for feature, own in zip(features, rows, strict=True):
        each = np.arange(own.start, own.stop)
        point = feature.kind == "point"
        where.append(np.repeat(each, 3) if point else each)
        along.append(np.tile(np.eye(3), (len(each), 1)) if point else feature.normals)
    return np.concatenate(where), np.concatenate(along)


def _explained(motions: Floats, away: Floats) -> Floats:
    left, sizes, _ = np.linalg.svd(motions, full_matrices=False)
    left = left[:, sizes > _FREE * sizes[0]]
    return np.asarray(left @ (left.T @ away))
