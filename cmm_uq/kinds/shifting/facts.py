"""``[artefact]`` of an artefact that is read in shifted places."""

from __future__ import annotations

from typing import Annotated, Literal, Self, cast

from pydantic import BaseModel, ConfigDict, Field, model_validator

from cmm_uq.jobs.job import ArtefactFacts, Job, NotNegative, Positive


class KnownLength(BaseModel):
    """A known length between two points of a shifted artefact."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)

    from_point: Annotated[int, Field(alias="from")]
    to_point: Annotated[int, Field(alias="to")]
    length_mm: Positive
    u_um: NotNegative


class ShiftFacts(ArtefactFacts):
    """A shifted artefact lies along an ``axis`` or, a plate, in a ``plane``."""

    axis: Literal["x", "y", "z"] | None = None
    plane: Literal["xy", "yz", "zx"] | None = None
    shifts_mm: list[float] = Field(default_factory=list)
    u_shift_um: NotNegative = 0.0
    known: KnownLength | None = None

    @model_validator(mode="after")
    def _axis_or_plane(self) -> Self:
        if self.plane is not None and (self.axis is not None or self.shifts_mm or self.u_shift_um):
            raise ValueError(
                "plane belongs to a plate that is shifted and turned: its placings are found from the readings; leave out "
                "axis, shifts_mm and u_shift_um, or leave out plane"
            )
        return self


def shift_facts(job: Job) -> ShiftFacts:
    """``[artefact]`` of a shift job."""
    return cast("ShiftFacts", job.facts.artefact)
