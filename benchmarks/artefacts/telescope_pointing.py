"""A telescope as an arm of two joints, one metre long, whose tool stars saw; beside the terms of TPOINT, fitted on their own.

Run:  python -m benchmarks.artefacts.telescope_pointing FILE

FILE is ``k_and_e.dat`` of MMTObservatory/pytelpoint (BSD licence): azimuth and elevation of 80 stars, and the encoders' of the
MMT. Terms by Wallace's names are linear least squares of their formulas on the sky. A star tells two coordinates, not three,
so u of such a job is too small by a factor of √(2/3), and no certificate is made.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cmm_uq.app.commands.model import model_of
from cmm_uq.app.commands.reading import job_of
from cmm_uq.artefacts import artefact_of
from cmm_uq.machine.physics.stated import physics_of

Floats = NDArray[np.float64]
SECONDS = np.degrees(1e-3) * 3600  # of one mm at one metre
JOB = """[job]
id = "telescope"
date = 2021-08-21
[machine]
name = "MMT"
joint = [{ alpha_deg = 90.0, reversed = true }, { a_mm = 1000.0 }]
[artefact]
kind = "tracked_points"
u_um = 0.001
[recording]
file = "recording.csv"
[model]
effects = ["zero_q2", "twist_q1", "sag_q2"]
"""


def stars(file: Path) -> Floats:
    """(n, 4) azimuth, elevation by the stars and by the encoders, °."""
    cells = [
        line.split() for line in file.read_text(encoding="utf-8").splitlines() if not line.startswith(("!", ":", "M"))
    ]
    return np.array([[float(cell) for cell in row] for row in cells if len(row) == 4])


def by_arm(told: Floats) -> tuple[dict[str, float], float]:
    """Parameters as found, and the rms of what they leave on the sky, ″."""
    az, el, *_ = np.radians(told).T
    seen = 1000 * np.column_stack([np.cos(el) * np.cos(az), -np.cos(el) * np.sin(az), np.sin(el)])
    head = "measurement,point,q1_deg,q2_deg,reference_x_mm,reference_y_mm,reference_z_mm"
    rows = [f"1,{i},{q1:.7f},{q2:.7f},{','.join(f'{v:.7f}' for v in at)}"
            for i, ((*_, q1, q2), at) in enumerate(zip(told, seen, strict=True), 1)]  # fmt: skip
    job = job_of({"job.toml": JOB.encode(), "recording.csv": "\n".join([head, *rows, ""]).encode()})
    with physics_of(job):
        model = model_of(job, artefact_of(job.facts.artefact, job.points))
        estimate = model.estimate()
        left = model.residuals(estimate.about).reshape(-1, 3)
    found = {one.key[0]: float(value) for one, value in zip(model.unknowns, estimate.about, strict=True)}
    return found, float(SECONDS * np.sqrt(np.sum(left**2, axis=1).mean()))


def by_terms(told: Floats) -> tuple[dict[str, float], float]:
    az, el = np.radians(told[:, 2:]).T
    left = 3600 * np.column_stack([((told[:, 0] - told[:, 2] + 180) % 360 - 180) * np.cos(el), told[:, 1] - told[:, 3]])
    nothing, one = np.zeros_like(az), np.ones_like(az)
    terms = {
        "IA": (-np.cos(el), nothing), "IE": (nothing, one), "AN": (-np.sin(az) * np.sin(el), -np.cos(az)),
        "AW": (-np.cos(az) * np.sin(el), np.sin(az)), "NPAE": (-np.sin(el), nothing), "TF": (nothing, -np.cos(el)),
    }  # fmt: skip
    design = np.column_stack([np.concatenate(each) for each in terms.values()])
    found, *_ = np.linalg.lstsq(design, left.T.ravel(), rcond=None)
    rest = left.T.ravel() - design @ found
    return dict(zip(terms, found.tolist(), strict=True)), float(np.sqrt(2 * np.mean(rest**2)))


if __name__ == "__main__":
    for found, rms in (by_arm(stars(Path(sys.argv[1]))), by_terms(stars(Path(sys.argv[1])))):
        print({name: round(value, 2) for name, value in found.items()}, f"{rms:.3f} ″")
