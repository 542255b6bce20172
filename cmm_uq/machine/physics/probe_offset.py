"""Probe offset on a plane surface: which way the material lies, and where the surface is (US 4,866,643 claim 1).

A probe of finite diameter touches a plane with its side, so that the points of contact lie on a plane one offset away from
the surface. A point just before contact tells on which side the probe was.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Ints
from cmm_uq.maths.geometry import Plane, fit_plane

ACCEPTANCE = np.pi / 3
"""The largest angle between normal and approach unless another is chosen, rad; the patent leaves it to the user."""


class DirectionPointError(CmmUqError):
    """A direction point that is not believed: which of them, in ``index``."""

    def __init__(self, index: int, problem: str, fix: str) -> None:
        super().__init__(problem, fix=fix)
        self.index = index


@dataclass(frozen=True, eq=False)
class OffsetPlane:
    """A plane surface, compensated for the probe's offset.

    Parameters
    ----------
    point : (3,) of the surface, mm: the centroid of the contact points, moved.
    normal : (3,) unit normal out of the material, towards the probe.
    covariance : (6, 6) of point and normal, mm² and rad².
    angle : between normal and the direction of approach, the largest of several, rad.
    reversed : whether the fitted normal had to be turned round.
    contact : the plane through the points of contact.
    """

    point: Floats
    normal: Floats
    covariance: Floats
    angle: float
    reversed: bool
    contact: Plane


def offset_plane(
    directions: Floats,
    contacts: Floats,
    offset: float,
    *,
    first: Ints | None = None,
    acceptance: float = ACCEPTANCE,
    u_offset: float = 0.0,
    u_point: float | None = None,
) -> OffsetPlane:
    """Surface plane from a point just before contact and the points of contact.

    Parameters
    ----------
    directions : (3,) or (d, 3) the point D just before contact, or several, mm.
    contacts : (n, 3) the points C1 … CN in contact, n ≥ 3, mm.
    first : (d,) which contact C1 each direction point belongs to; the first one by default.
    offset : of the probe, its effective radius, mm.
    acceptance : largest angle A between the normal and D − C1 at which D is believed, rad. Every D must be within it.
    u_offset : standard uncertainty of the offset, mm.
    u_point : standard uncertainty of a contact point along the normal, mm; from the residuals when left out.

    Raises
    ------
    CmmUqError : too few points or on one line, or an offset that is not positive.
    DirectionPointError : a direction point is rejected, with what to measure again.
    """
    if not (np.isfinite(offset) and offset > 0):
        raise CmmUqError(f"a probe offset of {offset} mm", fix="Give the probe's effective radius in mm, above 0")
    if not 0 < acceptance < np.pi / 2:
        raise CmmUqError(
            f"a range of acceptance of {np.degrees(acceptance):.4g}°", fix="Choose an angle between 0° and 90°"
        )
    plane = fit_plane(contacts, u_point=u_point)
    ahead = np.atleast_2d(np.asarray(directions, dtype=np.float64))
    touched = np.asarray(contacts, dtype=np.float64)[np.zeros(len(ahead), dtype=np.int64) if first is None else first]
    cosine = _cosines(plane.normal, ahead - touched)
    turned = bool(cosine[0] < 0)
    angles = np.arccos(np.clip(-cosine if turned else cosine, -1, 1))
    _refuse_slanting(angles, acceptance)
    normal, angle = -plane.normal if turned else plane.normal, float(angles.max())
    moved = np.vstack([np.hstack([np.eye(3), -offset * np.eye(3)]), np.hstack([np.zeros((3, 3)), np.eye(3)])])
    # turning the normal round turns the sign of its covariance with the point
    flip = np.diag([1.0] * 3 + [-1.0 if turned else 1.0] * 3)
    covariance = moved @ flip @ plane.covariance @ flip @ moved.T
    covariance[:3, :3] += u_offset**2 * np.outer(normal, normal)
    return OffsetPlane(plane.point - offset * normal, normal, covariance, angle, turned, plane)


def _cosines(normal: Floats, approach: Floats) -> Floats:
    """Of the angles (d,) between the normal and the directions (d, 3) of approach."""
    distance = np.linalg.norm(approach, axis=1)
    if np.any(nowhere := ~(distance > 0)):
        raise DirectionPointError(
            int(np.argmax(nowhere)), "the direction point is the first point of contact",
            "Measure the direction point again, before the probe touches the surface",
        )  # fmt: skip
    return np.asarray(approach @ normal / distance, dtype=np.float64)


def _refuse_slanting(angles: Floats, acceptance: float) -> None:
    """Of angles (d,) on the side of the first direction point."""
    if not np.any(slanting := angles > acceptance):
        return
    index = int(np.argmax(slanting))
    if angles[index] >= np.pi - acceptance:
        raise DirectionPointError(
            index, "the direction point is rejected: it lies on the other side of the plane than the first one",
            "Measure the direction points again, all from where the probe comes, and then the points of contact",
        )  # fmt: skip
    beside = float(np.degrees(min(angles[index], np.pi - angles[index])))
    raise DirectionPointError(
        index,
        f"the direction point is rejected: it was approached at {beside:.1f}° to the plane's normal, accepted are "
        f"{np.degrees(acceptance):.1f}°",
        "Measure the direction point again nearer to the normal, just before contact, and then the points of contact",
    )  # fmt: skip
