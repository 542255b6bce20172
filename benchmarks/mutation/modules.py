"""What is studied: the modules whose figures and decisions go on a certificate or choose a plan."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parents[2]
KEEP = ROOT / "reports" / "mutation"

_BY_ROOM = {
    "analysis/conformity": "decision standards accuracy statement limits plan_conditions uncertainty decided",
    "analysis/diagnosis": "comparison/evidence comparison/conditional comparison/algebra held_out location power",
    "analysis/planning": "identifiability information suggestion",
    "certificate": "wording",
    "maths/inference": "linear_model posterior",
    "maths/uncertainty": "quantity coverage distributions",
}  # fmt: skip
MODULES = tuple(f"cmm_uq/{room}/{name}.py" for room, names in _BY_ROOM.items() for name in names.split())
