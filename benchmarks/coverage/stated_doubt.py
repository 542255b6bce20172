"""Whether 95 % intervals hold where thermometer, coefficient of expansion and clamping err as the job states.

    python -m benchmarks.coverage.stated_doubt [machines] [first seed]

Each machine has scales and squarenesses of its own and is otherwise straight. The artefact is at 22 °C; its temperature is
read 0.15 K wrong, once for all set-ups or in each anew, its coefficient of expansion is 0.6·10⁻⁶/K off, and clamping changes
a length by 0.3 µm (standard deviations). Recordings come from these sentences alone; the diagnosis is left out, for it
changes no interval of a machine that has all its errors named.
"""

from __future__ import annotations

import sys

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

import cmm_uq
from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.estimation import parameters, with_doubt, with_noise
from cmm_uq.base.points import Floats
from cmm_uq.machine.model.artefact_doubt import causes_of
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.maths.inference.posterior import sample_with_noise

EFFECTS = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")
TRAVEL = {"x": [0.0, 700.0], "y": [0.0, 700.0], "z": [-700.0, 0.0]}
MIDDLE = np.array([350.0, 350.0, -350.0])
ALPHA, DEGREES = 11.5e-6, 22.0
U_KELVIN, U_ALPHA, U_CLAMPING, U_LENGTH = 0.15, 0.6e-6, 0.3e-3, 0.1e-3
STATED = {"u_temperature_k": U_KELVIN, "u_cte_per_k": U_ALPHA, "u_fixturing_um": 1000 * U_CLAMPING}
LINES = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1), (-1, 1, 1), (1, -1, 1), (-1, -1, 1)]


def recorded(kind: str, seed: int, *, common: bool) -> tuple[cmm_uq.Job, dict[str, float]]:
    """A job of a machine drawn anew, and its true errors: ppm, and angles between axes less 90°, arcsec."""
    random = np.random.default_rng(seed)
    scale, angle = 10 * random.standard_normal(3), 5 * random.standard_normal(3)
    xy, yz, zx = np.radians(angle / 3600)
    # true = machine · indicated: an axis is longer than it reads, and the second leans against the first by the angle
    machine = np.eye(3) + 1e-6 * np.diag(scale) - np.array([[0, xy, 0], [0, 0, yz], [zx, 0, 0]])
    indicated, alpha = np.linalg.inv(machine), ALPHA + U_ALPHA * random.standard_normal()
    kelvin, clamping, calibration = random.standard_normal(3)
    rows: list[dict[str, float]] = []
    for number, body in enumerate(_placed(kind, random), 1):
        if not common:
            kelvin, clamping = random.standard_normal(2)
        warm = alpha * (DEGREES - 20 + U_KELVIN * kelvin)
        longest = float(np.linalg.norm(body[-1] - body[0]))
        grown = 1 + warm + (U_CLAMPING * clamping + U_LENGTH * calibration) / longest
        middle = body.mean(axis=0)
        for repeat in (1, 2, 3):
            true = middle + (body - middle) * grown - MIDDLE
            xyz = MIDDLE + true @ indicated.T + 0.0007 * random.standard_normal(body.shape)
            rows += [
                {"measurement": number, "repeat": repeat, "point": point, "x_mm": p[0], "y_mm": p[1], "z_mm": p[2],
                 "temp_artefact_c": DEGREES, **_reference(kind, body, point - 1)}
                for point, p in enumerate(xyz, 1)
            ]  # fmt: skip
    artefact: dict[str, object] = {"kind": kind, "cte_per_k": ALPHA, "u_um": 1000 * U_LENGTH}
    if kind == "ballbar":
        artefact["length_mm"] = 500.0
    job = cmm_uq.job(
        pd.DataFrame(rows), machine={"name": "M", "chain": "XYZ", "travel_mm": TRAVEL}, artefact=artefact, effects=EFFECTS,
        test_uncertainty=STATED, recording={"u_coordinate_um": 0.7},
    )  # fmt: skip
    return job, dict(zip(EFFECTS, [*scale, *angle], strict=True))


def _placed(kind: str, random: np.random.Generator) -> list[Floats]:
    """Points (n, 3) of the artefact at 20 °C in each set-up."""
    if kind == "plate":
        flat = np.array([[x, y, 0.0] for x in (-200, 0, 200) for y in (-200, 0, 200)])
        turns = [
            Rotation.identity(),
            Rotation.from_euler("x", 90, degrees=True),
            Rotation.from_euler("y", 90, degrees=True),
        ]
        turns += [Rotation.from_euler("z", 45, degrees=True), Rotation.from_euler("zx", [45, 90], degrees=True)]
        return [MIDDLE + turn.apply(flat) for turn in turns]
    along = np.linspace(-250, 250, 2 if kind == "ballbar" else 6)
    ways = np.array(LINES, dtype=float) if kind == "step_gauge" else random.standard_normal((20, 3))
    return [MIDDLE + 80 * random.uniform(-1, 1, 3) + along[:, None] * way / np.linalg.norm(way) for way in ways]


def _reference(kind: str, body: Floats, i: int) -> dict[str, float]:
    if kind == "ballbar":
        return {}
    if kind == "step_gauge":
        return {"reference_mm": 100.0 * i}
    return {"reference_x_mm": 200.0 * (i // 3), "reference_y_mm": 200.0 * (i % 3), "reference_z_mm": 0.0}


def held(kind: str, machines: int, first: int, *, common: bool) -> tuple[Floats, Floats]:
    """Parts of the intervals of scales and squarenesses that hold, (2,): without what is stated, and with it."""
    found = np.zeros((machines, 2, len(EFFECTS)))
    for i in range(machines):
        job, truth = recorded(kind, first + i, common=common)
        model, estimate, _ = with_noise(screened_model(job)[0])
        posterior = sample_with_noise(estimate.linear, noise_of(model), estimate.least_squares, i)
        causes = causes_of(model.artefact, job.circumstances)
        for j, stated in enumerate(((), causes)):
            values, _ = with_doubt(model, estimate, posterior, posterior.draws, stated)
            for e, (name, quantities) in enumerate(parameters(model, values).items()):
                low, high = next(iter(quantities.values())).interval95
                found[i, j, e] = low <= truth[name] <= high
    return found[:, :, :3].mean(axis=(0, 2)), found[:, :, 3:].mean(axis=(0, 2))


if __name__ == "__main__":
    count, start = int(sys.argv[1]) if len(sys.argv) > 1 else 200, int(sys.argv[2]) if len(sys.argv) > 2 else 1
    print("| artefact | temperatures and clamping err | scales without | with | squarenesses without | with |")
    print("| --- | --- | --- | --- | --- | --- |")
    for kind in ("step_gauge", "ballbar", "plate"):
        for common in (True, False):
            scales, squares = held(kind, count, start, common=common)
            numbers = " | ".join(f"{100 * value:.1f}" for value in (*scales, *squares))
            print(f"| {kind} | {'alike in all set-ups' if common else 'anew in each set-up'} | {numbers} |", flush=True)
