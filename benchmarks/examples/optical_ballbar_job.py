"""Writes the example of a ballbar whose balls a laser digitizer scans.

Run:  python -m benchmarks.examples.optical_ballbar_job [FOLDER]

The scans are made from their definitions alone, with nothing of the package's models: true = read + e with scales and
squarenesses, and a point of a ball at the true place of the mount plus E·([u v 0] − [U1 V1 W1]).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.examples.written_job import write

Floats = NDArray[np.float64]
SEED = 20260103
OFFSET = np.array([1.001, 264.505, 129.575])
THREE = ((90.0, 90.0, 0.0), (90.0, 90.0, 90.0), (180.0, 90.0, 0.0))
LENGTH, RADIUS = 404.235, 38.125
SCALES_PPM, SQUARE_ARCSEC = (40.0, -25.0, 60.0), (-173.0, -19.0, 21.0)
MIDDLE = np.array([450.0, 600.0, -300.0])
HEADER = "measurement,point,ball,x_mm,y_mm,z_mm,alpha_deg,beta_deg,gamma_deg,u_mm,v_mm"


def true_over_read(scales_ppm: Sequence[float] = SCALES_PPM, square_arcsec: Sequence[float] = SQUARE_ARCSEC) -> Floats:
    """(3, 3): e_x = sx·x − Sxy·y − Szx·z, e_y = sy·y − Syz·z, e_z = sz·z."""
    found = np.eye(3) + np.diag(np.array(scales_ppm) * 1e-6)
    found[0, 1], found[1, 2], found[0, 2] = -np.radians(np.array(square_arcsec) / 3600)
    return found


def cap(count: int, half_angle: float = 80.0) -> Floats:
    """Directions (n, 3) along u, v, w of what the digitizer sees, spread evenly by a spiral about v."""
    up = 1 - np.arange(count) / count * (1 - np.cos(np.radians(half_angle)))
    turn, flat = np.pi * (3 - np.sqrt(5)) * np.arange(count), np.sqrt(1 - up**2)
    return np.column_stack([flat * np.cos(turn), up, flat * np.sin(turn)])


def scanned_bars(
    random: np.random.Generator, machine: Floats, *, bars: int = 20, count: int = 40, noise_um: float = 9.0,
    form_um: float = 2.0, offset: Floats = OFFSET, attitudes: Sequence[Sequence[float]] = THREE, alike: bool = False,
    length: float = LENGTH,
) -> Floats:  # fmt: skip
    """Rows as in ``HEADER``: both ends of a bar in many places, seen in different attitudes, or (``alike``) in one.

    ``noise_um`` of a reading; ``form_um`` of what shifts the centre of a ball as a whole, along each axis.
    """
    rows = []
    for bar in range(bars):
        along = random.standard_normal(3)
        along *= 0.5 * length / np.linalg.norm(along)
        middle = MIDDLE + random.uniform(-100, 100, 3)
        for ball, end in ((1, middle - along), (2, middle + along)):
            angles = attitudes[(bar if alike else bar + ball * (1 + bar // 3 % 2)) % len(attitudes)]
            E, n = Rotation.from_euler("ZXZ", angles, degrees=True).as_matrix(), RADIUS * cap(count)
            centre = end + 1e-3 * form_um * random.standard_normal(3)
            mount = centre + (offset + np.column_stack([np.zeros((count, 2)), n[:, 2]])) @ E.T
            read = np.linalg.solve(machine, mount.T).T + 1e-3 * noise_um * random.standard_normal((count, 3))
            point = np.arange(1, count + 1) + count * (ball - 1)
            same = np.tile([bar + 1, ball, *angles], (count, 1))
            rows.append(np.column_stack([same[:, 0], point, same[:, 1], read, same[:, 2:], n[:, :2]]))
    return np.vstack(rows)


def as_csv(rows: Floats) -> str:
    form = "%d,%d,%d,%.5f,%.5f,%.5f,%g,%g,%g,%.5f,%.5f"
    return "\n".join([HEADER, *(form % tuple(row) for row in rows.tolist())]) + "\n"


TOML = f"""\
# Simulated with benchmarks/examples/optical_ballbar_job.py, seed {SEED}: no machine was measured.

[job]
id = "optical-ballbar-simulated"
date = 2026-01-01
origin = "simulated"
procedure = "Ballbar of two coated balls in 20 places, each end scanned by a laser digitizer in an attitude of its own"
remarks = \"\"\"
Simulated, no machine was measured. Truth: U1 = 1.001 mm; V1 = 264.505 mm; W1 = 129.575 mm; scale_x 40 ppm, scale_y −25 ppm, \\
scale_z 60 ppm, squareness_xy −173″, squareness_yz −19″, squareness_zx 21″; noise of a reading 9 µm, balls 2 µm.\"\"\"

[machine]
name = "Simulated bridge machine"
chain = "XYZ"
travel_mm = {{ x = [-200, 1100], y = [-200, 1400], z = [-900, 300] }}

[artefact]
kind = "ballbar"
name = "Optical ballbar, 404 mm, coated balls of grade 200"
length_mm = {LENGTH}
u_um = 0.5
offset_mm = [1.0, 264.5, 129.6]
ball_form_um = 5.08

[recording]
file = "recording.csv"

[model]
effects = ["scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx"]
"""


if __name__ == "__main__":
    rows = scanned_bars(np.random.default_rng(SEED), true_over_read())
    write("optical-ballbar-simulated", TOML, as_csv(rows))
