"""What new jobs begin with that simulate more than a recording: a plate that is shifted and turned, and error maps."""

from __future__ import annotations

import numpy as np

from cmm_uq.base.points import AXES, Machine, Points
from cmm_uq.machine.model.kind import Beginning
from cmm_uq.machine.physics.error_map import COLUMNS

SIDE, PITCH = 3, 150.0  # balls along a side of the plate, and their distance, mm

# shift of the plate's middle along x and y, mm, and turn, °: enough to part the plate from the machine
PLACINGS = ((0.0, 0.0, 0.0), (150.0, 0.0, 0.0), (0.0, 150.0, 0.0), (0.0, 0.0, 90.0))


def placed_plate(machine: Machine) -> Points:
    """A square plate of balls about the middle of the plane xy, in every placing."""
    steps = PITCH * (np.arange(SIDE) - 0.5 * (SIDE - 1))
    balls = np.column_stack([part.ravel() for part in np.meshgrid(steps, steps)])
    middle = np.array([np.mean(machine.travel(axis)) for axis in AXES]) - machine.origin_mm
    parts = []
    for dx, dy, degrees in PLACINGS:
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        flat = balls @ np.array([[c, s], [-s, c]]) + [dx - 25.0, dy - 25.0]
        parts.append(np.column_stack([flat, np.zeros(len(flat))]) + middle)
    count, n = len(balls), len(balls) * len(PLACINGS)
    measurement, point = np.repeat(np.arange(n // count) + 1, count), np.tile(np.arange(count) + 1, n // count)
    return Points(np.vstack(parts), measurement, point, np.ones(n, dtype=np.int64), machine)


PLANE_SHIFTED = Beginning(
    title="Self-calibration of a plane by shifting and turning an uncalibrated plate",
    numbering="One measurement is one placing of the plate; its points are the balls.",
    artefact={
        "name": "Ball plate, uncalibrated but for its diagonal",
        "plane": "xy",
        "known": {"from": 1, "to": SIDE**2, "length_mm": round(PITCH * (SIDE - 1) * 2**0.5, 4), "u_um": 0.5},
    },
    effects=(),
    points=placed_plate,
)

TEMPERATURES = (20.0, 25.0, 30.0)
EXPANSION_UM_PER_M_K = 8.0  # of the scales, so that the maps differ by temperature alone
STEPS, NOISE = 20, 0.2  # steps over each axis, and standard deviation of every figure, µm or ″


def maps(machine: Machine) -> dict[str, bytes]:
    random, files = np.random.default_rng(1), {}
    for temperature in TEMPERATURES:
        lines = ["# simulated by cmm-uq new: put in the maps of your machine", f"axis,position_mm,{','.join(COLUMNS)}"]
        for axis in AXES:
            low, high = machine.travel(axis)
            for position in np.linspace(low, high, STEPS + 1):
                figures = random.normal(0.0, NOISE, len(COLUMNS)) * (position != low)
                grown = EXPANSION_UM_PER_M_K * (temperature - 20.0) * (position - low) / 1000.0
                figures[AXES.index(axis)] += grown
                lines.append(",".join((axis, f"{position:g}", *(f"{figure:.2f}" for figure in figures))))
        files[f"error_map_{temperature:g}C.csv"] = ("\n".join(lines) + "\n").encode()
    return files


BEGINNING = Beginning(
    title="Error maps of a machine at several temperatures",
    numbering="There is no recording: each map is a file under [machine] error_map.",
    effects=("thermal_scale_x", "thermal_scale_y", "thermal_scale_z"),
    files=maps,
    command="diagnose",
    machine={"error_map": [{"file": f"error_map_{t:g}C.csv", "temperature_c": t} for t in TEMPERATURES]},
)
