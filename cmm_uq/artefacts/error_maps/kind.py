"""The machine's error maps as a recording, and where its parts are."""

from __future__ import annotations

from cmm_uq.artefacts.error_maps.facts import ErrorMapFacts
from cmm_uq.machine.model.kind import Kind

KIND = Kind(
    name="error_map",
    table=ErrorMapFacts,
    begin="cmm_uq.artefacts.error_maps.begin:BEGINNING",
    check="cmm_uq.artefacts.error_maps.analysis:refuse_unfit",
    own="cmm_uq.artefacts.error_maps.outcome:OWN",
    refusal="error maps cannot be {}: they are free functions, no points of an artefact",
    instead="cmm-uq diagnose JOB compares them with each other",
)
