"""A laser digitizer aligned on a reference sphere, and where its parts are."""

from __future__ import annotations

from cmm_uq.artefacts.digitizer.facts import AlignmentFacts
from cmm_uq.machine.model.kind import Kind

KIND = Kind(
    name="digitizer",
    table=AlignmentFacts,
    observe="cmm_uq.artefacts.digitizer.observe:Digitizer",
    screen="cmm_uq.artefacts.digitizer.screen:SCREENING",
    plan="cmm_uq.artefacts.digitizer.plan:PLANNING",
    page="cmm_uq.artefacts.digitizer.page:PAGE",
    begin="cmm_uq.artefacts.digitizer.begin:BEGINNING",
)
