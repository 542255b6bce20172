"""A new job of a Bryan gauge: a bar swept about a fixed ball."""

from __future__ import annotations

from cmm_uq.jobs.beginning import Beginning

BEGINNING = Beginning(
    title="Bryan gauge, a bar swept about a fixed ball",
    numbering="One measurement is one position of the swept ball, which is point 1; the fixed ball is not recorded.",
    artefact={"name": "Swept bar", "length_mm": 250.0, "u_um": 0.5},
    plan={"repeats": 1},
)
