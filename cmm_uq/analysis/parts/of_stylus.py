"""Styli among the causes: what the qualification of each left open, common to all points that it probes.

On a sphere the qualification finds a tip's size and offset, so what remains of its pre-travel (lobing) has neither: a random
field over directions of probing without terms of degree 0 and 1, stationary over directions. Its covariance at an angle γ is
lobing² times the mean of the Legendre polynomials P_l(cos γ) of degrees 2 to 6 (addition theorem of spherical harmonics).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import eval_legendre

from cmm_uq.analysis.parts.causes import Cause, Common, normal
from cmm_uq.analysis.parts.fields import field_components
from cmm_uq.analysis.parts.placing import Pose
from cmm_uq.analysis.parts.plan import Plan, Stylus
from cmm_uq.base.points import AXES, Floats
from cmm_uq.base.units import MICROMETRE

STYLUS = "stylus"

DEGREES = (2, 3, 4, 5, 6)
"""By which pre-travel varies with direction: two and three lobes of triggering and bending, up to six of a tip's form."""


def styli(plan: Plan, pose: Pose) -> list[Cause]:
    """Size, offset and lobing of every stylus that leaves some open.

    A tip that is effectively larger than thought finds every surface by half of the difference outside.
    """
    found: list[Cause] = []
    for place, stylus in enumerate(plan.styli):
        its = plan.stylus_of == place
        if stylus.u_diameter_um:
            basis = (0.5 * MICROMETRE * its[:, None] * plan.normals)[None]
            size = (f"tip size {stylus.name}",)
            found.append(Common(name=STYLUS, factors=size, draw=normal([stylus.u_diameter_um]), basis=basis))
        if np.any(stylus.u_offset_um):
            basis = MICROMETRE * its[:, None] * pose.back(np.eye(3))[:, None, :]
            factors = (f"tip offset {stylus.name}",) * len(AXES)
            found.append(Common(name=STYLUS, factors=factors, draw=normal(stylus.u_offset_um), basis=basis))
        if stylus.lobing_um:
            found.append(_lobing(stylus, plan, its))
    return found


def _lobing(stylus: Stylus, plan: Plan, its: NDArray[np.bool_]) -> Common:
    variance = (MICROMETRE * stylus.lobing_um) ** 2

    def covariance(some: slice) -> Floats:
        cosine = np.clip(plan.normals[some] @ plan.normals.T, -1.0, 1.0)
        mean = np.mean([eval_legendre(degree, cosine) for degree in DEGREES], axis=0)
        return np.asarray(variance * mean * np.outer(its[some], its))

    shapes = field_components(covariance, np.where(its, variance, 0.0))
    draw, factors = normal(np.ones(len(shapes))), (f"lobing {stylus.name}",) * len(shapes)
    return Common(name=STYLUS, factors=factors, draw=draw, basis=shapes[:, :, None] * plan.normals)
