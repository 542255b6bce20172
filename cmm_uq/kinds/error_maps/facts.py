"""``[artefact]`` of a job whose recording are the machine's error maps."""

from __future__ import annotations

from typing import ClassVar

from cmm_uq.jobs.artefact import ArtefactFacts


class ErrorMapFacts(ArtefactFacts):
    """The maps are named under ``[machine]``."""

    with_recording: ClassVar[bool] = False
