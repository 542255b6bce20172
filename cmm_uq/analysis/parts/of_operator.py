"""Operators among the causes: what repeats by different people, days or set-ups scatter by beyond everything else.

Stated, not computed: from repeats of one's own. It is common to a measurement, however often each point is read, and drawn
again in the next measurement.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cmm_uq.analysis.parts.causes import Cause, Scatter, normal
from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE

OPERATOR = "operator"


@dataclass(frozen=True, eq=False, kw_only=True)
class Beside(Cause):
    """What changes characteristics and moves no point.

    Parameters
    ----------
    adds : (K, c) change of each characteristic for one unit of each coefficient, mm or rad.
    count : of the plan's points.
    """

    adds: Floats
    count: int

    def through(self, derivative: Floats) -> Floats:
        """See :meth:`Cause.through`."""
        return np.zeros((len(self.factors), len(derivative)))

    def moved(self, coefficients: Floats, rows: slice) -> Floats:
        """See :meth:`Cause.moved`."""
        return np.zeros((len(coefficients), len(range(*rows.indices(self.count))), 3))


def reproducibility(plan: Plan, u: Mapping[str, float]) -> Beside:
    """A standard uncertainty of some characteristics, each on its own.

    Parameters
    ----------
    u : by name of the characteristic, mm or rad.

    Raises
    ------
    CmmUqError : there is no such characteristic.
    """
    names = [one.name for one in plan.characteristics]
    for name in u:
        if name not in names:
            raise CmmUqError(
                f"there is no characteristic {name!r}", where="reproducibility", fix=suggestion(name, names)
            )
    adds = np.zeros((len(u), len(names)))
    adds[np.arange(len(u)), [names.index(name) for name in u]] = 1.0
    return Beside(name=OPERATOR, factors=tuple(f"reproducibility of {name}" for name in u), draw=normal(list(u.values())),
                  adds=adds, count=len(plan.points))  # fmt: skip


def of_points(plan: Plan, u_um: float) -> Scatter:
    """A standard uncertainty of each coordinate of each point, common to its repeats."""
    return Scatter.of(OPERATOR, "reproducibility of points", np.full((len(plan.points), 3), MICROMETRE * u_um))
