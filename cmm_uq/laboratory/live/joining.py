"""Readings that come by themselves, joined to points by time.

A stream is what one instrument says for one column of the recording. At the moment of a point its value is interpolated
between the two readings about it, each taken where it was measured: its arrival less the stated latency.

The standard uncertainty that this adds has two parts. Between two readings a smooth quantity lies off their straight line by
at most ½·|f″|·(t − t₀)·(t₁ − t) (the remainder of linear interpolation, e.g. Abramowitz & Stegun 25.2.3); f″ is the larger of
the last two second differences of the stream itself, and the bound is taken as a rectangular distribution (GUM 4.3.7). And
the latency is known no better than to be between nothing and twice what is stated: the slope times latency over √3. What the
instrument's own calibration leaves open, and the scatter of a single reading, are not in it.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from dataclasses import dataclass
from math import hypot, sqrt

from cmm_uq.base.messages import Text, Verbatim, say

NS = 1e-9  # s
_BEFORE = 3  # readings before a point that its value is made of, with the one after it


@dataclass(frozen=True)
class Joined:
    """A value of a stream at a moment, with the standard uncertainty of having been interpolated."""

    value: float
    u: float


class Stream:
    """The last readings of one instrument for one column."""

    def __init__(self, column: str, source: str, *, latency_s: float = 0.0, max_gap_s: float = 10.0) -> None:
        self.column, self.source = column, source
        self.latency_s, self.max_gap_s = latency_s, max_gap_s
        self._latency_ns = round(latency_s / NS)
        self._keep_ns = round(3 * max_gap_s / NS)
        self._times: deque[int] = deque()
        self._values: deque[float] = deque()

    def __len__(self) -> int:
        return len(self._times)

    @property
    def latest(self) -> float | None:
        """Its last value; ``None`` before the first."""
        return self._values[-1] if self._values else None

    def age_s(self, now_ns: int) -> float | None:
        """Time since its last reading; ``None`` before the first."""
        return (now_ns - self._times[-1]) * NS if self._times else None

    def add(self, monotonic_ns: int, value: float) -> None:
        """A reading that arrived at a moment; none that is older than the last is taken."""
        time = monotonic_ns - self._latency_ns
        if self._times and time <= self._times[-1]:
            return
        self._times.append(time)
        self._values.append(value)

    def forget(self, before_ns: int) -> None:
        """Let go of what no point from this moment on can need."""
        while len(self._times) > _BEFORE + 1 and self._times[_BEFORE] < before_ns - self._keep_ns:
            self._times.popleft()
            self._values.popleft()

    def at(self, moment_ns: int, now_ns: int | None) -> Joined | Text | None:
        """Value at a moment, or why there is none; ``None`` while a reading may come (never where ``now_ns`` is ``None``)."""
        after, source = bisect_left(self._times, moment_ns), Verbatim(self.source)
        if after == len(self._times):
            if now_ns is None:
                return say("the session ended before {source} gave another reading", source=source)
            if (now_ns - moment_ns) * NS - self.latency_s <= self.max_gap_s:
                return None
            if after == 0:
                return say("{source} gave nothing", source=source)
            return say("{source} gave nothing for {gap:g} s after the point", source=source, gap=self.max_gap_s)
        if self._times[after] == moment_ns:
            return Joined(self._values[after], self._u(after, moment_ns))
        if after == 0:
            return say("{source} gave nothing before the point", source=source)
        gap = (self._times[after] - self._times[after - 1]) * NS
        if gap > self.max_gap_s:
            return say(
                "{source} gave nothing for {gap:.3g} s about the point, and {most:g} s are the most that is interpolated over",
                source=source, gap=gap, most=self.max_gap_s,
            )  # fmt: skip
        part = (moment_ns - self._times[after - 1]) / (self._times[after] - self._times[after - 1])
        before = self._values[after - 1]
        return Joined(before + part * (self._values[after] - before), self._u(after, moment_ns))

    def _u(self, after: int, moment_ns: int) -> float:
        times = [(self._times[i] - moment_ns) * NS for i in range(max(0, after - _BEFORE), after + 1)]
        values = [self._values[i] for i in range(max(0, after - _BEFORE), after + 1)]
        if len(times) < 2:
            return 0.0
        slope = (values[-1] - values[-2]) / (times[-1] - times[-2])
        if times[-1] == 0:
            off = 0.0
        elif len(times) == 2:
            off = abs(values[1] - values[0]) / sqrt(12)  # anywhere between the two (GUM 4.3.7)
        else:
            bends = [_bend(times[i : i + 3], values[i : i + 3]) for i in range(len(times) - 2)]
            off = 0.5 * max(bends) * -times[-2] * times[-1] / sqrt(3)
        return hypot(off, slope * self.latency_s / sqrt(3))


def _bend(times: list[float], values: list[float]) -> float:
    """Size of the second derivative of the parabola through three readings."""
    first = (values[1] - values[0]) / (times[1] - times[0])
    second = (values[2] - values[1]) / (times[2] - times[1])
    return abs(2 * (second - first) / (times[2] - times[0]))
