"""``[artefact]`` of a probed plane."""

from __future__ import annotations

from cmm_uq.jobs.job import ArtefactFacts
from cmm_uq.jobs.table import Length, Uncertainty


class PlaneFacts(ArtefactFacts):
    """``probe_offset_mm`` is the effective radius by which the plane of the probe's centres is moved to the surface."""

    probe_offset_mm: Length | None = None
    u_probe_offset_um: Uncertainty = 0.0
