"""Writes an example of the experiments of Shimizu, Kiyono & Gao: two series of 23 points, and 12 of them chosen in two ways.

Run:  python -m benchmarks.examples.shift_source_job [FOLDER]

Pitch 20 mm, shift 20 mm with an error, repeatability 1.1 µm, ten readings; an error of 27 µm, steep at the ends.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from benchmarks.examples.written_job import write

SEED = 20260104
SHIFT, NOISE_UM, REPEATS, POINTS = 20.013, 1.1, 10, 23
EQUAL = list(range(1, POINTS + 1, 2))  # every other one: 40 mm
UNEQUAL = [1 + place // 20 for place in (0, 40, 60, 120, 140, 180, 220, 240, 320, 340, 400, 440)]
TOML = f"""\
# Simulated with benchmarks/examples/shift_source_job.py, seed {SEED}: no machine was measured.

[job]
id = "shift-source-simulated"
date = 2026-01-01
origin = "simulated"
procedure = "Self-calibration of the x axis by one shift of a step gauge of 23 faces, after Shimizu, Kiyono and Gao"
remarks = \"\"\"
Simulated, no machine was measured. True error: e = 0.0726·s³(1 − s²) mm with s = (x − 320)/220; \\
noise of a reading {NOISE_UM} µm.\"\"\"

[machine]
name = "Simulated coordinate measuring machine"
chain = "XYZ"
travel_mm = {{ x = [0, 600], y = [0, 500], z = [-400, 0] }}

[artefact]
kind = "shift"
name = "Step gauge, 440 mm, uncalibrated but for its length"
axis = "x"
shifts_mm = [0.0, 20.0]
u_shift_um = 100.0
known = {{ from = 1, to = 23, length_mm = 440.0, u_um = 0.5 }}
integrated_points = [{EQUAL}, {UNEQUAL}]

[recording]
file = "recording.csv"

[model]
effects = []
"""


def error(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """True = indicated + e, mm."""
    s = (x - 320.0) / 220.0
    return np.asarray(0.0726 * s**3 * (1 - s**2))


def recording() -> str:
    random = np.random.default_rng(SEED)
    faces = 100.0 + 20.0 * np.arange(POINTS) + random.normal(0, 0.003, POINTS)
    faces[-1] = faces[0] + 440.0
    lines = ["measurement,point,repeat,x_mm,y_mm,z_mm"]
    for series, shift in enumerate((0.0, SHIFT), 1):
        reading = faces + shift
        for _ in range(8):
            reading = faces + shift - error(reading)
        for repeat in range(1, REPEATS + 1):
            noisy = reading + random.normal(0, NOISE_UM * 1e-3, POINTS)
            lines += [f"{series},{i},{repeat},{x:.5f},250.00000,-200.00000" for i, x in enumerate(noisy.tolist(), 1)]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    write("shift-source-simulated", TOML, recording())
