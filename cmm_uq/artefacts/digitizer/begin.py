"""A new job of a laser digitizer: a reference sphere scanned in three attitudes."""

from __future__ import annotations

from cmm_uq.jobs.beginning import Beginning

BEGINNING = Beginning(
    title="Laser digitizer aligned on a reference sphere in three attitudes",
    numbering="One measurement is one attitude; its points are scanned points of the sphere, or its centre as point 1.",
    artefact={
        "name": "Laser digitizer",
        "length_mm": 25.4,
        "u_um": 0.3,
        "offset_mm": [1.0, 200.0, 130.0],
        "u_attitude_arcsec": 2.0,
        "u_centre_um": [1.0, 1.0, 1.0],
    },
    effects=(),
    plan={"repeats": 2},
    columns={
        "alpha_deg": "First Euler angle (3-1-3) of the digitizer.",
        "beta_deg": "Second Euler angle of the digitizer.",
        "gamma_deg": "Third Euler angle of the digitizer.",
    },
    further={
        "u_mm": "u of a scanned point in the digitizer's scan plane; left out where centres are recorded.",
        "v_mm": "v of a scanned point in the digitizer's scan plane, likewise.",
    },
    noise_um=5.0,
)
