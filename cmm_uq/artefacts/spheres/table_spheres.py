"""Spheres on turning tables, or seen by a turning head, whose centres are free but stay where they are: observed, planned.

Each point is the centre of a sphere at one position of the axes, numbered by ``repeat``. What the coordinates of a sphere do
about their mean while these turn is what the machine and its rotary axes err: along the radius, the tangent and the axis of
one that turns alone, else along X, Y and Z.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.planning.set_up import SetUp
from cmm_uq.analysis.planning.setting import Planning, Setting, Start
from cmm_uq.analysis.screening.shape import ArtefactShape, Screening
from cmm_uq.artefacts.kinds import TableSpheresFacts
from cmm_uq.artefacts.spheres.seat import Staying, staying
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, commas, say
from cmm_uq.base.points import AXES, Floats, Machine, Points
from cmm_uq.base.rotary import RotaryAxis, RotaryMachine
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model.artefact import ArtefactFigure, Placings
from cmm_uq.machine.model.kind import AT_20_C, Beginning
from cmm_uq.machine.model.recorded import place

FIGURES = ("FR", "FT", "FA")  # ranges along the radius, the tangent and the axis
RANGES = ("FX", "FY", "FZ")  # where several axes turned, or a sphere lies on the axis: along those of the coordinates
_STILL = 1e-3  # ° by which an axis that does not turn may seem to
DIRECTIONS = (say("radial"), say("tangential"), say("axial"))
_STRAY, _ON_AXIS = 5.0, 1.0  # mm by which no table errs; from the axis within which a sphere has no radius
_TURN, POSITIONS = 720.0, 7  # degrees out and back, and positions of the table in each sense


class TableSpheres(Staying):
    """Spheres as recorded: three observations (radial, tangential, axial) of each of n centres."""

    kind = "table_spheres"
    title = say("Spheres on a rotary table")

    def __init__(self, facts: TableSpheresFacts, points: Points, *, where: str | None = None) -> None:
        self.machine = _turning(points.machine)
        self.read = {
            axis.letter: points.columns[axis.column] for axis in self.machine.rotary if axis.column in points.columns
        }
        if not self.read:
            column = self.machine.rotary[0].column
            problem, fix = f"no column {column!r}: at which angle of the table each centre lay", "Add it"
            raise CmmUqError(problem, where=where or "recording", fix=fix)
        load = np.ones_like(points.measurement) if facts.stay else points.measurement
        each, index = np.unique(np.column_stack([load, points.point]), axis=0, return_inverse=True)
        super().__init__(points, Placings(index.ravel().astype(np.int64), each[:, 0].astype(np.int64)))
        whole = np.unique(np.column_stack([points.measurement, points.point]), axis=0, return_inverse=True)[1]
        self.runs = [np.flatnonzero(whole.ravel() == i) for i in range(int(whole.max()) + 1)]  # of one sphere each
        middle, n = self.placings.means(points.xyz), len(points)
        self.radius, self.axial, self.by_axis = np.full(n, np.nan), np.full(n, np.nan), np.zeros(n, dtype=bool)
        self.turns: dict[int, str] = {}
        for run in np.unique(points.measurement).tolist():
            own = np.flatnonzero(points.measurement == run)
            self.turns[run] = letters = self._turning(own)
            axis = next(each for each in self.machine.rotary if each.letter == letters) if len(letters) == 1 else None
            if axis is not None:
                columns = {name: values[own] for name, values in points.columns.items()}
                self._along(own, *self.machine.by_turn(axis, middle[own], columns))
        self._refuse_stray(where)
        if self.machine.fourth:
            self._refuse_no_radius(where)

    def _turning(self, rows: NDArray[np.int64]) -> str:
        """Letters of the axes that turned in these rows, in the order of the chain."""
        if self.machine.fourth:
            return self.machine.fourth.letter
        return "".join(letter for letter, read in self.read.items() if np.ptp(read[rows]) > _STILL)

    def _along(self, rows: NDArray[np.int64], away: Floats, axis: Floats) -> None:
        """What is observed of these rows lies along the radius, the tangent and the axis of what turned."""
        axial = np.einsum("ni,ni->n", away, axis)
        across = away - axial[:, None] * axis
        radius = np.linalg.norm(across, axis=1)
        self.radius[rows], self.axial[rows] = radius, axial
        if self.machine.fourth or radius.min() > _ON_AXIS:
            radial = across / radius[:, None]
            self.axes[rows], self.by_axis[rows] = np.stack([radial, np.cross(axis, radial), axis], axis=1), True

    def words_of(self, observation: int) -> Text:
        i, k = divmod(observation, 3)
        what = DIRECTIONS[k] if self.by_axis[i] else Verbatim(AXES[k].upper())
        return say("the {direction} coordinate of {what}", direction=what, what=super().words_of(observation))

    def figures(self, counts: NDArray[np.bool_]) -> Mapping[str, ArtefactFigure]:
        """Range of each sphere's coordinates over all positions, by direction: of those that one axis turned, or of others."""
        deviations, found = self.deviations(), dict[str, ArtefactFigure]()
        for by_axis, figures in ((True, FIGURES), (False, RANGES)):
            every = [
                own for rows in self.runs if len(own := rows[counts[rows]]) > 1 and self.by_axis[own[0]] == by_axis
            ]
            if not every:
                continue
            rows = np.array([np.resize(own, len(self.points)) for own in every])
            names = tuple(sphere_name(int(self.points.point[own[0]])) for own in every)
            for k, name in enumerate(figures):
                values = np.array([np.ptp(deviations[own, k]) for own in every])
                found[name] = ArtefactFigure(values, rows, np.nan_to_num(self.radius[rows[:, 0]]), names=names)
        return found

    def _refuse_stray(self, where: str | None) -> None:
        points = self.points
        stray = np.linalg.norm(points.xyz - self.placings.means(points.xyz), axis=1)
        if stray.max(initial=0.0) > _STRAY:
            row, other = int(np.argmax(stray)), "table" if self.machine.recorded_in_machine else "machine"
            fix = f'give coordinates = "{other}", turns or axis_mm in [machine.table]'
            if not self.machine.fourth:
                fix = "mend coordinates, turns and axis_mm of the axes in [machine]"
            raise CmmUqError(
                f"sphere {points.point[row]} does not stay where it is on the table: it goes {stray[row]:.4g} mm away",
                where=place(points, np.arange(len(points)) == row, where),
                fix=f"Number the same sphere by the same point, or {fix}",
            )

    def _refuse_no_radius(self, where: str | None) -> None:
        points = self.points
        for load in np.unique(points.measurement).tolist():
            own = [rows for rows in self.runs if points.measurement[rows[0]] == load]
            middles = np.array([points.xyz[rows].mean(axis=0) for rows in own])
            if len(own) > 1 and np.ptp(middles, axis=0).max() < _ON_AXIS:
                raise CmmUqError(
                    f"the spheres of measurement {load} lie in one place",
                    where=where or "recording",
                    fix="Record the centre of each sphere",
                )
        if np.any(rows := self.radius < _ON_AXIS):
            raise CmmUqError(
                f"sphere {points.point[np.argmax(rows)]} lies on the axis of the table, so it has no radius",
                where=place(points, rows, where),
                fix="Mend axis_mm in [machine.table]",
            )


def _turning(machine: Machine) -> RotaryMachine:
    if isinstance(machine, RotaryMachine):
        return machine
    fix = 'Give it in [machine], such as chain = "XYZ|C"'
    raise CmmUqError("the machine has no rotary table in its chain", where="job.toml [machine] chain", fix=fix)


def sphere_name(point: int) -> Text:
    """``sphere A`` is point 1."""
    return say("sphere {name}", name=Verbatim(chr(64 + point) if 1 <= point <= 26 else str(point)))


def shape_of(facts: ArtefactFacts, points: Points) -> ArtefactShape | None:
    whole = np.unique(np.column_stack([points.measurement, points.point]), axis=0, return_inverse=True)[1]
    return staying(points, Placings.of(whole.ravel()))


SCREENING = Screening(shape_of, balls=True)


def positions(axis: RotaryAxis) -> tuple[Floats, Floats]:
    """Angles of a table, out from 0 over two turns, or over its travel, and back, °; and the senses of turning."""
    low, high = np.where(np.isnan(axis.travel_deg), [-np.inf, np.inf], axis.travel_deg)
    far = min(max(_TURN, float(low) + _TURN), float(high))
    start = max(far - _TURN, float(low))
    out = np.linspace(start, far, POSITIONS + 1)
    return np.concatenate([out, out[-2::-1]]), np.repeat([0.0, 1.0, -1.0], [1, POSITIONS, POSITIONS])


def _pair(setting: Setting, axis: RotaryAxis, radius: float, height: float, turn: float) -> Floats:
    """(2, 3) a low and a high sphere on opposite sides of an axis, by parts of the radius and height of the job."""
    machine, facts = _turning(setting.machine), cast("TableSpheresFacts", setting.artefact)
    about, pivot = axis.about, machine.pivot(axis)
    out = np.roll(np.array([0.0, np.cos(turn), np.sin(turn)]), about) * facts.radius_mm * radius
    low = pivot + np.eye(3)[about] * facts.low_mm
    return np.array([low + out, low - out + np.eye(3)[about] * facts.height_mm * height])


def _at_positions(setting: Setting, spheres: Floats, columns: Mapping[str, Floats]) -> Points:
    """Each sphere (k, 3) at each position, ``columns`` (n,) by position; refused where the carriages cannot go there."""
    n, k, machine = len(next(iter(columns.values()))), len(spheres), _turning(setting.machine)
    whole = {name: np.repeat(values, k) for name, values in columns.items()}
    if machine.head:
        whole |= {
            f"tip_{a}_mm": tip for a, tip in zip(AXES, np.broadcast_to(machine.tip(whole), (n * k, 3)).T, strict=True)
        }
    ones, visit = np.ones(k * n, dtype=np.int64), np.repeat(np.arange(1, n + 1), k)
    points = Points(np.tile(spheres, (n, 1)), ones, np.tile(np.arange(1, k + 1), n), visit, machine, whole)
    box, there = setting.volume.box, points.carriages
    if np.any(beyond := (there < box[:, 0] - 1e-6) | (there > box[:, 1] + 1e-6)):
        axis = AXES[int(np.argmax(beyond.any(axis=0)))]
        raise CmmUqError(
            f"the spheres would leave the volume along {axis.upper()} as the table turns",
            where="job.toml [plan]",
            fix="Make radius_mm or height_mm smaller, or mend axis_mm or low_mm",
        )
    return points


def two_spheres(setting: Setting, *, radius: float = 1.0, height: float = 1.0, turn: float = 0.0) -> SetUp:
    """A low and a high sphere at the positions of ISO 10360-3."""
    facts, axis = cast("TableSpheresFacts", setting.artefact), _turning(setting.machine).fourth
    if axis is None:
        fix = 'Ask for ready = "runs" of each axis, in [plan]'
        raise CmmUqError("ISO 10360-3 is of one rotary table alone", where="job.toml [plan]", fix=fix)
    angles, senses = (np.tile(each, setting.plan.repeats) for each in positions(axis))
    columns = {axis.column: angles, f"{axis.letter}_approach": senses}
    points = _at_positions(setting, _pair(setting, axis, radius, height, turn), columns)
    title = say(
        "radius {radius:.0f} mm, height difference {height:.0f} mm, at {turn:.0f}°",
        radius=facts.radius_mm * radius,
        height=facts.height_mm * height,
        turn=np.degrees(turn),
    )
    return SetUp(title, points)


def _candidates(setting: Setting, start: Start | None) -> tuple[SetUp, ...]:
    """The spheres farther in, lower, and a quarter of a turn on; of several axes the others at further angles, too."""
    parts = [(r, h, turn) for r in (1.0, 0.5) for h in (1.0, 0.5) for turn in (0.0, 0.5 * np.pi)]
    parts = parts[:1] if cast("TableSpheresFacts", setting.artefact).stay else parts
    if _turning(setting.machine).fourth is None:
        usual = [one for r, h, turn in parts for one in runs(setting, radius=r, height=h, turn=turn)]
        further = [one for part in parts[:2] for one in runs(setting, turn=part[2], stands=_FURTHER)]
        return setting.completed([*usual, *further])
    return setting.completed([two_spheres(setting, radius=r, height=h, turn=turn) for r, h, turn in parts])


def runs(
    setting: Setting,
    *,
    radius: float = 1.0,
    height: float = 1.0,
    turn: float = 0.0,
    stands: Sequence[float] = (0.25, 0.75),
) -> tuple[SetUp, ...]:
    """Each axis there and back over a turn, or its travel, while each other stands low and high; then all at once.

    Two spheres on the last table; one in the middle of the volume where nothing but the probe turns. ``stands``: parts of its
    travel at which an axis stands meanwhile.
    """
    machine, found = _turning(setting.machine), list[SetUp]()
    spheres = setting.volume.box.mean(axis=1)[None] - machine.origin_mm
    if machine.tables:
        spheres = _pair(setting, machine.tables[-1], radius, height, turn)
    out = {axis.letter: np.linspace(*_range(axis), STEPS + 1) for axis in machine.rotary}
    for axis in machine.rotary:
        others = [other for other in machine.rotary if other is not axis]
        for part in stands if others else stands[:1]:
            at = {other.letter: float(np.quantile(out[other.letter], part)) for other in others}
            found.append(_run(setting, spheres, (axis,), out, at))
    if len(machine.rotary) > 1:
        found.append(_run(setting, spheres, machine.rotary, out, {}))
    return tuple(found)


STEPS, _FURTHER = 12, (0.0, 0.5, 1.0)  # of a run each way; further parts of its travel at which an axis may stand


def _range(axis: RotaryAxis) -> tuple[float, float]:
    """A turn from 0, or the travel where that is less, °."""
    low, high = np.where(np.isnan(axis.travel_deg), [0.0, 360.0], axis.travel_deg)
    return float(max(low, min(0.0, high - 360.0))), float(min(high, max(360.0, low)))


def _run(
    setting: Setting,
    spheres: Floats,
    turning: Sequence[RotaryAxis],
    out: Mapping[str, Floats],
    stands: Mapping[str, float],
) -> SetUp:
    """These axes there and back, those that stand at an angle."""
    n, columns = (2 * STEPS + 2) * setting.plan.repeats, dict[str, Floats]()
    for axis in turning:
        there = out[axis.letter]
        columns[axis.column] = np.tile(np.concatenate([there, there[::-1]]), setting.plan.repeats)
        senses = np.repeat([1.0, -1.0], STEPS + 1)
        columns[f"{axis.letter}_approach"] = np.tile(senses, setting.plan.repeats)
    for letter, angle in stands.items():
        columns |= {f"{letter}_deg": np.full(n, angle), f"{letter}_approach": np.zeros(n)}
    which = commas(Verbatim(axis.letter.upper()) for axis in turning)
    words = say("{axes} there and back", axes=which)
    if stands:
        at = commas(
            say("{axis} at {angle:g}°", axis=Verbatim(each.upper()), angle=angle) for each, angle in stands.items()
        )
        words = say("{words}, {at}", words=words, at=at)
    return SetUp(words, _at_positions(setting, spheres, columns))


PLANNING = Planning({"ISO 10360-3": lambda setting: (two_spheres(setting),), "runs": runs}, _candidates)

_TRUNNION = tuple(
    f"rotary_{name}"
    for name in (
        "location_a_y",
        "location_a_z",
        "tilt_a_y",
        "tilt_a_z",
        "positioning_a_1",
        "location_c_x",
        "location_c_y",
        "tilt_c_x",
        "tilt_c_y",
        "positioning_c_1",
    )
)
FIVE_AXES = Beginning(
    title="Five axes: spheres on a trunnion and its table (R-test)",
    numbering="One measurement is one run: an axis there and back while the other stands; points 1 and 2 are the centres of "
    "the spheres, repeat counts the positions in their order.",
    artefact={"name": "Spheres A and B", "radius_mm": 120.0, "height_mm": 120.0, "stay": True},
    effects=_TRUNNION,
    noise_um=0.3,
    machine={
        "chain": "XYZ|AC",
        "origin_mm": [350.0, 500.0, -300.0],
        "rotary": [
            {"name": "A", "axis_mm": [350.0, 500.0, -260.0], "travel_deg": [-30.0, 100.0]},
            {"name": "C", "travel_deg": [0.0, 360.0]},
        ],
    },
    columns={"a_deg": "", "c_deg": ""},
    further={"a_approach": "", "c_approach": ""},
    plan={"ready": "runs", "repeats": 1},
    recorded=AT_20_C,
)
