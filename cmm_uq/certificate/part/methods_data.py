"""Other methods on a part, as ``results.json`` has them: values in mm or °, uncertainties likewise, shares from 0 to 1."""

from __future__ import annotations

from math import degrees, isfinite
from typing import Any

from cmm_uq.analysis.parts.by_method import ByMethod, Compared, Comparison, Figure


def methods_data(comparison: Comparison | None) -> dict[str, Any] | None:
    """All of it; ``None`` where the job has no other method."""
    if comparison is None:
        return None
    return {
        "methods": [_method(one) for one in comparison.methods],
        "compared": [_compared(one) for one in comparison.characteristics],
    }


def _method(one: ByMethod) -> dict[str, Any]:
    return {
        "method": one.method,
        "characteristics": [_figure(each) for each in one.figures],
        "conditions": [{"asked": str.__str__(each.text), "met": each.met} for each in one.conditions],
        "seen": dict(one.seen),
    }


def _figure(one: Figure) -> dict[str, Any]:
    def given(value: float | None) -> float | None:
        return degrees(value) if one.angle and value is not None else value

    budget = one.budget
    return {
        "name": one.name, "unit": "°" if one.angle else "mm", "value": given(one.value), "u": given(one.u), "U": given(one.U),
        "k": budget.k, "dof": budget.dof if isfinite(budget.dof) else None, "systematic_error": given(one.systematic),
        "corrected": one.corrected, "u_one_measurement": given(one.single), "scatter": given(one.scatter),
        "budget": [
            {"line": str.__str__(line.name), "depth": depth, "share": share,
             "dof": line.dof if isfinite(line.dof) else None}
            for depth, line, share in budget.flat()
        ],
    }  # fmt: skip


def _compared(one: Compared) -> dict[str, Any]:
    return {
        "name": one.name,
        "normalised_errors": [
            {"one": pair.one, "other": pair.other, "E_n": pair.normalised} for pair in one.pairs
        ],
        "why": [str.__str__(text) for text in one.why],
    }  # fmt: skip
