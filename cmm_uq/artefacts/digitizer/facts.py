"""``[artefact]`` of a laser digitizer that is aligned on a reference sphere."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from cmm_uq.base.files.table import Triple, Uncertainty
from cmm_uq.jobs.tables.artefact import DIAMETER, ArtefactFacts, CertifiedValue

Uncertainties = Annotated[list[Uncertainty], Field(min_length=3, max_length=3)]
"""Of x, y, z."""


class AlignmentFacts(ArtefactFacts):
    """``length_mm`` is the diameter of the reference sphere, for a recording of scans.

    Attributes
    ----------
    offset_mm : [U1 V1 W1] by the drawing, to hold the result against and to plan by.
    u_attitude_arcsec : standard uncertainty of the attitude in one measurement, about each axis of the machine.
    u_centre_um : standard uncertainties, along x, y, z of the machine, of what shifts the sphere's centre as found in one
        measurement as a whole, however many points it has: the ball's form, the digitizer, the scales.
    """

    carries_probe: ClassVar[bool] = True
    certified_values: ClassVar[tuple[CertifiedValue, ...]] = (DIAMETER,)

    offset_mm: Triple | None = None
    """[U1, V1, W1] by the drawing, to hold the result against and to plan by; it is not taken as known."""
    u_attitude_arcsec: Annotated[float, Field(ge=0, le=36_000)] = 0.0
    """Standard uncertainty of the attitude in one measurement, about each axis of the machine."""
    u_centre_um: Uncertainties = Field(default_factory=lambda: [0.0, 0.0, 0.0])
    """Standard uncertainties along x, y, z of what shifts the sphere's centre as a whole in one measurement: form,
    digitizer, scales."""
