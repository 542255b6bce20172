"""Points whose true places another instrument measured, as a laser tracker those of a robot's tool; placed rigidly and anyhow.

All three coordinates of every point are observations, as those of a plate's balls, and the six freedoms between the frames of
both instruments are projected out. Nothing is asked of the poses but that they differ: that is a calibration. Poses that were
commanded again and again (``repeat``) have pose accuracy and repeatability too (ISO 9283).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, TypeGuard, cast

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtri, stdtrit

from cmm_uq.analysis.diagnosis.comparison.explanations import SAME_PLACE
from cmm_uq.analysis.diagnosis.held_out import numbered_by_place, predicted_folds
from cmm_uq.analysis.screening.shape import ArtefactShape, Screening
from cmm_uq.artefacts.kinds import TrackedFacts
from cmm_uq.artefacts.optical.pose_noise import PoseNoise, pose_noise, reaches
from cmm_uq.artefacts.optical.repeated_poses import angle_figures, place_figures, pose_tables, poses_data
from cmm_uq.artefacts.plate import REFERENCES, Plate, shape_of as shape_of_plate
from cmm_uq.base.arm import ALPHA, BETA, THETA, A, Arm, D
from cmm_uq.base.messages import NOTHING, Text, Verbatim, number, say, signed
from cmm_uq.base.points import AXES, Floats, Ints, Machine, Points
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.base.values import dataclass, replace
from cmm_uq.certificate.document import Block, Column, Section, Table, figure_columns, section, table
from cmm_uq.certificate.plots.volume import vector_plot
from cmm_uq.certificate.result import Page, Result
from cmm_uq.jobs.tables.artefact import ReferencedFacts
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.artefact import ArtefactFigure, Indications
from cmm_uq.machine.model.kind import Beginning
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.effects.joints import OfJoint
from cmm_uq.maths.inference.posterior import Cause
from cmm_uq.maths.uncertainty.quantity import alike, rounded

_AGAIN, _WIDEST = 3, 1.0  # points at one reading, fewer of which are chance; mm, beyond which readings are a scan's
# times the extent of all points by which places may be off before a row is held for damaged: rows may be nominal ones
_ROBOT = 2.0


class TrackedPoints(Plate):
    """3n observations (x, y, z in turn) of n points, with ``reference_x_mm``, … in the frame of the reference instrument."""

    kind = "tracked_points"
    observed = REFERENCES
    title = say("Reference instrument")
    size_title = size_what = say("Longest distance by the reference instrument")
    plural = "the points as the machine has them"
    mend = "Check which row has which reference, and of an arm its rows, convention and reversed"

    def own_faults(self) -> Iterable[Effect]:
        return ()

    def calibration(self) -> Cause | None:
        """Nothing beside the scale: what each reading has of its own is in the noise."""
        return None

    def indications(self) -> Indications | None:
        return None

    def recorded(self, points: Points, xyz: Floats) -> Points:
        """Of an arm what was commanded, or its joints, stays: the tool is seen where the arm errs instead."""
        if not isinstance(points.machine, Arm):
            return super().recorded(points, xyz)
        moved = np.einsum("nji,nj->ni", self.attitudes(xyz), points.xyz - xyz) / self.expansion[:, None]
        seen = dict(zip(REFERENCES, (self.reference + moved).T, strict=True))
        return replace(points, columns={**points.columns, **seen})

    def without_noise(self, placed: Floats) -> Floats:
        """The mean along each axis of all that the machine had at one reading: the instrument saw each with its noise."""
        found = placed.copy()
        for read, mean in zip(self.points.xyz.T, found.T, strict=True):
            order = np.argsort(read)
            for rows in np.split(order, np.flatnonzero(np.diff(read[order]) > SAME_PLACE) + 1):
                if len(rows) >= _AGAIN and np.ptp(read[rows]) < _WIDEST:
                    mean[rows] = mean[rows].mean()
        return found

    def figures(self, counts: NDArray[np.bool_]) -> Mapping[str, ArtefactFigure]:
        """RP, RP_a … of each pose that was commanded again; AP, AP_a … where places are seen in the frame of the base."""
        points, in_base = self.points, cast("TrackedFacts", self._facts).frame == "base"
        u, own = self.sizes[0].sd if in_base else None, np.broadcast_to(np.eye(3), (len(points), 3, 3))
        to_base = own if in_base else self.attitudes(points.xyz)
        return {
            **place_figures(points, self.reference, counts, u),
            **angle_figures(points, self.reference, counts, to_base, in_base=in_base),
        }


def joined(machine: Machine) -> TypeGuard[Arm]:
    """Whether coordinates follow from joints."""
    return isinstance(machine, Arm) and bool(machine.joints)


def shape_of(facts: ReferencedFacts, points: Points) -> ArtefactShape | None:
    found = shape_of_plate(facts, points)
    return None if found is None else replace(found, extent=_ROBOT * found.extent)


SCREENING = Screening(shape_of)


def noise_by_pose(model: RecordingModel) -> PoseNoise:
    """What the model leaves at each pose of which all coordinates are used."""
    found, points, rows = model.estimate().least_squares, model.artefact.points, model.artefact.rows[model.used, 0]
    whole = np.flatnonzero(np.bincount(rows, minlength=len(points)) == 3)
    left = found.residuals[np.isin(rows, whole)].reshape(-1, 3)
    return pose_noise(left, reaches(points)[whole], found.degrees_of_freedom * left.size / len(rows))


@dataclass(frozen=True, eq=False)
class PredictedPoses:
    rows: Ints  # (n,) of the recording, those of which all coordinates are used
    off: Floats  # (n,) distance from where they were seen, mm
    within: Floats  # (n, 3) coordinates within U of their prediction, as 0 or 1
    inside: Floats  # (n,) whether within the 95 % ellipsoid of all three


def predicted_poses(model: RecordingModel) -> PredictedPoses | None:
    """By the named model and the residuals that it leaves; ``None`` where a set-up has too few points to leave any out."""
    if len(np.unique(model.artefact.points.point)) < 2 * len(model.unknowns) / 3 + 4:
        return None
    points, rows, noise = model.artefact.points, model.artefact.rows[model.used, 0], noise_by_pose(model)
    sigma, degrees, scale = noise.sigma, noise.degrees, noise.scale(reaches(points)[rows])
    linear = model.estimate().linear
    linear = replace(linear, noise_scale=linear.noise_scale * scale)
    numbers = np.column_stack([points.measurement, points.point])
    if joined(points.machine):  # all reflectors that were seen at one pose
        numbers = np.column_stack([points.columns[name] for name in points.machine.columns_of_joints])
    groups = numbered_by_place(model, numbers[rows])
    taken, off, within, inside = [], [], [], []
    for out, error, root, _ in predicted_folds(linear, sigma, groups):
        _, first, count = np.unique(rows[out], return_index=True, return_counts=True)
        whole = (first[count == 3, None] + np.arange(3)).ravel()  # of others a coordinate is not used
        each, of_each = error[whole].reshape(-1, 3) / sigma, root[whole].reshape(-1, 3, root.shape[1])
        covariance = np.eye(3) + of_each @ of_each.transpose(0, 2, 1)
        taken.append(rows[out][first[count == 3]])
        off.append(np.linalg.norm(each, axis=1) * sigma * scale[out][first[count == 3]])
        within.append(np.abs(each) <= stdtrit(degrees, 0.975) * np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)))
        squares = np.einsum("ni,ni->n", each, np.linalg.solve(covariance, each[:, :, None])[:, :, 0])
        inside.append(squares <= 3 * fdtri(3, degrees, 0.95))
    return PredictedPoses(*map(np.concatenate, (taken, off, within, inside)))


def _distances(result: Result) -> dict[str, dict[str, float]]:
    """Mean, root mean square and largest distance of points from where they were seen, µm: before the fit, and after it."""
    points = cast("TrackedPoints", result.artefact)
    each = {"before": points.deviations(), "after": result.residuals.reshape(-1, 3)}
    return {when: _figures(np.linalg.norm(values, axis=1)) for when, values in each.items()}


def _figures(off: Floats) -> dict[str, float]:
    found = {"mean_um": off.mean(), "rms_um": np.sqrt(np.mean(off**2)), "largest_um": off.max()}
    return {name: float(value / MICROMETRE) for name, value in found.items()}


def results(result: Result) -> dict[str, Any]:
    """For results.json: distances, how points held out were predicted, and the rows of an arm as found."""
    predicted, found = predicted_poses(result.model), dict[str, Any](_distances(result))
    if predicted is not None:
        shown = {of: float(own.mean()) for of, own in zip(_SHARES, (predicted.within, predicted.inside), strict=True)}
        found["held_out"] = {**_figures(predicted.off), **shown, "points": len(predicted.off)}
        noise = noise_by_pose(result.model)
        named = {"sigma_um": noise.sigma / MICROMETRE, "growing": noise.growing}
        found["left_at_a_pose"] = {**named, "degrees_of_freedom": noise.degrees}
    points, machine = result.artefact.points, result.artefact.points.machine
    rows: dict[str, Any] = {}
    if joined(machine):
        rows = {"screws": screws_of(result, machine)} if machine.by_screws else {"rows": rows_of(result, machine)}
    return {"positions": found, **rows, **poses_data(points, result.artefact.figures)}


_SHARES = ("coordinates_within_U", "points_within_ellipsoid")
_KEYS = {A: "a_mm", ALPHA: "alpha_deg", D: "d_mm", THETA: "theta_deg", BETA: "beta_deg"}
_TO_ROWS: Mapping[int, float] = {i: MICROMETRE if i in (A, D) else 1 / 3600 for i in range(5)}


def rows_of(result: Result, arm: Arm) -> list[dict[str, float]]:
    """Rows of the arm with what was found, where that is determined, as job.toml has them."""
    scale = np.where(np.isin(np.arange(5), (A, D)), 1.0, np.degrees(1.0))
    rows = [dict(zip((_KEYS[i] for i in range(5)), row, strict=True)) for row in (arm.rows * scale).tolist()]
    for effect in result.model.effects:
        if isinstance(effect, OfJoint) and len(effect.coefficients) == 1 and type(effect).amount is OfJoint.amount:
            name, found = next(iter(result.parameters[effect.name].items()))
            if (effect.name, name) not in result.not_given:
                rows[effect.index][_KEYS[effect.row]] += float(found.value) * _TO_ROWS[effect.row]
    return rows


def screws_of(result: Result, arm: Arm) -> list[dict[str, list[float]]]:
    """Screw axes of the arm as found, as job.toml has them: directions, and the points next to the origin of the base."""
    scale = np.where(np.isin(np.arange(5), (A, D)), 1.0, np.radians(1.0))
    rows = np.array([[row[_KEYS[i]] for i in range(5)] for row in rows_of(result, arm)]) * scale
    pose, found = replace(arm, rows=rows).at(np.zeros((1, len(rows)))), []
    for joint, turns in enumerate(arm.revolute):
        direction, point = (each[0, joint, THETA if turns else D] for each in (pose.axes, pose.origins))
        place = {"point_mm": (point - (point @ direction) * direction).tolist()} if turns else {}
        found.append({"direction": direction.tolist(), **place})
    return found


def sections(result: Result) -> list[Section]:
    data = results(result)
    rows = (
        _rows(data["rows"], result) if "rows" in data else _screws(data["screws"], result) if "screws" in data else None
    )
    poses = pose_tables(data, result.noise.expanded / 10)
    return [section(say("Positions of the tool"), _table(data, result), *poses, _arrows(result), rows)]


_WHEN: Mapping[str, Text] = {
    "before": say("as recorded, placed"),
    "after": say("after the fitted model"),
    "held_out": say("held out, predicted"),
}


def _table(data: dict[str, Any], result: Result) -> Table | None:
    found, noise, rows, notes = data["positions"], result.noise.coordinate.value, [], list[Text]()
    for when, words in _WHEN.items():
        if (one := found.get(when)) is None:
            continue
        figures = (rounded(one[name], noise)[0] for name in ("mean_um", "rms_um", "largest_um"))
        shares = [number(100 * one[name], ".1f") if name in one else NOTHING for name in _SHARES]
        rows.append((words, *figures, *shares))
    if "held_out" in found:
        held_out = say(
            "Held out: {count} points, each predicted from those at other poses; how many coordinates lie "
            "within U (95 %), and how many points within the 95 % ellipsoid of all three.",
            count=found["held_out"]["points"],
        )
        one = found["left_at_a_pose"]
        left = say(
            "What is left at a pose: {sigma} µm in a coordinate at the mean reach, {share:.0f} % of its square from what "
            "grows with the reach of the joints, with tails of the t distribution of {degrees:.0f} degrees of freedom.",
            sigma=rounded(one["sigma_um"], one["sigma_um"] / 10)[0],
            share=100 * one["growing"],
            degrees=one["degrees_of_freedom"],
        )
        notes += [held_out, left]
    if "poses" not in data:
        iso = say(
            "This is a calibration. Pose accuracy and repeatability (ISO 9283) need poses that were commanded and repeated."
        )
        notes.append(iso)
    distances = figure_columns(say("Mean"), say("rms"), say("Largest"), unit=unit("µm"))
    within = figure_columns(say("Coordinates within U"), say("Points within the ellipsoid"), unit=unit("%"))
    title = say("Distance from where the reference instrument saw the point")
    return table(title, [say("Points"), *distances, *within], rows, *notes)


def _rows(rows: list[dict[str, float]], result: Result) -> Table | None:
    figures = (("a", "mm"), ("α", "°"), ("d", "mm"), ("θ", "°"), ("β", "°"))
    each = (
        (Verbatim(joint.upper()), *(signed(row[_KEYS[i]], ".4f" if i in (A, D) else ".5f") for i in range(5)))
        for joint, row in zip(cast("Arm", result.artefact.points.machine).joints, rows, strict=True)
    )
    heads: list[Text | Column] = [say("Joint"), *(Column(Verbatim(name), unit(of)) for name, of in figures)]
    return table(say("Rows of the arm as found"), heads, each, _LEFT_OPEN)


def _screws(screws: list[dict[str, list[float]]], result: Result) -> Table | None:
    joints = zip(cast("Arm", result.artefact.points.machine).joints, screws, strict=True)
    each = []
    for joint, screw in joints:
        place = [signed(value, ".4f") for value in screw["point_mm"]] if "point_mm" in screw else [NOTHING] * 3
        each.append((Verbatim(joint.upper()), *(signed(value, ".7f") for value in screw["direction"]), *place))
    directions = (Column(Verbatim(f"ω {axis}")) for axis in AXES)
    heads: list[Text | Column] = [say("Joint"), *directions, *(Column(Verbatim(axis), unit("mm")) for axis in AXES)]
    return table(say("Screw axes of the arm as found"), heads, each, _LEFT_OPEN)


_LEFT_OPEN = say("What the recording leaves open stands as the job has it.")


def _arrows(result: Result) -> Block:
    points = cast("TrackedPoints", result.artefact)
    xyz = points.points.xyz
    axes = np.sort(np.argsort(np.ptp(xyz, axis=0))[1:])
    turned = np.einsum("nij,nj->ni", points.attitudes(xyz), result.residuals.reshape(-1, 3))
    arrows = [values[:, axes] / MICROMETRE for values in (points.deviations(), turned)]
    before, after = alike(*(float(np.linalg.norm(each, axis=1).max()) for each in arrows))
    first, second = (Verbatim(AXES[axis].upper()) for axis in axes)
    return vector_plot(
        xyz[:, axes],
        tuple(zip((_WHEN["before"], _WHEN["after"]), arrows, strict=True)),
        axis_labels=(say("{axis} / mm", axis=first), say("{axis} / mm", axis=second)),
        caption=say("Indicated less seen places, in the plane of {first} and {second}.", first=first, second=second),
        alternative=say(
            "Arrows of up to {before} µm as recorded, up to {after} µm after the fitted model.",
            before=before,
            after=after,
        ),
    )


PAGE = Page(sections, results)

_POSES = 60


def readings_within(limits: Floats, count: int, seed: int) -> Floats:
    """(count, j) readings, evenly in each range of (j, 2) (Latin hypercube: McKay et al., Technometrics 21 (1979) 239)."""
    low, high = limits.T
    rank = np.argsort(np.random.default_rng(seed).random((count, len(low))), axis=0)
    return np.asarray(np.round(low + (high - low) * (rank + 0.5) / count, 3))


def poses(machine: Machine) -> Points:
    """Poses within the joints' travels, evenly in each, and where a tracker two metres away sees the tool."""
    arm = cast("Arm", machine)
    n = _POSES
    q = readings_within(np.array([arm.travel(joint) for joint in arm.joints]), n, seed=1)
    columns = dict(zip(arm.columns_of_joints, q.T, strict=True))
    xyz = arm.posed(columns).tool
    seen = xyz @ np.array([[0.8, 0.6, 0.0], [-0.6, 0.8, 0.0], [0.0, 0.0, 1.0]]) + [2000.0, -500.0, 300.0]
    columns |= dict(zip(REFERENCES, seen.T, strict=True))
    one = np.ones(n, dtype=np.int64)
    return Points(xyz, one, np.arange(1, n + 1), one, machine, columns)


_ROBOT_ROWS = (  # a, α, d, θ, travel of a robot of six joints that reaches 1.6 m
    (150.0, -90.0, 475.0, 0.0, [-90.0, 90.0]),
    (600.0, 0.0, 0.0, -90.0, [-40.0, 60.0]),
    (120.0, -90.0, 0.0, 0.0, [-50.0, 50.0]),
    (0.0, 90.0, 720.0, 0.0, [-120.0, 120.0]),
    (0.0, -90.0, 0.0, 0.0, [-90.0, 90.0]),
    (0.0, 0.0, 85.0, 180.0, [-150.0, 150.0]),
)
# without what a place says nothing of: the base, rows of parallel axes, and the last joint beside the tool
_DETERMINED = (
    *(f"zero_q{i}" for i in range(2, 6)),
    *(f"length_q{i}" for i in range(1, 6)),
    *(f"twist_q{i}" for i in range(1, 6)),
    *(f"offset_q{i}" for i in range(3, 6)),
    "parallelism_q2",
    "tool_offset",
)
BEGIN = Beginning(
    title="Robot measured by a laser tracker",
    numbering="One measurement is one station of the tracker; its points are the poses.",
    artefact={"name": "Laser tracker", "u_um": "10 + 5·L/1000"}, noise_um=40.0, effects=_DETERMINED, points=poses,
    plan={"criterion": "D", "number": 50, "repeats": 1, "placing_um": 0.0, "minutes_per_placing": 0.5},
    machine={
        "name": "Robot", "arm": {"tool_mm": [30.0, 0.0, 120.0]},
        "joint": [
            dict(zip(("a_mm", "alpha_deg", "d_mm", "theta_deg", "travel"), row, strict=True)) for row in _ROBOT_ROWS
        ],
    },
    columns={
        **{name: f"Place of the reflector along {name[-4]} of the tracker's own frame." for name in REFERENCES},
        **{f"q{i}_deg": f"Reading of joint {i}." for i in range(1, 7)},
    },
    further={f"approach_q{i}": f"Sense in which joint {i} moved last: −1, 0 or +1." for i in range(1, 7)},
)  # fmt: skip
