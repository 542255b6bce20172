"""An axis or a plane calibrated by shifting an artefact: one kind, its keys, its beginning, what is refused."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self, cast

import numpy as np
from pydantic import Field, model_validator

from cmm_uq.base.files.limits import LISTED
from cmm_uq.base.files.table import JobTable, Length, Number, Position, Uncertainty
from cmm_uq.base.points import AXES, Machine, Points
from cmm_uq.jobs.beginning import Beginning
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.tables.artefact import LENGTH_WORDS, ArtefactFacts, CertifiedValue
from cmm_uq.machine.model.kind import Kind


class KnownLength(JobTable):
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
        return self.known is not None


def shift_facts(job: Job) -> ShiftFacts:
    return cast("ShiftFacts", job.facts.artefact)


SIDE, PITCH = 3, 150.0  # balls along a side of the plate, and their distance, mm

# shift of the plate's middle along x and y, mm, and turn, °: enough to part the plate from the machine
PLACINGS = ((0.0, 0.0, 0.0), (150.0, 0.0, 0.0), (0.0, 150.0, 0.0), (0.0, 0.0, 90.0))

AXIS = Beginning(
    title="Self-calibration of an axis by shifting an uncalibrated gauge",
    numbering="One measurement is one series, at one shift; its points are those of the gauge.",
    artefact={
        "name": "Step gauge, uncalibrated but for its length",
        "axis": "x",
        "shifts_mm": [0.0, 20.0, 50.0],
        "u_shift_um": 100.0,
        "known": {"from": 1, "to": 21, "length_mm": 400.0, "u_um": 0.5},
    },
    effects=(),
    plan={"repeats": 3},
)


def placed_plate(machine: Machine) -> Points:
    """A square plate of balls about the middle of the plane xy, in every placing."""
    steps = PITCH * (np.arange(SIDE) - 0.5 * (SIDE - 1))
    balls = np.column_stack([part.ravel() for part in np.meshgrid(steps, steps)])
    middle = np.array([np.mean(machine.travel(axis)) for axis in AXES]) - machine.origin_mm
    parts = []
    for dx, dy, degrees in PLACINGS:
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        flat = balls @ np.array([[c, s], [-s, c]]) + [dx - 25.0, dy - 25.0]
        parts.append(np.column_stack([flat, np.zeros(len(flat))]) + middle)
    count, n = len(balls), len(balls) * len(PLACINGS)
    return Points(
        np.vstack(parts),
        np.repeat(np.arange(1, len(PLACINGS) + 1), count),
        np.tile(np.arange(1, count + 1), len(PLACINGS)),
        np.ones(n, dtype=np.int64),
        machine,
    )


PLANE = Beginning(
    title="Self-calibration of a plane by shifting and turning an uncalibrated plate",
    numbering="One measurement is one placing of the plate; its points are the balls.",
    artefact={
        "name": "Ball plate, uncalibrated but for its diagonal",
        "plane": "xy",
        "known": {"from": 1, "to": SIDE**2, "length_mm": round(PITCH * (SIDE - 1) * 2**0.5, 4), "u_um": 0.5},
    },
    effects=(),
    points=placed_plate,
)


KIND = Kind(
    name="shift",
    table=ShiftFacts,
    plan="cmm_uq.artefacts.shift_axis.plan:PLANNING",
    begin="cmm_uq.artefacts.shifting.kind:AXIS",
    begin_also={"shift_plate": "cmm_uq.artefacts.shifting.kind:PLANE"},
    check="cmm_uq.artefacts.shifting.analysis:refuse_unfit",
    own="cmm_uq.artefacts.shifting.analysis:OWN",
    refusal="a shift job cannot be {}: its machine error is a free function, no list of effects",
    instead="cmm-uq report JOB estimates it",
)
