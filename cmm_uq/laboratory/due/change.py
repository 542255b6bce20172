"""What a value changed by between two certificates, and whether that means anything.

Both values carry the error of the artefact. Where it was the same artefact, that part is in both, and cancels in their
difference: u²(d) = u₁² + u₂² − 2·u_a1·u_a2 (JCGM 100:2008, 5.2.2, with correlation 1 of what comes from the artefact).
Where all of an uncertainty comes from the artefact, as a test uncertainty does, nothing is stated of how the machine
repeats; then nothing cancels either, or every change would be called significant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist


def two_sided(z: float) -> float:
    """Probability of a deviate at least as far from zero as ``z``."""
    return math.erfc(abs(z) / math.sqrt(2))


def two_sided_limit(probability: float) -> float:
    """The deviate that is exceeded on either side with a probability."""
    return -NormalDist().inv_cdf(probability / 2)


_NOTHING = 1e-9  # part of a variance that is none
FAMILY = 0.05  # probability that anything at all is called significant where nothing changed


@dataclass(frozen=True)
class ComparedValue:
    """A value of a certificate: estimate, standard uncertainty, the part of it from the artefact, and which artefact."""

    value: float
    u: float
    u_artefact: float
    artefact: str


@dataclass(frozen=True)
class ValueChange:
    value: float
    u: float

    @property
    def ratio(self) -> float:
        """The difference in units of its standard uncertainty; infinite where something changed that nothing can have."""
        if self.u > 0:
            return self.value / self.u
        return math.copysign(math.inf, self.value) if self.value else 0.0

    @property
    def chance(self) -> float:
        """Probability of a difference at least as large where nothing changed (two-sided)."""
        return two_sided(self.ratio)

    def significant(self, compared: int, family: float = FAMILY) -> bool:
        """Whether it is more than chance among ``compared`` differences (Šidák)."""
        return self.chance < each_of(compared, family)


def each_of(count: int, family: float) -> float:
    """Probability for each of several comparisons that gives ``family`` for all, at most (Šidák 1967)."""
    return -math.expm1(math.log1p(-family) / max(count, 1))


def common_part(u: float, u_artefact: float) -> float:
    """Part of a standard uncertainty that cancels against another value of the same artefact; 0 where it is the whole."""
    return u_artefact if u**2 - u_artefact**2 > _NOTHING * u**2 else 0.0


def change(before: ComparedValue, now: ComparedValue) -> ValueChange:
    same = bool(before.artefact) and before.artefact == now.artefact
    common = common_part(before.u, before.u_artefact) * common_part(now.u, now.u_artefact) if same else 0.0
    return ValueChange(now.value - before.value, math.sqrt(max(before.u**2 + now.u**2 - 2 * common, 0.0)))
