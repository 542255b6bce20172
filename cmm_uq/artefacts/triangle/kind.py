"""A triangle of gauge blocks and cylinders: where its parts are, its keys, and what a new job begins with."""

from __future__ import annotations

from typing import ClassVar

from cmm_uq.base.files.table import Triple, Uncertainty
from cmm_uq.jobs.beginning import Beginning
from cmm_uq.jobs.tables.artefact import DIAMETER_WORDS, LENGTH_WORDS, ArtefactFacts, CertifiedValue
from cmm_uq.machine.model.kind import Kind


class TriangleFacts(ArtefactFacts):
    """``blocks_mm`` (1–2, 2–3, 3–1) and the diameters ``cylinders_mm`` (1, 2, 3), with the standard uncertainty of each."""

    certified_values: ClassVar[tuple[CertifiedValue, ...]] = (
        CertifiedValue("blocks_mm", "u_blocks_um", LENGTH_WORDS, count=3),
        CertifiedValue("cylinders_mm", "u_cylinders_um", DIAMETER_WORDS, count=3),
    )

    blocks_mm: Triple
    """Lengths of the gauge blocks 1–2, 2–3 and 3–1."""
    u_blocks_um: Uncertainty = 0.0
    """Standard uncertainty of each block."""
    cylinders_mm: Triple
    """Diameters of the cylinders 1, 2 and 3."""
    u_cylinders_um: Uncertainty = 0.0
    """Standard uncertainty of each diameter."""

    @property
    def traced(self) -> bool:
        return True


BEGINNING = Beginning(
    title="Triangle of gauge blocks and cylinders in seven placings",
    numbering="One measurement is one placing; points 1, 2 and 3 are the centres of the cylinders.",
    artefact={
        "name": "Triangle of gauge blocks and cylinders",
        "cte_per_k": 11.5e-6,
        "blocks_mm": [380.0, 280.0, 340.0],
        "u_blocks_um": 0.1,
        "cylinders_mm": [20.0, 20.0, 20.0],
        "u_cylinders_um": 0.1,
    },
    plan={"repeats": 3},
    further=dict.fromkeys(("tip_x_mm", "tip_y_mm", "tip_z_mm"), ""),
    noise_um=0.3,
)


KIND = Kind(
    name="triangle",
    table=TriangleFacts,
    observe="cmm_uq.artefacts.triangle.observe:Triangle",
    screen="cmm_uq.artefacts.triangle.observe:SCREENING",
    plan="cmm_uq.artefacts.triangle.observe:PLANNING",
    page="cmm_uq.artefacts.triangle.page:PAGE",
    begin="cmm_uq.artefacts.triangle.kind:BEGINNING",
)
