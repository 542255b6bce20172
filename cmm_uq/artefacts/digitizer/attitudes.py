"""Attitudes of the digitizer as recorded, and whether they determine the offset of its mount."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, number, say, signed
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.machine.model.artefact import Placings
from cmm_uq.machine.model.recorded import columns_needed, place
from cmm_uq.machine.physics.digitizer import Alignment, align_on_sphere

ANGLES = ("alpha_deg", "beta_deg", "gamma_deg")
SCAN = ("u_mm", "v_mm")

MOST = 100.0
"""Standard uncertainty of a component of the offset, in those of one centre, from which on attitudes determine nothing."""

_SAME = 1e-9
"""Degrees by which the rows of one measurement may differ."""

_LITTLE = 0.005
"""Part of a direction that is not told."""

_TURN_MORE = (
    "Align in three attitudes that differ by turns about two axes, such as γ = 0° and 90°, and α = 90° and 180°"
)


def scan_of(points: Points) -> Floats | None:
    """(n, 2) u, v in the scan plane, mm; ``None`` where the recording holds centres of the sphere.

    Raises
    ------
    CmmUqError : one of the two is missing.
    """
    given = [name for name in SCAN if name in points.columns]
    return columns_needed(points, SCAN, "scanned sphere", None) if given else None


def check_angles(points: Points, where: str | None) -> None:
    """Refuse a recording without attitudes, or with several in one measurement.

    Raises
    ------
    CmmUqError : with the line.
    """
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

    Raises
    ------
    CmmUqError : the points of a measurement determine no sphere.
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
    """Refuse attitudes that leave a component of the offset open.

    Raises
    ------
    CmmUqError : with the direction that they do not determine.
    """
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
