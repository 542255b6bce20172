"""How characteristics follow what all orientations of a part have in common: the machine's scale, and the size of a tip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.analysis.parts.result import evaluated
from cmm_uq.base.points import Floats

_STEP_MM = 1e-3
"""By which the farthest point moves, or a tip grows, to see what follows."""


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Derivatives of c characteristics.

    Parameters
    ----------
    scale : (c,) by the scale of all coordinates, mm and rad: of a length itself.
    tips : by stylus, (c,) by the effective diameter of its tip, mm/mm and rad/mm.
    """

    scale: Floats
    tips: dict[str, Floats]


def sensitivities(plan: Plan) -> Sensitivities:
    """Of the characteristics of a plan, at its nominal points, by central differences.

    A position or a form, which is zero at the nominal and grows to both sides, has none to first order.
    """
    reach = max(1.0, float(np.linalg.norm(plan.points, axis=1).max()))
    step = _STEP_MM / reach
    scale = (evaluated(plan, plan.points * (1 + step)) - evaluated(plan, plan.points * (1 - step))) / (2 * step)
    tips = {}
    for place, stylus in enumerate(plan.styli):
        out = 0.5 * _STEP_MM * (plan.stylus_of == place)[:, None] * plan.normals
        grown, shrunk = evaluated(plan, plan.points + out), evaluated(plan, plan.points - out)
        tips[stylus.name] = (grown - shrunk) / (2 * _STEP_MM)
    return Sensitivities(scale, tips)
