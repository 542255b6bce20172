"""Attitudes of the digitizer, as recorded and as planned, and whether they determine the offset."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np

from cmm_uq.analysis.planning.set_up import SetUp
from cmm_uq.analysis.planning.setting import Planning, Setting, Start
from cmm_uq.artefacts.digitizer.kind import ReferenceSphereFacts
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, number, say, signed
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.machine.model.artefact import Placings
from cmm_uq.machine.model.recorded import columns_needed, place
from cmm_uq.machine.physics.digitizer import Alignment, align_on_sphere
from cmm_uq.machine.physics.kinematics import euler_313

ANGLES = ("alpha_deg", "beta_deg", "gamma_deg")
SCAN = ("u_mm", "v_mm")

# standard uncertainty of a component of the offset, in those of one centre, from which on attitudes determine
# nothing
MOST = 100.0

_SAME = 1e-9  # degrees by which the rows of one measurement may differ
_LITTLE = 0.005  # part of a direction that is not told

_TURN_MORE = (
    "Align in three attitudes that differ by turns about two axes, such as γ = 0° and 90°, and α = 90° and 180°"
)


def scan_of(points: Points) -> Floats | None:
    """(n, 2) u, v in the scan plane, mm; ``None`` where the recording holds centres of the sphere."""
    given = [name for name in SCAN if name in points.columns]
    return columns_needed(points, SCAN, "scanned sphere", None) if given else None


def check_angles(points: Points, where: str | None) -> None:
    """Refuse a recording without attitudes, or with several in one measurement."""
    angles = columns_needed(points, ANGLES, "digitizer", where)
    poses = Placings.of(points.measurement)
    off = np.any(np.abs(angles - poses.means(angles)) > _SAME, axis=1)
    if off.any():
        number = points.measurement[np.argmax(off)]
        raise CmmUqError(f"measurement {number} has several attitudes", where=place(points, off, where),
                         fix="Number each attitude of the digitizer as a measurement of its own")  # fmt: skip


def alignments(points: Points, where: str | None) -> tuple[Alignment, ...]:
    """One for each measurement: [D0 E0 F0] by the mean of its centres, or by a sphere through its points.

    The covariances are those of points of equal weight, for a standard uncertainty of one micrometre.
    """
    scan, poses, found = scan_of(points), Placings.of(points.measurement), []
    for i, measurement in enumerate(poses.numbers.tolist()):
        rows = poses.index == i
        alpha, beta, gamma = (float(np.radians(points.columns[name][rows][0])) for name in ANGLES)
        if scan is None:
            found.append(
                Alignment(
                    alpha, beta, gamma, points.xyz[rows].mean(axis=0), MICROMETRE**2 * np.eye(3) / int(rows.sum())
                )
            )
            continue
        try:
            found.append(align_on_sphere(scan[rows], points.xyz[rows], alpha, beta, gamma, u_point=MICROMETRE))
        except CmmUqError as error:
            raise CmmUqError(f"measurement {measurement}: {error.problem}", where=place(points, rows, where),
                             fix="Scan as much of the sphere as the digitizer sees, moving the machine across it",
                             ) from error  # fmt: skip
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
    """Refuse attitudes that leave a component of the offset open."""
    direction, times = worst_direction(found)
    if times <= MOST:
        return
    told = "" if np.isinf(times) else f", {times:.0f} times as uncertain as a centre"
    problem = f"{len(found)} attitudes leave the offset of the mount along {words(direction)} open{told}"
    raise CmmUqError(problem, where=where, fix=_TURN_MORE)


def words(direction: Floats) -> Text:
    """A direction (3,) in the digitizer's frame: ``w``, or ``0.37 u + 0.66 v − 0.66 w``."""
    parts = [(float(part), Verbatim(axis)) for part, axis in zip(direction, "uvw", strict=True) if abs(part) > _LITTLE]
    (first, axis), *further = parts
    if not further:
        return axis
    text: Text = say("{part} {axis}", part=signed(first, ".2f"), axis=axis)
    for part, axis in further:
        size = number(abs(part), ".2f")
        text = (
            say("{before} − {size} {axis}", before=text, size=size, axis=axis)
            if part < 0
            else say("{before} + {size} {axis}", before=text, size=size, axis=axis)
        )
    return text


# α, β, γ in degrees of the source's alignments 1, 2 and 3 (Harris 2004 section 5.3)
THREE = ((90.0, 90.0, 0.0), (90.0, 90.0, 90.0), (180.0, 90.0, 0.0))

# points over what the digitizer sees of the sphere: degrees from the line of sight, how many
RINGS = ((0.0, 1), (25.0, 6), (50.0, 12), (75.0, 18))


def seen_directions() -> Floats:
    """(n, 3) from the centre of the sphere to its points, along u, v, w: the digitizer looks along −v."""
    found = []
    for down, count in RINGS:
        around = 2 * np.pi * np.arange(count) / count
        flat, up = np.sin(np.radians(down)), np.cos(np.radians(down))
        found.append(np.column_stack([flat * np.cos(around), np.full(count, up), flat * np.sin(around)]))
    return np.vstack(found)


def scan(attitude: Floats, offset: Floats, radius: float) -> tuple[Floats, Floats]:
    """Scan of a sphere about the origin: u, v (n, 2) and scale readings (n, 3), mm; the machine moves along w."""
    seen = radius * seen_directions()
    along = np.column_stack([np.zeros((len(seen), 2)), seen[:, 2]])
    return seen[:, :2], (along + offset) @ attitude.T


def three_attitudes(setting: Setting) -> tuple[SetUp, ...]:
    """The source's three; scans where the job gives the sphere's diameter, else centres."""
    facts, plan, volume = cast("ReferenceSphereFacts", setting.artefact), setting.plan, setting.volume
    if facts.offset_mm is None:
        raise CmmUqError("where the mount lies is needed", where="job.toml [artefact] offset_mm",
                         fix="Give [U1, V1, W1] by the drawing, mm; it is not taken as known")  # fmt: skip
    offset, radius = np.array(facts.offset_mm), 0.5 * (facts.length_mm or 0.0)
    parts = []
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
        count, times = len(moved), plan.repeats
        columns = {name: np.full(count * times, angle) for name, angle in zip(ANGLES, angles, strict=True)}
        if radius:
            columns |= {name: np.tile(seen[:, i], times) for i, name in enumerate(SCAN)}
        xyz = np.tile(middle + moved - setting.machine.origin_mm, (times, 1))
        points = Points(
            xyz, np.ones(len(xyz), dtype=np.int64), np.tile(np.arange(1, count + 1), times),
            np.repeat(np.arange(1, times + 1), count), setting.machine, columns,
        )  # fmt: skip
        alpha, beta, gamma = angles
        title = say("α = {alpha:g}°, β = {beta:g}°, γ = {gamma:g}°", alpha=alpha, beta=beta, gamma=gamma)
        found.append(SetUp(title, points))
    return tuple(found)


def candidates(setting: Setting, start: Start | None) -> tuple[SetUp, ...]:
    raise CmmUqError("the attitudes of a digitizer are those of its wrist, and none are searched for",
                     where="job.toml [plan] criterion", fix="Leave it out, or record further attitudes")  # fmt: skip


PLANNING = Planning({"three attitudes": three_attitudes}, candidates, shared=True, sought=True)
