"""Faults of the artefact, in its own frame: what turns with the artefact is the artefact.

Each gives displacements (n, 3), mm, of the artefact's true points from where its certificate has them.
"""

from __future__ import annotations

import numpy as np

from benchmarks.second.artefacts import Placed

KINDS = ("pattern", "geometry", "temperature")


def fault(random: np.random.Generator, kind: str, placed: Placed) -> tuple[str, np.ndarray] | None:
    """A fault of a kind, in words, of any size; nothing where the artefact cannot have it."""
    if kind == "pattern":
        return _pattern(random, placed)
    if kind == "geometry":
        return _geometry(random, placed)
    return _temperature(random, placed)


def _turned(placed: Placed, own: np.ndarray) -> np.ndarray:
    """Displacements in the artefact's frame as the machine sees them."""
    return np.einsum("ni,nij->nj", own, placed.axes)


def _pattern(random: np.random.Generator, placed: Placed) -> tuple[str, np.ndarray] | None:
    """Every ball, face or direction has an error of its own."""
    if placed.kind == "ballbar":
        return None
    errors = random.standard_normal((placed.node.max(), 3))[placed.node - 1]
    return "every node an error of its own", _turned(placed, errors)


def _geometry(random: np.random.Generator, placed: Placed) -> tuple[str, np.ndarray] | None:
    """A plate as a machine would have made it that is out of square, stretched or bowed; a gauge stretched unevenly."""
    if placed.kind not in ("plate", "step_gauge"):
        return None
    x, y = (placed.own[:, :2] / np.abs(placed.own).max()).T
    zero = np.zeros_like(x)
    forms = {
        "out of square": [-y, zero, zero],
        "one side stretched": [x, zero, zero],
        "bowed in its plane": [zero, 1 - (2 * x - 1) ** 2, zero],
        "bent": [zero, zero, 1 - (2 * x - 1) ** 2],
        "twisted": [zero, zero, x * y],
    }
    if placed.kind == "step_gauge":
        forms = {"stretched unevenly": [x**2 - x, zero, zero]}
    name = str(random.choice(sorted(forms)))
    return name, _turned(placed, np.column_stack(forms[name]))


def _temperature(random: np.random.Generator, placed: Placed) -> tuple[str, np.ndarray] | None:
    """Warmer or colder than it was taken for, always by as much or by another amount in every set-up."""
    if placed.kind == "sphere":
        return None
    longer = _turned(placed, placed.own)
    if random.random() < 0.6:
        return "another temperature", longer
    by = random.standard_normal(placed.measurement.max())[placed.measurement - 1]
    return "another temperature in every set-up", by[:, None] * longer
