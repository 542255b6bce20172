"""How far measured points lie from the features that are associated with them: what of a part's form was seen."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.parts.plan import FEWEST, Feature, Plan
from cmm_uq.base.points import Floats
from cmm_uq.maths.geometry.association import associate


def deviations_of(plan: Plan, measured: Floats) -> Floats:
    """(n,) signed distances of measured points (n, 3) from their least-squares features, out of the material, mm.

    ``nan`` of features whose number of points alone determines them, which have no form.
    """
    found = np.full(len(measured), np.nan)
    for feature in plan.features:
        if len(feature.points) > FEWEST[feature.kind]:
            rows = plan.rows[feature.name]
            found[rows] = _deviations(feature, measured[rows])
    return found


def _deviations(feature: Feature, points: Floats) -> Floats:
    if feature.kind == "point":
        return np.asarray(np.einsum("ni,ni->n", points - points.mean(axis=0), feature.normals))
    if feature.kind == "line" and feature.nominal.direction is not None:
        along = np.asarray(feature.nominal.direction)
        out = feature.normals.mean(axis=0)
        out = out - (out @ along) * along
        out /= np.linalg.norm(out)
        flat = np.column_stack([points @ along, points @ out])
        flat -= flat.mean(axis=0)
        across = np.linalg.svd(flat, full_matrices=False)[2][1]
        return np.asarray(np.sign(across[1]) * (flat @ across))
    if feature.kind == "plane":
        return associate("plane", points, outward=feature.normals.mean(axis=0)).deviations
    sign = -1.0 if feature.internal else 1.0
    return np.asarray(sign * associate(feature.kind, points).deviations)
