"""The real machine: its errors as a laser interferometer found them, put together as a rigid body's (chain XYZ)."""

from __future__ import annotations

import csv
from functools import cache

import numpy as np

from benchmarks.concealed.physics import SECOND
from benchmarks.second.artefacts import EXAMPLES

SQUARENESS = {20: (-173.0, -19.0, 21.0), 25: (-178.0, -4.0, 42.0), 30: (-172.0, -20.0, 1.0)}
"""XY, YZ, ZX in seconds of arc, table 7 of the source."""
COLUMNS = ("dx_um", "dy_um", "dz_um", "rx_arcsec", "ry_arcsec", "rz_arcsec")


@cache
def tables(temperature: int) -> dict[str, np.ndarray]:
    """(places, 7) of each axis: position in mm, displacements in mm, rotations in rad."""
    with (EXAMPLES / "iota-1102-maps" / f"error_map_{temperature}C.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    factors = np.array([1.0, 1e-3, 1e-3, 1e-3, SECOND, SECOND, SECOND])
    return {
        axis: np.array(
            [[float(row[name]) for name in ("position_mm", *COLUMNS)] for row in rows if row["axis"] == axis]
        )
        * factors
        for axis in "xyz"
    }


def error(p: np.ndarray, temperature: int) -> np.ndarray:
    """e (n, 3), mm, at readings p; methods.md, equations 11 to 13. Beyond the tables their last value holds."""
    d, r = np.zeros((3, len(p), 3)), np.zeros((3, len(p), 3))
    for i, axis in enumerate("xyz"):
        table = tables(temperature)[axis]
        table = table[np.argsort(table[:, 0])]
        for b in range(3):
            d[i, :, b] = np.interp(p[:, i], table[:, 0], table[:, 1 + b])
            r[i, :, b] = np.interp(p[:, i], table[:, 0], table[:, 4 + b])
    xy, yz, zx = (SECOND * angle for angle in SQUARENESS[temperature])
    y, z = p[:, 1], p[:, 2]
    e = d.sum(axis=0)
    e[:, 0] += -y * r[0, :, 2] + z * (r[0, :, 1] + r[1, :, 1]) - y * xy - z * zx
    e[:, 1] += -z * (r[0, :, 0] + r[1, :, 0]) - z * yz
    e[:, 2] += y * r[0, :, 0]
    return e
