"""``[artefact]`` of a test sphere."""

from __future__ import annotations

from cmm_uq.jobs.job import ArtefactFacts, NotNegative


class SphereFacts(ArtefactFacts):
    """``length_mm`` is the diameter, ``form_um`` the form deviation by the sphere's certificate."""

    form_um: NotNegative | None = None
