"""``[artefact]`` of a test sphere."""

from __future__ import annotations

from typing import ClassVar

from cmm_uq.base.files.table import Uncertainty
from cmm_uq.jobs.tables.artefact import DIAMETER, FORM_WORDS, ArtefactFacts, CertifiedValue


class SphereFacts(ArtefactFacts):
    """``length_mm`` is the diameter, ``form_um`` the form deviation by the sphere's certificate."""

    form_key: ClassVar[str | None] = "form_um"
    certified_values: ClassVar[tuple[CertifiedValue, ...]] = (
        DIAMETER, CertifiedValue("form_um", "", FORM_WORDS, needed=False),
    )  # fmt: skip

    form_um: Uncertainty | None = None
    """Form deviation of the sphere by its certificate."""
