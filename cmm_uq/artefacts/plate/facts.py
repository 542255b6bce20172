"""``[artefact]`` of a ball plate or hole plate."""

from __future__ import annotations

from typing import ClassVar

from cmm_uq.jobs.tables.artefact import ReferencedFacts


class PlateFacts(ReferencedFacts):
    """Two recordings of a plate at two dates can be compared."""

    with_earlier: ClassVar[bool] = True
