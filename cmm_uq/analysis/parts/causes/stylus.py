"""Styli among the causes, and what their qualification takes out of the machine's errors.

Styli among the causes: what the qualification of each left open, common to all points that it probes.

On a sphere the qualification finds a tip's size and offset, so what remains of its pre-travel (lobing) has neither: a random
field over directions of probing without terms of degree 0 and 1, stationary over directions. Its covariance at an angle γ is
lobing² times the mean of the Legendre polynomials P_l(cos γ) of degrees 2 to 6 (addition theorem of spherical harmonics).

What the qualification of a tip takes out of the machine's errors: a reference sphere is measured by the same machine.

Errors that act on the sphere as on the part (play of an axis, a rotation that moves a long stylus) end in the tip's effective
size and offset, and so do not act on the part again. The sphere is probed at 25 points of its upper half (ISO 10360-5:2010,
6.2.3), its least-squares radius and centre are what is taken out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import eval_legendre

from cmm_uq.analysis.parts.causes.cause import CommonCause, PartCause, field_components, normal
from cmm_uq.analysis.parts.placing import OWN_COLUMNS, PartPose, probed
from cmm_uq.analysis.parts.plan import Plan, Stylus
from cmm_uq.base.points import AXES, Floats, Ints, Machine, Points
from cmm_uq.base.units import MICROMETRE

STYLUS = "stylus"
# by which pre-travel varies with direction: two and three lobes of triggering and bending, up to six of a tip's form
DEGREES = (2, 3, 4, 5, 6)


def styli(plan: Plan, pose: PartPose) -> list[PartCause]:
    """Size, offset and lobing of every stylus that leaves some open.

    A tip that is effectively larger than thought finds every surface by half of the difference outside.
    """
    found: list[PartCause] = []
    for place, stylus in enumerate(plan.styli):
        its = plan.stylus_of == place
        if stylus.u_diameter_um:
            basis = (0.5 * MICROMETRE * its[:, None] * plan.normals)[None]
            size = (f"tip size {stylus.name}",)
            found.append(CommonCause(name=STYLUS, factors=size, draw=normal([stylus.u_diameter_um]), basis=basis))
        if np.any(stylus.u_offset_um):
            basis = MICROMETRE * its[:, None] * pose.back(np.eye(3))[:, None, :]
            factors = (f"tip offset {stylus.name}",) * len(AXES)
            found.append(CommonCause(name=STYLUS, factors=factors, draw=normal(stylus.u_offset_um), basis=basis))
        if stylus.lobing_um:
            found.append(_lobing(stylus, plan, its))
    return found


def _lobing(stylus: Stylus, plan: Plan, its: NDArray[np.bool_]) -> CommonCause:
    variance = (MICROMETRE * stylus.lobing_um) ** 2

    def covariance(some: slice) -> Floats:
        cosine = np.clip(plan.normals[some] @ plan.normals.T, -1.0, 1.0)
        mean = np.mean([eval_legendre(degree, cosine) for degree in DEGREES], axis=0)
        return np.asarray(variance * mean * np.outer(its[some], its))

    shapes = field_components(covariance, np.where(its, variance, 0.0))
    draw, factors = normal(np.ones(len(shapes))), (f"lobing {stylus.name}",) * len(shapes)
    return CommonCause(name=STYLUS, factors=factors, draw=draw, basis=shapes[:, :, None] * plan.normals)


SPHERE_MM = 25.0  # diameter of the reference sphere; errors hardly change over it
# height above the equator, points, and the first one's angle, in degrees
_LATITUDES = ((90.0, 1, 0.0), (67.5, 4, 0.0), (45.0, 8, 22.5), (22.5, 4, 45.0), (0.0, 8, 0.0))


def directions() -> Floats:
    """(25, 3) unit vectors to the points on the sphere."""
    found = []
    for height, count, start in _LATITUDES:
        for angle in np.radians(start + 360.0 * np.arange(count) / count):
            level = np.cos(np.radians(height))
            found.append((level * np.cos(angle), level * np.sin(angle), np.sin(np.radians(height))))
    return np.array(found)


@dataclass(frozen=True, eq=False)
class Qualified:
    """A part and the reference sphere, measured by the same tips."""

    part: Points  # the points of the part
    sphere: Points  # those of the sphere, for each stylus whose place of qualification is known, one after the other
    styli: Ints  # (s,) which styli these are
    of: Ints  # (n,) stylus of each point of the part

    @classmethod
    def on(cls, plan: Plan, part: Points, machine: Machine) -> Qualified:
        """The sphere where the styli were qualified, with what is recorded of the surroundings of the part's points."""
        which = [i for i, stylus in enumerate(plan.styli) if stylus.qualified_at_mm is not None and i in plan.stylus_of]
        toward = directions()
        q = len(toward)
        places = [np.asarray(plan.styli[i].qualified_at_mm) + 0.5 * SPHERE_MM * toward for i in which]
        tips = [np.tile(plan.styli[i].offset_mm, (q, 1)) for i in which]
        radii = np.repeat([0.5 * plan.styli[i].diameter_mm for i in which], q)
        none = np.zeros((0, 3))
        # before the part: at the first of its times, with what else is recorded as it is then
        start = int(np.argmin(part.columns["time_s"])) if "time_s" in part.columns else 0
        columns = {name: np.full(q * len(which), float(values[start])) for name, values in part.columns.items()
                   if name not in OWN_COLUMNS}  # fmt: skip
        sphere = probed(np.concatenate([none, *places]), np.tile(toward, (len(which), 1)), np.concatenate([none, *tips]),
                        radii, machine, columns)  # fmt: skip
        return cls(part, sphere, np.array(which, dtype=np.int64), plan.stylus_of)

    @cached_property
    def both(self) -> Points:
        """Points of the part, and then those of the spheres."""
        part, sphere = self.part, self.sphere
        columns = {name: np.concatenate([values, sphere.columns[name]]) for name, values in part.columns.items()}
        n = len(part) + len(sphere)
        ones = np.ones(n, dtype=np.int64)
        return replace(part, xyz=np.vstack([part.xyz, sphere.xyz]), measurement=ones, point=np.arange(1, n + 1),
                       repeat=ones, columns=columns)  # fmt: skip

    def left(self, columns: Floats) -> Floats:
        """(n, 3, k) of the part that a qualification leaves of displacements (n + q, 3, k) in the frame of the machine."""
        n, q = len(self.part), len(directions())
        found = columns[:n].copy()
        normals = np.column_stack([self.part.columns[f"n{axis}"] for axis in "xyz"])
        toward = directions()
        solve = np.linalg.pinv(np.column_stack([toward, np.ones(q)]))
        for place, stylus in enumerate(self.styli):
            own = columns[n + place * q : n + (place + 1) * q]
            sphere = solve @ np.einsum("qi,qik->qk", toward, own)
            its = self.of == stylus
            found[its] -= sphere[None, :3] + normals[its][:, :, None] * sphere[3]
        return found
