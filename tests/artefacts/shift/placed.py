"""Recordings of a plate in several placings on machines whose parametric errors are known."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from cmm_uq.base.points import AXES, Floats, Machine, Points
from cmm_uq.machine.physics.kinematics import first_order

Parametric = Callable[[Floats], tuple[Floats, Floats]]
"""Scale readings (n, 3) to errors of the carriages (n, 3, 6) and squareness (3,)."""

GRID = np.column_stack([part.ravel() for part in np.meshgrid(*[100.0 * np.arange(4)] * 2)])
SHIFTED = ((150.0, 150.0, 0.0), (190.0, 150.0, 0.0), (150.0, 190.0, 0.0))
"""First and second coordinate of the plate's origin, mm, and turn, degrees."""
TURNED = (*SHIFTED, (240.0, 200.0, 0.0), (510.0, 170.0, 90.0), (500.0, 480.0, 180.0))


def read(
    parametric: Parametric, plane: str, chain: str, placings: Sequence[tuple[float, float, float]], noise: float = 0.0,
    seed: int = 0, balls: Floats = GRID, kinematics: Callable[..., Floats] = first_order,
) -> Points:  # fmt: skip
    """Readings r with r + e(r) at the balls' true places, the third axis at 50 mm."""
    random = np.random.default_rng(seed)
    axes = [AXES.index(a) for a in plane]
    rows, numbers = [], []
    for s, (first, second, degrees) in enumerate(placings, 1):
        c, t = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        true = np.full((len(balls), 3), 50.0)
        true[:, axes] = balls @ np.array([[c, t], [-t, c]]) + [first, second]
        ideal = true
        for _ in range(8 if kinematics is first_order else 30):
            errors, squareness = parametric(ideal)
            ideal = true - kinematics(ideal, errors, squareness, chain=chain)
        rows.append(ideal + random.normal(0, noise, ideal.shape) * np.isin(np.arange(3), axes))
        numbers += [(s, p) for p in range(1, len(balls) + 1)]
    measurement, point = np.array(numbers).T
    return Points(
        np.vstack(rows), measurement, point, np.ones_like(point), Machine(chain=chain),
        lines=np.arange(2, len(numbers) + 2),
    )  # fmt: skip


def bent(readings: Floats) -> tuple[Floats, Floats]:
    """Every carriage with linearity, two straightnesses and three rotations of simple shapes; three squarenesses."""
    errors = np.zeros((len(readings), 3, 6))
    for carriage in range(3):
        u = readings[:, carriage] / 300 - 1
        for k in range(3):
            errors[:, carriage, k] = 1e-3 * (3 - carriage + k) * np.cos(1.5 * u + carriage + k)
            errors[:, carriage, 3 + k] = 1e-5 * np.sin(1.2 * u + carriage - k)
        errors[:, carriage, carriage] += (20e-6 - 15e-6 * carriage) * readings[:, carriage]
    return errors, np.array([60e-6, -40e-6, 25e-6])


def none(readings: Floats) -> tuple[Floats, Floats]:
    """No errors at all."""
    return np.zeros((len(readings), 3, 6)), np.zeros(3)
