"""What a part may be that was measured: less the errors of a draw, as far as these are not form that only errors have.

Of orientation, location and runout the form of a feature is little beside where it is. What was measured of it is mostly error
where errors have more of it than is seen. Another draw's form taken off would not make it less but more: form that errors
have is not taken off, and what was measured is shrunk by as much as errors explain (the positive part of James and Stein's
estimate: Baranchik, Ann. Math. Stat. 41 (1970) 642). Of form itself all is what the part may be.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cmm_uq.analysis.parts.evaluating import Movement
from cmm_uq.analysis.parts.plan import Feature, Plan
from cmm_uq.base.points import Floats

_FREE = 1e-9
"""Of the largest, a singular value of motions that points do not tell from others."""


def trial_parts(errors: Movement, perfect: Movement, plan: Plan, *, form: bool) -> Movement:
    """(N, …) what the part may be, from what it was measured as.

    Parameters
    ----------
    errors : (N, …) draws.
    perfect : (1, …) from the part as measured to the nominal one.
    form : whether a form is asked of it.
    """
    less = errors.times(-1.0)
    return less if form else less.plus(_seen_form(errors, perfect, plan))


def _seen_form(errors: Movement, perfect: Movement, plan: Plan) -> Movement:
    """Of errors their form, less that of the measured part as far as errors explain it."""
    found = {}
    for name, drawn in errors.points.items():
        normals, motions = _motions([plan.feature(member) for member in plan.members(name)])
        form, measured = (_left(moved, normals, motions) for moved in (drawn, perfect.points[name]))
        seen = float(np.sum(measured**2))
        explained = min(1.0, float(np.mean(np.sum(form**2, axis=1))) / seen) if seen else 0.0
        along = form + explained * measured
        found[name] = along if drawn.ndim == 2 else along[:, :, None] * normals
    return replace(errors.times(0.0), points=found)


def _left(moved: Floats, normals: Floats, motions: Floats) -> Floats:
    """(N, m) form along the normals of displacements (N, m, 3), or (N, m) along them."""
    along = moved if moved.ndim == 2 else np.einsum("kmi,mi->km", moved, normals)
    return np.asarray(along - (along @ motions) @ motions.T)


def _motions(features: list[Feature]) -> tuple[Floats, Floats]:
    """Normals (m, 3) of the points of features, and (m, r) orthonormal motions and sizes of each; of points all is such."""
    normals = np.concatenate([feature.normals for feature in features])
    found, start = list[Floats](), 0
    for feature in features:
        own = slice(start, start := start + len(feature.points))
        motions = np.eye(len(feature.points)) if feature.kind == "point" else _own(feature)
        found.append(np.zeros((len(normals), motions.shape[1])))
        found[-1][own] = motions
    return normals, np.hstack(found)


def _own(feature: Feature) -> Floats:
    about = feature.points - feature.points.mean(axis=0)
    about = about / max(float(np.abs(about).max()), 1.0)
    moved = [feature.normals, np.cross(about, feature.normals)]
    if feature.nominal.diameter_mm is not None:
        moved.append(np.ones((len(about), 1)))
    left, sizes, _ = np.linalg.svd(np.hstack(moved), full_matrices=False)
    return np.asarray(left[:, sizes > _FREE * sizes[0]])
