"""Readings in groups, as many in each: what varies within them and what between (JCGM 100:2008, annex H.5).

The model is x_ij = µ + g_i + e_ij, with groups g (days, set-ups, orientations) that are as random as the readings in them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, sqrt

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats, Ints
from cmm_uq.maths.uncertainty.budget import REPEATS, Budget, BudgetLine


@dataclass(frozen=True)
class OneWay:
    groups: int
    repeats: int  # readings in each group
    mean: float  # of all readings
    between: float  # mean square, of ``groups − 1`` degrees of freedom
    within: float  # mean square, of ``groups · (repeats − 1)`` degrees of freedom

    @property
    def s_repeat(self) -> float:
        return sqrt(self.within)

    @property
    def s_group(self) -> float:
        """Standard deviation of the groups themselves; 0 where readings within them explain all that lies between."""
        return sqrt(max(0.0, (self.between - self.within) / self.repeats))

    @property
    def F(self) -> float:  # noqa: N802
        """Ratio of the mean squares; around 1 where groups do not differ."""
        return self.between / self.within if self.within else inf

    @property
    def u_single(self) -> float:
        """Standard deviation of one reading in a group of its own."""
        return float(np.hypot(self.s_group, self.s_repeat))

    @property
    def dof_single(self) -> float:
        """Effective degrees of freedom of :attr:`u_single` (JCGM 100:2008, G.4.1)."""
        if self.between <= self.within:
            return float(self.groups * (self.repeats - 1))
        between, within = self.between / self.repeats, self.within * (1 - 1 / self.repeats)
        whole = between**2 / (self.groups - 1) + within**2 / (self.groups * (self.repeats - 1))
        return (between + within) ** 2 / whole

    @property
    def u_mean(self) -> float:
        """Standard uncertainty of the mean of all readings."""
        return sqrt(max(self.between, self.within) / (self.groups * self.repeats))

    @property
    def dof_mean(self) -> float:
        """Degrees of freedom of :attr:`u_mean`: those of the larger mean square."""
        return self.groups - 1.0 if self.between >= self.within else float(self.groups * (self.repeats - 1))

    def line(self, name: Text, group: Text, repeat: Text, unit: Text, sensitivity: float = 1.0) -> BudgetLine:
        """The uncertainty of the mean as a line of a budget, made up of that by groups and that by readings within them.

        Both come from the same mean square, so that its degrees of freedom are those of the sum, not of the parts.
        """
        u_repeat, within = self.s_repeat / sqrt(self.groups * self.repeats), float(self.groups * (self.repeats - 1))
        lines = [
            BudgetLine(group, self.s_group / sqrt(self.groups), REPEATS, unit=unit, dof=self.groups - 1.0),
            BudgetLine(repeat, u_repeat, REPEATS, unit=unit, dof=within),
        ]
        parts = Budget(name, lines, unit=unit, effective_dof=self.dof_mean)
        return replace(parts.as_line(name, sensitivity), origin=REPEATS)


def one_way(readings: Sequence[float] | Floats, group: Sequence[int] | Ints) -> OneWay:
    """Analysis of variance of readings (n,) by the group of each (n,)."""
    values, of = np.asarray(readings, dtype=np.float64), np.asarray(group)
    names, counts = np.unique(of, return_counts=True)
    if len(names) < 2 or counts.min() < 2 or counts.min() != counts.max():
        fix = "Give two groups at least, and as many readings in each, two at least"
        raise CmmUqError(f"{len(names)} groups with {', '.join(map(str, counts.tolist()))} readings", fix=fix)
    table = np.array([values[of == name] for name in names])
    groups, repeats = table.shape
    means = table.mean(axis=1)
    within = float(np.sum((table - means[:, None]) ** 2)) / (groups * (repeats - 1))
    return OneWay(groups, repeats, float(values.mean()), float(repeats * means.var(ddof=1)), within)
