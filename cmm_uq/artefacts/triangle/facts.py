"""``[artefact]`` of a triangle of gauge blocks and cylinders."""

from __future__ import annotations

from typing import ClassVar

from cmm_uq.base.files.table import Triple, Uncertainty
from cmm_uq.jobs.tables.artefact import DIAMETER_WORDS, LENGTH_WORDS, ArtefactFacts, CertifiedValue


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
        """See :attr:`ArtefactFacts.traced`: blocks and cylinders always are certified."""
        return True
