"""Whether temperatures have settled: the change of each in an hour, over the time that the job states, against its criterion.

It is within the limit with twice its standard uncertainty, by the straight line through means of ten seconds.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from cmm_uq.base.messages import Text, Verbatim, number, say, signed
from cmm_uq.laboratory.live.joining import NS

_MEAN_S = 10.0
_FEWEST = 4
_HOUR = 3600.0
_WHOLE = 0.95  # part of the stated time that must have been seen


@dataclass
class Soak:
    """The temperatures of one column over the last while."""

    column: str
    limit_k_per_h: float | None  # largest change in an hour; ``None``: none is stated
    over_min: float  # time over which it is taken, min
    _means: deque[tuple[float, float]] = field(default_factory=deque)
    _sum: float = 0.0
    _count: int = 0
    _times: float = 0.0
    _begin_ns: int = 0
    _latest: float | None = None

    def add(self, monotonic_ns: int, value: float) -> None:
        time_s = monotonic_ns * NS
        if self._count and monotonic_ns - self._begin_ns >= _MEAN_S / NS:
            self._means.append((self._times / self._count, self._sum / self._count))
            self._sum, self._times, self._count = 0.0, 0.0, 0
            while self._means[0][0] < time_s - 60 * self.over_min:
                self._means.popleft()
        if not self._count:
            self._begin_ns = monotonic_ns
        self._sum, self._times, self._count = self._sum + value, self._times + time_s, self._count + 1
        self._latest = value

    @property
    def change(self) -> tuple[float, float] | None:
        """Change in an hour and its standard uncertainty, K/h; ``None`` before the stated time has been seen."""
        if len(self._means) < _FEWEST:
            return None
        times, values = np.array(self._means).T / np.array([[_HOUR], [1.0]])
        if (times[-1] - times[0]) * _HOUR + _MEAN_S < _WHOLE * 60 * self.over_min:
            return None
        about = times - times.mean()
        slope = float(about @ values / (about @ about))
        left = values - values.mean() - slope * about
        return slope, float(np.sqrt(left @ left / (len(values) - 2) / (about @ about)))

    @property
    def settled(self) -> bool | None:
        """Whether the criterion is kept; ``None`` where there is none, or it cannot be said yet."""
        if self.limit_k_per_h is None or (change := self.change) is None:
            return None
        return abs(change[0]) + 2 * change[1] <= self.limit_k_per_h

    @property
    def unsettled(self) -> bool:
        """Whether there is a criterion that it does not keep, or of which that cannot be said yet."""
        return self.limit_k_per_h is not None and self.settled is not True

    @property
    def words(self) -> Text:
        """Temperature, change and what is asked of it."""
        if self._latest is None:
            return say("{column}: nothing yet", column=Verbatim(self.column))
        now = say("{column} {value} °C", column=Verbatim(self.column), value=number(self._latest, ".3f"))
        change = self.change
        if change is None:
            seen = (len(self._means) * _MEAN_S) / 60
            return say("{now}, seen for {seen:.0f} of {over:g} min", now=now, seen=seen, over=self.over_min)
        told = say("{now}, {slope} K/h over {over:g} min", now=now, slope=signed(change[0], "+.2f"), over=self.over_min)
        if self.limit_k_per_h is None:
            return told
        within = say("{told}: within {limit:g} K/h", told=told, limit=self.limit_k_per_h)
        return within if self.settled else say("{told}: NOT within {limit:g} K/h", told=told, limit=self.limit_k_per_h)
