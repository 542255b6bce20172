"""``[artefact]`` of a probed plane."""

from __future__ import annotations

from cmm_uq.jobs.job import ArtefactFacts, NotNegative, Positive


class PlaneFacts(ArtefactFacts):
    """``probe_offset_mm`` is the effective radius by which the plane of the probe's centres is moved to the surface."""

    probe_offset_mm: Positive | None = None
    u_probe_offset_um: NotNegative = 0.0
