"""The measurement plan of a part's job and its circumstances, as the virtual measurement takes them.

Features as lines that can be drawn: circles about an axis, generators, the border of what is probed of a plane.

Lines are as a view along one direction shows them, so that the generators of a cylinder are those at its edge.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cmm_uq.analysis.machine.state import MachineState, at_points
from cmm_uq.analysis.parts import plan as plans
from cmm_uq.analysis.parts.causes import surroundings as causes
from cmm_uq.analysis.parts.causes.cause import LARGE, PartCause, PointScatter
from cmm_uq.analysis.parts.causes.surroundings import Expansion, SurfaceForm, Surroundings
from cmm_uq.analysis.parts.evaluation import characteristics_of
from cmm_uq.analysis.parts.plan import Nominal, PartFeature, PartPose, Plan, around, placed
from cmm_uq.analysis.parts.virtual import MeasurementConditions
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Machine
from cmm_uq.base.units import MICROMETRE
from cmm_uq.jobs.part.checks import as_one, members, readings, rotation
from cmm_uq.jobs.part.feature import CharacteristicFacts, FormFacts
from cmm_uq.jobs.part.job import PartJob
from cmm_uq.jobs.part.probed import Probed, probed, whole_surface
from cmm_uq.maths.geometry.feature import frame_about

PLACES = 16  # places of the part that are drawn where it does not lie in the same one each time


def plan_of(job: PartJob) -> Plan:
    """The plan of a job that was read: geometry alone, in mm and rad, in the frame of the part."""
    facts = job.facts
    features = tuple(_feature(f, facts.stylus_of(f.facts).name, f.facts.form or facts.form) for f in job.features)
    names = [one.name for one in features]
    ends = np.cumsum([0, *(len(one.points) for one in features)])
    order = [names.index(name) for name in facts.probing.order] or list(range(len(names)))
    rows = np.concatenate([np.arange(ends[i], ends[i + 1]) for i in order])
    times = np.zeros(0)
    if facts.probing.seconds_per_point:
        times = np.empty(len(rows))
        times[rows] = facts.probing.seconds_per_point * np.arange(len(rows))
    styli = tuple(
        plans.Stylus(one.name, np.array(one.offset_mm), one.diameter_mm, one.u_diameter_um, np.array(one.u_offset_um),
                     one.lobing_um, None if one.qualified_at_mm is None else np.array(one.qualified_at_mm))
        for one in facts.stylus
    )  # fmt: skip
    alignment = plans.PartAlignment(tuple(facts.alignment.datums), facts.alignment.best_fit)
    characteristics = tuple(_characteristic(one) for one in facts.characteristic)
    return Plan(features, characteristics, styli, alignment, rows.astype(np.int64), times, _common(job))


def _feature(one: Probed, stylus: str, form: FormFacts) -> plans.PartFeature:
    facts = one.facts
    half = None if facts.angle_deg is None else float(np.radians(facts.angle_deg / 2))
    sized = facts.diameter_mm if facts.kind != "plane" else None
    nominal = Nominal(np.array(facts.point_mm), one.direction, sized, half)
    given = plans.PartFeature(facts.name, facts.kind, one.points, one.normals, stylus, nominal, facts.association)
    whole = whole_surface(facts, form.surface_points)
    return given if whole is None else replace(given, surface=whole.points, surface_normals=whole.normals)


def _characteristic(one: CharacteristicFacts) -> plans.PartCharacteristic:
    lower, upper = one.lower_mm, one.upper_mm
    if one.asks.limits == "angles":
        lower, upper = (None if limit is None else float(np.radians(limit)) for limit in (one.lower_deg, one.upper_deg))
    elif one.asks.limits == "zone":
        upper = one.tolerance_mm
    features, datums = tuple(one.features), tuple(one.datums)
    return plans.PartCharacteristic(one.name, one.what, features, datums, lower, upper, one.association)


def _common(job: PartJob) -> tuple[plans.CommonDatum, ...]:
    """Datums on several features, which alignment and characteristics name."""
    features = {one.facts.name: one for one in job.features}
    named = [*job.facts.alignment.datums, *(name for one in job.facts.characteristic for name in one.datums)]
    found = []
    for name in dict.fromkeys(named):
        own = members(name, features)
        if len(own) > 1:
            kind, point, direction = as_one([features[each] for each in own])
            found.append(plans.CommonDatum(name, own, kind, Nominal(point, direction)))
    return tuple(found)


def refuse_unfit(job: PartJob) -> None:
    """Refuse what a virtual measurement of the job would refuse of its plan."""
    plan, path = plan_of(job), job.folder / "job.toml"
    try:
        nominal = characteristics_of(plan, plan.points)
    except CmmUqError as error:
        raise CmmUqError(error.problem, where=f"{path}: {error.where or ''}", fix=error.fix) from error
    for one, value in zip(plan.characteristics, nominal.tolist(), strict=True):
        limits = [limit for limit in (one.lower, one.upper) if limit is not None]
        if one.what == "distance" and limits and max(map(abs, limits)) < value - max(map(abs, limits)):
            said = " to ".join(f"{limit:g}" for limit in limits)
            raise CmmUqError(
                f"limits of {said} mm, where the distance is {value:.6g} mm by the nominals",
                where=f"{path}: [[characteristic]] {one.name}",
                fix="Give limits of the distance itself, not deviations from it",
            )


def refuse_out_of_reach(job: PartJob, machine: Machine) -> None:
    """Refuse a part that the axes do not reach everywhere, in any of the places where it may lie."""
    plan = plan_of(job)
    for pose in poses_of(job, PLACES, machine):
        try:
            placed(plan, pose, machine)
        except CmmUqError as error:
            raise CmmUqError(error.problem, where=f"{job.folder / 'job.toml'}: [placing]", fix=error.fix) from error


def circumstances_of(job: PartJob, machine: MachineState, plan: Plan, places: int) -> MeasurementConditions:
    """How and where the part is measured."""
    further, size = list[PartCause](), MICROMETRE * job.facts.placing.u_fixture_um
    if size:  # what clamping does to each point on its own
        further.append(PointScatter.of(causes.FIXTURE, "fixture", np.full((len(plan.points), 3), size)))
    # what who measures does to each point, and to characteristics
    if job.facts.probing.u_operator_um:
        further.append(causes.of_points(plan, job.facts.probing.u_operator_um))
    asked = [one for one in job.facts.characteristic if one.u_operator_um or one.u_operator_deg]
    if asked:
        u = {one.name: MICROMETRE * one.u_operator_um + float(np.radians(one.u_operator_deg)) for one in asked}
        further.append(causes.reproducibility(plan, u))
    if job.reported is not None and job.reported.rounding:
        further.append(causes.reproducibility(plan, job.reported.rounding, causes.ROUNDING, "last digit"))
    poses, repeats = poses_of(job, places, machine.machine), job.facts.probing.repeats
    surroundings = surroundings_of(job)
    columns = placed(plan, poses[0], machine.machine, surroundings.since(machine.temperature_c).columns).columns
    machine = at_points(machine, columns)
    return MeasurementConditions(machine, poses, surroundings, forms_of(job), repeats, tuple(further))


def poses_of(job: PartJob, count: int, machine: Machine) -> tuple[PartPose, ...]:
    """Where the part lies: the one place that is stated, or so many where it may lie."""
    given = job.facts.placing
    pose = PartPose(rotation(given), origin_of(job, machine))
    if not (any(given.u_origin_mm) or any(given.u_rotation_deg)):
        return (pose,)
    return around(pose, np.array(given.u_origin_mm), np.radians(given.u_rotation_deg), count)


def origin_of(job: PartJob, machine: Machine) -> Floats:
    """(3,) where the part's origin lies in coordinates of the machine, as the job says; else in the middle of the travel."""
    if job.facts.placing.origin_mm is not None:
        return np.array(job.facts.placing.origin_mm, dtype=np.float64)
    # so that its points are in the middle of the travel, to the mm
    read = np.concatenate([readings(one, job.facts) for one in job.features])
    read = read - job.facts.machine_state.origin_mm + machine.origin_mm
    return np.asarray(np.round(machine.travel_mm.mean(axis=1) - 0.5 * (read.min(axis=0) + read.max(axis=0))))


def surroundings_of(job: PartJob) -> Surroundings:
    """Temperatures of part and scales, and what is known of them."""
    facts, given = job.facts.part, job.facts.environment
    part = Expansion(facts.cte_per_k, facts.u_cte_per_k, given.part_c, given.u_part_k, given.compensated)
    x, y, z = (
        Expansion(given.scales_cte_per_k, given.u_scales_cte_per_k, celsius, given.u_scales_k, given.compensated)
        for celsius in given.scales_c
    )
    return Surroundings(part, (x, y, z), np.array(given.u_gradient_k_per_m), given.u_drift_k)


def forms_of(job: PartJob) -> tuple[SurfaceForm, ...]:
    """Form of each feature: its own, else that of all."""
    found = []
    for one in job.features:
        given = one.facts.form or job.facts.form
        lobed = one.facts.kind in ("circle", "cylinder", "cone")
        harmonics = tuple((int(count), size) for count, size in given.harmonics_um.items()) if lobed else ()
        if given.field_um or harmonics or given.roughness_um:
            form = harmonics, given.field_um, given.correlation_mm, given.roughness_um
            found.append(SurfaceForm(one.facts.name, *form))
    return tuple(found)


def doubled(job: PartJob) -> PartJob:
    """The job with twice the points in every feature that is probed by a pattern, and nothing measured."""
    where = str(job.folder / "job.toml")
    if any(len(one.points) >= LARGE for one in job.features):
        raise CmmUqError("has a feature of thousands of points", where=where, fix="More of them change nothing")
    if all(one.facts.strategy is None for one in job.features):
        fix = "Give strategy in place of points_mm"
        raise CmmUqError("has no feature that is probed by a pattern", where=where, fix=fix)
    return replace(job, features=tuple(map(_doubled, job.features)), measured=None)


def _doubled(one: Probed) -> Probed:
    if (pattern := one.facts.strategy) is None:
        return one
    key = "columns" if pattern.pattern == "grid" else "points"
    more = pattern.model_copy(update={key: 2 * (getattr(pattern, key) or 1)})
    return probed(one.facts.model_copy(update={"strategy": more}), one.facts.name)


_STEPS = 48  # of a circle
_ALONG = 1e-6  # sine of the angle to the view below which an axis is seen end on
_FLAT = 1e-9  # of the size of a set of points, below which it has no second direction


def outline(feature: PartFeature, view: Floats) -> list[Floats]:
    """Polylines (m, 3) of a nominal feature as far as it is probed; none of a point.

    ``view``: (3,) direction along which one looks.
    """
    points, nominal = feature.points, feature.nominal
    if nominal.direction is None:
        radius = 0.5 * (nominal.diameter_mm or 0.0)
        return [_ring(nominal.point, view, radius)] if radius else []
    axis = nominal.direction
    if nominal.diameter_mm is None or feature.kind in ("line", "plane"):
        return [_border(points, axis)] if feature.kind == "plane" else [_ends(points, axis)]
    along = (points - nominal.point) @ axis
    ends = [nominal.point + at * axis for at in (along.min(), along.max())]
    slope = np.tan(nominal.half_angle_rad or 0.0)
    radii = [0.5 * nominal.diameter_mm + slope * at for at in (along.min(), along.max())]
    if feature.kind == "circle":
        return [_ring(nominal.point, axis, radii[0])]
    rings = [_ring(end, axis, radius) for end, radius in zip(ends, radii, strict=True)]
    across = np.cross(axis, view)
    size = float(np.linalg.norm(across))
    if size < _ALONG:
        return rings
    sides = [
        np.array([end + sign * radius * across / size for end, radius in zip(ends, radii, strict=True)])
        for sign in (-1.0, 1.0)
    ]
    return [*rings, *sides]


def _ring(centre: Floats, axis: Floats, radius: float) -> Floats:
    angle = np.linspace(0.0, 2 * np.pi, _STEPS + 1)
    one, other = frame_about(axis / np.linalg.norm(axis))[:2]
    return np.asarray(centre + radius * (np.outer(np.cos(angle), one) + np.outer(np.sin(angle), other)))


def _ends(points: Floats, axis: Floats) -> Floats:
    along = points @ axis
    return points[[int(along.argmin()), int(along.argmax())]]


def _border(points: Floats, normal: Floats) -> Floats:
    """The convex border of points on a plane, closed."""
    flat = (points - points.mean(axis=0)) @ frame_about(normal)[:2].T
    _, spread, along = np.linalg.svd(flat, full_matrices=False)
    if spread[-1] <= _FLAT * max(float(spread[0]), _FLAT):
        return _ends(points, along[0] @ frame_about(normal)[:2])
    from scipy.spatial import ConvexHull

    corners = ConvexHull(flat).vertices
    return points[[*corners, corners[0]]]
