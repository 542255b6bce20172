"""``[artefact]`` of a triangle of gauge blocks and cylinders."""

from __future__ import annotations

from cmm_uq.jobs.artefact import ArtefactFacts
from cmm_uq.jobs.table import Triple, Uncertainty


class TriangleFacts(ArtefactFacts):
    """``blocks_mm`` (1–2, 2–3, 3–1) and the diameters ``cylinders_mm`` (1, 2, 3), with the standard uncertainty of each."""

    blocks_mm: Triple
    u_blocks_um: Uncertainty = 0.0
    cylinders_mm: Triple
    u_cylinders_um: Uncertainty = 0.0

    @property
    def traced(self) -> bool:
        """See :attr:`ArtefactFacts.traced`: blocks and cylinders always are certified."""
        return True
