"""Figures as a certificate states them."""

from __future__ import annotations

from cmm_uq.conformity.statement import Statement
from cmm_uq.documents.result import Result
from cmm_uq.model.measurement import ARTEFACT
from cmm_uq.uncertainty.quantity import Quantity
from cmm_uq.uncertainty.rounding import rounded


def expanded(quantity: Quantity) -> tuple[str, str, str]:
    """Value, expanded uncertainty and coverage factor, as text.

    The expanded uncertainty is given to two significant digits.
    """
    value, uncertainty = rounded(quantity.value, quantity.expanded)
    k = quantity.coverage_factor
    return value, uncertainty, "–" if k is None else f"{k:.2f}"


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


def listed(words: list[str]) -> str:
    """Words with commas and an "and"."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
