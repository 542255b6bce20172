"""``[artefact]`` of an artefact that is read in shifted places."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self, cast

from pydantic import Field, model_validator

from cmm_uq.base.files.limits import LISTED
from cmm_uq.base.files.table import Length, Number, Position, Table, Uncertainty
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.tables.artefact import LENGTH_WORDS, ArtefactFacts, CertifiedValue


class KnownLength(Table):
    """A known length between two points of a shifted artefact."""

    from_point: Annotated[Number, Field(alias="from")]
    """Point from which the known length goes."""
    to_point: Annotated[Number, Field(alias="to")]
    """Point to which it goes."""
    length_mm: Length
    """The known length."""
    u_um: Uncertainty
    """Standard uncertainty (k = 1) of the known length."""


class ShiftFacts(ArtefactFacts):
    """A shifted artefact lies along an ``axis`` or, a plate, in a ``plane``."""

    certified_values: ClassVar[tuple[CertifiedValue, ...]] = (
        CertifiedValue("known.length_mm", "known.u_um", LENGTH_WORDS),
    )

    axis: Literal["x", "y", "z"] | None = None
    """Axis along which the artefact is shifted."""
    plane: Literal["xy", "yz", "zx"] | None = None
    """Plane in which a plate is shifted and turned, in place of `axis` and `shifts_mm`."""
    shifts_mm: Annotated[list[Position], Field(max_length=LISTED.most)] = Field(default_factory=list)
    """Nominal shift of each series along the axis."""
    u_shift_um: Uncertainty = 0.0
    """Standard uncertainty of the shifts; where it is not 0 they are estimated."""
    known: KnownLength | None = None
    """A known length between two points of the artefact, for the mean scale of the axis."""

    @model_validator(mode="after")
    def _axis_or_plane(self) -> Self:
        if self.plane is not None and (self.axis is not None or self.shifts_mm or self.u_shift_um):
            raise ValueError(
                "plane belongs to a plate that is shifted and turned: its placings are found from the readings; leave out "
                "axis, shifts_mm and u_shift_um, or leave out plane"
            )
        return self

    @property
    def traced(self) -> bool:
        """See :attr:`ArtefactFacts.traced`: one length may be known."""
        return self.known is not None


def shift_facts(job: Job) -> ShiftFacts:
    """``[artefact]`` of a shift job."""
    return cast("ShiftFacts", job.facts.artefact)
