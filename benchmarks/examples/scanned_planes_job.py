"""Writes the example of planes scanned by a laser digitizer, from the definition alone.

Run:  python -m benchmarks.examples.scanned_planes_job [FOLDER]
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.examples.written_job import write

SEED, NOISE_UM = 20260105, 9.0
INDEXED, TRUE = (90.0, 90.0, 30.0), (90.12, 89.95, 30.08)
NORMALS = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.5, 0.5, 0.7))
MIDDLE = np.array([450.0, 600.0, -300.0])
TOML = f"""\
# Simulated with benchmarks/examples/scanned_planes_job.py, seed {SEED}: no machine was measured.

[job]
id = "scanned-planes-simulated"
date = 2026-01-01
origin = "simulated"
procedure = "Three planes of different directions scanned by a laser digitizer in one attitude, the machine moving across them"
remarks = \"\"\"
Simulated, no machine was measured. Truth: α = 90.12°, β = 89.95°, γ = 30.08°; noise of a reading {NOISE_UM:g} µm.\"\"\"

[machine]
name = "Simulated bridge machine"
chain = "XYZ"
travel_mm = {{ x = [0, 900], y = [0, 1200], z = [-600, 0] }}

[artefact]
kind = "scanned_planes"
name = "Three ground planes"

[recording]
file = "recording.csv"

[model]
effects = []
"""


def recording() -> str:
    random = np.random.default_rng(SEED)
    E = Rotation.from_euler("ZXZ", TRUE, degrees=True).as_matrix()
    lines = ["measurement,point,x_mm,y_mm,z_mm,alpha_deg,beta_deg,gamma_deg,u_mm,v_mm"]
    for number, normal in enumerate(NORMALS, 1):
        n = np.array(normal) / np.linalg.norm(normal)
        uv = random.uniform(-20, 20, (60, 2))
        D = MIDDLE + random.uniform(-30, 30, (60, 3))
        D -= np.outer((D + uv @ E[:, :2].T) @ n - MIDDLE @ n, n)
        D += NOISE_UM * 1e-3 * random.standard_normal(D.shape)
        for point, (d, (u, v)) in enumerate(zip(D.tolist(), uv.tolist(), strict=True), 1):
            at = ",".join(f"{value:.5f}" for value in d)
            lines.append(f"{number},{point},{at},{','.join(f'{a:g}' for a in INDEXED)},{u:.5f},{v:.5f}")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    write("scanned-planes-simulated", TOML, recording())
