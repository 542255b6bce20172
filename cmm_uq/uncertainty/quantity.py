"""A result: estimate, standard uncertainty, 95 % interval."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmm_uq.points import Floats


@dataclass(frozen=True)
class Quantity:
    """A quantity with its uncertainty.

    Parameters
    ----------
    value, u : estimate and standard uncertainty, in ``unit``.
    interval95 : probabilistically symmetric 95 % coverage interval.
    unit : as printed.
    """

    value: float
    u: float
    interval95: tuple[float, float]
    unit: str

    @classmethod
    def of_draws(cls, draws: Floats, unit: str, value: float | None = None) -> Quantity:
        """From draws (N,) of a distribution; its mean is the estimate unless one is given."""
        low, high = np.quantile(draws, [0.025, 0.975])
        estimate = float(draws.mean()) if value is None else value
        return cls(estimate, float(draws.std(ddof=1)), (float(low), float(high)), unit)

    def times(self, factor: float, unit: str) -> Quantity:
        """The same quantity in another unit; the factor is positive."""
        low, high = self.interval95
        return Quantity(self.value * factor, self.u * factor, (low * factor, high * factor), unit)
