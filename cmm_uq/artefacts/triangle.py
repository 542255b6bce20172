"""Triangle standard of gauge blocks and cylinders (Manlay, *Fast checking of CMM geometry with a patented tool*).

A block touches a cylinder at each end, so a side between two cylinder axes is the block and two radii. Recorded are the
axes of the cylinders. In the source's equations a rotation of any carriage acts on the stylus tip offset too, and two tips
of different length part yaw from scale; so ``tip_x_mm, tip_y_mm, tip_z_mm`` count for every carriage. The source counts
seven placings and describes eight: the horizontal one shifted along X gives the yaw of Y, which the vertical ones give over
a longer lever.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import product
from types import MappingProxyType
from typing import cast

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.planning import candidates as places
from cmm_uq.analysis.planning.set_up import SetUp, split
from cmm_uq.analysis.planning.setting import Planning, Setting, Start
from cmm_uq.analysis.screening.shape import ArtefactShape, Screening, body_misfit, rows_by
from cmm_uq.artefacts.kinds import TriangleFacts
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import AXES, Floats, Machine, Points
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.base.values import dataclass, replace
from cmm_uq.machine.model.artefact import ArtefactFigure, Indications, Size, figures_of_errors, ranges_of_repeats
from cmm_uq.machine.model.artefact_doubt import by_certificate, faults
from cmm_uq.machine.model.placed import Rigid
from cmm_uq.machine.model.recorded import check_length, expansion, refuse
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.effects.own_errors import AFFINE, Body

DIMENSIONS = ("block_12", "block_23", "block_31", "cylinder_1", "cylinder_2", "cylinder_3")

# sides 1–2, 2–3, 3–1 for the six dimensions
SIDES_OF_DIMENSIONS = np.array([[1, 0, 0, 0.5, 0.5, 0], [0, 1, 0, 0, 0.5, 0.5], [0, 0, 1, 0.5, 0, 0.5]])

DRAWS, _STEP_MM = 100_000, 1e-3


@dataclass(frozen=True, eq=False)
class TriangleGeometry:
    """Sides 1–2, 2–3, 3–1 (mm), angles at 1, 2, 3 (rad) and height over the side 1–2 (mm), each (..., ) of a set of draws."""

    sides: Floats
    angles: Floats
    height: Floats


@dataclass(frozen=True, eq=False)
class TriangleStandard:
    """The dimensions of a triangle, mm, each (6,) in the order of :data:`DIMENSIONS`."""

    dimensions: Floats
    u: Floats

    def __post_init__(self) -> None:
        sides = self.sides
        if 2 * sides.max() >= sides.sum():
            said = ", ".join(f"{side:.6g}" for side in sides)
            raise CmmUqError(
                f"sides of {said} mm do not close to a triangle: the longest is not shorter than the other two together",
                where="job.toml [artefact] blocks_mm, cylinders_mm",
                fix="Mend the dimensions of blocks and cylinders",
            )

    @classmethod
    def of(cls, facts: TriangleFacts) -> TriangleStandard:
        dimensions = np.array([*facts.blocks_mm, *facts.cylinders_mm], dtype=np.float64)
        return cls(dimensions, MICROMETRE * np.repeat([facts.u_blocks_um, facts.u_cylinders_um], 3))

    @property
    def sides(self) -> Floats:
        """(3,) between cylinder axes, mm."""
        return np.asarray(SIDES_OF_DIMENSIONS @ self.dimensions, dtype=np.float64)

    def figures(self) -> TriangleGeometry:
        return figures_of(self.sides)

    def draws(self, seed: int, count: int = DRAWS) -> TriangleGeometry:
        """The same of normal draws of the dimensions (JCGM 101:2008, 7)."""
        random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(6,)))
        dimensions = self.dimensions + self.u * random.standard_normal((count, len(DIMENSIONS)))
        return figures_of(dimensions @ SIDES_OF_DIMENSIONS.T)


def figures_of(sides: Floats) -> TriangleGeometry:
    """Angles by the cosine rule, and height, of sides (..., 3)."""
    c, a, b = np.moveaxis(sides, -1, 0)

    def angle(opposite: Floats, one: Floats, other: Floats) -> Floats:
        return np.asarray(np.arccos((one**2 + other**2 - opposite**2) / (2 * one * other)), dtype=np.float64)

    angles = np.stack([angle(a, b, c), angle(b, c, a), angle(c, a, b)], axis=-1)
    return TriangleGeometry(sides, angles, np.asarray(b * np.sin(angles[..., 0]), dtype=np.float64))


def corners(sides: Floats) -> Floats:
    """Corners (3, 3) in the triangle's axes, mm: 1 at the origin, 2 along x, 3 on the side of y."""
    c, a, b = sides
    x = (b**2 + c**2 - a**2) / (2 * c)
    return np.array([[0, 0, 0], [c, 0, 0], [x, np.sqrt(b**2 - x**2), 0]])


def corner_changes(sides: Floats) -> Floats:
    """Change of the corners (3, 3, 6) for one mm of each dimension."""
    c, _, b = sides
    x, y, _ = corners(sides)[2]
    change = np.zeros((3, 3, 3))
    change[1, 0] = [1, 0, 0]
    change[2, 0] = [1 - x / c, -sides[1] / c, b / c]
    change[2, 1] = ([0, 0, b] - x * change[2, 0]) / y
    return np.asarray(change @ SIDES_OF_DIMENSIONS, dtype=np.float64)


# axis of the longest side, axis of the height over it
PLANES: Mapping[str, tuple[int, int]] = MappingProxyType({"XY": (0, 1), "YZ": (1, 2), "ZX": (0, 2)})


@dataclass(frozen=True)
class Placing:
    title: Text  # in words
    plane: str  # key of :data:`PLANES`
    place: tuple[float, float, float]  # where along the room that the machine has for it, 0 … 1 for X, Y, Z
    long_tip: bool = False  # whether the longer of two tips is mounted


SEVEN_PLACINGS = (
    Placing(say("horizontal, low"), "XY", (0.0, 0.5, 0.0)),
    Placing(say("horizontal, high"), "XY", (0.0, 0.5, 1.0)),
    Placing(say("vertical in YZ, left"), "YZ", (0.0, 0.5, 0.0)),
    Placing(say("vertical in YZ, right"), "YZ", (1.0, 0.5, 0.0)),
    Placing(say("vertical in YZ, right, longer tip"), "YZ", (1.0, 0.5, 0.0), long_tip=True),
    Placing(say("vertical in ZX"), "ZX", (0.5, 0.5, 0.0)),
    Placing(say("vertical in ZX, longer tip"), "ZX", (0.5, 0.5, 0.0), long_tip=True),
)


def placed_triangle(
    machine: Machine, sides: Floats, placings: Sequence[Placing] = SEVEN_PLACINGS, *,
    tips_mm: tuple[float, float] = (80.0, 240.0), repeats: int = 1,
) -> Points:  # fmt: skip
    """Nominal readings of a triangle in these placings, one measurement each.

    ``sides`` (3,) 1–2, 2–3, 3–1 of the triangle, mm; 1–2 is laid along an axis; ``tips_mm`` lengths of the short and of
    the long tip: down in horizontal placings, along X in YZ, along Y in ZX. The readings are those of the machine's
    scales, so a longer tip wants the triangle moved, not the machine.
    """
    travel = np.array([machine.travel(axis) for axis in AXES])
    room = travel + 0.05 * np.ptp(travel, axis=1)[:, None] * [1, -1]
    body = corners(sides)
    xyz, tips = [], []
    for placing in placings:
        along, up = PLANES[placing.plane]
        size = np.zeros(3)
        size[[along, up]] = np.ptp(body[:, :2], axis=0)
        spare = room[:, 1] - room[:, 0] - size
        if np.any(spare < 0):
            axis = int(np.argmin(spare))
            raise CmmUqError(
                f"the triangle is {size[axis]:.4g} mm long along {AXES[axis].upper()}, of which the machine has "
                f"{np.ptp(room[axis]):.4g} mm to spare", where=placing.title, fix="Use a smaller triangle",
            )  # fmt: skip
        corner = np.tile(room[:, 0] + spare * placing.place, (3, 1))
        corner[:, [along, up]] += body[:, :2] - body[:, :2].min(axis=0)
        tip = np.zeros(3)
        tip[3 - along - up] = tips_mm[placing.long_tip] * (-1 if placing.plane == "XY" else 1)
        xyz.append(np.tile(corner, (repeats, 1)))
        tips.append(np.tile(tip, (3 * repeats, 1)))
    n = 3 * repeats * len(placings)
    readings, offsets = np.vstack(xyz), np.vstack(tips)
    return Points(
        machine.coordinates(readings), np.repeat(np.arange(1, len(placings) + 1), 3 * repeats),
        np.tile([1, 2, 3], n // 3), np.tile(np.repeat(np.arange(1, repeats + 1), 3), len(placings)), machine,
        {f"tip_{axis}_mm": offsets[:, i] for i, axis in enumerate(AXES)},
    )  # fmt: skip


_TITLES = say("Block 1–2"), say("Block 2–3"), say("Block 3–1"), say("Cylinder 1"), say("Cylinder 2"), say("Cylinder 3")


_WRONG_UM = 5.0  # by how much a side may be off whose block or cylinder is another than the job says, µm


class Triangle(Rigid):
    """A triangle as recorded: points 1, 2, 3 of every (measurement, repeat) are the axes of its cylinders.

    ``facts`` what the job says of blocks and cylinders; ``points`` the recording. ``standard`` dimensions of the triangle.
    """

    kind = "triangle"
    title = say("Triangle standard")
    key_of_u = "u_blocks_um and u_cylinders_um"

    def __init__(self, facts: TriangleFacts, points: Points, *, where: str | None = None) -> None:
        super().__init__(replace(points, machine=replace(points.machine, tip_on_every_carriage=True)))
        self._facts, self.standard, self.expansion = facts, TriangleStandard.of(facts), expansion(facts, points)
        _refuse_missing_corners(points, where)
        self._corner = points.point - 1
        each = zip(DIMENSIONS, _TITLES, self.standard.dimensions.tolist(), self.standard.u.tolist(), strict=True)
        self.sizes = tuple(Size(f"{name}_mm", title, unit("mm"), nominal, u) for name, title, nominal, u in each)
        self.body = self.shape(self.standard.dimensions)
        nominal, found = self.extents()
        longest = float(self.standard.sides.max())
        check_length(float(found.sum() / nominal.sum()) * longest, longest, "the longest sides", where)
        self.refuse_another_shape("Check the numbering of the cylinders: blocks_mm are 1–2, 2–3, 3–1", where)

    def shape(self, sizes: Floats) -> Floats:
        body = corners(SIDES_OF_DIMENSIONS @ sizes)[self._corner] * self.expansion[:, None]
        return np.asarray(body - self.placings.means(body), dtype=np.float64)

    def figures(self, counts: NDArray[np.bool_]) -> Mapping[str, ArtefactFigure]:
        """Sides by what is measured less what blocks and cylinders make them, and angles as arcs over their shorter side."""
        groups = [rows[np.argsort(self._corner[rows])] for rows in self.points.rows_of_groups if counts[rows].all()]
        if not groups:
            return {}
        of = np.array(groups)  # (q, 3)
        ends, nominal, u = np.array([[0, 1], [1, 2], [2, 0]]), self.standard.figures(), self.standard.u
        pairs = of[:, ends]
        apart = np.linalg.norm(np.diff(self.points.xyz[pairs], axis=2)[:, :, 0], axis=2)
        measured = figures_of(apart / self.expansion[pairs].mean(axis=2))
        numbers = 3 * self.points.measurement[of] + np.arange(3)
        lengths = np.tile(nominal.sides, len(of))
        errors, rows = (measured.sides - nominal.sides).ravel(), pairs.reshape(-1, 2)
        of_sides = np.sqrt(SIDES_OF_DIMENSIONS**2 @ u**2)
        found = figures_of_errors(Indications(errors, lengths, np.tile(of_sides, len(of)), rows))
        # the mean of all three sides has a third of each block and cylinder
        mean = replace(found["mean error"], u=np.array([np.linalg.norm(SIDES_OF_DIMENSIONS.mean(axis=0) * u)]))
        arms = np.minimum(nominal.sides, np.roll(nominal.sides, 1))  # of the angle at 1, 2, 3
        steps = self.standard.dimensions + _STEP_MM * np.vstack([np.eye(6), -np.eye(6)])
        moved = figures_of(steps @ SIDES_OF_DIMENSIONS.T).angles
        of_angles = arms * np.linalg.norm((moved[:6] - moved[6:]).T / (2 * _STEP_MM) * u, axis=1)
        arcs = ((measured.angles - nominal.angles) * arms).ravel()
        turned = np.repeat(of, 3, axis=0)
        angle = ArtefactFigure(arcs, turned, np.tile(arms, len(of)), np.tile(of_angles, len(of)))
        repeated = ranges_of_repeats(errors, rows, lengths, numbers.ravel())
        each = {**found, "mean error": mean, "angle error": angle}
        return each if repeated is None else {**each, "repeatability": repeated}

    def own_faults(self) -> Iterable[Effect]:
        body = Body.of(self.points, corners(self.standard.sides)[self._corner])
        u_um = float(np.hypot(self._facts.u_blocks_um, self._facts.u_cylinders_um))
        return faults(self._facts, self.points, body, by_certificate(u_um, _WRONG_UM), geometry=AFFINE)

    def size_change(self) -> Floats:
        change = corner_changes(self.standard.sides)[self._corner] * self.expansion[:, None, None]
        return np.asarray((change - self.placings.means(change)).reshape(-1, len(DIMENSIONS)), dtype=np.float64)


def _refuse_missing_corners(points: Points, where: str | None) -> None:
    other = ~np.isin(points.point, (1, 2, 3))
    problem = f"there is a point {points.point[np.argmax(other)]}: a triangle has 1, 2, 3"
    refuse(points, other, where, problem, "Number the cylinders as in blocks_mm")
    short = np.bincount(points.group)[points.group] < 3
    row = int(np.argmax(short))
    missing = min({1, 2, 3} - set(points.point[points.group == points.group[row]].tolist()), default=0)
    whose = f"measurement {points.measurement[row]}, repeat {points.repeat[row]}"
    problem = f"{whose} has no point {missing}: the triangle does not close"
    refuse(points, short, where, problem, "Record all three cylinders, or leave out the measurement")


def shape_of(facts: TriangleFacts, points: Points) -> ArtefactShape | None:
    """Placings of the triangle; ``None`` where a point is no corner."""
    if not np.isin(points.point, (1, 2, 3)).all():
        return None
    sides = TriangleStandard.of(facts).sides
    body = corners(sides)[points.point - 1]
    return ArtefactShape(rows_by(points.measurement), body_misfit, np.nan, float(sides.max()), True, (), body)


SCREENING = Screening(shape_of, balls=True)


def triangle_placings(setting: Setting) -> tuple[SetUp, ...]:
    for placing in SEVEN_PLACINGS:
        places.check_allowed(setting, np.eye(3)[3 - sum(PLANES[placing.plane])], places.ACROSS)
    return tuple(_set_ups(setting, SEVEN_PLACINGS))


def _set_ups(setting: Setting, placings: Sequence[Placing]) -> Iterator[SetUp]:
    sides = TriangleStandard.of(cast("TriangleFacts", setting.artefact)).sides
    machine = replace(setting.machine, travel_mm=setting.volume.box)
    points = placed_triangle(machine, sides, placings, repeats=setting.plan.repeats)
    for placing, some in zip(placings, split(points), strict=True):
        yield SetUp(placing.title, replace(some.points, machine=setting.machine))


def candidates(setting: Setting, start: Start | None) -> tuple[SetUp, ...]:
    return places.thinned(_everywhere(setting), setting.plan.candidates, setting.volume)


def _everywhere(setting: Setting) -> Iterator[SetUp]:
    volume = setting.volume
    for plane, (a, b) in PLANES.items():
        if not volume.allows(np.eye(3)[3 - a - b]):
            continue
        named = Verbatim(plane)
        titles = say("in the plane {plane}", plane=named), say("in the plane {plane}, longer tip", plane=named)
        at = ((x, y, z, long) for x, y, z in product(places.THIRDS, repeat=3) for long in (False, True))
        with suppress(CmmUqError):  # it does not fit this plane
            for set_up in _set_ups(setting, [Placing(titles[long], plane, (x, y, z), long) for x, y, z, long in at]):
                if volume.heights[0] <= set_up.middle[2] <= volume.heights[1]:
                    yield set_up


PLANNING = Planning(
    {"triangle placings": triangle_placings}, candidates, places.RelocatedCandidates(places.across_planes)
)
