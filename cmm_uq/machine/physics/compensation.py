"""From indicated to true coordinates by error maps and back, and the probe offset on a plane surface.

The inverse is found by iteration: the map changes by far less than it is displaced, so every round gains three digits or more.
A probe of finite diameter touches a plane with its side, so that the points of contact lie on a plane one offset away from
the surface; a point just before contact tells on which side the probe was (US 4,866,643 claim 1).
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.csv_table import csv_table
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.base.values import dataclass, replace
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.kinematics import KinematicChain, exact, on_leaning_axes
from cmm_uq.machine.physics.map_interpolation import Beyond, ErrorMaps, factor_of
from cmm_uq.machine.physics.superposition import Superposition
from cmm_uq.maths.geometry import Plane, fit_plane

SETTLED = 1e-10  # change of a coordinate, mm, at which the inverse is found
MAX_ROUNDS = 50
BLOCK = 8192  # points computed at a time: as many as a processor's cache holds with all that is between
HEADER = ("effect", "coefficient", "value", "u")
_ROTARY_BLOCK = 1024  # points computed at a time
_WRITE_AGAIN = "Write the file again: cmm-uq compensate --new-map"


@dataclass(frozen=True, eq=False)
class RotaryErrors:
    """Errors of a machine with rotary axes as a calibration found them, with their covariance: what corrects such a machine.

    They are coefficients c of effects that follow from where the axes stand: true = indicated + B·c, B along the axes of the
    coordinates. With F·Fᵀ the covariance of c, u of a corrected coordinate is the length of its row of B·F.
    """

    effects: tuple[Effect, ...]
    values: Floats  # (k,) of their coefficients, in the units of these
    factor: Floats  # (k, r)
    source: str = ""  # file that they were read from
    sha256: str = ""

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the recording, or of the cloud, by which they go."""
        return tuple(dict.fromkeys(name for effect in self.effects for name in effect.columns))

    def errors(self, points: Points) -> Floats:
        """(n, 3) true less indicated, mm, along the axes of the coordinates."""
        return points.on_artefact(self._acting.errors(points, self.values)[:, :, None])[:, :, 0]

    def root(self, points: Points) -> Floats:
        """B·F (n, 3, r), mm, along the axes of the coordinates."""
        change = self._acting.derivatives(self._acting.about(points, self.values))
        return np.asarray(points.on_artefact(change @ self.factor))

    def standard_uncertainty(self, points: Points) -> Floats:
        """(n, 3), mm, of each corrected coordinate."""
        parts = (self.root(points.select(rows)) for rows in blocks(len(points)))
        return np.concatenate([np.zeros((0, 3)), *(np.linalg.norm(part, axis=2) for part in parts)])

    def csv(self) -> str:
        u, rows = np.linalg.norm(self.factor, axis=1), [",".join(HEADER)]
        named = [(effect.name, one.name) for effect in self.effects for one in effect.coefficients]
        for (effect, name), value, own in zip(named, self.values.tolist(), u.tolist(), strict=True):
            rows.append(f"{effect},{name},{value!r},{own:.6g}")
        return "\n".join(rows) + "\n"

    @property
    def _acting(self) -> Superposition:
        return Superposition(self.effects)


def blocks(count: int) -> Iterator[Ints]:
    for start in range(0, count, _ROTARY_BLOCK):
        yield np.arange(start, min(start + _ROTARY_BLOCK, count))


def parse_rotary_errors(content: bytes, factor: bytes, where: str, at: str, source: str) -> RotaryErrors:
    """Of the contents of two files as ``compensate --new-map`` writes them; ``where``, ``at``: of each, for messages."""
    table = csv_table(content, where, HEADER)
    names, coefficients = table.texts("effect"), table.texts("coefficient")
    found = effects(list(dict.fromkeys(names)), where=where)
    if shaped := next((effect.name for effect in found if effect.shape or not of_axes(effect)), None):
        raise CmmUqError(f"{shaped} is no error that such a file corrects", where=where, fix=_WRITE_AGAIN)
    asked = [(effect.name, one.name) for effect in found for one in effect.coefficients]
    given = list(zip(names, coefficients, strict=True))
    if asked != given:
        row = next((i for i, (a, b) in enumerate(zip(asked, given, strict=False)) if a != b), len(given) - 1)
        problem = f"the coefficients of {given[row][0]} are not all there in their order"
        raise CmmUqError(problem, where=table.at(row), fix=_WRITE_AGAIN)
    values = table.numbers("value")
    whose = f"the file {source} has {len(values)} coefficients"
    root = factor_of(factor, at, len(values), whose, "file of errors")
    return RotaryErrors(found, values, root, source, hashlib.sha256(content).hexdigest())


def of_axes(effect: Effect) -> bool:
    """Whether an effect is an error of carriages or rotary axes, and not of an artefact or of the probe."""
    return effect.mechanism not in ("artefact", "probe") and not effect.of_artefact


@dataclass(frozen=True, eq=False)
class PointConditions:
    """What the error of a point depends on beside its coordinates."""

    tip: Floats | None = None  # (n, 3) or (3,) stylus tip offset from the end of the ram, mm
    temperatures: Floats | float | None = None  # of the scales, (n, 3) or (3,), or of all, °C; see :meth:`ErrorMaps.at`
    lines: Ints | None = None  # (n,) of the points in their file, for messages

    def of(self, rows: slice) -> PointConditions:
        tip = self.tip[rows] if self.tip is not None and self.tip.ndim == 2 else self.tip
        each = isinstance(self.temperatures, np.ndarray) and self.temperatures.ndim == 2
        temperatures = np.asarray(self.temperatures)[rows] if each else self.temperatures
        return PointConditions(tip, temperatures, self.lines[rows] if self.lines is not None else None)


NOMINAL = PointConditions()


@dataclass(frozen=True, eq=False)
class Compensation:
    """How the readings of one machine become true coordinates."""

    maps: ErrorMaps  # its error maps
    # its carriages; see :meth:`cmm_uq.machine.physics.kinematics.KinematicChain.of`
    chain: str | KinematicChain = "XYZ"
    origin: Floats | tuple[float, float, float] = (0.0, 0.0, 0.0)  # (3,) scale reading = coordinate + origin, mm
    # True for exact rigid transformations; False to first order in displacements and rotations (Harris 2004 eq. 10–13), on
    # axes that lean exactly.
    rigid: bool = False
    beyond: Beyond = "refuse"  # what to do beyond the mapped positions and temperatures

    def error(self, indicated: Floats, when: PointConditions = NOMINAL) -> tuple[Floats, NDArray[np.bool_]]:
        """Error e (n, 3) in mm of indicated coordinates (n, 3), mm, and which points (n,) were extrapolated."""
        return self.error_at(indicated + np.asarray(self.origin), when)

    def error_at(self, readings: Floats, when: PointConditions = NOMINAL) -> tuple[Floats, NDArray[np.bool_]]:
        """The same of scale readings (n, 3), mm, of the carriages."""
        form = exact if self.rigid else on_leaning_axes
        e, extrapolated = np.empty(readings.shape), np.empty(len(readings), dtype=bool)
        for start in range(0, len(readings), BLOCK):
            rows = slice(start, start + BLOCK)
            here, part = when.of(rows), readings[rows]
            found = self.maps.at(part, here.temperatures, beyond=self.beyond, lines=here.lines, first=start + 1)
            e[rows] = form(part, found.errors, found.squareness, tip=here.tip, chain=self.chain)
            extrapolated[rows] = found.extrapolated
        return e, extrapolated

    def compensate(self, indicated: Floats, when: PointConditions = NOMINAL) -> tuple[Floats, NDArray[np.bool_]]:
        """True coordinates (n, 3) in mm, and which points (n,) were extrapolated; parameters as :meth:`error`."""
        e, extrapolated = self.error(indicated, when)
        return indicated + e, extrapolated

    def indicated_from_true(self, true: Floats, when: PointConditions = NOMINAL) -> tuple[Floats, NDArray[np.bool_]]:
        """Coordinates (n, 3) in mm that the machine indicates at true coordinates; the inverse of :meth:`compensate`."""
        # on the way a point of the edge may lie outside by its own error; where it ends is what counts
        onward = replace(self, beyond="extrapolate")
        indicated = np.array(true, dtype=np.float64)
        for _ in range(MAX_ROUNDS):
            e, _ = onward.error(indicated, when)
            change = float(np.abs(true - e - indicated).max(initial=0.0))
            indicated = true - e
            if change <= SETTLED:
                _, extrapolated = self.error(indicated, when)
                return indicated, extrapolated
            if not np.isfinite(change):
                break
        fix = "Give finite coordinates; if they are, an error in the map is as large as the step between its positions"
        raise CmmUqError("no indicated coordinates belong to these true ones", fix=fix)

    def provenance(self) -> dict[str, object]:
        """What a compensated recording says of how it came about: maps with their SHA-256, squareness, chain, form."""
        return {
            "error_maps": [
                {"file": m.source, "sha256": m.sha256, "temperature_c": m.temperature,
                 "squareness_arcsec": m.squareness_arcsec,
                 **({} if m.covariance is None else {"u_beside_um": (m.covariance.beside / MICROMETRE).tolist()})}
                for m in self.maps.maps
            ],
            "chain": KinematicChain.of(self.chain).letters, "origin_mm": [float(o) for o in self.origin],
            "form": "rigid transformations" if self.rigid else "first order on exact axes",
            "sign": "true = indicated + e", "beyond_the_maps": "refused" if self.beyond == "refuse" else "extrapolated",
        }  # fmt: skip


def compensate_points(points: Points, compensation: Compensation | None, rotary: RotaryErrors | None = None) -> Points:
    """A recording at its true coordinates, with tip offsets and temperatures of the scales where it has their columns.

    Maps are of the carriages, wherever rotary axes stand; ``rotary`` errors add to theirs. Points beyond the maps, where they
    are allowed, are marked by 1 in the column ``extrapolated``.
    """
    xyz, marked = points.xyz, dict[str, Floats]()
    if compensation is not None:
        e, extrapolated = compensation.error_at(points.carriages, circumstances(points))
        xyz = xyz + points.on_artefact(e[:, :, None])[:, :, 0]
        marked = {"extrapolated": extrapolated.astype(np.float64)} if extrapolated.any() else {}
    if rotary is not None:
        xyz = xyz + rotary.errors(points)
    return replace(points, xyz=xyz, columns={**points.columns, **marked})


def machine_compensation(
    points: Points, maps: ErrorMaps, *, rigid: bool = False, beyond: Beyond = "refuse"
) -> Compensation:
    for error_map in maps.maps:
        error_map.covers(points.machine)
    return Compensation(maps, points.machine.chain, points.machine.origin_mm, rigid, beyond)


def circumstances(points: Points) -> PointConditions:
    return PointConditions(_three(points.columns, "tip_{}_mm"), _three(points.columns, "temp_{}_c"), points.lines)


def _three(columns: Mapping[str, Floats], pattern: str) -> Floats | None:
    names = [pattern.format(axis) for axis in AXES]
    given = [name for name in names if name in columns]
    if given and len(given) < 3:
        missing = next(name for name in names if name not in columns)
        raise CmmUqError(f"the recording has {given[0]} but not {missing}", fix="Record all three, or none")
    return np.column_stack([columns[name] for name in names]) if given else None


# the largest angle between normal and approach unless another is chosen, rad; the patent leaves it to the user
ACCEPTANCE = np.pi / 3


class DirectionPointError(CmmUqError):
    """A direction point that is not believed: which of them, in ``index``."""

    def __init__(self, index: int, problem: str, fix: str) -> None:
        super().__init__(problem, fix=fix)
        self.index = index


@dataclass(frozen=True, eq=False)
class OffsetPlane:
    """A plane surface, compensated for the probe's offset."""

    point: Floats  # (3,) of the surface, mm: the centroid of the contact points, moved
    normal: Floats  # (3,) unit normal out of the material, towards the probe
    covariance: Floats  # (6, 6) of point and normal, mm² and rad²
    angle: float  # between normal and the direction of approach, the largest of several, rad
    reversed: bool  # whether the fitted normal had to be turned round
    contact: Plane  # the plane through the points of contact


def offset_plane(
    directions: Floats, contacts: Floats, offset: float, *, first: Ints | None = None, acceptance: float = ACCEPTANCE,
    u_offset: float = 0.0, u_point: float | None = None,
) -> OffsetPlane:  # fmt: skip
    """Surface plane from a point just before contact and the points of contact.

    ``directions``: (3,) or (d, 3) the point D just before contact, or several, mm. ``contacts``: (n, 3) the points
    C1 … CN in contact, n ≥ 3, mm. ``offset``: of the probe, its effective radius, mm. ``first``: (d,) which contact C1
    each direction point belongs to; the first one by default. ``acceptance``: largest angle A between the normal and
    D − C1 at which D is believed, rad; every D must be within it. ``u_offset``: standard uncertainty of the offset, mm.
    ``u_point``: that of a contact point along the normal, mm; from the residuals when left out.
    """
    if not (np.isfinite(offset) and offset > 0):
        raise CmmUqError(f"a probe offset of {offset} mm", fix="Give the probe's effective radius in mm, above 0")
    if not 0 < acceptance < np.pi / 2:
        problem = f"a range of acceptance of {np.degrees(acceptance):.4g}°"
        raise CmmUqError(problem, fix="Choose an angle between 0° and 90°")
    plane = fit_plane(contacts, u_point=u_point)
    ahead = np.atleast_2d(np.asarray(directions, dtype=np.float64))
    touched = np.asarray(contacts, dtype=np.float64)[np.zeros(len(ahead), dtype=np.int64) if first is None else first]
    cosine = _cosines(plane.normal, ahead - touched)
    turned = bool(cosine[0] < 0)
    angles = np.arccos(np.clip(-cosine if turned else cosine, -1, 1))
    _refuse_slanting(angles, acceptance)
    normal, angle = -plane.normal if turned else plane.normal, float(angles.max())
    moved = np.vstack([np.hstack([np.eye(3), -offset * np.eye(3)]), np.hstack([np.zeros((3, 3)), np.eye(3)])])
    # turning the normal round turns the sign of its covariance with the point
    flip = np.diag([1.0] * 3 + [-1.0 if turned else 1.0] * 3)
    covariance = moved @ flip @ plane.covariance @ flip @ moved.T
    covariance[:3, :3] += u_offset**2 * np.outer(normal, normal)
    return OffsetPlane(plane.point - offset * normal, normal, covariance, angle, turned, plane)


def _refuse(wrong: NDArray[np.bool_], problem: str, fix: str) -> None:
    if wrong.any():
        raise DirectionPointError(int(np.argmax(wrong)), problem, fix)


def _cosines(normal: Floats, approach: Floats) -> Floats:
    distance = np.linalg.norm(approach, axis=1)
    problem = "the direction point is the first point of contact"
    _refuse(~(distance > 0), problem, "Measure the direction point again, before the probe touches the surface")
    return np.asarray(approach @ normal / distance, dtype=np.float64)


def _refuse_slanting(angles: Floats, acceptance: float) -> None:
    slanting = angles > acceptance
    angle = angles[int(np.argmax(slanting))]
    beside = float(np.degrees(min(angle, np.pi - angle)))
    problem = f"it was approached at {beside:.1f}° to the plane's normal, accepted are {np.degrees(acceptance):.1f}°"
    fix = "Measure the direction point again nearer to the normal, just before contact, and then the points of contact"
    if angle >= np.pi - acceptance:
        problem = "it lies on the other side of the plane than the first one"
        fix = "Measure the direction points again, all from where the probe comes, and then the points of contact"
    _refuse(slanting, f"the direction point is rejected: {problem}", fix)
