"""Noise of recordings, of every kind that machines show, written without the package.

Each kind takes where the points lie and when they were read, and gives displacements of the readings, mm.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.concealed.physics import TRAVEL
from benchmarks.coverage.artefacts import Placed

RESOLUTION = 5e-3
"""mm of the display."""
CORRELATION = 0.85
"""Of the slow noise, from one observation to the next."""
WALK = 4.0
"""Standard deviation of the random walk at the end of the recording, over that of the reading noise beside it."""


@dataclass(frozen=True, eq=False)
class Readings:
    """What noise depends on.

    Parameters
    ----------
    placed : the artefact.
    sigma : reading noise of one coordinate, mm.
    time : (n,) s.
    axis : the noisy one, where one is.
    """

    placed: Placed
    sigma: float
    time: np.ndarray
    axis: int

    @property
    def shape(self) -> tuple[int, int]:
        """Of the displacements."""
        return self.placed.true.shape

    def white(self, random: np.random.Generator) -> np.ndarray:
        """Independent, (n, 3) mm."""
        return self.sigma * random.standard_normal(self.shape)


def white(readings: Readings, random: np.random.Generator) -> np.ndarray:
    """Independent and alike in every coordinate."""
    return readings.white(random)


def set_up(ratio: float) -> Callable[[Readings, np.random.Generator], np.ndarray]:
    """Every point of every placing lies off by its own offset, which its repeats share."""

    def noise(readings: Readings, random: np.random.Generator) -> np.ndarray:
        key = np.column_stack([readings.placed.measurement, readings.placed.point])
        _, which = np.unique(key, axis=0, return_inverse=True)
        offsets = ratio * readings.sigma * random.standard_normal((which.max() + 1, 3))
        return readings.white(random) + offsets[which.ravel()]

    return noise


def noisy_axis(times: float) -> Callable[[Readings, np.random.Generator], np.ndarray]:
    """One axis reads that many times worse."""

    def noise(readings: Readings, random: np.random.Generator) -> np.ndarray:
        return readings.white(random) * np.where(np.arange(3) == readings.axis, times, 1.0)

    return noise


def growing(readings: Readings, random: np.random.Generator) -> np.ndarray:
    """From one to three times: with the distance along a gauge, else of each coordinate over its travel."""
    reach = readings.placed.reach
    if reach is not None:
        return readings.white(random) * (1 + 2 * reach / reach.max())[:, None]
    along = (readings.placed.true - TRAVEL[:, 0]) / np.ptp(TRAVEL, axis=1)
    return readings.white(random) * (1 + 2 * np.clip(along, 0, 1))


def slow(readings: Readings, path: Callable[[np.ndarray, int], np.ndarray]) -> np.ndarray:
    """A path in time as displacements: of every coordinate, or of a bar's length, whose ends are read at once."""
    placed = readings.placed
    if placed.along is None:
        return path(readings.time, 3)
    return np.repeat(path(readings.time[::2], 1), 2, axis=0) * placed.along


def correlated(readings: Readings, random: np.random.Generator) -> np.ndarray:
    """Ornstein and Uhlenbeck's process, and nothing beside it."""

    def path(time: np.ndarray, width: int) -> np.ndarray:
        kept = CORRELATION ** (np.diff(time) / np.mean(np.diff(time)))
        values = random.standard_normal((len(time), width))
        for i, phi in enumerate(kept, 1):
            values[i] = phi * values[i - 1] + np.sqrt(1 - phi**2) * values[i]
        return readings.sigma * values

    return slow(readings, path)


def walk(readings: Readings, random: np.random.Generator) -> np.ndarray:
    """A random walk in time beside white noise."""

    def path(time: np.ndarray, width: int) -> np.ndarray:
        steps = np.sqrt(np.diff(time, prepend=time[0]) / (time[-1] - time[0]))
        values = np.cumsum(steps[:, None] * random.standard_normal((len(time), width)), axis=0)
        return WALK * readings.sigma * values

    return readings.white(random) + slow(readings, path)


def tails(readings: Readings, random: np.random.Generator) -> np.ndarray:
    """Student's t with three degrees of freedom, of the same standard deviation."""
    return readings.sigma * random.standard_t(3, readings.shape) / np.sqrt(3)


NOISES: Mapping[str, Callable[[Readings, np.random.Generator], np.ndarray]] = {
    "white": white, "set-up 0.5": set_up(0.5), "set-up 1": set_up(1.0), "set-up 2": set_up(2.0), "axis × 2": noisy_axis(2.0),
    "axis × 3": noisy_axis(3.0), "growing": growing, "correlated": correlated, "walk": walk, "t3": tails, "resolution": white,
}  # fmt: skip
"""By name; with ``resolution`` the display then rounds."""
IN_TIME = ("correlated", "walk")
"""Kinds that a recording shows only with the time in it: there it is always recorded, with the others every second time."""


def displayed(kind: str, xyz: np.ndarray) -> np.ndarray:
    """What the display shows of readings (n, 3)."""
    return np.round(xyz / RESOLUTION) * RESOLUTION if kind == "resolution" else xyz
