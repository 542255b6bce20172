"""A laser digitizer aligned on a reference sphere: where its parts are, its keys, and what a new job begins with."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from cmm_uq.base.files.table import Triple, Uncertainty
from cmm_uq.jobs.beginning import Beginning
from cmm_uq.jobs.tables.artefact import DIAMETER, ArtefactFacts, CertifiedValue
from cmm_uq.machine.model.kind import Kind

Uncertainties = Annotated[list[Uncertainty], Field(min_length=3, max_length=3)]  # of x, y, z


class ReferenceSphereFacts(ArtefactFacts):
    """``length_mm`` is the diameter of the reference sphere, for a recording of scans.

    ``offset_mm`` [U1 V1 W1] by the drawing, to hold the result against and to plan by; ``u_attitude_arcsec`` standard
    uncertainty of the attitude in one measurement, about each axis of the machine; ``u_centre_um`` standard
    uncertainties, along x, y, z of the machine, of what shifts the sphere's centre as found in one measurement as a
    whole, however many points it has: the ball's form, the digitizer, the scales.
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


BEGINNING = Beginning(
    title="Laser digitizer aligned on a reference sphere in three attitudes",
    numbering="One measurement is one attitude; its points are scanned points of the sphere, or its centre as point 1.",
    artefact={
        "name": "Laser digitizer",
        "length_mm": 25.4,
        "u_um": 0.3,
        "offset_mm": [1.0, 200.0, 130.0],
        "u_attitude_arcsec": 2.0,
        "u_centre_um": [1.0, 1.0, 1.0],
    },
    effects=(),
    plan={"repeats": 2},
    columns={
        "alpha_deg": "First Euler angle (3-1-3) of the digitizer.",
        "beta_deg": "Second Euler angle of the digitizer.",
        "gamma_deg": "Third Euler angle of the digitizer.",
    },
    further={
        "u_mm": "u of a scanned point in the digitizer's scan plane; left out where centres are recorded.",
        "v_mm": "v of a scanned point in the digitizer's scan plane, likewise.",
    },
    noise_um=5.0,
)


KIND = Kind(
    name="digitizer",
    table=ReferenceSphereFacts,
    observe="cmm_uq.artefacts.digitizer.observe:DigitizerArtefact",
    screen="cmm_uq.artefacts.digitizer.observe:SCREENING",
    plan="cmm_uq.artefacts.digitizer.plan:PLANNING",
    page="cmm_uq.artefacts.digitizer.page:PAGE",
    begin="cmm_uq.artefacts.digitizer.kind:BEGINNING",
)
