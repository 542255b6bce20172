"""Parameters of the machine against the tolerances that a job sets for them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from cmm_uq.messages import Text
from cmm_uq.uncertainty.quantity import Quantity

Verdict = Literal["in", "out", "open"]


@dataclass(frozen=True)
class Judged:
    """A parameter against its tolerance.

    Parameters
    ----------
    effect, title, parameter : names of what is judged.
    quantity : its estimate.
    tolerance : for either sign, in the quantity's unit.
    """

    effect: str
    title: Text
    parameter: str
    quantity: Quantity
    tolerance: float

    @property
    def verdict(self) -> Verdict:
        """``in`` or ``out`` when the whole coverage interval is, else ``open``."""
        low, high = self.quantity.interval95
        if -self.tolerance <= low and high <= self.tolerance:
            return "in"
        return "out" if low > self.tolerance or high < -self.tolerance else "open"
