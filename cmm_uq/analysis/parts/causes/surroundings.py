"""The part's own form, temperatures, the fixture and operators among the causes.

Where a feature's ``surface`` is given, what is true of it is what its whole surface says, form and all; the points that are
probed, a few of a surface that is not its nominal, are drawn on the same surface, and what they miss between them is an error
like any other.

A part is measured at 20 °C (ISO 1), or reduced to it by an expansion coefficient and a temperature that both are uncertain:
what remains is the difference of two products, drawn as such. A warm scale reads too little. A gradient bends the part.

What repeats by different people, days or set-ups scatter by beyond everything else is stated, not computed: from repeats of
one's own. It is common to a measurement, however often each point is read, and drawn again in the next measurement.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache, partial

import numpy as np

from cmm_uq.analysis.parts.causes.cause import CommonCause, PartCause, PointScatter, Rough, field_components, normal
from cmm_uq.analysis.parts.plan import PartFeature, PartPose, Plan
from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import METRE, MICROMETRE, REFERENCE_TEMPERATURE
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.jobs.part.feature import ORIENTED
from cmm_uq.maths.geometry.feature import frame_about

FORM, TEMPERATURE, FIXTURE, OPERATOR, ROUNDING = "form", "temperature", "fixture", "operator", "rounding"


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
            said, where = "a field of form needs the distance over which it is correlated", f"form of {self.feature!r}"
            raise CmmUqError(said, where=where, fix="Give correlation_mm")

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
            along, name = MICROMETRE * one.roughness_um * plan.normals[rows], f"roughness of {one.feature}"
            causes.append(Rough(name=FORM, factors=(name,) * count, draw=normal(np.ones(count)), along=along, rows=rows,
                                count=len(plan.points)))  # fmt: skip
            whole.append(None)
    return causes, whole


def whole_surfaces(plan: Plan) -> Plan:
    """The plan with the whole surface of each feature, where it is given, in place of the points that are probed."""
    features = tuple(
        replace(f, points=f.surface, normals=f.surface_normals) if len(f.surface) else f for f in plan.features
    )
    return replace(plan, features=features, order=np.zeros(0, dtype=np.int64), times_s=np.zeros(0))


def _placed(shapes: Floats, plan: Plan, rows: slice) -> Floats:
    """(K, n, 3) of all points, of shapes (K, m) along the normals of some."""
    basis = np.zeros((len(shapes), len(plan.points), 3))
    basis[:, rows] = shapes[:, :, None] * plan.normals[rows]
    return basis


def _angles(feature: PartFeature, points: Floats) -> Floats:
    """(n,) about the feature's axis."""
    axis = feature.nominal.direction
    if feature.kind not in ORIENTED or axis is None:
        where, fix = f"form of {feature.name!r}", "Give field_um instead"
        raise CmmUqError("undulations need an axis to go round", where=where, fix=fix)
    across = (points - feature.nominal.point) @ frame_about(axis)[:2].T
    return np.asarray(np.arctan2(across[:, 1], across[:, 0]))


def elapsed(plan: Plan) -> Floats:
    """(n,) part of the measurement that is over at each point, by its times or else by its order."""
    n = len(plan.points)
    if len(plan.times_s):
        since = plan.times_s - plan.times_s.min()
        return np.asarray(since / (since.max() or 1.0))
    place = np.empty(n)
    place[plan.order if len(plan.order) else np.arange(n)] = np.arange(n)
    return place / max(n - 1, 1)


@dataclass(frozen=True)
class Expansion:
    # cte_per_k, u_cte_per_k: coefficient of thermal expansion, and its standard uncertainty
    cte_per_k: float = 0.0
    u_cte_per_k: float = 0.0
    # temperature_c, u_temperature_k: as measured, and its standard uncertainty
    temperature_c: float = REFERENCE_TEMPERATURE
    u_temperature_k: float = 0.0
    corrected: bool = True  # whether results are reduced to 20 °C with these
    # temperature at which its size is known: 20 °C; of scales that of the machine's calibration, where the errors that it
    # found are those of then
    known_at_c: float = REFERENCE_TEMPERATURE

    @property
    def excess(self) -> float:
        """K by which it is warmer than where its size is known."""
        return self.temperature_c - self.known_at_c

    @property
    def left(self) -> float:
        """Relative expansion that is not corrected, as far as it is known."""
        return 0.0 if self.corrected else self.cte_per_k * self.excess

    @property
    def uncertain(self) -> bool:
        return bool(self.u_cte_per_k or (self.u_temperature_k and (self.cte_per_k or self.u_cte_per_k)))

    def drawn(self, cte: Floats, kelvin: Floats) -> Floats:
        """(N,) relative expansion about its mean, for standard normal draws of the coefficient and of the temperature."""
        true = (self.cte_per_k + self.u_cte_per_k * cte) * (self.excess + self.u_temperature_k * kelvin)
        return np.asarray(true - self.cte_per_k * self.excess)


@dataclass(frozen=True, eq=False)
class Surroundings:
    part: Expansion = Expansion()  # the part
    # of x, y, z, of one material: what is not known of their coefficient is common to them. Without uncertainty by default,
    # as it is right where the machine's certificate models their expansion.
    scales: tuple[Expansion, Expansion, Expansion] = (Expansion(), Expansion(), Expansion())
    # (3,) standard uncertainty of the temperature's gradient in the part along the axes of the machine
    u_gradient_k_per_m: Floats = field(default_factory=lambda: np.zeros(3))
    # standard uncertainty of how much the part, and each scale, has warmed from the first point to the last, evenly in the
    # order of probing
    u_drift_k: float = 0.0
    # temperatures by their columns, for effects of the machine that need some
    columns: dict[str, float] = field(default_factory=dict)

    def since(self, calibrated_c: float | None) -> Surroundings:
        """With scales that are known at the temperature of the machine's calibration; ``None`` leaves them at 20 °C."""
        if calibrated_c is None:
            return self
        x, y, z = (replace(scale, known_at_c=calibrated_c) for scale in self.scales)
        return replace(self, scales=(x, y, z))


def mean_expansion(surroundings: Surroundings, plan: Plan, points: Points, pose: PartPose) -> Floats:
    """(n, 3) displacements by what is not corrected of temperatures, without any draw, mm."""
    scales = np.array([scale.left for scale in surroundings.scales])
    return surroundings.part.left * _about(plan) - pose.back(scales * points.carriages)


def temperatures(surroundings: Surroundings, plan: Plan, points: Points, pose: PartPose) -> list[PartCause]:
    """Expansion of part and scales, and bending of the part in a gradient."""
    part, found = surroundings.part, list[PartCause]()
    if part.uncertain:

        def of_part(random: np.random.Generator, n: int) -> Floats:
            return part.drawn(random.standard_normal(n), random.standard_normal(n))[:, None]

        found.append(CommonCause(name=TEMPERATURE, factors=("part",), draw=of_part, basis=_about(plan)[None]))
    if any(scale.uncertain for scale in surroundings.scales):

        def of_scales(random: np.random.Generator, n: int) -> Floats:
            cte = random.standard_normal(n)
            return np.column_stack([s.drawn(cte, random.standard_normal(n)) for s in surroundings.scales])

        along = np.stack([-points.carriages[:, [i]] * np.eye(3)[i] for i in range(len(AXES))])
        factors = tuple(f"scale {axis}" for axis in AXES)
        found.append(CommonCause(name=TEMPERATURE, factors=factors, draw=of_scales, basis=pose.back(along)))
    if np.any(surroundings.u_gradient_k_per_m) and part.cte_per_k:
        basis = part.cte_per_k * _bent(_about(plan), pose.back(np.eye(3))) / METRE
        draw = normal(surroundings.u_gradient_k_per_m)
        found.append(CommonCause(name=TEMPERATURE, factors=("gradient in the part",) * 3, draw=draw, basis=basis))
    return [*found, *_warming(surroundings, plan, points, pose)]


def _warming(surroundings: Surroundings, plan: Plan, points: Points, pose: PartPose) -> list[PartCause]:
    """Expansion of part and scales while points are probed: what is probed later is warmer."""
    kelvin, done = surroundings.u_drift_k, elapsed(plan)[:, None]
    bases = {"warming of the part": surroundings.part.cte_per_k * done * _about(plan)}
    for i, (axis, scale) in enumerate(zip(AXES, surroundings.scales, strict=True)):
        bases[f"warming of scale {axis}"] = pose.back(-scale.cte_per_k * done * points.carriages[:, [i]] * np.eye(3)[i])
    seen = {factor: b[None] for factor, b in bases.items() if kelvin and np.any(b)}
    return [CommonCause(name=TEMPERATURE, factors=(f,), draw=normal([kelvin]), basis=b) for f, b in seen.items()]


def _about(plan: Plan) -> Floats:
    """(n, 3) points about their middle: where the part is held, an alignment takes away."""
    return np.asarray(plan.points - plan.points.mean(axis=0))


def _bent(about: Floats, directions: Floats) -> Floats:
    """(3, n, 3) of a free body in a linear field of temperature along each direction: (g·r)r − ½r²g, without stress.

    Boley and Weiner, Theory of Thermal Stresses, 1960: a linear field leaves a simply connected free body without stress.
    """
    square = np.einsum("ni,ni->n", about, about)
    return np.stack([(about @ g)[:, None] * about - 0.5 * square[:, None] * g for g in directions])


@dataclass(frozen=True, eq=False, kw_only=True)
class Reproducibility(PartCause):
    """What changes characteristics and moves no point."""

    adds: Floats  # (K, c) change of each characteristic for one unit of each coefficient, mm or rad
    count: int  # of the plan's points

    def through(self, derivative: Floats) -> Floats:
        return np.zeros((len(self.factors), len(derivative)))

    def moved(self, coefficients: Floats, rows: slice) -> Floats:
        return np.zeros((len(coefficients), len(range(*rows.indices(self.count))), 3))


def reproducibility(
    plan: Plan, u: Mapping[str, float], cause: str = OPERATOR, line: str = "reproducibility"
) -> Reproducibility:
    """A standard uncertainty of some characteristics, each on its own.

    ``u``: by name of the characteristic, mm or rad. ``line``: how its lines of the budget begin.
    """
    names = [one.name for one in plan.characteristics]
    for name in u:
        if name not in names:
            fix = suggestion(name, names)
            raise CmmUqError(f"there is no characteristic {name!r}", where="reproducibility", fix=fix)
    adds = np.zeros((len(u), len(names)))
    adds[np.arange(len(u)), [names.index(name) for name in u]] = 1.0
    factors, draw = tuple(f"{line} of {name}" for name in u), normal(list(u.values()))
    return Reproducibility(name=cause, factors=factors, draw=draw, adds=adds, count=len(plan.points))


def of_points(plan: Plan, u_um: float) -> PointScatter:
    """A standard uncertainty of each coordinate of each point, common to its repeats."""
    return PointScatter.of(OPERATOR, "reproducibility of points", np.full((len(plan.points), 3), MICROMETRE * u_um))
