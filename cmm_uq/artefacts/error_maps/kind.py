"""The kind of a recording that is the machine's error maps: where its parts are, its keys, its beginning."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from cmm_uq.base.points import Machine
from cmm_uq.jobs.beginning import Beginning
from cmm_uq.jobs.tables.artefact import ArtefactFacts, CertifiedValue
from cmm_uq.machine.model.kind import Kind
from cmm_uq.machine.physics.error_map import COLUMNS


class ErrorMapFacts(ArtefactFacts):
    """The maps are named under ``[machine]``."""

    with_recording: ClassVar[bool] = False
    certified_values: ClassVar[tuple[CertifiedValue, ...]] = ()


TEMPERATURES = (20.0, 25.0, 30.0)
EXPANSION_UM_PER_M_K = 8.0  # of the scales, so that the maps differ by temperature alone
STEPS, NOISE = 20, 0.2  # steps over each axis, and standard deviation of every figure, µm or ″


def maps(machine: Machine) -> dict[str, bytes]:
    """One map at each temperature, simulated."""
    random, found = np.random.default_rng(1), {}
    for temperature in TEMPERATURES:
        lines = [
            "# simulated by cmm-uq new: put in the maps of your machine",
            ",".join(("axis", "position_mm", *COLUMNS)),
        ]
        for axis in machine.axes:
            low, high = machine.travel(axis)
            for position in np.linspace(low, high, STEPS + 1):
                figures = random.normal(0.0, NOISE, len(COLUMNS)) * (position != low)
                grown = EXPANSION_UM_PER_M_K * (temperature - 20.0) * (position - low) / 1000.0
                figures[machine.axes.index(axis)] += grown
                lines.append(",".join((axis, f"{position:g}", *(f"{figure:.2f}" for figure in figures))))
        found[f"error_map_{temperature:g}C.csv"] = ("\n".join(lines) + "\n").encode()
    return found


BEGINNING = Beginning(
    title="Error maps of a machine at several temperatures",
    numbering="There is no recording: each map is a file under [machine] error_map.",
    effects=("thermal_scale_x", "thermal_scale_y", "thermal_scale_z"),
    files=maps,
    machine={
        "error_map": [
            {"file": f"error_map_{temperature:g}C.csv", "temperature_c": temperature} for temperature in TEMPERATURES
        ]
    },
    command="diagnose",
)


KIND = Kind(
    name="error_map",
    table=ErrorMapFacts,
    begin="cmm_uq.artefacts.error_maps.kind:BEGINNING",
    check="cmm_uq.artefacts.error_maps.diagnosis:refuse_unfit",
    own="cmm_uq.artefacts.error_maps.page:OWN",
    refusal="error maps cannot be {}: they are free functions, no points of an artefact",
    instead="cmm-uq diagnose JOB compares them with each other",
)
