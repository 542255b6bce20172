"""The noise that a plan reckons with: that of an earlier recording, what the job states, and the prior for the rest.

Readings are independent; each point of each set-up has an offset that its repeats share; and noise may grow with the length
(``noise``). What nobody knows of the latter two is averaged over what the estimate takes for possible
beforehand. A half-Cauchy distribution has no mean, so that it is the logarithm of an expected uncertainty that is averaged:
one recording in twenty with a huge offset then does not decide what is expected of all.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.model.noise import growing_lengths, noise_of
from cmm_uq.maths.inference.linear_model import LinearModel
from cmm_uq.maths.inference.noise import ABSENT, GROWTH, LARGEST_RATIO, PLACING, RATIO, SLOW, Components, Sizes

_NODES = 10  # sizes of a component that stand for its prior, beside none at all
_LEAST_RATIO = 0.02  # ratio to the reading noise below which a component does not count


@dataclass(frozen=True, eq=False)
class PlannedNoise:
    """What is known of the noise before anything is measured."""

    reading: tuple[float, float, float]  # standard deviation of a reading along each axis, mm
    # placing, growth: of a set-up offset, and of what grows, at the longest length, mm; None where nothing is known
    placing: float | None = 0.0
    growth: float | None = 0.0
    longest: float | None = None  # that length, mm; None where it is the longest of whatever is planned

    @property
    def coordinate(self) -> float:
        """Root mean square of the axes' reading noise, mm."""
        return float(np.sqrt(np.mean(np.square(self.reading))))

    @property
    def white(self) -> PlannedNoise:
        """Of nothing but readings, alike along all axes."""
        return PlannedNoise((self.coordinate,) * 3, longest=self.longest)

    def times(self, factor: float) -> PlannedNoise:
        x, y, z = (factor * each for each in self.reading)
        placing, growth = (None if size is None else factor * size for size in (self.placing, self.growth))
        return replace(self, reading=(x, y, z), placing=placing, growth=growth)

    @property
    def typical(self) -> Sizes:
        """One set of sizes; an offset of which nothing is known is as large as the reading noise, growth is then absent."""
        return _sizes(self, [self.coordinate if self.placing is None else self.placing], [self.growth or 0.0])

    @property
    def drawn(self) -> Noise:
        typical = self.typical
        return Noise(self.reading, placing=float(typical.placing[0]), growth=float(typical.growth[0]))

    def spread(self, components: Components) -> tuple[Sizes, Floats]:
        """All sizes (w,) that are reckoned with, and their weights (w,), which sum up to one."""
        placing, p = np.array([self.placing]), np.ones(1)
        growth, g = np.array([self.growth or 0.0]), np.ones(1)
        if self.placing is None:
            placing, p = _prior(PLACING, self.coordinate)
        if self.growth is None and GROWTH in components.possible:
            growth, g = _prior(GROWTH, self.coordinate)
        sizes = _sizes(self, np.repeat(placing, len(growth)), np.tile(growth, len(placing)))
        return sizes, np.outer(p, g).ravel()

    def components(self, model: RecordingModel, values: Floats) -> Components:
        """The noise of a model's observations about parameters (k,), without what depends on the time of a reading."""
        found = noise_of(model, values=values)
        possible = tuple(name for name in found.possible if name != SLOW)
        shares = found.shares.copy()
        if self.longest is not None:
            own = float(growing_lengths(model, model.placed(values)).max(initial=0.0))
            shares[:, 4] *= (own / max(self.longest, 1e-9)) ** 2
        none = np.zeros((len(shares), 0))
        return replace(found, shares=shares, slow=none, frequency=np.zeros(0), possible=possible)

    def over(self, model: RecordingModel, values: Floats) -> PlannedNoise:
        """The same, growing up to the longest length of this model."""
        return replace(self, longest=float(growing_lengths(model, model.placed(values)).max(initial=0.0)))


def white_noise(model: RecordingModel) -> PlannedNoise:
    """That which a model states; of one µm where it states none."""
    each = model.sigma or MICROMETRE
    return PlannedNoise((each, each, each))


def uncorrelated(model: RecordingModel, values: Floats, noise: PlannedNoise | None) -> LinearModel:
    """The model about parameters (k,) in uncorrelated observations with the noise of one reading each."""
    linear = model.linearised(values)
    return linear if noise is None else linear.uncorrelated(noise.components(model, values).white(noise.typical))


def _sizes(noise: PlannedNoise, placing: Floats | list[float], growth: Floats | list[float]) -> Sizes:
    reading, nothing = np.tile(noise.reading, (len(placing), 1)), np.zeros(len(placing))
    return Sizes(reading, np.asarray(placing), np.asarray(growth), nothing, nothing + 1)


def _prior(component: str, sigma: float) -> tuple[Floats, Floats]:
    """Sizes of a component, mm, and their weights, for a reading noise ``sigma``."""
    ratio, weight = _half_cauchy(ABSENT[component], RATIO[component])
    return sigma * ratio, weight


@cache
def _half_cauchy(absent: float, scale: float) -> tuple[Floats, Floats]:
    low, high = np.log(_LEAST_RATIO), np.log(LARGEST_RATIO)
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    ratio = np.exp(low + 0.5 * (high - low) * (nodes + 1))
    density = 2 / np.pi * (ratio / scale) / (1 + (ratio / scale) ** 2)
    middle = 0.5 * (high - low) * weights * density
    below, beyond = (2 / np.pi * np.arctan(np.array([_LEAST_RATIO, LARGEST_RATIO]) / scale)).tolist()
    inside = (beyond - below) / middle.sum() * middle
    weight = (1 - absent) * np.concatenate([[below], inside, [1 - beyond]]) + absent * (np.arange(_NODES + 2) == 0)
    return np.concatenate([[0.0], ratio, [LARGEST_RATIO]]), weight
