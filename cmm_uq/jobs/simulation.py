"""``[simulation]`` of job.toml: what a simulation, by whatever program, predicts for the recording.

It names a file of predicted coordinates or lengths (:mod:`cmm_uq.jobs.prediction`), or error maps of the machine.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from cmm_uq.base.files.limits import MAPS
from cmm_uq.base.files.table import Length, Names, Table, Uncertainty
from cmm_uq.jobs.machine import ErrorMapFile

KEY = "[simulation]"

UNIT_MM = {"mm": 1.0, "m": 1000.0, "cm": 10.0, "um": 1e-3, "inch": 25.4}
"""Millimetres in each unit that predicted coordinates and lengths may have."""

_OF_A_FILE = ("length_mm", "unit", "columns")
"""Keys that say how a file is to be read."""

NOMINAL_C = 20.0
"""°C of a map that is named without its temperature."""


class SimulationFacts(Table):
    """``[simulation]``."""

    file: str | None = None
    """File of predicted coordinates or lengths."""
    map: Annotated[list[ErrorMapFile], Field(max_length=MAPS.most)] = []
    """In place of a file, error maps: the displacements that they give at the recorded positions are the prediction."""
    program: str = ""
    """Program that made the prediction, in your words."""
    u_um: Uncertainty = 0.0
    """Standard uncertainty of each predicted coordinate (or length), where the file has no column of it; repeats share it."""
    u_common_um: Uncertainty = 0.0
    """Standard uncertainty of the artefact's size that all predictions share."""
    length_mm: Length | None = None
    """Length of the artefact, as the simulation took it; otherwise that of [artefact]."""
    unit: Literal["mm", "m", "cm", "um", "inch"] = "mm"
    """Unit of predicted coordinates and lengths."""
    columns: Annotated[dict[str, str], Field(max_length=10)] = {}
    """Names of the file's columns, where they are others than the recording's."""
    effects: Names = []
    """Effects that the simulation contains."""
    refit: bool = False
    """Whether these are estimated anew, as corrections to what the simulation contains."""

    @field_validator("map", mode="before")
    @classmethod
    def _one_or_several(cls, given: Any) -> Any:
        if isinstance(given, str):
            given = {"file": given, "temperature_c": NOMINAL_C}
        return [given] if isinstance(given, dict) else given

    @model_validator(mode="after")
    def _one_prediction(self) -> Self:
        if (self.file is None) == (not self.map):
            raise ValueError('give either file = "predicted.csv", or map = "error_map.csv"')
        if self.refit and not self.effects:
            raise ValueError("refit = true says nothing of what: name the effects that the simulation contains")
        if self.map and (given := [key for key in _OF_A_FILE if key in self.model_fields_set]):
            raise ValueError(f"{given[0]} belongs to a file of predictions, not to a map: leave it out")
        return self
