"""What a simulated recording is drawn from: truth.toml.

[effects.squareness_xy]
angle_arcsec = -173.0
[artefact]
length_mm = 404.236
[noise]
coordinate_um = 1.2
placing_um = 0.5
[columns]
temp_x_c = 22.5
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, field_validator

from cmm_uq.files.limits import COLUMNS, EFFECTS
from cmm_uq.jobs.recording import REQUIRED, largest
from cmm_uq.jobs.table import AnyFloat, Column, Table, Uncertainty


class NoiseFacts(Table):
    """``[noise]``: standard deviations of a coordinate, of each reading and of each placing."""

    coordinate_um: Uncertainty = 0.0
    placing_um: Uncertainty = 0.0


class Truth(Table):
    """All of truth.toml.

    ``effects`` gives the reported parameters of each effect that acts, whatever the job's model names; ``artefact`` the true
    sizes; ``columns`` values that hold for every row of the recording, such as temperatures.
    """

    effects: Annotated[dict[str, dict[str, AnyFloat]], Field(max_length=EFFECTS.most)] = {}
    artefact: dict[str, AnyFloat] = {}
    noise: NoiseFacts = NoiseFacts()
    columns: Annotated[dict[Column, AnyFloat], Field(max_length=COLUMNS.most)] = {}
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0

    @field_validator("columns")
    @classmethod
    def _of_a_recording(cls, columns: dict[str, float]) -> dict[str, float]:
        for name, value in columns.items():
            if name in (*REQUIRED, "repeat"):
                raise ValueError(f"{name} comes from the job's own recording")
            if abs(value) > largest(name):
                raise ValueError(f"{name} = {value:g} is more than anything that is measured")
        return columns
