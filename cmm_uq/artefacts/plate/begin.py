"""A new job of a ball plate or hole plate: three attitudes, two places each."""

from __future__ import annotations

from cmm_uq.jobs.beginning import Beginning

BEGINNING = Beginning(
    title="Ball plate in three attitudes, two places each",
    numbering="One measurement is one place of the plate; its points are the balls or holes.",
    artefact={"name": "Ball plate", "u_um": 0.5, "cte_per_k": 11.5e-6},
    plan={"pitch_mm": 80.0, "repeats": 1},
    columns=dict.fromkeys(("reference_x_mm", "reference_y_mm", "reference_z_mm"), ""),
)
