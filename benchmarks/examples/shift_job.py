"""Writes the simulated example of a shift job: an uncalibrated step gauge in three placings along x.

Run:  python benchmarks/examples/shift_job.py [FOLDER]

The axis' error is a wave, a bend at the far end and a scale; the noise comes from the seed below, so two runs write the
same bytes.
"""

from __future__ import annotations

import numpy as np
from written_job import write

from cmm_uq.base.points import Floats

SEED = 20260102
SHIFTS = (0.0, 20.0, 50.0)
LANDED = (0.0, 20.013, 49.981)
NOISE_UM, REPEATS = 1.1, 3
TOML = f"""\
# Simulated with benchmarks/examples/shift_job.py, seed {SEED}: no machine was measured.

[job]
id = "shift-simulated"
date = 2026-01-01
origin = "simulated"
procedure = "Self-calibration of the x axis by shifting an uncalibrated step gauge of 23 faces"
remarks = \"\"\"
Simulated, no machine was measured. True error: e = 0.012·sin(x/90) + 0.01·exp((x − 590)/60) + 8e-6·x mm; \\
noise of a reading {NOISE_UM} µm.\"\"\"

[machine]
name = "Simulated bridge machine"
chain = "XYZ"
travel_mm = {{ x = [0, 900], y = [0, 1200], z = [-600, 0] }}

[artefact]
kind = "shift"
name = "Step gauge, 440 mm, uncalibrated but for its length"
axis = "x"
shifts_mm = {list(SHIFTS)}
u_shift_um = 100.0
known = {{ from = 1, to = 23, length_mm = 440.0, u_um = 0.5 }}

[recording]
file = "recording.csv"

[model]
effects = []
"""


def error(x: Floats) -> Floats:
    """True = indicated + e, mm."""
    return np.asarray(0.012 * np.sin(x / 90) + 0.010 * np.exp((x - 590) / 60) + 8e-6 * x)


def recording() -> str:
    random = np.random.default_rng(SEED)
    faces = 20.0 * np.arange(23) + random.normal(0, 0.003, 23)
    faces += 100.0 - faces[0]
    faces[-1] = faces[0] + 440.0
    lines = ["measurement,point,repeat,x_mm,y_mm,z_mm"]
    for series, shift in enumerate(LANDED, 1):
        for point, place in enumerate(faces + shift, 1):
            reading = np.array([place])
            for _ in range(8):
                reading = place - error(reading)
            for repeat in range(1, REPEATS + 1):
                x = reading[0] + random.normal(0, NOISE_UM * 1e-3)
                lines.append(f"{series},{point},{repeat},{x:.5f},600.00000,-300.00000")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    write("shift-simulated", TOML, recording())
