"""Recordings of a digitizer without any error, built from their definition alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from cmm_uq.base.points import Floats, Machine, Points
from tests.recordings import TRAVEL

OFFSET = np.array([1.001, 264.505, 129.575])
"""[U1 V1 W1] of the digitizer in the source, mm (Harris 2004 section 5.3)."""

THREE = ((90.0, 90.0, 0.0), (90.0, 90.0, 90.0), (180.0, 90.0, 0.0))
"""Its three attitudes, degrees."""

SIX = (*THREE, (0.0, 90.0, -90.0), (-90.0, 90.0, 45.0), (35.0, 70.0, 20.0))

SPHERE = np.array([350.0, 350.0, -330.0])
RADIUS = 12.7
MACHINE = Machine("test machine", "XYZ", TRAVEL)


def turned(angles: Sequence[float]) -> Floats:
    """Attitude (3, 3) by SciPy."""
    return Rotation.from_euler("ZXZ", angles, degrees=True).as_matrix()


def recording(xyz: Floats, angles: Floats, measurement: Sequence[int], **columns: Floats) -> Points:
    number = np.array(measurement, dtype=np.int64)
    names = ("alpha_deg", "beta_deg", "gamma_deg")
    point = np.concatenate([np.arange(1, n + 1) for n in np.unique(number, return_counts=True)[1]])
    return Points(xyz, number, point, np.ones_like(number), MACHINE,
                  dict(zip(names, np.asarray(angles).T, strict=True)) | columns, np.arange(2, len(xyz) + 2))  # fmt: skip


def centres(attitudes: Sequence[Sequence[float]] = THREE, times: int = 1, offset: Floats = OFFSET) -> Points:
    """Scale readings with the origin of the scan plane at the centre: D = S + E·[U1 V1 W1]."""
    angles = np.repeat(np.array(attitudes), times, axis=0)
    xyz = np.array([SPHERE + turned(each) @ offset for each in angles])
    return recording(xyz, angles, np.repeat(np.arange(1, len(attitudes) + 1), times).tolist())


def cap(count: int = 60, half_angle: float = 75.0) -> Floats:
    """Directions (n, 3) along u, v, w of what the digitizer sees, spread evenly by a spiral about v."""
    up = 1 - np.arange(count) / count * (1 - np.cos(np.radians(half_angle)))
    turn, flat = np.pi * (3 - np.sqrt(5)) * np.arange(count), np.sqrt(1 - up**2)
    return np.column_stack([flat * np.cos(turn), up, flat * np.sin(turn)])


def scans(
    attitudes: Sequence[Sequence[float]] = THREE, count: int = 60, *, offset: Floats = OFFSET, radius: float = RADIUS
) -> Points:
    """Points of the sphere, w = 0 in the scan plane: D = S + r·n − E·([u v 0] − [U1 V1 W1])."""
    xyz, angles, seen = [], [], []
    for each in attitudes:
        E, n = turned(each), radius * cap(count)
        local = np.column_stack([n[:, :2], np.zeros(count)])
        xyz.append(SPHERE + n @ E.T - (local - offset) @ E.T)
        angles.append(np.tile(each, (count, 1)))
        seen.append(local[:, :2])
    scan = np.vstack(seen)
    return recording(np.vstack(xyz), np.vstack(angles), np.repeat(np.arange(1, len(attitudes) + 1), count).tolist(),
                     u_mm=scan[:, 0], v_mm=scan[:, 1])  # fmt: skip
