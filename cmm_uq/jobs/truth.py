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

from typing import Annotated, Literal

from pydantic import Field, field_validator

from cmm_uq.base.files.limits import COLUMNS, EFFECTS
from cmm_uq.base.files.table import AnyFloat, Column, JobTable, Uncertainty, key, required
from cmm_uq.jobs.columns import REQUIRED, largest


class ByAxis(JobTable):
    """One number for each axis."""

    x: Uncertainty = required("Along x.")
    y: Uncertainty = required("Along y.")
    z: Uncertainty = required("Along z.")


class NoiseFacts(JobTable):
    """``[noise]``: standard deviations of a coordinate."""

    coordinate_um: Uncertainty | ByAxis = 0.0
    """Standard deviation of each reading, of every coordinate or by axis."""
    placing_um: Uncertainty = 0.0
    """Standard deviation of the offset of each point of each placing, which its repeats share."""
    growth_um: Uncertainty = 0.0
    """Standard deviation of what is added at the longest distance in a placing, in proportion to the distance."""
    slow_um: Uncertainty = key(0.0, "Standard deviation of slow noise; needs `time_s` in the recording.")
    slow_time_s: Annotated[float, Field(gt=0, le=1e9)] | Literal["never"] = 600.0
    """Time over which slow noise forgets; `"never"` for a random walk from the first reading on, of which `slow_um` is
    then the root mean square over the recording."""
    tails_dof: Annotated[float, Field(gt=2, le=1000)] | None = None
    """Degrees of freedom of readings with Student's t distribution of the same standard deviation; normal by
    default."""
    resolution_um: Uncertainty = key(0.0, "Step of the display.")

    @property
    def coordinates_um(self) -> tuple[float, float, float]:
        given = self.coordinate_um
        return (given.x, given.y, given.z) if isinstance(given, ByAxis) else (given, given, given)


class Truth(JobTable):
    """All of truth.toml."""

    effects: Annotated[dict[str, dict[str, AnyFloat]], Field(max_length=EFFECTS.most)] = {}
    """True parameters of each effect that acts, by the effect's name, whatever the job's model names."""
    artefact: dict[str, AnyFloat] = {}
    """True sizes of the artefact, by name, such as `length_mm`; as certified by default."""
    noise: NoiseFacts = key(NoiseFacts(), "Noise of the simulated readings.")
    columns: Annotated[dict[Column, AnyFloat], Field(max_length=COLUMNS.most)] = {}
    """Columns of the recording at a value that holds for every row, such as temperatures."""
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = key(0, "Seed of the random numbers.")

    @field_validator("columns")
    @classmethod
    def _of_a_recording(cls, columns: dict[str, float]) -> dict[str, float]:
        for name, value in columns.items():
            if name in (*REQUIRED, "repeat"):
                raise ValueError(f"{name} comes from the job's own recording")
            if abs(value) > largest(name):
                raise ValueError(f"{name} = {value:g} is more than anything that is measured")
        return columns
