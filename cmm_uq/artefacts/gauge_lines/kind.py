"""Step gauges and gauge blocks: where their parts are, and what a new job of them begins with."""

from __future__ import annotations

from typing import Any

from cmm_uq.jobs.beginning import AT_20_C, SIX, Beginning, circumstances
from cmm_uq.jobs.tables.artefact import ReferencedFacts
from cmm_uq.machine.model.kind import LENGTHS, Kind


def _beginning(effects: tuple[str, ...], further: tuple[str, ...], **others: Any) -> Beginning:
    return Beginning(
        effects=(*SIX, *effects),
        conformity={"standard": "ISO 10360-2:2009", "mpe": "4 + L/100", "rule": "ISO 14253-1"},
        test=circumstances(u_cte_per_k=1e-6, u_temperature_k=0.1, u_alignment_um=0.1, u_fixturing_um=0.1),
        recorded=AT_20_C,
        plan={"lengths_mm": [20.0, *(100.0 * i for i in range(1, 10))], "repeats": 3},
        columns={"reference_mm": ""},
        further=dict.fromkeys(further, ""),
        **others,
    )


GAUGE_OF_STEPS = _beginning(
    ("hysteresis_x", "hysteresis_y", "hysteresis_z"), ("approach_x", "approach_y", "approach_z"),
    title="Step gauge on seven lines (ISO 10360-2)", artefact={"name": "Step gauge", "u_um": 0.4, "cte_per_k": 11.5e-6},
    numbering="One measurement is one line; its points are the faces, numbered as they are met, again where met again.",
)  # fmt: skip
BLOCKS = _beginning(
    ("probe_radius",), ("approach_x", "approach_y", "approach_z", "nx", "ny", "nz"),
    title="Gauge blocks on seven lines (ISO 10360-2)", artefact={"name": "Gauge blocks", "u_um": 0.15, "cte_per_k": 11.5e-6},
    numbering="One measurement is one block in one place; points 1 and 2 are its outer faces.",
)  # fmt: skip


def _kind(name: str, artefact: str, planning: str, beginning: Beginning) -> Kind:
    room = "cmm_uq.artefacts.gauge_lines"
    return Kind(
        name, ReferencedFacts, f"{room}.observe:{artefact}", f"{room}.observe:SCREENING", f"{room}.plan:{planning}",
        f"{room}.page:PAGE", beginning, tested=(LENGTHS,),
    )  # fmt: skip


STEP_GAUGE = _kind("step_gauge", "StepGauge", "STEP_GAUGE", GAUGE_OF_STEPS)
GAUGE_BLOCKS = _kind("gauge_blocks", "GaugeBlocks", "GAUGE_BLOCKS", BLOCKS)
