"""How often intervals of a triangle on axes that lean by degrees hold the truth: a line in docs/machine/kinematics.md.

Run:  PYTHONPATH=. python benchmarks/artefacts/leaning_triangle_coverage.py DEGREES NOISE_UM [RECORDINGS]

The recordings are made here, of unit vectors with the wanted scalar products and a triangle whose dimensions are drawn anew;
the placings are those of ``examples/triangle-simulated``.
"""

from __future__ import annotations

import csv
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np

from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.estimation import parameters, with_noise
from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.points import Floats
from cmm_uq.machine.model.measurement import with_curvature
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.maths.inference.posterior import sample_with_noise

EXAMPLE = Path(__file__).parents[2] / "examples" / "triangle-simulated"
PLANES = {"squareness_xy": (0, 1, 1.0), "squareness_yz": (1, 2, -0.9), "squareness_zx": (0, 2, 1.1)}


def sides(random: np.random.Generator) -> Floats:
    """Sides 1–2, 2–3, 3–1 of blocks and cylinders that are as uncertain as the job says."""
    blocks, cylinders = np.array([480.0, 280.0, 380.0]), np.full(3, 20.0)
    blocks, cylinders = blocks + 1e-4 * random.standard_normal(3), cylinders + 1e-4 * random.standard_normal(3)
    return np.asarray(blocks + 0.5 * (cylinders + np.roll(cylinders, -1)))


def recorded(folder: Path, degrees: float, noise_um: float, seed: int) -> dict[str, float]:
    """Write the job; give the true angles in arcsec."""
    random = np.random.default_rng(seed)
    gram, truth = np.eye(3), {}
    for name, (i, j, part) in PLANES.items():
        gram[i, j] = gram[j, i] = -np.sin(np.radians(degrees * part))
        truth[name] = 3600 * degrees * part
    axes = np.linalg.cholesky(gram)
    c, a, b = sides(random)
    x = (b**2 + c**2 - a**2) / (2 * c)
    body = np.array([[0.0, 0.0, 0.0], [c, 0.0, 0.0], [x, np.sqrt(b**2 - x**2), 0.0]])
    lines = [line for line in (EXAMPLE / "recording.csv").read_text().splitlines() if not line.startswith("#")]
    head, *rows = csv.reader(lines)
    columns = [head.index(f"{axis}_mm") for axis in "xyz"]
    read = np.array([[float(row[i]) for i in columns] for row in rows])
    number, point = (np.array([int(row[head.index(name)]) for row in rows]) for name in ("measurement", "point"))
    for one in np.unique(number):
        where = np.array([read[(number == one) & (point == k)][0] for k in (1, 2, 3)]) @ axes
        U, _, Vt = np.linalg.svd((body - body.mean(axis=0)).T @ (where - where.mean(axis=0)))
        turn = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
        true = (body - body.mean(axis=0)) @ turn + where.mean(axis=0)
        own = number == one
        read[own] = true[point[own] - 1] @ np.linalg.inv(axes)
    read += random.normal(0.0, 1e-3 * noise_um, read.shape)
    for row, xyz in zip(rows, read, strict=True):
        for column, value in zip(columns, xyz, strict=True):
            row[column] = f"{value:.5f}"
    shutil.copy(EXAMPLE / "job.toml", folder)
    (folder / "recording.csv").write_text("\n".join(",".join(row) for row in [head, *rows]) + "\n")
    return truth


def main(degrees: float, noise_um: float, recordings: int) -> None:
    inside, angles, count, failed = 0, 0, 0, 0
    with tempfile.TemporaryDirectory() as name:
        for seed in range(recordings):
            truth = recorded(Path(name), degrees, noise_um, seed)
            model, estimate, _ = with_noise(screened_model(read_job(Path(name)))[0])
            draws = sample_with_noise(estimate.linear, noise_of(model), estimate.least_squares, seed)
            posterior = with_curvature(model, noise_of(model), draws)
            failed += not posterior.converged
            for effect, each in parameters(model, posterior.draws).items():
                for quantity in each.values():
                    low, high = quantity.interval95
                    held = low <= truth.get(effect, 0.0) <= high
                    inside, angles, count = inside + held, angles + (held and effect in truth), count + 1
    print(f"{degrees:g}°, {noise_um:g} µm: {100 * inside / count:.1f} % of {count} intervals hold, of the squarenesses "
          f"{angles} of {3 * recordings}; {failed} of {recordings} did not converge")  # fmt: skip


if __name__ == "__main__":
    main(float(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 30)
