"""The fixture among the causes: a part that moves while it is measured.

Where a part lies is no error, but that it moves is one: what is probed later has moved farther. Movement is taken as even over
the measurement, in the order in which points are probed.
"""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.parts.causes import Common, normal
from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.base.points import Floats
from cmm_uq.base.units import ARCSECOND, MICROMETRE

FIXTURE = "fixture"


def moving_part(plan: Plan, u_shift_um: float, u_turn_arcsec: float = 0.0) -> Common:
    """A part that has shifted and turned evenly by the end of its measurement.

    Parameters
    ----------
    u_shift_um, u_turn_arcsec : standard uncertainty of the whole movement, along and about each axis.
    """
    about = plan.points - plan.points.mean(axis=0)
    done = elapsed(plan)[:, None]
    shifts = [MICROMETRE * done * axis for axis in np.eye(3)]
    turns = [ARCSECOND * done * np.cross(axis, about) for axis in np.eye(3)]
    sd = np.repeat([u_shift_um, u_turn_arcsec], 3)
    return Common(
        name=FIXTURE, factors=("movement of the part",) * 6, draw=normal(sd), basis=np.array([*shifts, *turns])
    )


def elapsed(plan: Plan) -> Floats:
    """(n,) part of the measurement that is over at each point, by its times or else by its order."""
    n = len(plan.points)
    if len(plan.times_s):
        since = plan.times_s - plan.times_s.min()
        return np.asarray(since / (since.max() or 1.0))
    place = np.empty(n)
    place[plan.order if len(plan.order) else np.arange(n)] = np.arange(n)
    return place / max(n - 1, 1)
