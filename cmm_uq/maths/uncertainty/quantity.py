"""A result: estimate, standard uncertainty, 95 % interval."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.base.units import Unit


def expanded_of(draws: Floats, value: Floats) -> Floats:
    """U (...) of draws (N, ...) about a value: the larger distance to an end of the 95 % interval."""
    low, high = np.quantile(draws, [0.025, 0.975], axis=0)
    return np.asarray(np.maximum(high - value, value - low))


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
    unit: Unit

    @classmethod
    def of_draws(cls, draws: Floats, unit: Unit, value: float | None = None) -> Quantity:
        """From draws (N,) of a distribution; its mean is the estimate unless one is given."""
        low, high = np.quantile(draws, [0.025, 0.975])
        estimate = float(draws.mean()) if value is None else value
        return cls(estimate, float(draws.std(ddof=1)), (float(low), float(high)), unit)

    @property
    def expanded(self) -> float:
        """Expanded uncertainty U: the larger distance from the value to an end of the 95 % interval."""
        low, high = self.interval95
        return max(high - self.value, self.value - low)

    @property
    def coverage_factor(self) -> float | None:
        """K = U/u; ``None`` where nothing is uncertain."""
        return self.expanded / self.u if self.u > 0 else None

    @property
    def one_sided(self) -> bool:
        """Whether ± U would reach beyond zero where the interval does not: such a quantity is stated by its interval."""
        low, high = self.interval95
        return (low >= 0 > self.value - self.expanded) or (high <= 0 < self.value + self.expanded)

    @property
    def degrees_of_freedom(self) -> float:
        """Of a standard deviation that is known this well: ½·(value/u)² (JCGM 100:2008, E.4.3), at least one."""
        return max(0.5 * (self.value / self.u) ** 2, 1.0) if self.u > 0 else float("inf")

    def at_least(self, expanded: float) -> Quantity:
        """The quantity with this expanded uncertainty (95 %, k = 2) where its own is smaller, else as it is."""
        if self.expanded >= expanded:
            return self
        return Quantity(self.value, expanded / 2, (self.value - expanded, self.value + expanded), self.unit)

    def times(self, factor: float, unit: Unit) -> Quantity:
        """The quantity multiplied by an exact factor, of either sign, in the unit of the product."""
        low, high = sorted(factor * end for end in self.interval95)
        return Quantity(self.value * factor, self.u * abs(factor), (low, high), unit)
