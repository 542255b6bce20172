"""Laser digitizer on a reference sphere, in several attitudes: where its mount lies (Harris 2004 sections 4.4 and 5.3).

With the mount at true coordinates D, a point of the scan plane lies at D + q, q = E·([u v 0] − [U1 V1 W1]). Recorded are
the points of the sphere (``u_mm``, ``v_mm``, and the scale readings as x, y, z), or the readings with the origin of the scan
plane at its centre (u = v = 0). The offset [U1 V1 W1] is what is sought, the sphere's place is free; the rotations of the
carriages turn q (eq. 35), so q is the stylus tip offset of each point.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import cast

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.planning.set_up import SetUp
from cmm_uq.analysis.planning.setting import Planning, Setting, Start
from cmm_uq.analysis.screening import shape
from cmm_uq.analysis.screening.shape import ArtefactShape, Screening
from cmm_uq.artefacts.kinds import ReferenceSphereFacts
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, number, say, signed
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.units import ARCSECOND, MICROMETRE, unit
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model.artefact import Artefact, ArtefactFigure, Placings, Size
from cmm_uq.machine.model.placed import Radial
from cmm_uq.machine.model.recorded import columns_needed, expansion, place, refuse
from cmm_uq.machine.physics.digitizer import (
    THREE_ATTITUDES,
    Alignment,
    MountOffset,
    align_on_sphere,
    axes_of_scans,
    mount_offset,
)
from cmm_uq.machine.physics.effects.probing import attitudes
from cmm_uq.machine.physics.kinematics import axis_directions, euler_313
from cmm_uq.maths.inference.linear_model import Freedoms


class ScannedSphere(Radial):
    """Points on one sphere, whose diameter may be certified."""

    kind = "digitizer"
    title = say("Reference sphere")
    per_size = 0.5
    size_title = say("Diameter of the reference sphere")
    size_what = say("diameter")
    plural = "the diameters of the scanned spheres"

    def __init__(self, facts: ArtefactFacts, points: Points, where: str | None) -> None:
        everywhere = Placings.of(np.zeros(len(points), dtype=np.int64))
        super().__init__(facts, points, everywhere, expansion(facts, points), where)


class Centre:
    """The centre of the sphere, found n times: three coordinates each."""

    sizes: tuple[Size, ...] = ()

    def __init__(self, count: int) -> None:
        self.rows: Ints = np.repeat(np.arange(count), 3)[:, None]
        self.noise_scale: Floats = np.ones(3 * count)

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        return np.broadcast_to(true_xyz.mean(axis=0), true_xyz.shape).copy()

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        return displacement.reshape(3 * len(xyz), displacement.shape[2])

    def size_change(self) -> Floats:
        return np.zeros((len(self.rows), 0))

    def placing(self, xyz: Floats) -> Floats:
        return np.tile(np.eye(3), (len(xyz), 1))


OFFSET = ("U1", "V1", "W1")


def offset_sizes(offset: Floats) -> tuple[Size, ...]:
    """[U1 V1 W1] (3,) as sizes that are sought."""
    each = zip(OFFSET, offset.tolist(), strict=True)
    return tuple(Size(f"{name}_mm", Verbatim(name), unit("mm"), value, np.inf, role="sought") for name, value in each)


_FAR = 0.2  # part of the offset by which a drawing may be off before a unit or a column is taken for mistaken


class DigitizerArtefact(Artefact):
    """A laser digitizer in several attitudes, each a ``measurement``.

    ``facts`` what the job says of it; ``points`` the recording, with ``alpha_deg``, ``beta_deg``, ``gamma_deg``; scale
    readings as x, y, z. ``attitude`` (n, 3, 3) of each point: columns u, v, w in machine axes; ``alignments`` of each
    measurement by itself; ``start`` the offset from these alone; ``poses`` which points were recorded in which attitude.
    """

    kind = "digitizer"
    title = say("Laser digitizer")

    def __init__(self, facts: ReferenceSphereFacts, points: Points, *, where: str | None = None) -> None:
        check_angles(points, where)
        self.poses = Placings.of(points.measurement)
        self.attitude = attitudes(points)
        scan = scan_of(points)
        self.scanned = scan is not None
        self._seen = np.zeros((len(points), 3)) if scan is None else np.column_stack([scan, np.zeros(len(scan))])
        self.alignments: tuple[Alignment, ...] = alignments(points, where)
        refuse_undetermined(self.alignments, where)
        self.start: MountOffset = mount_offset(self.alignments)
        self._refuse_another(facts, points, where)
        offset = self.start.offset
        if self.scanned:
            self.leans, offset = axes_of_scans(points.xyz, self.attitude, self._seen, self.start)
        carried = self._carried(offset)
        self.points = replace(
            points,
            machine=replace(points.machine, tip_on_every_carriage=True),
            columns={**points.columns, **{f"tip_{axis}_mm": carried[:, i] for i, axis in enumerate(AXES)}},
        )
        self._tip = carried
        # observations, sizes and place are all seen along the directions of the recorded points: taken anew at fitted
        # ones, they would differ by the noise, and what no recording determines would seem determined
        self._seen_at = (points.xyz @ axis_directions(self.leans) if self.leans.any() else points.xyz) + carried
        self.target: ScannedSphere | Centre = (
            ScannedSphere(facts, points.at(self._seen_at), where) if self.scanned else Centre(len(points))
        )
        self.rows, self.noise_scale = self.target.rows, self.target.noise_scale
        self.u_turn, self.u_shift = facts.u_attitude_arcsec, facts.u_centre_um
        self.sizes = (*offset_sizes(offset), *self.target.sizes, *self._set_up_sizes())

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        own = len(self.target.sizes)
        carried = self._carried(sizes[:3]) + self._set_up @ sizes[3 + own :]
        return self.target.fit(true_xyz + carried, sizes[3 : 3 + own]) - carried

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        return self.target.project(self._seen_at, displacement)

    def placing(self, xyz: Floats) -> Floats | Freedoms:
        return self.target.placing(self._seen_at)

    def size_change(self) -> Floats:
        moved = np.concatenate([self.attitude, -self._set_up], axis=2)
        shown = self.target.project(self._seen_at, moved)
        return np.hstack([shown[:, :3], self.target.size_change(), shown[:, 3:]])

    def figures(self, counts: NDArray[np.bool_]) -> Mapping[str, ArtefactFigure]:
        """Closure: how far each attitude by itself finds the sphere's centre from where all together have it."""
        found = mount_offset(alignments(self.points.select(counts), None))
        rows = [np.flatnonzero(counts & (self.poses.index == i)) for i in range(len(self.poses.numbers))]
        kept = [np.resize(own, len(counts)) for own in rows if len(own)]
        length = np.full(len(kept), float(np.linalg.norm(found.offset)))
        return {"closure": ArtefactFigure(np.linalg.norm(found.residuals, axis=1), np.array(kept), length)}

    def centre(self, xyz: Floats, sizes: Floats) -> Floats:
        """(3,) centre of the sphere, mm, for true coordinates (n, 3) of the mount and these sizes."""
        own = len(self.target.sizes)
        seen = xyz + self._carried(sizes[:3]) + self._set_up @ sizes[3 + own :]
        if isinstance(self.target, ScannedSphere):
            return np.asarray(self.target.centres(seen, float(sizes[3]))[0], dtype=np.float64)
        return np.asarray(seen.mean(axis=0), dtype=np.float64)

    def _carried(self, offset: Floats) -> Floats:
        """(n, 3) from the mount to what it sees, mm, in machine axes."""
        return np.asarray(np.einsum("nij,nj->ni", self.attitude, self._seen - offset), dtype=np.float64)

    @cached_property
    def _set_up(self) -> Floats:
        """(n, 3, j) what each size of a set-up moves of the points that were recorded in it, mm per unit of the size."""
        n, freedoms = len(self._tip), []
        if self.u_turn:
            freedoms.append(ARCSECOND * np.cross(np.eye(3)[None], self._tip[:, None, :]))
        if any(self.u_shift):
            freedoms.append(np.broadcast_to(MICROMETRE * np.eye(3), (n, 3, 3)))
        if not freedoms:
            return np.zeros((n, 3, 0))
        return self.poses.columns(np.concatenate(freedoms, axis=1).transpose(0, 2, 1)).dense().reshape(n, 3, -1)

    def _set_up_sizes(self) -> Iterator[Size]:
        for pose in self.poses.numbers.tolist():
            for a in AXES if self.u_turn else ():
                title = say("Turn of measurement {number} about {axis}", number=pose, axis=Verbatim(a.upper()))
                yield Size(f"turn_{a}_{pose}_arcsec", title, unit("″"), 0.0, self.u_turn, role="set-up")
            for a, u in zip(AXES, self.u_shift, strict=True) if any(self.u_shift) else ():
                title = say("Shift of measurement {number} along {axis}", number=pose, axis=Verbatim(a.upper()))
                yield Size(f"shift_{a}_{pose}_um", title, unit("µm"), 0.0, u, role="set-up")

    def _refuse_another(self, facts: ReferenceSphereFacts, points: Points, where: str | None) -> None:
        if not np.ptp(points.xyz, axis=0).any():
            raise CmmUqError("the scale readings are all the same: nothing moved between the attitudes", where=where,
                             fix="Record the scale readings D, E, F as x_mm, y_mm, z_mm")  # fmt: skip
        drawn = np.array(facts.offset_mm or self.start.offset)
        if np.linalg.norm(self.start.offset - drawn) > _FAR * np.linalg.norm(drawn):
            found = ", ".join(f"{value:.3f}" for value in self.start.offset)
            fix = "Check the units, the Euler angles, and offset_mm in job.toml [artefact]"
            raise CmmUqError(f"the alignments give [U1 V1 W1] = [{found}] mm, far from offset_mm", where=where, fix=fix)


_UNKNOWNS = 6
_SOUND = 1e-2  # least singular value, over the largest, of three attitudes that tell an offset


def shape_of(facts: ReferenceSphereFacts, points: Points) -> ArtefactShape | None:
    """Spheres, one in each attitude, or centres; ``None`` without attitudes, or with scans of a few points."""
    if any(name not in points.columns for name in ANGLES):
        return None
    attitude, scan = attitudes(points), scan_of(points)
    if scan is None:
        return ArtefactShape((np.arange(len(points)),), offset_misfit, np.nan, 0.0, reference=attitude.reshape(-1, 9))
    rows = shape.rows_by(points.measurement)
    if any(len(one) < 5 for one in rows):
        return None
    seen = np.einsum("nij,nj->ni", attitude[:, :, :2], scan)
    radius = (facts.length_mm or np.nan) / 2
    extent = 0.5 * float(np.median([shape.spread((points.xyz + seen)[one]) for one in rows]))
    return ArtefactShape(rows, scan_misfit, radius, radius if np.isfinite(radius) else extent, reference=seen)


def scan_misfit(xyz: Floats, seen: Floats, radius: float) -> Floats:
    """Points of one scan, relative to the mount plus what the scan plane shows (k, 3), against a sphere."""
    return shape.ball_misfit(xyz + seen, seen, radius)


def offset_misfit(xyz: Floats, attitude: Floats, _: float) -> Floats:
    """By the three centres whose offset suits half of all best, then by all that agree with these."""
    count = len(xyz)
    if count < 3:
        return np.zeros(count)
    design = np.concatenate([attitude.reshape(count, 3, 3), np.broadcast_to(np.eye(3), (count, 3, 3))], axis=2)
    samples = np.array([np.arange(3)]) if count == 3 else shape.samples_of(count, 3)
    some = design[samples].reshape(len(samples), 9, _UNKNOWNS)
    s = np.linalg.svd(some, compute_uv=False)
    sound = s[:, -1] > _SOUND * s[:, 0]
    if not sound.any():
        return np.zeros(count)
    found = np.linalg.pinv(some[sound]) @ xyz[samples[sound]].reshape(-1, 9, 1)
    misfits = np.linalg.norm(xyz - np.einsum("nij,sj->sni", design, found[:, :, 0]), axis=2)
    best = misfits[np.argmin(np.median(misfits, axis=1))]
    agree = best <= max(4 * float(np.median(best)), shape.TOLERANCE_MM)
    fitted, *_rest = np.linalg.lstsq(design[agree].reshape(-1, _UNKNOWNS), xyz[agree].ravel(), rcond=None)
    return np.asarray(np.linalg.norm(xyz - design @ fitted, axis=1), dtype=np.float64)


SCREENING = Screening(shape_of)

ANGLES = ("alpha_deg", "beta_deg", "gamma_deg")
SCAN = ("u_mm", "v_mm")

# standard uncertainty of a component of the offset, in those of one centre, from which on attitudes determine nothing
MOST = 100.0

_SAME = 1e-9  # degrees by which the rows of one measurement may differ
_LITTLE = 0.005  # part of a direction that is not told


def scan_of(points: Points) -> Floats | None:
    """(n, 2) u, v in the scan plane, mm; ``None`` where the recording holds centres of the sphere."""
    given = [name for name in SCAN if name in points.columns]
    return columns_needed(points, SCAN, "scanned sphere", None) if given else None


def check_angles(points: Points, where: str | None) -> None:
    angles = columns_needed(points, ANGLES, "digitizer", where)
    off = np.any(np.abs(angles - Placings.of(points.measurement).means(angles)) > _SAME, axis=1)
    problem = f"measurement {points.measurement[np.argmax(off)]} has several attitudes"
    refuse(points, off, where, problem, "Number each attitude of the digitizer as a measurement of its own")


def alignments(points: Points, where: str | None) -> tuple[Alignment, ...]:
    """One for each measurement: [D0 E0 F0] by the mean of its centres, or by a sphere through its points.

    The covariances are those of points of equal weight, for a standard uncertainty of one micrometre.
    """
    scan, poses, found = scan_of(points), Placings.of(points.measurement), []
    for i, measurement in enumerate(poses.numbers.tolist()):
        rows = poses.index == i
        alpha, beta, gamma = (float(np.radians(points.columns[name][rows][0])) for name in ANGLES)
        if scan is None:
            covariance = MICROMETRE**2 * np.eye(3) / int(rows.sum())
            found.append(Alignment(alpha, beta, gamma, points.xyz[rows].mean(axis=0), covariance))
            continue
        try:
            found.append(align_on_sphere(scan[rows], points.xyz[rows], alpha, beta, gamma, u_point=MICROMETRE))
        except CmmUqError as error:
            raise CmmUqError(
                f"measurement {measurement}: {error.problem}",
                where=place(points, rows, where),
                fix="Scan as much of the sphere as the digitizer sees, moving the machine across it",
            ) from error
    return tuple(found)


def worst_direction(found: Sequence[Alignment]) -> tuple[Floats, float]:
    """Direction (3,) in the digitizer's frame along which its attitudes tell least of the offset.

    Also the standard uncertainty of the offset along it, in those of one centre; infinite where nothing is told.
    """
    turned = np.array([one.attitude for one in found])
    _, s, Vt = np.linalg.svd((turned - turned.mean(axis=0)).reshape(-1, 3), full_matrices=False)
    direction = Vt[-1] * np.sign(Vt[-1][np.argmax(np.abs(Vt[-1]))])
    return direction, float(1 / s[-1]) if s[-1] > 1e-12 else np.inf


def refuse_undetermined(found: Sequence[Alignment], where: str | None) -> None:
    direction, times = worst_direction(found)
    if times > MOST:
        told = "" if np.isinf(times) else f", {times:.0f} times as uncertain as a centre"
        problem = f"{len(found)} attitudes leave the offset of the mount along {words(direction)} open{told}"
        raise CmmUqError(problem, where=where, fix=THREE_ATTITUDES)


def words(direction: Floats) -> Text:
    """A direction (3,) in the digitizer's frame: ``w``, or ``0.37 u + 0.66 v − 0.66 w``."""
    parts = [(float(part), Verbatim(axis)) for part, axis in zip(direction, "uvw", strict=True) if abs(part) > _LITTLE]
    (first, axis), *further = parts
    text: Text = say("{part} {axis}", part=signed(first, ".2f"), axis=axis)
    for part, other in further:
        size, before = number(abs(part), ".2f"), text
        text = say("{before} + {size} {axis}", before=before, size=size, axis=other)
        if part < 0:
            text = say("{before} − {size} {axis}", before=before, size=size, axis=other)
    return text if further else axis


# α, β, γ in degrees of the source's alignments 1, 2 and 3 (Harris 2004 section 5.3)
THREE = ((90.0, 90.0, 0.0), (90.0, 90.0, 90.0), (180.0, 90.0, 0.0))

# points over what the digitizer sees of the sphere: degrees from the line of sight, how many
RINGS = ((0.0, 1), (25.0, 6), (50.0, 12), (75.0, 18))


def scan(attitude: Floats, offset: Floats, radius: float) -> tuple[Floats, Floats]:
    """Scan of a sphere about the origin: u, v (n, 2) and scale readings (n, 3), mm; the machine moves along w.

    The digitizer looks along −v.
    """
    seen = []
    for down, count in RINGS:
        around = 2 * np.pi * np.arange(count) / count
        flat, up = np.sin(np.radians(down)), np.cos(np.radians(down))
        seen.append(radius * np.column_stack([flat * np.cos(around), np.full(count, up), flat * np.sin(around)]))
    u, v, w = np.vstack(seen).T
    return np.column_stack([u, v]), (np.column_stack([0 * w, 0 * w, w]) + offset) @ attitude.T


def three_attitudes(setting: Setting) -> tuple[SetUp, ...]:
    """The source's three; scans where the job gives the sphere's diameter, else centres."""
    facts, times, volume = cast("ReferenceSphereFacts", setting.artefact), setting.plan.repeats, setting.volume
    if facts.offset_mm is None:
        raise CmmUqError("where the mount lies is needed", where="job.toml [artefact] offset_mm",
                         fix="Give [U1, V1, W1] by the drawing, mm; it is not taken as known")  # fmt: skip
    offset, radius, parts = np.array(facts.offset_mm), 0.5 * (facts.length_mm or 0.0), []
    for angles in THREE:
        attitude = euler_313(*np.radians(angles))
        parts.append(scan(attitude, offset, radius) if radius else (np.zeros((0, 2)), (attitude @ offset)[None]))
    readings = np.vstack([part for _, part in parts])
    room = volume.room(readings - readings.mean(axis=0))
    if room is None:
        raise volume.too_small(readings, say("over the three attitudes"))
    middle = room.mean(axis=1) - readings.mean(axis=0)
    found = []
    for angles, (seen, moved) in zip(THREE, parts, strict=True):
        count = len(moved)
        columns = {name: np.full(count * times, angle) for name, angle in zip(ANGLES, angles, strict=True)}
        if radius:
            columns |= {name: np.tile(seen[:, i], times) for i, name in enumerate(SCAN)}
        xyz = np.tile(middle + moved - setting.machine.origin_mm, (times, 1))
        point, repeat = np.tile(np.arange(1, count + 1), times), np.repeat(np.arange(1, times + 1), count)
        alpha, beta, gamma = angles
        title = say("α = {alpha:g}°, β = {beta:g}°, γ = {gamma:g}°", alpha=alpha, beta=beta, gamma=gamma)
        found.append(SetUp(title, Points(xyz, np.ones_like(point), point, repeat, setting.machine, columns)))
    return tuple(found)


def candidates(setting: Setting, start: Start | None) -> tuple[SetUp, ...]:
    raise CmmUqError("the attitudes of a digitizer are those of its wrist, and none are searched for",
                     where="job.toml [plan] criterion", fix="Leave it out, or record further attitudes")  # fmt: skip


PLANNING = Planning({"three attitudes": three_attitudes}, candidates, shared=True, sought=True)
