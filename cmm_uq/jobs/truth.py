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

from pydantic import BaseModel, ConfigDict, Field

NotNegative = Annotated[float, Field(ge=0)]


class _Table(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class NoiseFacts(_Table):
    """``[noise]``: standard deviations of a coordinate, of each reading and of each placing."""

    coordinate_um: NotNegative = 0.0
    placing_um: NotNegative = 0.0


class Truth(_Table):
    """All of truth.toml.

    ``effects`` gives the reported parameters of each effect that acts, whatever the job's model names; ``artefact`` the true
    sizes; ``columns`` values that hold for every row of the recording, such as temperatures.
    """

    effects: dict[str, dict[str, float]] = {}
    artefact: dict[str, float] = {}
    noise: NoiseFacts = NoiseFacts()
    columns: dict[str, float] = {}
    seed: Annotated[int, Field(ge=0)] = 0
