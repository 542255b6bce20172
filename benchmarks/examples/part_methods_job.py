"""Writes examples/part-methods-simulated: a plate with two bores, by a virtual measurement and by both other methods.

    python -m benchmarks.examples.part_methods_job [TESTS]

With a number, so many such tests of other seeds are drawn instead, and how often their intervals hold is printed.

The machine is that of examples/bryan-simulated, with the true errors that its recording was drawn from and that its remarks
state; nothing corrects them. It measures with one tip, whose effective diameter is wrong,

- the part, in the middle of the travel;
- a calibrated plate like it in the same place, twice in each of ten set-ups;
- the part in four orientations about the vertical, five times in each, a bar and a ring beside it.

Drawn anew are in each set-up the temperatures of scales and of what is measured, in each measurement the noise of readings
and the roughness. Form is drawn once for the part and once for the calibrated plate in their place, and anew in each
orientation, where other points are probed. Each calibrated value is off by a draw of its standard uncertainty.
"""

from __future__ import annotations

import datetime as dt
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.examples.part_job import NEGLIGIBLE
from benchmarks.examples.simulated_jobs import MACHINE, bryan
from cmm_uq.analysis.machine.state import MachineState, StatedNoise
from cmm_uq.analysis.parts.causes.machine import STYLUS
from cmm_uq.analysis.parts.causes.surroundings import TEMPERATURE, forms
from cmm_uq.analysis.parts.methods.of_job import methods_of
from cmm_uq.analysis.parts.plan import Nominal, PartCharacteristic, PartFeature, PartPose, Plan
from cmm_uq.analysis.parts.result import evaluated
from cmm_uq.analysis.parts.setup import forms_of, plan_of, surroundings_of
from cmm_uq.analysis.parts.virtual import AtPose, MeasurementConditions
from cmm_uq.base.files.toml_file import as_toml
from cmm_uq.base.points import Floats
from cmm_uq.jobs.part.job import PartJob, part_of
from cmm_uq.jobs.tables.identification import SIMULATED
from cmm_uq.machine.physics.catalogue import effects

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "examples" / "part-methods-simulated"
MACHINE_JOB = "bryan-simulated"
SEED = 20261122

ORIGIN = np.array([400.0, 550.0, -400.0])
"""Where the part's origin lies in the machine, mm."""

LARGER_MM = {"small": 0.006, "large": -0.009}
BESIDE_MM = {"small": np.array([0.012, 0.008, 0.0]), "large": np.array([-0.015, 0.020, 0.0])}
"""Of the part's bores: diameter more than nominal, and axis beside its place in the frame of the datums."""

CALIBRATED_LARGER_MM = {"small": -0.003, "large": 0.004}
CALIBRATED_BESIDE_MM = {"small": np.array([-0.010, 0.015, 0.0]), "large": np.array([0.018, -0.007, 0.0])}
"""The same of the calibrated plate."""

TIP_UM = 0.5
"""By how much the tip's effective diameter is more than it was qualified to."""

CYCLES, TWICE, TURNS, REPEATS = 10, 2, 4, 5
BAR_MM, U_BAR_UM, RING_MM, U_RING_UM, U_CAL_UM = 100.0, 0.2, 25.0, 0.2, 0.4
U_PART_UM = {"1": 0.7, "2": 0.6, "3": 0.7, "4": 1.0}
"""By how much the forms of two plates make a characteristic differ: 400 draws, rounded up."""

MIDDLE_MM = np.array([60.0, 40.0, -10.0])
"""Of the plate, about which it is turned."""


def _plane(name: str, point: list[float], direction: list[float], along: list[float], sides: tuple[float, float],
           counts: tuple[int, int]) -> dict[str, Any]:  # fmt: skip
    return {
        "name": name, "kind": "plane", "point_mm": point, "direction": direction, "along": along, "length_mm": sides[0],
        "width_mm": sides[1],
        "strategy": {"pattern": "grid", "rows": counts[0], "columns": counts[1], "margin_mm": 5.0},
    }  # fmt: skip


def _bore(name: str, point: list[float], diameter: float) -> dict[str, Any]:
    return {
        "name": name, "kind": "cylinder", "point_mm": point, "direction": [0.0, 0.0, 1.0], "diameter_mm": diameter,
        "inner": True, "length_mm": 20.0,
        "strategy": {"pattern": "sections", "sections": 2, "points": 6, "margin_mm": 4.0},
    }  # fmt: skip


TABLES: Mapping[str, Any] = {
    "part": {"name": "Plate with two bores", "cte_per_k": 11.5e-6, "u_cte_per_k": 0.5e-6},
    "machine_state": {"job": f"../{MACHINE_JOB}", "valid_until": dt.date(2026, 12, 31), "corrected": False},
    "stylus": [{"name": "down", "diameter_mm": 4.0, "offset_mm": [0.0, 0.0, -150.0], "u_diameter_um": 0.5}],
    "feature": [
        _plane("A", [60.0, 40.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], (120.0, 80.0), (2, 3)),
        _plane("B", [60.0, 0.0, -10.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0], (120.0, 20.0), (2, 2)),
        _plane("C", [0.0, 40.0, -10.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], (80.0, 20.0), (2, 2)),
        _bore("small", [25.0, 40.0, -10.0], 20.0),
        _bore("large", [95.0, 40.0, -10.0], 30.0),
    ],
    "alignment": {"datums": ["A", "B", "C"]},
    "placing": {"origin_mm": ORIGIN.tolist()},
    "environment": {"u_part_k": 0.05, "u_scales_k": 0.05, "scales_cte_per_k": 0.0},
    "form": {"field_um": 0.5, "roughness_um": 0.2},
    "characteristic": [
        {"name": "1", "what": "size", "features": ["large"], "lower_mm": 29.97, "upper_mm": 30.03},
        {"name": "2", "what": "distance", "features": ["small", "large"], "lower_mm": 69.95, "upper_mm": 70.05},
        {"name": "3", "what": "distance", "features": ["large", "B"], "lower_mm": 39.95, "upper_mm": 40.05},
        {"name": "4", "what": "x", "features": ["small"], "datums": ["A", "B", "C"], "lower_mm": 24.95, "upper_mm": 25.05},
    ],
    "negligible": {**NEGLIGIBLE, "lobing": {"by": "the simulation", "reason": "the probe was simulated without"}},
}  # fmt: skip
"""Tables of job.toml but ``[job]`` and those of recordings."""


def state() -> MachineState:
    """The machine with its true errors, which are also their mean, and its noise."""
    calibrated = bryan()
    truth = np.array([list(calibrated.truth.values())], dtype=np.float64)
    noise = StatedNoise(np.full(3, 1e-3 * calibrated.noise_um))
    return MachineState(MACHINE, effects(list(calibrated.truth)), truth, noise, corrected=False)


def made(plan: Plan, larger: Mapping[str, float], beside: Mapping[str, Floats]) -> Floats:
    """(n, 3) points of a plate as it is, but for its form."""
    points = plan.points.copy()
    for bore, by in larger.items():
        rows = plan.rows[bore]
        points[rows] += beside[bore] - 0.5 * by * plan.normals[rows]
    return points


@dataclass(frozen=True, eq=False)
class Bench:
    """The machine, on which plans are measured.

    Parameters
    ----------
    job : for temperatures and forms.
    random : draws of all that is not the same each time.
    """

    job: PartJob
    random: np.random.Generator

    def form(self, plan: Plan) -> Floats:
        """(n, 3) what one form adds to the points, without roughness."""
        smooth = tuple(replace(one, roughness_um=0.0) for one in forms_of(self.job))
        return np.asarray(sum(each.moved(each.draw(self.random, 1), slice(None))[0] for each in forms(smooth, plan)[0]))

    def setup(self, plan: Plan, true: Floats, pose: PartPose, repeats: int) -> list[Floats]:
        """(c,) values of each repeat in one set-up: temperatures and tip are the same, noise and roughness are not."""
        return [evaluated(plan, points) for points in self.points(plan, true, pose, repeats)]

    def points(self, plan: Plan, true: Floats, pose: PartPose, repeats: int) -> list[Floats]:
        """(n, 3) points of each, in the frame of the part."""
        names = {one.name for one in plan.features}
        rough = tuple(replace(one, field_um=0.0) for one in forms_of(self.job) if one.feature in names)
        at = AtPose(plan, MeasurementConditions(state(), (pose,), surroundings_of(self.job), rough), pose)
        once, found = at.drawn(self.random, 1), []
        for _ in range(repeats):
            drawn = at.drawn(self.random, 1)
            for i, cause in enumerate(at.causes):
                if cause.name == TEMPERATURE:
                    drawn[i] = once[i]
                elif cause.name == STYLUS:
                    drawn[i] = np.full_like(drawn[i], TIP_UM)
            found.append(true + at.measured.base + at.measured.moved(drawn, slice(None))[0])
        return found


def turned(quarters: int) -> PartPose:
    """The plate turned about the vertical through its middle, by so many quarters of a revolution."""
    c, s = round(np.cos(0.5 * np.pi * quarters)), round(np.sin(0.5 * np.pi * quarters))
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return PartPose(turn, ORIGIN + MIDDLE_MM - turn @ MIDDLE_MM)


def standards(plan: Plan) -> tuple[Plan, Plan]:
    """A length along the plate's own, between faces that are met from one side, and a ring in the plate's middle."""
    faces = [MIDDLE_MM + x * np.array([1.0, 0.0, 0.0]) for x in (-0.5 * BAR_MM, 0.5 * BAR_MM)]
    along = np.array([[1.0, 0.0, 0.0]])
    bar = tuple(PartFeature(name, "point", at[None], along, "down", Nominal(at))
                for name, at in zip("ab", faces, strict=True))  # fmt: skip
    angles = 2 * np.pi * np.arange(24) / 24
    out = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(24)])
    nominal = Nominal(MIDDLE_MM, np.array([0.0, 0.0, 1.0]), RING_MM)
    ring = PartFeature("ring", "circle", MIDDLE_MM + 0.5 * RING_MM * out, -out, "down", nominal)
    return (
        Plan(bar, (PartCharacteristic("bar", "distance", ("a", "b")),), plan.styli),
        Plan((ring,), (PartCharacteristic("ring", "size", ("ring",)),), plan.styli),
    )


def files(seed: int = SEED) -> dict[str, bytes]:
    """Every file of the folder, by name."""
    bare = part_of({"job.toml": as_toml({"job": _said(""), **TABLES}, "job.toml")}, machine=False)
    plan, bench = plan_of(bare), Bench(bare, np.random.default_rng(seed))
    part, calibrated = made(plan, LARGER_MM, BESIDE_MM), made(plan, CALIBRATED_LARGER_MM, CALIBRATED_BESIDE_MM)
    names = [one.name for one in plan.characteristics]
    truth, known = evaluated(plan, part), evaluated(plan, calibrated)
    told = (
        f"Simulated, no part was measured. True values: {_listed(names, truth)}; of the calibrated plate "
        f"{_listed(names, known)}. The machine errs as the remarks of {MACHINE_JOB} say, uncorrected, with noise of "
        f"{bryan().noise_um:g} µm; the tip is {TIP_UM:g} µm larger than it was qualified to; seed {seed}."
    )
    (points,) = bench.points(plan, part + bench.form(plan), turned(0), 1)
    own = calibrated + bench.form(plan)
    cycles = [bench.setup(plan, own, turned(0), TWICE) for _ in range(CYCLES)]
    stated = known + 1e-3 * U_CAL_UM * bench.random.standard_normal(len(known))
    bar, ring = standards(plan)
    off = 1e-3 * bench.random.standard_normal(2) * [U_BAR_UM, U_RING_UM]
    by_turn: list[list[list[Floats]]] = [[], [], []]
    for quarters in range(TURNS):
        pose = turned(quarters)
        by_turn[0].append(bench.setup(plan, part + bench.form(plan), pose, REPEATS))
        for found, one in zip(by_turn[1:], (bar, ring), strict=True):
            found.append(bench.setup(one, one.points, pose, REPEATS))
    lengths, diameters = (
        [[values + by for values in setup] for setup in found] for found, by in zip(by_turn[1:], off, strict=True)
    )
    contents = {
        "points.csv": _points_csv(plan, points),
        "calibrated.csv": _values_csv("cycle", names, cycles),
        "turned.csv": _values_csv("orientation", names, by_turn[0]),
        "bar.csv": _standard_csv("length_mm", lengths),
        "ring.csv": _standard_csv("diameter_mm", diameters),
    }
    tables = {"job": _said(told), **TABLES, "recording": {"file": "points.csv"}, **_methods(names, stated)}
    head = f"# Simulated with benchmarks/examples/{Path(__file__).name}: no part and no machine was measured.\n\n"
    return {
        "job.toml": head.encode() + as_toml(tables, "job.toml"),
        **{name: f"# {told}\n{content}\n".encode() for name, content in contents.items()},
    }


def _said(remarks: str) -> dict[str, Any]:
    return {"id": FOLDER.name, "date": dt.date(2026, 3, 2), "origin": SIMULATED, "procedure": "Probed point by point",
            "remarks": remarks}  # fmt: skip


def _listed(names: Sequence[str], values: Floats) -> str:
    return ", ".join(f"{name}: {value:.4f} mm" for name, value in zip(names, values.tolist(), strict=True))


def _methods(names: Sequence[str], stated: Floats) -> dict[str, Any]:
    """Both tables; each certified size is what its standard was simulated with, but for a draw of its uncertainty."""
    certified = [
        {"name": name, "value_mm": round(value, 5), "u_um": U_CAL_UM, "u_part_um": U_PART_UM[name]}
        for name, value in zip(names, stated.tolist(), strict=True)
    ]
    return {
        "by_calibrated_part": {
            "file": "calibrated.csv", "certificate": "Simulated, K-1", "same_procedure": True, "similar": True,
            "conditions_varied": True, "substitution": True, "characteristic": certified,
        },
        "by_orientations": {
            "file": "turned.csv", "points_varied": True, "place_varied": False,
            "length_standard": {"length_mm": BAR_MM, "u_um": U_BAR_UM, "file": "bar.csv", "certificate": "Simulated, K-2"},
            "probe_standard": [{"diameter_mm": RING_MM, "u_um": U_RING_UM, "inner": True, "file": "ring.csv",
                                "certificate": "Simulated, K-3"}],
        },
    }  # fmt: skip


def _points_csv(plan: Plan, points: Floats) -> str:
    rows = ["feature,point,x_mm,y_mm,z_mm"]
    for feature in plan.features:
        for i, (x, y, z) in enumerate(points[plan.rows[feature.name]].tolist(), 1):
            rows.append(f"{feature.name},{i},{x:.4f},{y:.4f},{z:.4f}")
    return "\n".join(rows)


def _values_csv(group: str, names: Sequence[str], found: Sequence[Sequence[Floats]]) -> str:
    return "\n".join([f"{group},repeat,characteristic,value_mm"] + [
        f"{i},{j},{name},{value:.5f}" for i, setup in enumerate(found, 1) for j, values in enumerate(setup, 1)
        for name, value in zip(names, values.tolist(), strict=True)
    ])  # fmt: skip


def _standard_csv(column: str, found: Sequence[Sequence[Floats]]) -> str:
    return "\n".join([f"orientation,repeat,{column}"] + [
        f"{i},{j},{float(values[0]):.5f}" for i, setup in enumerate(found, 1) for j, values in enumerate(setup, 1)
    ])  # fmt: skip


def study(tests: int) -> None:
    """Print how often |value − truth| ≤ U, and by how much values are off, of so many tests with seeds from 1000 on."""
    off: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for seed in range(1000, 1000 + tests):
        job = part_of(files(seed), machine=False)
        plan = plan_of(job)
        assert job.measured is not None
        truth, measured = evaluated(plan, made(plan, LARGER_MM, BESIDE_MM)), evaluated(plan, job.measured)
        for method in methods_of(job, plan, measured):
            for figure, true in zip(method.figures, truth.tolist(), strict=True):
                off.setdefault((method.method, figure.name), []).append((figure.value - true, figure.U))
    for (name, characteristic), pairs in off.items():
        error, expanded = 1e3 * np.array(pairs).T
        held, rms = 100 * np.mean(np.abs(error) <= expanded), np.sqrt(np.mean(error**2))
        print(f"{name:16} {characteristic}  holds {held:3.0f} %  mean error {error.mean():+.2f} µm  rms {rms:.2f} µm  "
              f"U {expanded.mean():.2f} µm")  # fmt: skip


def main() -> None:
    """Write the folder anew, or study its tests."""
    if len(sys.argv) > 1:
        study(int(sys.argv[1]))
        return
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, content in files().items():
        (FOLDER / name).write_bytes(content)


if __name__ == "__main__":
    main()
