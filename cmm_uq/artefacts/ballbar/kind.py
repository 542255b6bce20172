"""A ballbar: where its parts are, its keys, and what a new job begins with."""

from __future__ import annotations

from cmm_uq.jobs.beginning import AT_20_C, Beginning, circumstances
from cmm_uq.machine.model.kind import BARS, LENGTHS, Kind

BEGINNING = Beginning(
    title="Ballbar in twenty positions (ASME B89.4.1)",
    numbering="One measurement is one position of the bar; points 1 and 2 are the centres of its balls.",
    artefact={"name": "Ballbar", "length_mm": 400.0, "u_um": 0.5, "cte_per_k": 11.5e-6},
    conformity={"standard": "ASME B89.4.1-1997", "limit_um": 10.0, "rule": "ISO 14253-1"},
    test=circumstances(u_repeat_um=0.1),
    recorded=AT_20_C,
    plan={"repeats": 1},
)


KIND = Kind(
    name="ballbar",
    observe="cmm_uq.artefacts.ballbar.bar:Ballbar",
    screen="cmm_uq.artefacts.ballbar.bar:SCREENING",
    plan="cmm_uq.artefacts.ballbar.bar:PLANNING",
    page="cmm_uq.artefacts.ballbar.bar:PAGE",
    begin="cmm_uq.artefacts.ballbar.kind:BEGINNING",
    tested=(BARS, LENGTHS),
)
