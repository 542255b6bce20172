"""What a drawing asks for, of measured features: size, distance, angle, form, orientation, location, runout.

Sizes are global ones by the association that is asked for (ISO 14405-1: least squares (GG), minimum zone, …). Tolerances of
form, orientation, location and runout are widths of the zones of ISO 1101:2017 that just hold what is measured: points of
surfaces, the associated axis of a hole or shaft over its measured length; circular runout is the largest of any section.
A zone that one datum leaves free to turn is the smallest one where it stands at right angles to the datum; where it is
tilted it turns with the associated plane. Two-point sizes (LP, which ISO 14405-1 takes where a drawing says nothing) are not
evaluated.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.parts.association import VALUES, Features, component, normed
from cmm_uq.analysis.parts.datums import BEST_FIT, PartFrame
from cmm_uq.analysis.parts.plan import FORMS, ORIENTATIONS, RUNOUTS, ZONES, PartCharacteristic, PartFeature, Plan
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import AXES, Floats, Ints
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.part.feature import ASKS, AXIAL
from cmm_uq.maths.geometry.association import Association
from cmm_uq.maths.geometry.repeated import Repeated

Key = tuple[str, Association]  # A feature by an association
# cosine of the angle between two directions from which on they are meant to be parallel; its complement, at right angles
_ALONG = 0.999
SECTION = 0.01  # mm: how far points of one section may lie apart along the datum's axis; of a plane, across it
_COINCIDE = 1e-6  # mm and rad: a nominal distance or angle below which there is none
_FEWEST_IN_SECTION = 3  # points by which a section shows any runout beyond where the axis stands


@dataclass(frozen=True, eq=False)
class MeasuredFeatures:
    features: Mapping[Key, Features]  # by name and association
    frames: Mapping[tuple[str, ...], PartFrame]  # of the part, by names of datums


@dataclass(frozen=True, eq=False)
class CharacteristicEvaluation:
    characteristic: PartCharacteristic
    plan: Plan  # in which it is
    nominal: Mapping[str, Features]  # values of its features, without errors, by name

    def __post_init__(self) -> None:
        """What it needs of its features and datums."""
        one, plan = self.characteristic, self.plan
        where, asks = f"characteristic {one.name!r}", ASKS[one.what]
        kinds = [plan.feature(name).kind for name in one.features]
        counts = (1, 2) if asks.alone else (asks.features,)
        if len(kinds) not in counts:
            raise CmmUqError(
                f"{one.what} is of {' or '.join(map(str, counts))} features, not {len(kinds)}", where=where
            )
        several = "cone" if one.what == "size" else None
        fitting = asks.alone if len(kinds) < asks.features else (*asks.kinds, *filter(None, [several]))
        anywhere = asks.framed or one.what == "coaxiality"  # what has a place has these, here
        for kind in kinds:
            if kind not in fitting and not anywhere:
                raise CmmUqError(f"a {kind} has no {one.what}", where=where, fix=f"It is of {', '.join(fitting)}")
        if asks.datums and not one.datums:
            raise CmmUqError(f"{one.what} needs a datum", where=where, fix="Name one")
        if asks.datums and (kind := plan.feature(one.datums[0]).kind) not in asks.datum_kinds:
            fix = f"Take a {' or '.join(asks.datum_kinds)}"
            raise CmmUqError(f"the datum of {one.what} is a {kind}", where=where, fix=fix)
        if asks.framed and not (one.datums or plan.alignment.datums or plan.alignment.best_fit):
            raise CmmUqError(f"{one.what} needs datums", where=where, fix="Name datums, or an alignment of the plan")

    @property
    def keys(self) -> tuple[Key, ...]:
        """Its features; of those of a tolerance of form, by the association of its zone."""
        given = self.characteristic.association
        return tuple((name, given or self.plan.feature(name).association) for name in self.characteristic.features)

    @property
    def datums(self) -> tuple[Key, ...]:
        names = self.frame_of or self.characteristic.datums
        return () if names == BEST_FIT else tuple((name, self.plan.feature(name).association) for name in names)

    @property
    def frame_of(self) -> tuple[str, ...]:
        """Names of the datums of its frame; none where it needs none."""
        one = self.characteristic
        if one.what not in ("position", *AXES):
            return ()
        if not one.datums and self.plan.alignment.best_fit:
            return BEST_FIT
        return one.datums or self.plan.alignment.datums

    @property
    def of_points(self) -> bool:
        """Whether it is of measured points, and not of features alone."""
        what = self.characteristic.what
        return what in (*FORMS, *RUNOUTS) or (self.feature.kind == "plane" and what in (*ORIENTATIONS, "position"))

    def __call__(self, measured: MeasuredFeatures) -> Floats:
        """Values (N,), mm or rad."""
        return np.asarray(_OF[self.characteristic.what](self, measured), dtype=np.float64)

    def first(self, measured: MeasuredFeatures) -> Features:
        """Its first feature."""
        return measured.features[self.keys[0]]

    @cached_property
    def feature(self) -> PartFeature:
        return self.plan.feature(self.characteristic.features[0])

    def place(self, name: str, measured: Features) -> Floats:
        """(N, 3) where a feature lies: of a cone where it has its nominal diameter (ISO 3040), else its position."""
        nominal = self.plan.feature(name).nominal
        if nominal.diameter_mm is None or nominal.half_angle_rad is None:
            return measured.position
        widening = 2 * np.tan(np.copysign(measured.values[:, 7], nominal.half_angle_rad))
        by = (nominal.diameter_mm - measured.diameter) / widening
        return np.asarray(measured.position + by[:, None] * measured.direction)

    @cached_property
    def ends(self) -> Floats:
        """(2,) of the first feature's measured length along its axis, from its position, mm."""
        of = self.nominal[self.feature.name]
        along = (self.feature.points - of.position[0]) @ of.direction[0]
        return np.array([along.min(), along.max()])

    @cached_property
    def sections(self) -> tuple[Ints, ...]:
        """Rows of the points of each section of a circular runout, by their nominal place; of all else, all rows.

        Sections are places along the axis, of a plane circles about it, with three points at least.
        """
        points, one = self.feature.points, self.characteristic
        if one.what != "circular_runout" or self.feature.kind == "circle":
            return (np.arange(len(points)),)
        datum = self.nominal[one.datums[0]]
        apart = points - datum.position[0]
        place = apart @ datum.direction[0]
        if self.feature.kind == "plane":
            place = np.linalg.norm(apart - np.outer(place, datum.direction[0]), axis=1)
        order = np.argsort(place, kind="stable")
        ends = np.flatnonzero(np.diff(place[order]) > SECTION) + 1
        return tuple(rows for rows in np.split(order, ends) if len(rows) >= _FEWEST_IN_SECTION)

    def refuse_unfit(self) -> None:
        """Refuse what only the nominal points show."""
        if self.characteristic.what in RUNOUTS and not self.sections:
            raise CmmUqError(
                f"no section of {self.feature.name!r} has {_FEWEST_IN_SECTION} points",
                where=f"characteristic {self.characteristic.name!r}",
                fix="Probe it in circles about the datum's axis, or ask for total runout",
            )

    @cached_property
    def across(self) -> Repeated:
        """Of a plane that stands at right angles to its datum: its points seen along the datum."""
        return Repeated("line", self.feature.points @ self._seen.T)

    @cached_property
    def _seen(self) -> Floats:
        """(2, 3) directions of the coordinates of :attr:`across`."""
        normal = self.nominal[self.feature.name].direction[0]
        datum = self.nominal[self.characteristic.datums[0]].direction[0]
        u = np.cross(datum, normal)
        u /= np.linalg.norm(u)
        return np.array([u, np.cross(u, datum)])


def never_negative(plan: Plan) -> NDArray[np.bool_]:
    """(c,) whether each characteristic is zero of the nominal part and never less.

    Such are widths of zones, and the angle or the distance of two features that are meant to coincide.
    """
    return np.array([one.what in ZONES or _coinciding(one, plan) for one in plan.characteristics], dtype=bool)


def _coinciding(one: PartCharacteristic, plan: Plan) -> bool:
    if one.what not in ("distance", "angle") or len(one.features) < 2:
        return False
    of = CharacteristicEvaluation(one, plan, {})
    nominal = {}
    for key in of.keys:
        feature = plan.feature(key[0]).nominal
        direction = np.zeros(3) if feature.direction is None else feature.direction
        nominal[key] = Features(np.hstack([feature.point, direction, np.zeros(VALUES - 6)])[None])
    return bool(of(MeasuredFeatures(nominal, {}))[0] < _COINCIDE)


def _distance(of: CharacteristicEvaluation, measured: MeasuredFeatures) -> Floats:
    """Along the normal of a plane, else across an axis, else between two places; of two alike, the first's."""
    first, second = of.characteristic.features
    kinds = [of.plan.feature(name).kind for name in (first, second)]
    if kinds[0] != "plane" and (kinds[1] == "plane" or kinds[0] not in AXIAL):
        first, second, kinds = second, first, kinds[::-1]
    one, other = (measured.features[key] for name in (first, second) for key in of.keys if key[0] == name)
    apart = of.place(second, other) - of.place(first, one)
    if kinds[0] == "plane":
        return np.asarray(np.abs(np.einsum("ni,ni->n", apart, one.direction)))
    if kinds[0] in AXIAL:
        apart = apart - component(apart, one.direction)
    return np.asarray(np.linalg.norm(apart, axis=1))


def _angle(of: CharacteristicEvaluation, measured: MeasuredFeatures) -> Floats:
    """Between two directions, in the sense of the nominal ones; of a single cone its whole angle."""
    if len(of.keys) == 1:
        return np.asarray(2 * measured.features[of.keys[0]].values[:, 7])
    one, other = (measured.features[key].direction for key in of.keys)
    return _between(one, other)


def _orientation(of: CharacteristicEvaluation, measured: MeasuredFeatures) -> Floats:
    """Width of the zone that has its nominal angle to the first datum."""
    own, datum = of.first(measured), measured.features[of.datums[0]].direction
    cosine = float(of.nominal[of.feature.name].direction[0] @ of.nominal[of.characteristic.datums[0]].direction[0])
    if of.feature.kind != "plane":
        length = float(np.ptp(of.ends))
        if abs(cosine) > _ALONG:
            return length * np.asarray(np.linalg.norm(np.cross(own.direction, datum), axis=1))
        return np.asarray(length * np.abs(np.sin(_between(own.direction, datum) - np.arccos(cosine))))
    if abs(cosine) > _ALONG:
        return np.asarray(np.ptp(np.einsum("npi,ni->np", own.points, datum), axis=1))
    normal = own.direction
    if abs(cosine) < np.sqrt(1 - _ALONG**2):
        u = normed(np.cross(datum, normal))
        seen = np.stack([u, np.cross(u, datum)], axis=1)
        # the first coordinate only says where along the line: the measured direction is at right angles to the datum
        flat = np.einsum("npi,nki->npk", own.points, seen)
        return of.across.minimum_zone(flat - of.across.points).form
    beside = normed(normal - component(normal, datum))
    tilted = cosine * datum + np.sqrt(1 - cosine**2) * beside
    return np.asarray(np.ptp(np.einsum("npi,ni->np", own.points, tilted), axis=1))


def _position(of: CharacteristicEvaluation, measured: MeasuredFeatures) -> Floats:
    """Twice the largest distance from the nominal place, in the frame of the datums."""
    own, frame, nominal = of.first(measured), measured.frames[of.frame_of], of.nominal[of.feature.name]
    place, direction = nominal.position[0], nominal.direction[0]
    if of.feature.kind == "plane":
        return np.asarray(2 * np.abs((frame.points(own.points) - place) @ direction).max(axis=1))
    off = frame.points(own.position) - place
    if of.feature.kind in AXIAL:
        return _farthest(off, frame.vectors(own.direction), of.ends, direction)
    if of.feature.kind == "circle":
        off = off - np.outer(off @ direction, direction)
    return np.asarray(2 * np.linalg.norm(off, axis=1))


def _coaxiality(of: CharacteristicEvaluation, measured: MeasuredFeatures) -> Floats:
    """Twice the largest distance of the axis, or of the centre, from that of the datum."""
    own, datum = of.first(measured), measured.features[of.datums[0]]
    off = own.position - datum.position
    if of.feature.kind in AXIAL:
        return _farthest(off, own.direction, of.ends, datum.direction)
    return np.asarray(2 * np.linalg.norm(off - component(off, datum.direction), axis=1))


def _coordinate(of: CharacteristicEvaluation, measured: MeasuredFeatures) -> Floats:
    at = measured.frames[of.frame_of].points(of.place(of.feature.name, of.first(measured)))
    return np.asarray(at[:, AXES.index(of.characteristic.what)])


def _runout(of: CharacteristicEvaluation, measured: MeasuredFeatures) -> Floats:
    """Largest range in a section of the points' distances from the datum axis, or along it where they are of a plane."""
    own, datum = of.first(measured), measured.features[of.datums[0]]
    apart = own.points - datum.position[:, None]
    along = np.einsum("npi,ni->np", apart, datum.direction)
    seen = along
    if of.feature.kind != "plane":
        seen = np.linalg.norm(apart - along[:, :, None] * datum.direction[:, None], axis=2)
    return np.asarray(np.max([np.ptp(seen[:, rows], axis=1) for rows in of.sections], axis=0))


_OF: Mapping[str, Callable[[CharacteristicEvaluation, MeasuredFeatures], Floats]] = {
    "size": lambda of, measured: of.first(measured).diameter, "distance": _distance, "angle": _angle,
    "position": _position, "coaxiality": _coaxiality, **dict.fromkeys(FORMS, lambda of, measured: of.first(measured).form),
    **dict.fromkeys(ORIENTATIONS, _orientation), **dict.fromkeys(AXES, _coordinate), **dict.fromkeys(RUNOUTS, _runout),
}  # fmt: skip


def _farthest(off: Floats, direction: Floats, ends: Floats, axis: Floats) -> Floats:
    """(N,) twice the distance from an axis of the farther end of a length, whose middle is ``off`` a point of that axis."""
    found = np.zeros(len(off))
    for end in ends:
        at = off + end * direction
        found = np.maximum(found, np.linalg.norm(at - component(at, np.broadcast_to(axis, at.shape)), axis=1))
    return 2 * found


def _between(one: Floats, other: Floats) -> Floats:
    """Angles (N,) in [0, π], exact also where they are small."""
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), np.einsum("ni,ni->n", one, other)))
