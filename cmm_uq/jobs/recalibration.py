"""``[machine] calibrate``: by which rule it is found out when the machine is to be calibrated again."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from cmm_uq.base.files.table import Table

Method = Literal["fixed", "A3", "S2", "staircase", "control chart", "drift"]

Months = Annotated[int, Field(ge=1, le=600)]


class Recalibration(Table):
    """``calibrate``: without a method a fixed interval, or method A3 where a reliability is given."""

    every_months: Months = 12
    """Months between calibrations; where a method adapts them, the interval it begins with."""
    method: Method | None = None
    """How the interval follows from the history: `fixed`, NCSLI RP-1 `A3` or `S2`, `staircase`, `control chart`, `drift`."""
    reliability: Annotated[float, Field(ge=0.5, le=0.999)] | None = None
    """Probability with which the machine is to be within its limits at its next calibration; 0.95 where nothing is said."""
    shortest_months: Months = 1
    """Shortest interval that a method may come to."""
    longest_months: Months | None = None
    """Longest interval that a method, or with a fixed one interim checks in control, may come to."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        longest = self.longest_months
        if longest is not None and not self.shortest_months <= self.every_months <= longest:
            raise ValueError(
                f"every_months = {self.every_months} lies outside {self.shortest_months} to {longest} months: "
                "give shortest_months ≤ every_months ≤ longest_months"
            )
        if self.method == "fixed" and self.reliability is not None:
            raise ValueError("a fixed interval knows no reliability: leave it out, or name another method")
        return self
