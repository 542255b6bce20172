"""What a new job of a part begins with: a plate with a bore, on three datum planes; every figure is an example."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

_GRID = {"pattern": "grid", "rows": 3, "columns": 4, "margin_mm": 5.0}


def _plane(
    name: str, point: list[float], direction: list[float], along: list[float], length: float, width: float
) -> Any:
    return {
        "name": name, "kind": "plane", "point_mm": point, "direction": direction, "along": along, "length_mm": length,
        "width_mm": width, "strategy": _GRID,
    }  # fmt: skip


TABLES: Mapping[str, Any] = MappingProxyType({
    "part": {"name": "Plate", "drawing": "", "cte_per_k": 11.5e-6, "u_cte_per_k": 0.5e-6},
    "machine_state": {"certificate": "machine"},
    "stylus": [
        {"name": "down", "diameter_mm": 4.0, "offset_mm": [0.0, 0.0, -150.0], "u_diameter_um": 0.3, "lobing_um": 0.3},
    ],
    "feature": [
        _plane("A", [60.0, 40.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], 120.0, 80.0),
        _plane("B", [60.0, 0.0, -10.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0], 120.0, 20.0),
        _plane("C", [0.0, 40.0, -10.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 80.0, 20.0),
        {
            "name": "bore", "kind": "cylinder", "point_mm": [60.0, 40.0, -10.0], "direction": [0.0, 0.0, 1.0],
            "diameter_mm": 30.0, "inner": True, "length_mm": 20.0,
            "strategy": {"pattern": "sections", "sections": 3, "points": 8, "margin_mm": 4.0},
        },
    ],
    "alignment": {"datums": ["A", "B", "C"]},
    "environment": {"u_part_k": 0.1, "u_scales_k": 0.1},
    "form": {"field_um": 1.0, "roughness_um": 0.2},
    "characteristic": [
        {"name": "1", "what": "size", "features": ["bore"], "lower_mm": 29.95, "upper_mm": 30.05},
        {"name": "2", "what": "position", "features": ["bore"], "datums": ["A", "B", "C"], "tolerance_mm": 0.1},
        {"name": "3", "what": "perpendicularity", "features": ["bore"], "datums": ["A"], "tolerance_mm": 0.05},
        {"name": "4", "what": "flatness", "features": ["A"], "tolerance_mm": 0.02},
        {"name": "5", "what": "distance", "features": ["bore", "B"], "lower_mm": 39.95, "upper_mm": 40.05},
    ],
})  # fmt: skip
"""Tables of job.toml but ``[job]``."""
