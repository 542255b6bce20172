"""A Bryan gauge: where its parts are, its keys, and what a new job begins with."""

from __future__ import annotations

from cmm_uq.jobs.beginning import Beginning
from cmm_uq.machine.model.kind import Kind

BEGINNING = Beginning(
    title="Bryan gauge, a bar swept about a fixed ball",
    numbering="One measurement is one position of the swept ball, which is point 1; the fixed ball is not recorded.",
    artefact={"name": "Swept bar", "length_mm": 250.0, "u_um": 0.5},
    plan={"repeats": 1},
)


KIND = Kind(
    name="bryan",
    observe="cmm_uq.artefacts.bryan.bar:Bryan",
    screen="cmm_uq.artefacts.bryan.bar:SCREENING",
    plan="cmm_uq.artefacts.bryan.bar:PLANNING",
    page="cmm_uq.artefacts.bryan.bar:PAGE",
    begin="cmm_uq.artefacts.bryan.kind:BEGINNING",
)
