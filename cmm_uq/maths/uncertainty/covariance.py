"""How estimates vary together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cmm_uq.base.points import Floats


@dataclass(frozen=True, eq=False)
class Covariance:
    """Covariance of several estimates.

    Parameters
    ----------
    parameters : k names.
    units : of each, as printed.
    matrix : (k, k); an element is in the product of the units of its row and column.
    """

    parameters: tuple[str, ...]
    units: tuple[str, ...]
    matrix: Floats

    @classmethod
    def of_draws(cls, draws: Mapping[str, tuple[Floats, str]]) -> Covariance:
        """From joint draws (N,) of each parameter and its unit, by name."""
        columns = np.array([values for values, _ in draws.values()])
        matrix = np.atleast_2d(np.cov(columns)) if len(columns) else np.zeros((0, 0))
        return cls(tuple(draws), tuple(unit for _, unit in draws.values()), np.asarray(matrix, dtype=np.float64))
