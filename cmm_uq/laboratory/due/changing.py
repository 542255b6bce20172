"""How far and how readily a method changes an interval."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Changing:
    """How far and how readily an interval is changed; the defaults are those of suncal.

    Parameters
    ----------
    confidence : least confidence of a rejection that changes the interval.
    factor : most that an interval grows or shrinks by at once.
    least_days : smaller changes are not worth making.
    shortest_days, longest_days : bounds of every interval.
    """

    confidence: float = 0.5
    factor: float = 2.0
    least_days: float = 5.0
    shortest_days: float = 14.0
    longest_days: float = 1826.0

    def bounded(self, days: float) -> float:
        """The interval within its bounds."""
        return min(max(days, self.shortest_days), self.longest_days)


USUAL = Changing()
"""As suncal has it."""
