"""A test sphere: where its parts are, its keys, and what a new job begins with."""

from __future__ import annotations

from typing import ClassVar

from cmm_uq.base.files.table import Uncertainty
from cmm_uq.jobs.beginning import AT_20_C, Beginning, circumstances
from cmm_uq.jobs.tables.artefact import DIAMETER, FORM_WORDS, ArtefactFacts, CertifiedValue
from cmm_uq.machine.model.kind import FORMS, Kind


class SphereFacts(ArtefactFacts):
    """``length_mm`` is the diameter, ``form_um`` the form deviation by the sphere's certificate."""

    form_key: ClassVar[str | None] = "form_um"
    certified_values: ClassVar[tuple[CertifiedValue, ...]] = (
        DIAMETER, CertifiedValue("form_um", "", FORM_WORDS, needed=False),
    )  # fmt: skip

    form_um: Uncertainty | None = None
    """Form deviation of the sphere by its certificate."""


BEGINNING = Beginning(
    title="Test sphere, twenty-five points (ISO 10360-5)",
    numbering="One measurement is one place of the sphere; its points are the points probed.",
    artefact={"name": "Test sphere", "length_mm": 25.0, "u_um": 0.1, "form_um": 0.1},
    effects=("probe_radius", "probe_lobing"),
    conformity={"standard": "ISO 10360-5:2010", "limit_um": 4.0, "rule": "ISO 14253-1"},
    test=circumstances(u_form_um=0.02),
    recorded=AT_20_C,
    plan={"repeats": 1},
    further=dict.fromkeys(("nx", "ny", "nz", "approach_x", "approach_y", "approach_z"), ""),
    noise_um=0.3,
)


KIND = Kind(
    name="sphere",
    table=SphereFacts,
    observe="cmm_uq.artefacts.sphere.ball:SphereArtefact",
    screen="cmm_uq.artefacts.sphere.ball:SCREENING",
    plan="cmm_uq.artefacts.sphere.ball:PLANNING",
    page="cmm_uq.artefacts.sphere.ball:PAGE",
    begin="cmm_uq.artefacts.sphere.kind:BEGINNING",
    tested=(FORMS,),
)
