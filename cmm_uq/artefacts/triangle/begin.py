"""A new job of a triangle of gauge blocks and cylinders: its seven placings."""

from __future__ import annotations

from cmm_uq.jobs.beginning import Beginning

BEGINNING = Beginning(
    title="Triangle of gauge blocks and cylinders in seven placings",
    numbering="One measurement is one placing; points 1, 2 and 3 are the centres of the cylinders.",
    artefact={
        "name": "Triangle of gauge blocks and cylinders",
        "cte_per_k": 11.5e-6,
        "blocks_mm": [380.0, 280.0, 340.0],
        "u_blocks_um": 0.1,
        "cylinders_mm": [20.0, 20.0, 20.0],
        "u_cylinders_um": 0.1,
    },
    plan={"repeats": 3},
    further=dict.fromkeys(("tip_x_mm", "tip_y_mm", "tip_z_mm"), ""),
    noise_um=0.3,
)
