"""Errors of a laser digitizer in its own frame: its alignment, its depth scale, the angle at which its light meets a surface.

Its frame turns with ``gamma_deg``, and with ``alpha_deg`` and ``beta_deg`` where they are recorded; without these w lies along
the machine's X axis (α = β = 90°, Harris 2004 section 6.2). Depth is measured along v.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.machine.physics.effect import FURTHER, Effect, Parameter
from cmm_uq.machine.physics.effects.probing import normals_of


class DigitizerOffset(Effect):
    """Digitizer misaligned in its scan plane, which turns with the pose.

    An alignment on the reference sphere that was off by [du dv], or a mount that has moved since (Harris 2004 eq. 14–25).
    """

    name = "digitizer_offset"
    title = say("Alignment of the digitizer")
    formula = "e = du·u + dv·v"
    mechanism = "optical probe"
    points_to = say(
        "the digitizer is out of alignment, or has moved in its mount: tighten the mount and align "
        "it on the reference sphere again, in every pose"
    )
    coefficients = (
        Parameter("u_um", unit("µm"), 20.0, say("along u")),
        Parameter("v_um", unit("µm"), 20.0, say("along v")),
    )
    columns = ("gamma_deg",)
    tier = FURTHER

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return MICROMETRE * attitudes(points)[:, :, :2]


class DigitizerDepth(Effect):
    """Error in proportion to scan depth, from the column ``depth_mm`` (Feng 2001, Xi 2001)."""

    name = "digitizer_depth"
    title = say("Depth bias of the digitizer")
    formula = "e = k·depth·v"
    mechanism = "optical probe"
    points_to = say(
        "the digitizer's depth scale is wrong: calibrate it over its range, and scan in its middle until then"
    )
    coefficients = (Parameter("um_per_mm", unit("µm/mm"), 1.0),)
    columns = ("gamma_deg", "depth_mm")
    tier = FURTHER

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return MICROMETRE * points.column("depth_mm")[:, None, None] * attitudes(points)[:, :, 1:2]


class DigitizerIncidence(Effect):
    """Error in proportion to the angles between beam and normal (Feng 2001, Xi 2001).

    The incident angle lies in the scan plane, the projected one across it.
    """

    name = "digitizer_incidence"
    title = say("Incidence of the digitizer's light")
    formula = "e = (kᵢ·incident + kₚ·projected)·v"
    mechanism = "optical probe"
    points_to = say(
        "the digitizer errs where its light meets the surface askew: turn it square to the surface, "
        "or correct its readings for the angle"
    )
    coefficients = (
        Parameter("incident_um_per_deg", unit("µm/°"), 1.0, say("by incidence")),
        Parameter("projected_um_per_deg", unit("µm/°"), 1.0, say("by projected angle")),
    )
    columns = ("gamma_deg", "nx", "ny", "nz")
    tier = FURTHER

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        frame = attitudes(points)
        own = np.einsum("ni,nij->nj", normals_of(points), frame)
        angles = np.degrees(np.arctan2(own[:, [0, 2]], np.abs(own[:, 1:2])))
        return np.asarray(MICROMETRE * frame[:, :, 1:2] * angles[:, None, :], dtype=np.float64)


def attitudes(points: Points) -> Floats:
    """Axes u, v, w of the digitizer as columns (n, 3, 3) in machine axes: Euler angles 3-1-3 (Harris 2004 eq. 7)."""
    right = np.full(len(points), 90.0)
    alpha, beta = (np.radians(points.columns.get(name, right)) for name in ("alpha_deg", "beta_deg"))
    gamma = np.radians(points.column("gamma_deg"))
    from cmm_uq.machine.physics.digitizer import euler_313  # with maps and fits that no other effect needs

    return np.moveaxis(euler_313(alpha, beta, gamma), 2, 0)


EFFECTS: tuple[Effect, ...] = (DigitizerOffset(), DigitizerDepth(), DigitizerIncidence())
