"""Figures as a certificate states them."""

from __future__ import annotations

from collections.abc import Mapping

from cmm_uq.conformity.statement import Statement
from cmm_uq.documents.result import Result
from cmm_uq.model.measurement import ARTEFACT
from cmm_uq.uncertainty.quantity import Quantity
from cmm_uq.uncertainty.rounding import rounded


def expanded(quantity: Quantity) -> tuple[str, str, str]:
    """Value, expanded uncertainty and coverage factor, as text.

    The expanded uncertainty is the larger distance from the value to an end of the 95 % interval, to two significant
    digits; the coverage factor is its ratio to the standard uncertainty.
    """
    low, high = quantity.interval95
    U = max(high - quantity.value, quantity.value - low)
    value, uncertainty = rounded(quantity.value, U)
    return value, uncertainty, f"{U / quantity.u:.2f}" if quantity.u > 0 else "–"


def probability(p: float) -> str:
    """A probability in per cent that never claims certainty."""
    if p < 1e-4:
        return "<\u00a00.01\u00a0%"
    if p > 1 - 1e-4:
        return ">\u00a099.99\u00a0%"
    return f"{100 * p:.{2 if p < 0.5 else 3 if p < 0.999 else 4}g}\u00a0%"


def measured(statement: Statement) -> tuple[str, str]:
    """Value that a statement names and its standard uncertainty, as text; the latter empty where none is known."""
    if statement.u_um > 0:
        return rounded(statement.value_um, statement.u_um)
    return f"{statement.value_um:.4g}", ""


def title_of(key: tuple[str, str], result: Result) -> str:
    """A parameter in words: ``Squareness X–Y``."""
    owner, name = key
    if owner == ARTEFACT:
        return next(size.title for size in result.artefact.sizes if size.name == name)
    effect = next(effect for effect in result.model.effects if effect.name == owner)
    return effect.title if len(effect.reported) == 1 else f"{effect.title}, {name}"


def units_of(result: Result) -> Mapping[tuple[str, str], str]:
    """Unit of every parameter."""
    return {unknown.key: unknown.unit for unknown in result.posterior.unknowns}


def listed(words: list[str]) -> str:
    """Words with commas and an "and"."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
