"""Writes the simulated example of a plate shifted and turned: 25 balls of an uncalibrated plate in seven placings in xy.

Run:  python -m benchmarks.examples.shift_plate_job [FOLDER]

Linearity, straightness, squareness and yaw are simple functions below; the noise comes from the seed, so two runs write the
same bytes.
"""

from __future__ import annotations

import numpy as np

from benchmarks.examples.written_job import write
from cmm_uq.base.points import Floats

SEED = 20260103
PLACINGS = (
    (150.0, 150.0, 0.02), (190.0, 150.0, 0.10), (150.0, 190.0, 0.0), (250.0, 210.0, 0.05),
    (610.0, 170.0, 90.1), (570.0, 150.0, 90.0), (610.0, 590.0, 180.0),
)  # fmt: skip
"""x and y of ball 1, mm, and turn, degrees."""
NOISE_UM, REPEATS = 0.7, 3
LENGTH_MM = 565.6883
TOML = f"""\
# Simulated with benchmarks/examples/shift_plate_job.py, seed {SEED}: no machine was measured.

[job]
id = "shift-plate-simulated"
date = 2026-01-01
origin = "simulated"
procedure = "Self-calibration of the plane xy by shifting and turning an uncalibrated plate of 25 balls"
remarks = \"\"\"
Simulated, no machine was measured. True errors, mm: e_x = 0.010·sin(x/90) + 20e-6·x + 0.003·sin(y/100) − 60e-6·y − y·yaw, \\
e_y = −0.008·cos(y/110) − 10e-6·y + 0.004·(x/300 − 1)² + 0.002·sin(x/60), yaw = 5e-6·sin(x/150) + 1e-5·x/600 rad; \\
noise of a coordinate {NOISE_UM} µm.\"\"\"

[machine]
name = "Simulated bridge machine"
chain = "XYZ"
travel_mm = {{ x = [0, 900], y = [0, 1200], z = [-600, 0] }}

[artefact]
kind = "shift"
name = "Ball plate, 400 mm × 400 mm, uncalibrated but for its diagonal"
plane = "xy"
known = {{ from = 1, to = 25, length_mm = {LENGTH_MM}, u_um = 0.5 }}

[recording]
file = "recording.csv"

[model]
effects = []
"""


def error(x: Floats, y: Floats) -> Floats:
    """True = indicated + e, (n, 2) mm."""
    yaw = 5e-6 * np.sin(x / 150) + 1e-5 * x / 600
    ex = 0.010 * np.sin(x / 90) + 20e-6 * x + 0.003 * np.sin(y / 100) - 60e-6 * y - y * yaw
    ey = -0.008 * np.cos(y / 110) - 10e-6 * y + 0.004 * (x / 300 - 1) ** 2 + 0.002 * np.sin(x / 60)
    return np.column_stack([ex, ey])


def balls(random: np.random.Generator) -> Floats:
    """(25, 2) mm, ball 1 at the origin, the diagonal 1–25 of the known length."""
    grid = 100.0 * np.arange(5)
    places = np.column_stack([part.ravel() for part in np.meshgrid(grid, grid)]) + random.normal(0, 0.02, (25, 2))
    places -= places[0]
    return np.asarray(places * LENGTH_MM / np.linalg.norm(places[24]))


def recording() -> str:
    random = np.random.default_rng(SEED)
    places = balls(random)
    lines = ["measurement,point,repeat,x_mm,y_mm,z_mm"]
    for placing, (dx, dy, degrees) in enumerate(PLACINGS, 1):
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        true = places @ np.array([[c, s], [-s, c]]) + [dx, dy]
        ideal = true
        for _ in range(8):
            ideal = true - error(*ideal.T)
        for ball, place in enumerate(ideal, 1):
            for repeat in range(1, REPEATS + 1):
                x, y = place + random.normal(0, NOISE_UM * 1e-3, 2)
                lines.append(f"{placing},{ball},{repeat},{x:.5f},{y:.5f},-300.00000")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    write("shift-plate-simulated", TOML, recording())
