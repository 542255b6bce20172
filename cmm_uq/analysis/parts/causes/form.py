"""The part's own form among the causes: the points that are probed are a few of a surface that is not its nominal.

Where a feature's ``surface`` is given, what is true of it is what its whole surface says, form and all; the points that are
probed are drawn on the same surface, and what they miss between them is an error like any other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np

from cmm_uq.analysis.parts.causes.cause import CommonCause, PartCause, field_components, normal
from cmm_uq.analysis.parts.plan import DIRECTED, PartFeature, Plan
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE
from cmm_uq.maths.geometry.feature import frame_about

FORM = "form"


@dataclass(frozen=True, eq=False)
class SurfaceForm:
    """What is known of a feature's form, along its normals."""

    feature: str
    # by undulations per revolution about the feature's axis, 2 and more, the standard deviation of each; its phase is any
    harmonics_um: tuple[tuple[int, float], ...] = ()
    # field_um, correlation_mm: standard deviation of a normal random field on the surface, and the distance over which its
    # correlation falls to exp(−½)
    field_um: float = 0.0
    correlation_mm: float = 0.0
    roughness_um: float = 0.0  # standard deviation of each point on its own

    def __post_init__(self) -> None:
        if self.field_um and not self.correlation_mm > 0:
            raise CmmUqError("a field of form needs the distance over which it is correlated",
                             where=f"form of {self.feature!r}", fix="Give correlation_mm")  # fmt: skip

    def kernel(self, feature: PartFeature, points: Floats, some: slice = slice(None)) -> Floats:
        """(m, n) covariance of some along the normals with all points (n, 3), mm²; without roughness."""
        own = points[some]
        found = np.zeros((len(own), len(points)))
        if self.field_um:
            apart = np.linalg.norm(own[:, None] - points, axis=2)
            found += self.field_um**2 * np.exp(-0.5 * (apart / self.correlation_mm) ** 2)
        if self.harmonics_um:
            angle = _angles(feature, points)
            for count, size in self.harmonics_um:
                found += size**2 * np.cos(count * np.subtract.outer(angle[some], angle))
        return np.asarray(MICROMETRE**2 * found)

    def components(self, feature: PartFeature, points: Floats) -> Floats:
        """(K, n) of the form on points (n, 3), mm; without roughness."""
        variance = MICROMETRE**2 * (self.field_um**2 + sum(size**2 for _, size in self.harmonics_um))
        return field_components(partial(self.kernel, feature, points), np.full(len(points), variance))


@lru_cache(maxsize=2)
def forms(known: tuple[SurfaceForm, ...], plan: Plan) -> tuple[list[PartCause], list[PartCause | None]]:
    """Form of the points that are probed, and of whole surfaces: the same wherever the part lies, and so looked up.

    Returns ``causes``: of the plan's points. ``whole``: as many, with the same coefficients, of the points of
    :func:`whole_surfaces`; ``None`` for roughness.
    """
    causes, whole = list[PartCause](), list[PartCause | None]()
    true = whole_surfaces(plan)
    for one in known:
        feature, rows, true_rows = plan.feature(one.feature), plan.rows[one.feature], true.rows[one.feature]
        count, factor = len(feature.points), f"form of {one.feature}"
        both = np.vstack([feature.points, feature.surface]) if len(feature.surface) else feature.points
        if one.field_um or one.harmonics_um:
            shapes = one.components(feature, both)
            draw, factors = normal(np.ones(len(shapes))), (factor,) * len(shapes)
            basis = _placed(shapes[:, :count], plan, rows)
            causes.append(CommonCause(name=FORM, factors=factors, draw=draw, basis=basis))
            on_surface = shapes[:, count:] if len(feature.surface) else np.zeros((len(shapes), count))
            whole.append(CommonCause(name=FORM, factors=factors, draw=draw, basis=_placed(on_surface, true, true_rows)))
        if one.roughness_um:
            causes.append(_rough(one, plan, rows))
            whole.append(None)
    return causes, whole


def whole_surfaces(plan: Plan) -> Plan:
    """The plan with the whole surface of each feature, where it is given, in place of the points that are probed."""
    features = tuple(
        replace(f, points=f.surface, normals=f.surface_normals) if len(f.surface) else f for f in plan.features
    )
    return replace(plan, features=features, order=np.zeros(0, dtype=np.int64), times_s=np.zeros(0))


@dataclass(frozen=True, eq=False, kw_only=True)
class Rough(PartCause):
    """What moves each point of a feature on its own along its normal, in standard deviations."""

    along: Floats  # (m, 3) displacements of its points for one unit of each coefficient, mm
    rows: slice  # of these among the plan's points
    count: int  # of the plan's points

    def through(self, derivative: Floats) -> Floats:
        return np.asarray(np.einsum("pmi,mi->mp", derivative[:, self.rows], self.along))

    def moved(self, coefficients: Floats, rows: slice) -> Floats:
        start, stop, _ = rows.indices(self.count)
        found = np.zeros((len(coefficients), stop - start, 3))
        first, last = max(start, self.rows.start), min(stop, self.rows.stop)
        if first < last:
            own = slice(first - self.rows.start, last - self.rows.start)
            found[:, first - start : last - start] = coefficients[:, own, None] * self.along[own]
        return found


def _rough(one: SurfaceForm, plan: Plan, rows: slice) -> PartCause:
    along = MICROMETRE * one.roughness_um * plan.normals[rows]
    factors = (f"roughness of {one.feature}",) * len(along)
    return Rough(
        name=FORM, factors=factors, draw=normal(np.ones(len(along))), along=along, rows=rows, count=len(plan.points)
    )


def _placed(shapes: Floats, plan: Plan, rows: slice) -> Floats:
    """(K, n, 3) of all points, of shapes (K, m) along the normals of some."""
    basis = np.zeros((len(shapes), len(plan.points), 3))
    basis[:, rows] = shapes[:, :, None] * plan.normals[rows]
    return basis


def _angles(feature: PartFeature, points: Floats) -> Floats:
    """(n,) about the feature's axis."""
    axis = feature.nominal.direction
    if feature.kind not in DIRECTED or axis is None:
        raise CmmUqError(
            "undulations need an axis to go round", where=f"form of {feature.name!r}", fix="Give field_um instead"
        )
    across = (points - feature.nominal.point) @ frame_about(axis)[:2].T
    return np.asarray(np.arctan2(across[:, 1], across[:, 0]))
