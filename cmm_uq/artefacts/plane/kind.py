"""A probed plane: where its parts are, its keys, and what a new job begins with."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from cmm_uq.base.files.table import Length, Uncertainty
from cmm_uq.jobs.beginning import Beginning
from cmm_uq.jobs.tables.artefact import ArtefactFacts, CertifiedValue
from cmm_uq.machine.model.kind import Kind


class PlaneFacts(ArtefactFacts):
    """``probe_offset_mm`` is the effective radius by which the plane of the probe's centres is moved to the surface.

    ``acceptance_deg`` is the largest angle between the normal and the direction of approach at which that is believed.
    """

    certified_values: ClassVar[tuple[CertifiedValue, ...]] = ()

    probe_offset_mm: Length | None = None
    """Effective radius of the probe, by which the plane of its centres is moved to the surface."""
    u_probe_offset_um: Uncertainty = 0.0
    """Standard uncertainty of the probe's effective radius."""
    acceptance_deg: Annotated[float, Field(ge=0.01, le=89.99)] = 60.0
    """Largest angle between the normal and the direction of approach at which the radius is believed."""


BEGINNING = Beginning(
    title="Surface plate, a grid of points",
    numbering="One measurement is one place of the surface; point 0, where there is one, lies just before contact.",
    artefact={"name": "Surface plate"},
    effects=("straightness_x_z", "straightness_y_z"),
    plan={"grid": [7, 7], "repeats": 2},
)


KIND = Kind(
    name="plane",
    table=PlaneFacts,
    observe="cmm_uq.artefacts.plane.surface:PlaneSurface",
    screen="cmm_uq.artefacts.plane.surface:SCREENING",
    plan="cmm_uq.artefacts.plane.surface:PLANNING",
    page="cmm_uq.artefacts.plane.surface:PAGE",
    begin="cmm_uq.artefacts.plane.kind:BEGINNING",
)
