"""The plan of a measurement: styli, features with their contact points, alignment, characteristics. Geometry, nothing else.

Everything is in the frame of the part, mm, at 20 °C. Contact points lie on the nominal surface; normals point out of the
material, so that they point to the axis of a hole and away from that of a shaft.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.points import Floats, Ints
from cmm_uq.maths.geometry.association import ASSOCIATIONS, Association

FeatureKind = Literal["point", "line", "plane", "circle", "sphere", "cylinder", "cone"]
# points that determine a feature
FEWEST: dict[FeatureKind, int] = {"point": 1, "line": 2, "plane": 3, "circle": 3, "sphere": 4, "cylinder": 5, "cone": 6}
# features with a direction: along a line or an axis, normal to a plane or to that of a circle
DIRECTED: tuple[FeatureKind, ...] = ("line", "plane", "circle", "cylinder", "cone")
SIZED: tuple[FeatureKind, ...] = ("circle", "sphere", "cylinder")  # features with a diameter
SIZES = ("size",)
FORMS = ("straightness", "flatness", "roundness", "cylindricity", "sphericity")
RELATIONS = ("distance", "angle")
ORIENTATIONS = ("parallelism", "perpendicularity", "angularity")
LOCATIONS = ("position", "coaxiality", "x", "y", "z")
RUNOUTS = ("circular_runout", "total_runout")
# kinds of characteristic; see :mod:`cmm_uq.analysis.parts.characteristics` for what each means.
WHATS = (*SIZES, *FORMS, *RELATIONS, *ORIENTATIONS, *LOCATIONS, *RUNOUTS)
# those of them that are widths of a zone, which is never negative
ZONES = (*FORMS, *ORIENTATIONS, "position", "coaxiality", *RUNOUTS)
_UNIT = 1e-6  # by how much the length of a unit vector may differ from one


@dataclass(frozen=True, eq=False)
class Stylus:
    """A stylus as it is used, with what its qualification left uncertain, as standard uncertainties."""

    name: str  # as features name it
    # (3,) centre of the tip from the ram's reference point, machine axes: x, y, z
    offset_mm: Floats = field(default_factory=lambda: np.zeros(3))
    diameter_mm: float = 0.0  # of the tip
    u_diameter_um: float = 0.0  # of the effective diameter
    # (3,) of the tip's offset against the tip to which the others are referred; zero of that tip itself
    u_offset_um: Floats = field(default_factory=lambda: np.zeros(3))
    # standard deviation of the pre-travel over directions of probing, once size and offset are taken out of it
    lobing_um: float = 0.0
    # (3,) coordinates of the machine where the reference sphere stood: what the machine's errors do there they do not do to
    # the part again. ``None`` where that is not known.
    qualified_at_mm: Floats | None = None


@dataclass(frozen=True, eq=False)
class Nominal:
    """Where a feature is meant to be.

    Parameters
    ----------
    point : (3,) on it: the centre, or a point of plane, line or axis.
    direction : (3,) unit vector along the line or axis, normal of plane or circle; ``None`` of point and sphere.
    diameter_mm : of circle, sphere, cylinder; of a cone at ``point``.
    half_angle_rad : of a cone, which widens along its direction where positive.
    """

    point: Floats
    direction: Floats | None = None
    diameter_mm: float | None = None
    half_angle_rad: float | None = None


@dataclass(frozen=True, eq=False)
class PartFeature:
    """A feature with the points at which it is probed.

    Parameters
    ----------
    name : as characteristics name it.
    kind : of geometry.
    points : (n, 3) nominal contact points.
    normals : (n, 3) unit vectors out of the material.
    stylus : name of the stylus that probes it.
    nominal : where it is meant to be.
    association : how it is made of its points where a characteristic says nothing else.
    surface : (m, 3) points so close on the whole surface that they stand for it, for what a part's form does between
        the points that are probed; none where this is not asked for.
    surface_normals : (m, 3) of these.
    members : of a common datum, whose points are theirs.

    Raises
    ------
    CmmUqError : too few points, shapes that do not fit, normals of another length than one, a nominal that lacks something.
    """

    name: str
    kind: FeatureKind
    points: Floats
    normals: Floats
    stylus: str
    nominal: Nominal
    association: Association = "least_squares"
    surface: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    surface_normals: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    members: tuple[PartFeature, ...] = ()

    def __post_init__(self) -> None:
        where = f"feature {self.name!r}"
        if self.kind not in FEWEST:
            raise CmmUqError(f"{self.kind!r} is no kind of feature", where=where, fix=suggestion(self.kind, FEWEST))
        if self.association not in ASSOCIATIONS:
            fix = suggestion(self.association, ASSOCIATIONS)
            raise CmmUqError(f"{self.association!r} is no association", where=where, fix=fix)
        for points, normals in ((self.points, self.normals), (self.surface, self.surface_normals)):
            _refuse_ill_shaped(points, normals, where)
        least = FEWEST[self.kind]
        if len(self.points) < least:
            raise CmmUqError(f"{len(self.points)} points are too few for a {self.kind}", where=where,
                             fix=f"Probe at least {least}")  # fmt: skip
        if self.kind in DIRECTED and self.nominal.direction is None:
            raise CmmUqError(f"a {self.kind} needs a nominal direction", where=where, fix="Give its direction")
        if self.kind in (*SIZED, "cone") and self.nominal.diameter_mm is None:
            raise CmmUqError(f"a {self.kind} needs a nominal diameter", where=where, fix="Give its diameter in mm")
        if self.kind == "cone" and self.nominal.half_angle_rad is None:
            raise CmmUqError("a cone needs a nominal angle", where=where, fix="Give half of its angle")

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
    kind: FeatureKind
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
    """What the drawing asks for.

    Parameters
    ----------
    name : as on the drawing.
    what : one of :data:`WHATS`.
    features : names of the features that it is of, in order.
    datums : names of its datums in order; the plan's alignment where it has none and needs some.
    lower, upper : limits of the value, mm, or rad of an angle; a tolerance zone's width is ``upper``.
    association : of its features, where not their own.
    """

    name: str
    what: str
    features: tuple[str, ...]
    datums: tuple[str, ...] = ()
    lower: float | None = None
    upper: float | None = None
    association: Association | None = None


@dataclass(frozen=True, eq=False)
class Plan:
    """A measurement of a part, as it is planned.

    Parameters
    ----------
    features : with their points.
    characteristics : that are to be evaluated.
    styli : by which it is probed; one without offset, named ``stylus``, by default.
    alignment : for characteristics without datums of their own.
    order : (n,) rows of the points of all features, in the order in which they are probed; as they stand by default.
    times_s : (n,) time of each point, in the rows' order, s since the start; none where no time is known.
    common : datums on several features.

    Raises
    ------
    CmmUqError : a name that stands twice or is not there, an order that is none.
    """

    features: tuple[PartFeature, ...]
    characteristics: tuple[PartCharacteristic, ...]
    styli: tuple[Stylus, ...] = (Stylus("stylus"),)
    alignment: PartAlignment = field(default_factory=PartAlignment)
    order: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    times_s: Floats = field(default_factory=lambda: np.zeros(0))
    common: tuple[CommonDatum, ...] = ()

    def __post_init__(self) -> None:
        for what, names in (
            ("feature", [*(one.name for one in self.features), *(one.name for one in self.common)]),
            ("stylus", [one.name for one in self.styli]),
            ("characteristic", [one.name for one in self.characteristics]),
        ):
            _refuse_twice(what, names)
        known = [feature.name for feature in self.features]
        for feature in self.features:
            _refuse_unknown([feature.stylus], [s.name for s in self.styli], f"feature {feature.name!r}", "stylus")
        for datum in self.common:
            _refuse_common(datum, [self.feature(name) for name in datum.features])
        may_be_datums = [*known, *(datum.name for datum in self.common)]
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

    @cached_property
    def tips(self) -> Floats:
        """(n, 3) offset of the tip that probes each point, mm."""
        return np.array([stylus.offset_mm for stylus in self.styli])[self.stylus_of]

    def rows_of(self, name: str) -> Ints:
        """(n,) rows of the points of a feature or of a common datum, among those of all."""
        rows = [self.rows[member] for member in self.members(name)]
        return np.concatenate([np.arange(each.start, each.stop) for each in rows])

    def members(self, name: str) -> tuple[str, ...]:
        """Names of the members of a common datum; of a feature its own."""
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
        raise CmmUqError(f"points {points.shape} and normals {normals.shape} do not belong together", where=where,
                         fix="Give (n, 3) of each")  # fmt: skip
    if not np.isfinite(points).all():
        raise CmmUqError("a point has a coordinate that is no finite number", where=where, fix="Correct or remove it")
    if not np.all(np.abs(np.linalg.norm(normals, axis=1) - 1) < _UNIT):
        raise CmmUqError("a normal is no unit vector", where=where, fix="Divide each by its length")


def _refuse_common(datum: CommonDatum, members: Sequence[PartFeature]) -> None:
    where = f"common datum {datum.name!r}"
    for one in members:
        if one.kind == "line":
            raise CmmUqError(f"{one.name!r} is a line, which stands in no common datum", where=where,
                             fix="Probe a plane, or name lines as datums of their own")  # fmt: skip
        if one.association != "least_squares":
            said = one.association.replace("_", " ")
            raise CmmUqError(f"is associated by least squares, and {one.name!r} by {said}", where=where,
                             fix=f"Leave the association of {one.name!r} out, and give it to its characteristics")  # fmt: skip


def _refuse_twice(what: str, names: Sequence[str]) -> None:
    for i, name in enumerate(names):
        if name in names[:i]:
            raise CmmUqError(f"the {what} {name!r} stands twice", where="plan", fix="Give each a name of its own")


def _refuse_unknown(names: Iterable[str], known: Sequence[str], where: str, what: str) -> None:
    for name in names:
        if name not in known:
            raise CmmUqError(f"there is no {what} {name!r}", where=where, fix=suggestion(name, known))
