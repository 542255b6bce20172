"""Writes examples/part-plate-simulated: the plate of a new job, its machine's certificate, and points of one drawn part.

    python -m benchmarks.examples.part_job

The machine is that of examples/step-gauge-simulated, reported by this package; the points are those of a plate whose bore is
larger and stands beside its place, moved by one draw of every cause of the virtual measurement.
"""

from __future__ import annotations

import datetime as dt
import tempfile
from pathlib import Path

import numpy as np

import cmm_uq
from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.analysis.parts.setup import circumstances_of, plan_of
from cmm_uq.analysis.parts.virtual import AtPose
from cmm_uq.app.commands.parts.machine import state_machine
from cmm_uq.base.files.toml_file import as_toml
from cmm_uq.base.points import Floats
from cmm_uq.jobs.part.job import TABLES, read_part
from cmm_uq.jobs.tables.identification import SIMULATED

ROOT = Path(__file__).parents[2]
FOLDER, MACHINE = ROOT / "examples" / "part-plate-simulated", ROOT / "examples" / "step-gauge-simulated"
SEED = 20261122
LARGER_MM, BESIDE_MM = 0.012, np.array([0.015, -0.010, 0.0])
"""Of the bore: its diameter, and its axis in the frame of the datums."""

DRAWN = f"""Simulated, no part was measured. True: bore {LARGER_MM:g} mm larger than its nominal and beside its place by \
{BESIDE_MM[0]:g} mm along x and {BESIDE_MM[1]:g} mm along y, all else nominal but for form; seed {SEED}."""

NEGLIGIBLE = {
    "clamping": {"by": "the simulation", "reason": "nothing was clamped"},
    "operators": {"by": "the simulation", "reason": "nobody measured"},
    "gradients": {"by": "the simulation", "reason": "the part was simulated at one temperature"},
}  # fmt: skip


def true_part(plan: Plan) -> Floats:
    """(n, 3) points of the part as it is."""
    points, bore = plan.points.copy(), plan.rows["bore"]
    points[bore] += BESIDE_MM - 0.5 * LARGER_MM * plan.normals[bore]
    return points


def main() -> None:
    """Write the folder anew."""
    (FOLDER / "machine").mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        files = cmm_uq.report(MACHINE).write(Path(folder) / "report")
        pdf = files["certificate-simulated.pdf"]
        (FOLDER / "machine" / pdf.name).write_bytes(pdf.read_bytes())
    said = {"id": FOLDER.name, "date": dt.date(2026, 3, 2), "origin": SIMULATED, "procedure": "Probed point by point",
            "remarks": DRAWN}  # fmt: skip
    head = "# Simulated with benchmarks/examples/part_job.py: no part and no machine was measured.\n\n"
    tables = {"job": said, **TABLES, "machine_state": {"certificate": "machine", "valid_until": dt.date(2026, 12, 31)}}
    tables |= {"environment": {"u_part_k": 0.1, "u_scales_k": 0.1, "scales_cte_per_k": 0.0}, "negligible": NEGLIGIBLE}
    tables = {name: table for name, table in tables.items() if name not in ("placing", "probing")}
    (FOLDER / "job.toml").write_bytes(head.encode() + as_toml(tables, "job.toml"))
    job = read_part(FOLDER)
    plan = plan_of(job)
    given = circumstances_of(job, state_machine(job).state, plan, 1)
    place = AtPose(plan, given, given.poses[0])
    moved = place.measured.moved(place.drawn(np.random.default_rng(SEED), 1), slice(None))[0] + place.measured.base
    rows = [f"# {DRAWN.replace(chr(10), ' ')}", "feature,point,x_mm,y_mm,z_mm"]
    points = true_part(plan) + moved
    for feature in plan.features:
        rows += [
            f"{feature.name},{i},{x:.4f},{y:.4f},{z:.4f}"
            for i, (x, y, z) in enumerate(points[plan.rows[feature.name]].tolist(), 1)
        ]
    (FOLDER / "points.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    recorded = {**tables, "recording": {"file": "points.csv"}}
    (FOLDER / "job.toml").write_bytes(head.encode() + as_toml(recorded, "job.toml"))


if __name__ == "__main__":
    main()
