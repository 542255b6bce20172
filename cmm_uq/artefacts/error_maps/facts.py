"""``[artefact]`` of a job whose recording are the machine's error maps."""

from __future__ import annotations

from typing import ClassVar

from cmm_uq.jobs.tables.artefact import ArtefactFacts, CertifiedValue


class ErrorMapFacts(ArtefactFacts):
    """The maps are named under ``[machine]``."""

    with_recording: ClassVar[bool] = False
    certified_values: ClassVar[tuple[CertifiedValue, ...]] = ()
