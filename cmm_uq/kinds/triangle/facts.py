"""``[artefact]`` of a triangle of gauge blocks and cylinders."""

from __future__ import annotations

from cmm_uq.jobs.artefact import ArtefactFacts
from cmm_uq.jobs.table import Triple, Uncertainty


class TriangleFacts(ArtefactFacts):
    """``blocks_mm`` (1–2, 2–3, 3–1) and the diameters ``cylinders_mm`` (1, 2, 3), with the standard uncertainty of each."""

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
