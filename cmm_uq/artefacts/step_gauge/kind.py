"""The kind of a step gauge: where its parts are, and what a new job of it begins with."""

from __future__ import annotations

from cmm_uq.jobs.beginning import AT_20_C, SIX, Beginning, circumstances
from cmm_uq.jobs.tables.artefact import ReferencedFacts
from cmm_uq.machine.model.kind import LENGTHS, Kind

BEGINNING = Beginning(
    title="Step gauge on seven lines (ISO 10360-2)",
    numbering="One measurement is one line; its points are the faces, numbered as they are met, again where met again.",
    artefact={"name": "Step gauge", "u_um": 0.4, "cte_per_k": 11.5e-6},
    effects=(*SIX, "hysteresis_x", "hysteresis_y", "hysteresis_z"),
    conformity={"standard": "ISO 10360-2:2009", "mpe": "4 + L/100", "rule": "ISO 14253-1"},
    test=circumstances(u_cte_per_k=1e-6, u_temperature_k=0.1, u_alignment_um=0.1, u_fixturing_um=0.1),
    recorded=AT_20_C,
    plan={"lengths_mm": [20.0, *(100.0 * i for i in range(1, 10))], "repeats": 3},
    columns={"reference_mm": ""},
    further=dict.fromkeys(("approach_x", "approach_y", "approach_z"), ""),
)


KIND = Kind(
    name="step_gauge",
    table=ReferencedFacts,
    observe="cmm_uq.artefacts.gauge_lines.observe:StepGauge",
    screen="cmm_uq.artefacts.gauge_lines.observe:SCREENING",
    plan="cmm_uq.artefacts.step_gauge.plan:PLANNING",
    page="cmm_uq.artefacts.gauge_lines.page:PAGE",
    begin="cmm_uq.artefacts.step_gauge.kind:BEGINNING",
    tested=(LENGTHS,),
)
