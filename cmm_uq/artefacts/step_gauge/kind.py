"""A step gauge, and where its parts are."""

from __future__ import annotations

from cmm_uq.jobs.tables.artefact import ReferencedFacts
from cmm_uq.machine.model.kind import LENGTHS, Kind

KIND = Kind(
    name="step_gauge",
    table=ReferencedFacts,
    observe="cmm_uq.artefacts.gauge_lines.observe:StepGauge",
    screen="cmm_uq.artefacts.gauge_lines.screen:SCREENING",
    plan="cmm_uq.artefacts.step_gauge.plan:PLANNING",
    page="cmm_uq.artefacts.gauge_lines.page:PAGE",
    begin="cmm_uq.artefacts.step_gauge.begin:BEGINNING",
    tested=(LENGTHS,),
)
