"""``[simulation]`` of job.toml: what a simulation, by whatever program, predicts for the recording.

It names a file of predicted coordinates or lengths (:mod:`cmm_uq.jobs.prediction`), or error maps of the machine.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from cmm_uq.files.limits import MAPS
from cmm_uq.jobs.machine import ErrorMapFile
from cmm_uq.jobs.table import Length, Names, Table, Uncertainty

KEY = "[simulation]"

UNIT_MM = {"mm": 1.0, "m": 1000.0, "cm": 10.0, "um": 1e-3, "inch": 25.4}
"""Millimetres in each unit that predicted coordinates and lengths may have."""

_OF_A_FILE = ("length_mm", "unit", "columns")
"""Keys that say how a file is to be read."""

NOMINAL_C = 20.0
"""°C of a map that is named without its temperature."""


class SimulationFacts(Table):
    """``[simulation]``.

    Attributes
    ----------
    file : of predicted coordinates or lengths.
    map : in its place, error maps: the displacements that they give at the recorded positions are the prediction.
    program : that made it, in the user's words.
    u_um : standard uncertainty of each predicted coordinate (of a predicted length: of the length), where the file has no
        column ``u_um``. Independent from point to point; repeats share it.
    u_common_um : standard uncertainty of the artefact's size that all predictions share.
    length_mm : of the artefact, as the simulation took it; that of ``[artefact]`` by default.
    unit : of predicted coordinates and lengths.
    columns : names of the file's columns, where they are others than the recording's.
    effects : that the simulation contains.
    refit : whether these are estimated anew, as corrections to what it contains.
    """

    file: str | None = None
    map: Annotated[list[ErrorMapFile], Field(max_length=MAPS.most)] = []
    program: str = ""
    u_um: Uncertainty = 0.0
    u_common_um: Uncertainty = 0.0
    length_mm: Length | None = None
    unit: Literal["mm", "m", "cm", "um", "inch"] = "mm"
    columns: Annotated[dict[str, str], Field(max_length=10)] = {}
    effects: Names = []
    refit: bool = False

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
