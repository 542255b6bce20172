"""The plan of a measurement, and where the part lies on the table: geometry, nothing else.

Styli, features with their contact points, alignment and characteristics are in the frame of the part, mm, at 20 °C. Contact
points lie on the nominal surface; normals point out of the material, to the axis of a hole and away from that of a shaft.

With an offset of the tip the scales read another place than that of the point: the ram stands where the tip is not. Errors of
scales and guideways go by readings, and rotations of carriages act on the tip too (:mod:`cmm_uq.base.points`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property

import numpy as np

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.points import AXES, Floats, Ints, Machine, Points, beyond_travel
from cmm_uq.base.values import dataclass, field, fields, replace
from cmm_uq.jobs.part.feature import ASKS, FEWEST, ORIENTED, Kind, What
from cmm_uq.maths.geometry.association import ASSOCIATIONS, Association

SIZED: tuple[Kind, ...] = ("circle", "sphere", "cylinder")  # features with a diameter
FORMS = ("straightness", "flatness", "roundness", "cylindricity", "sphericity")
ORIENTATIONS = ("parallelism", "perpendicularity", "angularity")
RUNOUTS = ("circular_runout", "total_runout")
# characteristics that are widths of a zone, which is never negative
ZONES = (*FORMS, *ORIENTATIONS, "position", "coaxiality", *RUNOUTS)
# kinds of characteristic; see :mod:`cmm_uq.analysis.parts.characteristics` for what each means
WHATS = tuple(ASKS)
_UNIT = 1e-6  # by how much the length of a unit vector may differ from one
_SIDEWAYS = 1e-6  # component of a normal below which an axis does not move into the surface


# columns that follow from how a point is probed
OWN_COLUMNS = tuple(f"{begin}{a}{end}" for begin, end in (("n", ""), ("tip_", "_mm"), ("approach_", "")) for a in AXES)


@dataclass(frozen=True, eq=False)
class Stylus:
    name: str  # as features name it
    # (3,) centre of the tip from the ram's reference point, machine axes: x, y, z
    offset_mm: Floats = field(default_factory=lambda: np.zeros(3))
    diameter_mm: float = 0.0  # of the tip
    u_diameter_um: float = 0.0  # of the effective diameter
    # (3,) of the tip's offset against the tip to which the others are referred; zero of that tip itself
    u_offset_um: Floats = field(default_factory=lambda: np.zeros(3))
    # standard deviation of the pre-travel over directions, once size and offset are taken out of it
    lobing_um: float = 0.0
    # (3,) coordinates of the machine where the reference sphere stood: what the machine's errors do there they do not do to
    # the part again. ``None`` where that is not known.
    qualified_at_mm: Floats | None = None


@dataclass(frozen=True, eq=False)
class Nominal:
    point: Floats  # (3,) on it: the centre, or a point of plane, line or axis
    # (3,) unit vector along line or axis, normal of plane or circle; none of point and sphere
    direction: Floats | None = None
    diameter_mm: float | None = None  # of circle, sphere, cylinder; of a cone at ``point``
    half_angle_rad: float | None = None  # of a cone, which widens along its direction where positive


@dataclass(frozen=True, eq=False)
class PartFeature:
    """A feature with the points at which it is probed.

    Raises
    ------
    CmmUqError : too few points, shapes that do not fit, normals of another length than one, a nominal that lacks something.
    """

    name: str  # as characteristics name it
    kind: Kind
    points: Floats  # (n, 3) nominal contact points
    normals: Floats  # (n, 3) unit vectors out of the material
    stylus: str  # name of the stylus that probes it
    nominal: Nominal
    association: Association = "least_squares"  # how it is made of its points where a characteristic says nothing else
    # (m, 3) points so close on the whole surface that they stand for it, for what a part's form does between the points that
    # are probed, and their normals; none where this is not asked for
    surface: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    surface_normals: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    members: tuple[PartFeature, ...] = ()  # of a common datum, whose points are theirs

    def __post_init__(self) -> None:
        where, least = f"feature {self.name!r}", FEWEST.get(self.kind, 0)
        named = (self.kind, FEWEST, "kind of feature"), (self.association, ASSOCIATIONS, "association")
        for value, known, what in named:
            if value not in known:
                raise CmmUqError(f"{value!r} is no {what}", where=where, fix=suggestion(value, known))
        for points, normals in ((self.points, self.normals), (self.surface, self.surface_normals)):
            _refuse_ill_shaped(points, normals, where)
        if len(self.points) < least:
            fix = f"Probe at least {least}"
            raise CmmUqError(f"{len(self.points)} points are too few for a {self.kind}", where=where, fix=fix)
        nominal = self.nominal
        for kinds, lacks, what, fix in (
            (ORIENTED, nominal.direction is None, "direction", "Give its direction"),
            ((*SIZED, "cone"), nominal.diameter_mm is None, "diameter", "Give its diameter in mm"),
            (("cone",), nominal.half_angle_rad is None, "angle", "Give half of its angle"),
        ):
            if lacks and self.kind in kinds:
                raise CmmUqError(f"a {self.kind} needs a nominal {what}", where=where, fix=fix)

    @cached_property
    def internal(self) -> bool:
        """Whether it is a hole: material is outside of its surface."""
        if self.kind not in (*SIZED, "cone"):
            return False
        out = self.points - self.nominal.point
        if self.nominal.direction is not None:
            out = out - np.outer(out @ self.nominal.direction, self.nominal.direction)
        return bool(np.einsum("ni,ni->", out, self.normals) < 0)


def as_datum(one: PartFeature) -> PartFeature:
    """A member of a common datum as what it fixes: a circle its axis, a sphere its centre, a point the plane there."""
    if one.kind == "point":
        return replace(one, kind="plane", points=np.repeat(one.points, FEWEST["plane"], axis=0),
                       normals=np.repeat(one.normals, FEWEST["plane"], axis=0),
                       nominal=replace(one.nominal, direction=one.normals[0]))  # fmt: skip
    if one.kind == "sphere":
        return replace(one, kind="point", nominal=replace(one.nominal, direction=None))
    return replace(one, kind="line") if one.kind == "circle" else one


@dataclass(frozen=True, eq=False)
class CommonDatum:
    """A datum on several features, which are associated at once (ISO 5459): ``A-B`` of a drawing."""

    name: str  # as characteristics and alignment name it
    features: tuple[str, ...]  # names of its members; points, planes, circles, spheres, cylinders or cones
    # what the whole is as a datum: ``line`` where all members lie on one axis, ``plane`` where all are parallel faces; else
    # ``point``, which aligns a part and is the datum of nothing else
    kind: Kind
    nominal: Nominal  # a point of it, and its direction, which a ``point`` has not


@dataclass(frozen=True)
class PartAlignment:
    """How the coordinates of the part follow from measured points."""

    # names of features in order of precedence: each fixes of rotation and translation what those before it left free (ISO
    # 5459), so that measured and nominal datums coincide in that
    datums: tuple[str, ...] = ()
    best_fit: bool = False  # by least squares of the distances of all points from the nominal surfaces instead


@dataclass(frozen=True)
class PartCharacteristic:
    name: str  # as on the drawing
    what: What
    features: tuple[str, ...]  # names of the features that it is of, in order
    datums: tuple[str, ...] = ()  # names of its datums in order; the plan's alignment where it has none and needs some
    # limits of the value, mm, or rad of an angle; a tolerance zone's width is ``upper``
    lower: float | None = None
    upper: float | None = None
    association: Association | None = None  # of its features, where not their own


@dataclass(frozen=True, eq=False)
class Plan:
    """A measurement of a part, as it is planned.

    Raises
    ------
    CmmUqError : a name that stands twice or is not there, an order that is none.
    """

    features: tuple[PartFeature, ...]
    characteristics: tuple[PartCharacteristic, ...]  # that are to be evaluated
    styli: tuple[Stylus, ...] = (Stylus("stylus"),)  # by which it is probed
    alignment: PartAlignment = field(default_factory=PartAlignment)  # for characteristics without datums of their own
    # (n,) rows of the points of all features, in the order in which they are probed; as they stand by default
    order: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    # (n,) time of each point, in the rows' order, s since the start; none where no time is known
    times_s: Floats = field(default_factory=lambda: np.zeros(0))
    common: tuple[CommonDatum, ...] = ()  # datums on several features

    def __post_init__(self) -> None:
        known, styli = [one.name for one in self.features], [one.name for one in self.styli]
        may_be_datums = [*known, *(one.name for one in self.common)]
        named = {
            "feature": may_be_datums,
            "stylus": styli,
            "characteristic": [one.name for one in self.characteristics],
        }
        for what, names in named.items():
            for i, name in enumerate(names):
                if name in names[:i]:
                    fix = "Give each a name of its own"
                    raise CmmUqError(f"the {what} {name!r} stands twice", where="plan", fix=fix)
        for feature in self.features:
            _refuse_unknown([feature.stylus], styli, f"feature {feature.name!r}", "stylus")
        for datum in self.common:
            _refuse_common(datum, [self.feature(name) for name in datum.features])
        _refuse_unknown(self.alignment.datums, may_be_datums, "alignment", "feature")
        for one in self.characteristics:
            where = f"characteristic {one.name!r}"
            _refuse_unknown([one.what], WHATS, where, "kind of characteristic")
            _refuse_unknown(one.features, known, where, "feature")
            _refuse_unknown(one.datums, may_be_datums, where, "feature")
        n = len(self.points)
        if len(self.order) and not np.array_equal(np.sort(self.order), np.arange(n)):
            raise CmmUqError(f"the order does not name each of {n} points once", where="plan")
        if len(self.times_s) not in (0, n):
            raise CmmUqError(f"{len(self.times_s)} times for {n} points", where="plan")

    @cached_property
    def points(self) -> Floats:
        """(n, 3) nominal contact points of all features, in their order."""
        return np.concatenate([np.zeros((0, 3)), *(feature.points for feature in self.features)])

    @cached_property
    def normals(self) -> Floats:
        """(n, 3) of these, out of the material."""
        return np.concatenate([np.zeros((0, 3)), *(feature.normals for feature in self.features)])

    @cached_property
    def rows(self) -> dict[str, slice]:
        """Rows of each feature's points among those of all, by its name."""
        ends = np.cumsum([0, *(len(feature.points) for feature in self.features)]).tolist()
        return {f.name: slice(a, b) for f, a, b in zip(self.features, ends, ends[1:], strict=False)}

    @cached_property
    def stylus_of(self) -> Ints:
        """(n,) place among ``styli`` of the stylus that probes each point."""
        names = [stylus.name for stylus in self.styli]
        return np.repeat([names.index(f.stylus) for f in self.features], [len(f.points) for f in self.features])

    def rows_of(self, name: str) -> Ints:
        """(n,) rows of the points of a feature or of a common datum, among those of all."""
        rows = [self.rows[member] for member in self.members(name)]
        return np.concatenate([np.arange(each.start, each.stop) for each in rows])

    def members(self, name: str) -> tuple[str, ...]:
        return next((datum.features for datum in self.common if datum.name == name), (name,))

    def feature(self, name: str) -> PartFeature:
        """A feature by its name, or a common datum as one."""
        for datum in self.common:
            if datum.name == name:
                parts = tuple(self.feature(each) for each in datum.features)
                points, normals = np.vstack([one.points for one in parts]), np.vstack([one.normals for one in parts])
                return PartFeature(name, datum.kind, points, normals, parts[0].stylus, datum.nominal, members=parts)
        _refuse_unknown([name], list(self.rows), "plan", "feature")
        return next(feature for feature in self.features if feature.name == name)


def _refuse_ill_shaped(points: Floats, normals: Floats, where: str) -> None:
    if points.ndim != 2 or points.shape[1] != 3 or normals.shape != points.shape:
        said = f"points {points.shape} and normals {normals.shape} do not belong together"
        raise CmmUqError(said, where=where, fix="Give (n, 3) of each")
    if not np.isfinite(points).all():
        raise CmmUqError("a point has a coordinate that is no finite number", where=where, fix="Correct or remove it")
    if not np.all(np.abs(np.linalg.norm(normals, axis=1) - 1) < _UNIT):
        raise CmmUqError("a normal is no unit vector", where=where, fix="Divide each by its length")


def _refuse_common(datum: CommonDatum, members: Sequence[PartFeature]) -> None:
    where = f"common datum {datum.name!r}"
    for one in members:
        if one.kind == "line":
            fix = "Probe a plane, or name lines as datums of their own"
            raise CmmUqError(f"{one.name!r} is a line, which stands in no common datum", where=where, fix=fix)
        if one.association != "least_squares":
            said = one.association.replace("_", " ")
            raise CmmUqError(f"is associated by least squares, and {one.name!r} by {said}", where=where,
                             fix=f"Leave the association of {one.name!r} out, and give it to its characteristics")  # fmt: skip


def _refuse_unknown(names: Iterable[str], known: Sequence[str], where: str, what: str) -> None:
    for name in names:
        if name not in known:
            raise CmmUqError(f"there is no {what} {name!r}", where=where, fix=suggestion(name, known))


@dataclass(frozen=True, eq=False)
class PartPose:
    """A place on the table: coordinates of the machine = rotation · those of the part + translation."""

    rotation: Floats = field(default_factory=lambda: np.eye(3))  # (3, 3), proper
    translation_mm: Floats = field(default_factory=lambda: np.zeros(3))  # (3,) where the part's origin lies

    def __post_init__(self) -> None:
        off = np.abs(self.rotation @ self.rotation.T - np.eye(3)).max()
        if self.rotation.shape != (3, 3) or not off < _SIDEWAYS or np.linalg.det(self.rotation) < 0:
            fix = "Give three angles, or a proper rotation"
            raise CmmUqError("the rotation of the part is none", where="placing", fix=fix)

    def of(self, points: Floats) -> Floats:
        """Points (…, 3) of the part in the machine."""
        return np.asarray(points @ self.rotation.T + self.translation_mm)

    def turned(self, vectors: Floats) -> Floats:
        """Vectors (…, 3) of the part in the machine."""
        return np.asarray(vectors @ self.rotation.T)

    def back(self, vectors: Floats) -> Floats:
        """Vectors (…, 3) of the machine in the part."""
        return np.asarray(vectors @ self.rotation)


def around(
    pose: PartPose, u_translation_mm: Floats, u_angles_rad: Floats, count: int, seed: int = 0
) -> tuple[PartPose, ...]:
    """So many places where a part may lie that is put near one: normal in all six.

    ``u_translation_mm``: (3,) standard deviations. ``u_angles_rad``: (3,) of small rotations about the axes of the machine.
    """
    from scipy.spatial.transform import Rotation

    random = np.random.default_rng(seed)
    moved, turned = random.standard_normal((count, 3)), random.standard_normal((count, 3))
    turns = (Rotation.from_rotvec(each * u_angles_rad).as_matrix() for each in turned)
    return tuple(
        PartPose(turn @ pose.rotation, pose.translation_mm + each * u_translation_mm)
        for turn, each in zip(turns, moved, strict=True)
    )


@dataclass(frozen=True, eq=False)
class WithStyli(Machine):
    """A machine whose probe has an offset, point by point in the columns ``tip_x_mm``, ``tip_y_mm``, ``tip_z_mm``."""

    def readings(self, xyz: Floats, columns: Mapping[str, Floats]) -> Floats:
        return super().readings(xyz - np.column_stack([columns[f"tip_{axis}_mm"] for axis in AXES]), columns)

    @classmethod
    def of(cls, machine: Machine) -> WithStyli:
        """The machine with a probe; rotations of all its carriages act on the tip, as they do in truth."""
        own = {each.name: getattr(machine, each.name) for each in fields(Machine)}
        return cls(**own | {"tip_on_every_carriage": True})


def placed(plan: Plan, pose: PartPose, machine: Machine, columns: Mapping[str, Floats | float] | None = None) -> Points:
    """The plan's points as the machine stands at them: the centres of the tip, with their normals, travel, tips and times.

    ``columns``: further columns of effects, by name, (n,) or a number for all: temperatures.
    """
    radii = 0.5 * np.array([stylus.diameter_mm for stylus in plan.styli])[plan.stylus_of]
    tips = np.array([stylus.offset_mm for stylus in plan.styli])[plan.stylus_of]
    further = {"time_s": plan.times_s} if len(plan.times_s) else {}
    for name, values in (columns or {}).items():
        further[name] = np.broadcast_to(np.asarray(values, dtype=np.float64), radii.shape).copy()
    points = probed(pose.of(plan.points), pose.turned(plan.normals), tips, radii, machine, further)
    for axis, row in beyond_travel(points.carriages, points.machine.travel_mm):
        low, high = points.machine.travel_mm[axis]
        feature = next(name for name, rows in plan.rows.items() if rows.start <= row < rows.stop)
        raise CmmUqError(
            f"{AXES[axis].upper()} would have to read {points.carriages[row, axis]:.1f} mm at feature {feature!r}, "
            f"beyond its travel of {low:g} to {high:g} mm",
            where="placing",
            fix="Move the part, or take another stylus",
        )
    return points


def probed(
    contacts: Floats, normals: Floats, tips: Floats, radii: Floats, machine: Machine, further: Mapping[str, Floats]
) -> Points:
    """The machine at points of contact (n, 3), with normals (n, 3), tips of offsets (n, 3) and radii (n,), mm."""
    travel = -np.sign(np.where(np.abs(normals) > _SIDEWAYS, normals, 0.0))
    own = np.column_stack([normals, tips, travel])
    known = {name: own[:, i] for i, name in enumerate(OWN_COLUMNS)}
    rows, ones = np.arange(1, len(contacts) + 1), np.ones(len(contacts), dtype=np.int64)
    centres = contacts + radii[:, None] * normals
    return Points(centres, ones, rows, ones, WithStyli.of(machine), {**known, **further}, start_s=0.0)
