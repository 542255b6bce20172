"""A laser digitizer aligned on a reference sphere, and where its parts are."""

from __future__ import annotations

from cmm_uq.kinds.digitizer.facts import AlignmentFacts
from cmm_uq.model.kind import Kind

KIND = Kind(
    name="digitizer",
    table=AlignmentFacts,
    observe="cmm_uq.kinds.digitizer.observe:Digitizer",
    screen="cmm_uq.kinds.digitizer.screen:SCREENING",
    plan="cmm_uq.kinds.digitizer.plan:PLANNING",
    page="cmm_uq.kinds.digitizer.page:PAGE",
    begin="cmm_uq.kinds.digitizer.begin:BEGINNING",
)
