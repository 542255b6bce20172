"""What is studied: the modules whose figures and decisions go on a certificate or choose a plan."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parents[2]
KEEP = ROOT / "reports" / "mutation"

_BY_ROOM = {
    "conformity": "decision risk standards accuracy statement tolerances consequences length_conditions bar_conditions "
                  "sphere_conditions orientation_conditions measurement_lines plan_conditions copies rated remeasured "
                  "shared_causes lengths_decided spheres_decided bars_decided",
    "documents": "wording",
    "uncertainty": "quantity rounding coverage_intervals degrees_of_freedom shapes",
    "inference": "least_squares linear_model posterior effective",
    "diagnosis": "comparison/evidence comparison/given comparison/precision held_out location power",
    "planning": "exchange identifiability information separation suggestion",
}  # fmt: skip
MODULES = tuple(f"cmm_uq/{room}/{name}.py" for room, names in _BY_ROOM.items() for name in names.split())
