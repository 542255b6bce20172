"""Is the law of propagation good enough here? Monte Carlo says (JCGM 101:2008 clause 8).

The interval value ± U of the law of propagation is compared with Monte Carlo's probabilistically symmetric one. The ends
may differ by the numerical tolerance δ, half a unit of the last digit of u that is regarded as meaningful. Monte Carlo's
own error must not decide: trials are made until every comparison is clear of it by two standard errors, or the error is
below δ/5 (8.2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import Floats
from cmm_uq.maths.uncertainty.degrees_of_freedom import coverage_factor
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.monte_carlo import LARGEST, Simulated, numerical_tolerance, simulate_adaptively
from cmm_uq.maths.uncertainty.propagation import Propagated
from cmm_uq.maths.uncertainty.rounding import figure

_OF_TOLERANCE = 5.0


@dataclass(frozen=True)
class Comparison:
    """Interval of the law of propagation against that of Monte Carlo, for one output.

    Parameters
    ----------
    low, high : differences of the lower and the upper ends.
    tolerance : δ.
    error : standard error of Monte Carlo's ends, the larger of the two.
    """

    low: float
    high: float
    tolerance: float
    error: float

    @property
    def agrees(self) -> bool:
        """Whether both ends agree within δ."""
        return max(self.low, self.high) <= self.tolerance

    @property
    def clear(self) -> bool:
        """Whether Monte Carlo's own error leaves the comparison as it is."""
        difference = abs(max(self.low, self.high) - self.tolerance)
        return 2 * self.error <= max(difference, self.tolerance / _OF_TOLERANCE)

    @property
    def words(self) -> Text:
        """The comparison as part of a sentence."""
        low, high, tolerance = (figure(number, 2) for number in (self.low, self.high, self.tolerance))
        return say(
            "its interval's ends differ from Monte Carlo's by {low} and {high}, numerical tolerance {tolerance}",
            low=low, high=high, tolerance=tolerance,
        )  # fmt: skip


def compare(propagated: Propagated, simulated: Simulated, row: int, digits: int) -> Comparison:
    """Clause 8.1 for one output; ``digits`` of u are regarded as meaningful.

    Raises
    ------
    CmmUqError : the law of propagation has no interval (fewer than one effective degree of freedom).
    """
    low, high = (float(end[row]) for end in propagated.interval(simulated.coverage))
    drawn_low, drawn_high = simulated.symmetric_interval[row]
    u = simulated.u[row]
    if not simulated.stable:
        # the standard deviation of draws without one (a ratio, a Cauchy distribution) must not widen the tolerance
        u = min(u, (drawn_high - drawn_low) / (2 * float(coverage_factor(np.inf, simulated.coverage))))
    return Comparison(
        abs(low - drawn_low),
        abs(high - drawn_high),
        float(numerical_tolerance(np.array([u]), digits)[0]),
        float(np.max(simulated.standard_error[row, 4:])),
    )


def simulate_to_validate(
    model: MeasurementModel,
    candidates: list[Propagated],
    coverage: float = 0.95,
    digits: int = 2,
    seed: int = 0,
    largest: int = LARGEST,
) -> Simulated:
    """Adaptive Monte Carlo, run until it can also say whether each candidate agrees with it."""
    ends = [np.stack(candidate.interval(coverage), axis=1) for candidate in candidates if _has_interval(candidate)]

    def settled(figures: Floats, errors: Floats) -> bool:
        tolerance = numerical_tolerance(figures[:, 1], digits)[:, None]
        doubt = 2 * errors[:, 4:]
        clear = [np.abs(np.abs(end - figures[:, 4:]) - tolerance) > doubt for end in ends]
        return all(np.all(one | (doubt <= tolerance / _OF_TOLERANCE)) for one in clear)

    return simulate_adaptively(model, coverage, digits, seed, largest, settled)


def _has_interval(propagated: Propagated) -> bool:
    return bool(np.all(propagated.dof >= 1))
