"""Gauge blocks, and where their parts are."""

from __future__ import annotations

from cmm_uq.jobs.tables.artefact import ReferencedFacts
from cmm_uq.machine.model.kind import LENGTHS, Kind

KIND = Kind(
    name="gauge_blocks",
    table=ReferencedFacts,
    observe="cmm_uq.artefacts.gauge_lines.observe:GaugeBlocks",
    screen="cmm_uq.artefacts.gauge_lines.screen:SCREENING",
    plan="cmm_uq.artefacts.gauge_blocks.plan:PLANNING",
    page="cmm_uq.artefacts.gauge_lines.page:PAGE",
    begin="cmm_uq.artefacts.gauge_blocks.begin:BEGINNING",
    tested=(LENGTHS,),
)
