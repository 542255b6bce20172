"""A new job of a test sphere: twenty-five points (ISO 10360-5)."""

from __future__ import annotations

from cmm_uq.jobs.beginning import AT_20_C, Beginning, circumstances

BEGINNING = Beginning(
    title="Test sphere, twenty-five points (ISO 10360-5)",
    numbering="One measurement is one place of the sphere; its points are the points probed.",
    artefact={"name": "Test sphere", "length_mm": 25.0, "u_um": 0.1, "form_um": 0.1},
    effects=("probe_radius", "probe_lobing"),
    conformity={"standard": "ISO 10360-5:2010", "limit_um": 4.0, "rule": "ISO 14253-1"},
    test=circumstances(u_form_um=0.02),
    recorded=AT_20_C,
    plan={"repeats": 1},
    further=dict.fromkeys(("nx", "ny", "nz", "approach_x", "approach_y", "approach_z"), ""),
    noise_um=0.3,
)
