"""Noise for a simulated recording: each component drawn at the points, in the sizes that its truth gives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Points


@dataclass(frozen=True)
class Noise:
    """Standard deviations, mm, of the components of a coordinate's noise."""

    coordinate: float | tuple[float, float, float] = 0.0  # of each reading, of every coordinate or along x, y, z
    placing: float = 0.0  # of each point of each placing, which its repeats share
    growth: float = 0.0  # of what grows with the distance from the first point of the placing, at the longest
    # slow, slow_time_s: of an Ornstein–Uhlenbeck process of each coordinate, and the time over which it forgets; what never
    # does (infinity) is a random walk from the first reading on, whose root mean square over the recording ``slow`` is
    slow: float = 0.0
    slow_time_s: float = 600.0
    # degrees of freedom of Student's t for the readings, above 2 (their standard deviation stays); 0 for a normal
    tails: float = 0.0
    resolution: float = 0.0  # steps in which coordinates are displayed; 0 for none

    def drawn(self, points: Points, random: np.random.Generator) -> Floats:
        """Noise (n, 3), mm, of points; the display's steps are left to :meth:`displayed`."""
        _, placing = np.unique(np.column_stack([points.measurement, points.point]), axis=0, return_inverse=True)
        offsets = self.placing * random.standard_normal((placing.max() + 1, 3))
        found = offsets[placing.ravel()] + np.asarray(self.coordinate) * self._readings(points.xyz.shape, random)
        if self.growth:
            away = distances_in_placing(points.xyz, points)
            part = away / max(float(away.max()), 1e-9)
            found = found + self.growth * part[:, None] * random.standard_normal(points.xyz.shape)
        if self.slow:
            if "time_s" not in points.columns:
                raise CmmUqError("slow noise needs the column time_s, which the recording has not", where="truth.toml [noise]",
                                 fix="Record time_s, or leave slow_um out")  # fmt: skip
            path, time = _random_walk, points.columns["time_s"]
            if np.isfinite(self.slow_time_s):
                path, time = _ornstein_uhlenbeck, time / self.slow_time_s
            found = found + self.slow * path(time, random)
        return np.asarray(found, dtype=np.float64)

    def displayed(self, xyz: Floats) -> Floats:
        return np.asarray(np.round(xyz / self.resolution) * self.resolution) if self.resolution else xyz

    def _readings(self, shape: tuple[int, ...], random: np.random.Generator) -> Floats:
        if not self.tails:
            return random.standard_normal(shape)
        return np.asarray(random.standard_t(self.tails, shape) / np.sqrt(self.tails / (self.tails - 2)))


def distances_in_placing(xyz: Floats, points: Points) -> Floats:
    """Distance (n,), mm, of each point from the first of its placing."""
    order = np.lexsort((points.repeat, points.point, points.measurement))
    _, starts, index = np.unique(points.measurement[order], return_index=True, return_inverse=True)
    first = np.empty(len(order), dtype=np.int64)
    first[order] = order[starts][index.ravel()]
    return np.asarray(np.linalg.norm(xyz - xyz[first], axis=1))


def _random_walk(time: Floats, random: np.random.Generator) -> Floats:
    """(n, 3) from zero at the first of times (n,), with the root mean square one over all their duration."""
    order = np.argsort(time, kind="stable")
    steps = np.diff(time[order], prepend=time[order[0]]) / max(float(np.ptp(time)), 1e-9)
    found = np.empty((len(time), 3))
    found[order] = np.cumsum(np.sqrt(2 * steps)[:, None] * random.standard_normal((len(time), 3)), axis=0)
    return found


def _ornstein_uhlenbeck(time: Floats, random: np.random.Generator) -> Floats:
    """(n, 3) of standard deviation one, at times (n,) in units of the time over which it forgets."""
    order = np.argsort(time, kind="stable")
    normal, found = random.standard_normal((len(time), 3)), np.empty((len(time), 3))
    kept = np.exp(-np.diff(time[order], prepend=-np.inf))
    last = np.zeros(3)
    for row, part, new in zip(order, kept, normal, strict=True):
        last = part * last + np.sqrt(1 - part**2) * new
        found[row] = last
    return found
