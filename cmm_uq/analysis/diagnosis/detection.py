"""With what probability an effect is detected, and named, as a function of its visible length: in closed form.

The length δ is that of what an effect leaves in all observations, the baseline projected out, over the noise. The statistic
of the lack-of-fit test sees of the noise, nearly, its part z along the effect, and its size besides, which it takes for σ: the
test rejects when z exceeds its threshold times s/σ, z² having a noncentral χ² distribution with δ² (z over s/σ a
noncentral t). To be named, an effect must besides exceed each rival, that sees z·c and noise of its own, by odds: their z²
differ by more than a threshold. What remains is one integral over z.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import special

from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.root import root

SHORTEST, LONGEST = 1.0, 60.0
"""Visible lengths within which one is looked for; beyond the last nothing is said to be found."""

_NOISES = 7
_Z = np.linspace(-5.0, 5.0, 101)


@dataclass(frozen=True, eq=False)
class Thresholds:
    """What an effect must pass, in terms of z; see the module's docstring.

    Parameters
    ----------
    detected : z from which on the test rejects.
    named : z (r,) from which on it exceeds each of its closest rivals, on average; infinite where never.
    cosines : (r,) with these.
    known : degrees of freedom of what was known of σ beforehand.
    left : degrees of freedom of the residuals.
    """

    detected: float
    named: Floats
    cosines: Floats
    known: float
    left: int

    @property
    def noises(self) -> Floats:
        """(q,) s/σ at evenly probable sizes of the residuals at right angles to the effect."""
        count = max(self.left - 1, 1)
        squares = special.chdtri(count, 1 - (np.arange(_NOISES) + 0.5) / _NOISES)
        return np.asarray(np.sqrt((self.known + squares) / (self.known + count)))

    def detects(self, length: Floats) -> Floats:
        """Probability (d,) that the test rejects, for visible lengths (d,)."""
        gate = self.detected * self.noises[:, None]
        return np.asarray((special.ndtr(length - gate) + special.ndtr(-length - gate)).mean(axis=0))

    def names(self, length: Floats) -> Floats:
        """Probability (d,) that it is called by its name."""
        if not np.all(np.isfinite(self.named)):
            return np.zeros(len(length))
        z = length[:, None] + _Z  # (d, z)
        noises = self.noises[:, None, None]
        passed = (np.abs(z) > self.detected * noises).astype(np.float64)
        for named, cosine in zip(self.named, self.cosines, strict=True):
            beside = 1 - cosine**2
            room = z**2 - beside * (named * noises) ** 2  # what is left of it for the rival's own z²
            rival, spread = np.sqrt(np.maximum(room, 0.0)), np.sqrt(beside)
            below = special.ndtr((rival - cosine * z) / spread) - special.ndtr((-rival - cosine * z) / spread)
            passed *= np.where(room > 0, below, 0.0)
        density = np.exp(-0.5 * _Z**2)
        return np.asarray(passed.mean(axis=0) @ density / density.sum())

    def length_detected(self, power: float) -> float:
        """Visible length detected with this probability."""
        return _reached(self.detects, power)

    def length_named(self, power: float) -> float:
        """Visible length named with this probability; infinite where none is."""
        return _reached(self.names, power) if np.all(np.isfinite(self.named)) else float(np.inf)


def _reached(probability: Callable[[Floats], Floats], power: float) -> float:
    """Length at which a probability that grows with it reaches a power; infinite beyond the longest."""

    def short(length: float) -> float:
        return float(probability(np.array([length]))[0]) - power

    if short(LONGEST) < 0:
        return float(np.inf)
    return root(short, SHORTEST, LONGEST, 1e-10) if short(SHORTEST) < 0 else SHORTEST
