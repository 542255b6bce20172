"""Error maps that a new job of them begins with."""

from __future__ import annotations

import numpy as np

from cmm_uq.base.points import AXES, Machine
from cmm_uq.jobs.beginning import Beginning
from cmm_uq.machine.physics.error_map import COLUMNS

TEMPERATURES = (20.0, 25.0, 30.0)
EXPANSION_UM_PER_M_K = 8.0  # of the scales, so that the maps differ by temperature alone
STEPS, NOISE = 20, 0.2  # steps over each axis, and standard deviation of every figure, µm or ″


def maps(machine: Machine) -> dict[str, bytes]:
    """One map at each temperature, simulated."""
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
