"""A step gauge, and where its parts are."""

from __future__ import annotations

from cmm_uq.jobs.artefact import ReferencedFacts
from cmm_uq.model.kind import Kind

KIND = Kind(
    name="step_gauge",
    table=ReferencedFacts,
    observe="cmm_uq.kinds.gauge_lines.observe:StepGauge",
    screen="cmm_uq.kinds.gauge_lines.screen:SCREENING",
    plan="cmm_uq.kinds.step_gauge.plan:PLANNING",
    page="cmm_uq.kinds.gauge_lines.page:PAGE",
    standards=("ISO 10360-2:2009", "VDI/VDE 2617"),
)
