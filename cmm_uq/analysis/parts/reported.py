"""What was measured of a part: by points, or by values that the report of another program states.

Of a report a characteristic has the value that is stated under its name. Where there is none, but its features are stated
with all that it is of, it follows from them exactly: from points on features without form, that lie where the report says.
Coordinates of the report are taken to be in the frame of the part's alignment. What needs points that nobody has, as a form,
is left out.

Of a zone w the value does not say to which side the part deviates. A zone is a seminorm of the deviations, so that errors,
with their mean, change it by no more than the zone F that they give a perfect part: |w − θ| ≤ F, whatever the part. Its U is
the quantile of F at the coverage, and holds at least as often. Decisions take F whole to either side, for a mean error may
point to one.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cmm_uq.analysis.parts.characteristics import never_negative
from cmm_uq.analysis.parts.evaluation import characteristics_of
from cmm_uq.analysis.parts.plan import PartCharacteristic, PartFeature, Plan
from cmm_uq.analysis.parts.result import evaluated
from cmm_uq.analysis.parts.setup import plan_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, commas, names, say
from cmm_uq.base.points import AXES, Floats
from cmm_uq.base.values import dataclass, replace
from cmm_uq.jobs.part.feature import ASKS
from cmm_uq.jobs.part.job import PartJob
from cmm_uq.jobs.part.readings import FAR_MM, in_another_unit
from cmm_uq.jobs.part.values import Reported, ReportedFeature

_FAR_DEG = 5.0  # from the nominal angle: a value farther away is of another angle
_SHAPED = ("point", "circle", "sphere", "cylinder", "plane")  # kinds whose points follow from what reports say
_TURNED = ("cylinder", "plane")  # of these, those whose place says nothing without a direction


@dataclass(frozen=True, eq=False)
class Measured:
    job: PartJob  # without characteristics of which the report says nothing
    values: Floats | None  # (c,) mm and rad; ``None`` where nothing was measured
    warnings: tuple[Text, ...] = ()


def measured_of(job: PartJob) -> Measured:
    """Values of a job's characteristics, by its points or its report; refused where they cannot be of this part."""
    plan = plan_of(job)
    if job.reported is None:
        return Measured(job, None if job.measured is None else evaluated(plan, job.measured))
    _refuse_whole_surfaces(job, plan)
    given, nominal = job.reported, characteristics_of(plan, plan.points)
    points = np.concatenate([_points(one, given.features.get(one.name), job) for one in plan.features])
    following = characteristics_of(plan, points)
    values, rounding, kept, derived = list[float](), dict[str, float](), list[bool](), list[str]()
    for i, one in enumerate(plan.characteristics):
        stated, radian = given.values.get(one.name), float(np.radians(1.0)) if one.what == "angle" else 1.0
        kept.append(stated is not None or _follows(one, plan, given))
        if not kept[-1]:
            continue
        if stated is None:
            derived.append(one.name)
            values.append(float(following[i]))
            # coordinates of two features, or of one in a diameter, off by half a digit each
            step = 2 * given.features[one.features[0]].step
            step = step if np.isfinite(step) else 0.0  # an angle of directions alone
        else:
            values.append(radian * stated.value)
            step = radian * stated.step
            _refuse_far(one, stated.value, float(nominal[i]) / radian, stated.where)
        rounding[one.name] = step / float(np.sqrt(12))
    facts = job.facts
    left = [one.name for one, there in zip(facts.characteristic, kept, strict=True) if not there]
    _refuse_nothing(job, left)
    part = facts.part.model_copy(update={"not_measured": list(dict.fromkeys([*facts.part.not_measured, *left]))})
    remaining = [one for one, there in zip(facts.characteristic, kept, strict=True) if there]
    facts = facts.model_copy(update={"part": part, "characteristic": remaining})
    settled = replace(job, facts=facts, reported=replace(given, rounding=rounding, derived=tuple(derived)))
    zones = never_negative(plan_of(settled)).any()
    return Measured(settled, np.array(values), tuple(_warnings(given, derived, left, zones=bool(zones))))


def _warnings(given: Reported, derived: list[str], left: list[str], *, zones: bool) -> Iterator[Text]:
    yield say(
        "Values are those of the report {file} ({program}): nobody evaluated them from points here. By which association "
        "and filter they were found, and what form the points showed, is not known; the uncertainty is that of the plan "
        "about the nominal part, evaluated as this job asks.",
        file=Verbatim(given.file),
        program=given.program,
    )
    if zones:
        yield say(
            "Of a form, orientation, location or runout a value does not say to which side the part deviates: it is not "
            "corrected for the mean error, and its U is as large as errors can make it on any part."
        )
    if derived:
        yield say(
            "By the features of the report, exactly, in the frame of the alignment; it does not state them "
            "themselves: {names}.",
            names=commas(names(derived)),
        )
    if left:
        yield say("Not in the report, and so not measured: {names}.", names=commas(names(left)))


def _refuse_whole_surfaces(job: PartJob, plan: Plan) -> None:
    drawn = {one.name for one in plan.features if len(one.surface)}
    for one, zone in zip(plan.characteristics, never_negative(plan), strict=True):
        if zone and drawn.intersection(one.features):
            problem = f"{one.name!r} is a zone of which the report says no more than its width, and surface_points "
            problem += "ask for a form that is true"
            fix = "Leave surface_points out: all form is then an error of the measurement"
            raise CmmUqError(problem, where=f"{job.folder / 'job.toml'}: [form] surface_points", fix=fix)


def _refuse_nothing(job: PartJob, left: list[str]) -> None:
    where = str(job.folder / "job.toml")
    if len(left) == len(job.facts.characteristic):
        fix = 'Name values by reported_as = "…", or give [recording] file with points'
        raise CmmUqError("asks for nothing that the report says", where=where, fix=fix)
    calibrated = job.facts.by_calibrated_part
    for one in [] if calibrated is None else calibrated.characteristic:
        if one.name in left:
            fix = "Give its value in the report, or leave it out here"
            raise CmmUqError(f"{one.name!r} is not in the report", where=f"{where}: [by_calibrated_part]", fix=fix)


def _refuse_far(one: PartCharacteristic, value: float, nominal: float, where: str) -> None:
    """``value``, ``nominal``: mm or degrees."""
    angle, zone = one.what == "angle", ASKS[one.what].limits == "zone"
    if zone and value < 0:
        problem = f"{value:g} mm is no width of a zone, which is never negative"
        raise CmmUqError(problem, where=where, fix="Give the width, not a deviation from it")
    if abs(value - nominal) <= (_FAR_DEG if angle else FAR_MM):
        return
    unit = "°" if angle else " mm"
    other = None if angle or zone or not nominal else in_another_unit(value / nominal)
    problem = f"{value:.6g}{unit} is not {one.name!r}, which is {nominal:.6g}{unit} by its nominals"
    fix = "Give the actual value, not a deviation, in mm or degrees; or name the right one by reported_as"
    raise CmmUqError(problem + (f": as if it were {other}" if other else ""), where=where, fix=fix)


def _follows(one: PartCharacteristic, plan: Plan, given: Reported) -> bool:
    """Whether a characteristic follows exactly from the features that the report states."""
    features = [plan.feature(name) for name in one.features]
    if one.what == "size":
        return features[0].kind in _SHAPED and _stated(given, features[0]).diameter_mm is not None
    if one.what == "angle":
        return len(features) == 2 and all(one.kind in _TURNED and _located(given, one) for one in features)
    if one.what == "distance":
        return all(_located(given, one) for one in features)
    alignment = plan.alignment.datums
    if one.what in ("position", *AXES):
        own = features[0].kind != "plane" and _located(given, features[0])
        return own and bool(alignment) and (one.datums or alignment) == alignment
    if one.what in ("coaxiality", "parallelism", "perpendicularity", "angularity") and features[0].kind != "plane":
        datums = [name for name in one.datums if name not in alignment[:1]]
        known = {feature.name: feature for feature in plan.features}
        return _located(given, features[0]) and all(name in known and _located(given, known[name]) for name in datums)
    return False


def _stated(given: Reported, feature: PartFeature) -> ReportedFeature:
    return given.features.get(feature.name, ReportedFeature(""))


def _located(given: Reported, feature: PartFeature) -> bool:
    """Whether the report says where a feature is, and how it is turned where that matters."""
    said = _stated(given, feature)
    turned = feature.kind not in _TURNED or said.direction is not None
    return feature.kind in _SHAPED and said.point is not None and turned


def _points(feature: PartFeature, said: ReportedFeature | None, job: PartJob) -> Floats:
    """(n, 3) the points of a feature without form where the report says that it is; the nominal ones where it says nothing."""
    if said is None or feature.kind not in _SHAPED:
        return feature.points
    nominal, along = feature.nominal, feature.nominal.direction
    turn, axis = np.eye(3), along
    if along is not None and said.direction is not None and feature.kind in _TURNED:
        axis = said.direction * (np.sign(said.direction @ along) or 1.0)
        turn = _turning(along, axis)
    at = nominal.point if said.point is None else said.point
    if feature.kind in _TURNED and axis is not None:  # anywhere on its axis, or its plane: beside the nominal place
        apart = nominal.point - at
        at = at + (apart @ axis) * axis if feature.kind == "cylinder" else nominal.point - (apart @ axis) * axis
    if (away := float(np.linalg.norm(at - nominal.point))) > FAR_MM:
        problem = f"{feature.name!r} lies {away:.4g} mm from where it is planned"
        raise CmmUqError(problem, where=said.where, fix="Report it in the frame of the part's alignment")
    about = feature.points - nominal.point
    if nominal.diameter_mm is not None and said.diameter_mm is not None:
        if abs(said.diameter_mm - nominal.diameter_mm) > FAR_MM:
            problem = f"{feature.name!r} has a diameter of {said.diameter_mm:.6g} mm, and by its nominal of "
            raise CmmUqError(f"{problem}{nominal.diameter_mm:.6g} mm", where=said.where, fix="Give diameters, in mm")
        across = about if along is None or feature.kind == "sphere" else about - np.outer(about @ along, along)
        about = about + (said.diameter_mm / nominal.diameter_mm - 1) * across
    return np.asarray(at + about @ turn.T)


def _turning(one: Floats, other: Floats) -> Floats:
    """(3, 3) the rotation by the shortest way from one direction to another."""
    (x, y, z), cosine = np.cross(one, other), float(one @ other)
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + skew + skew @ skew / (1 + cosine))
