"""Probe offset on a plane surface: which way the material lies, and where the surface is (US 4,866,643 claim 1).

A probe of finite diameter touches a plane with its side, so that the points of contact lie on a plane one offset away from
the surface. A point just before contact tells on which side the probe was.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmm_uq.errors import CmmUqError
from cmm_uq.geometry import Plane, fit_plane
from cmm_uq.points import Floats


@dataclass(frozen=True, eq=False)
class OffsetPlane:
    """A plane surface, compensated for the probe's offset.

    Parameters
    ----------
    point : (3,) of the surface, mm: the centroid of the contact points, moved.
    normal : (3,) unit normal out of the material, towards the probe.
    covariance : (6, 6) of point and normal, mm² and rad².
    angle : between normal and the direction of approach, rad.
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
    direction: Floats,
    contacts: Floats,
    offset: float,
    *,
    acceptance: float = np.pi / 3,
    u_offset: float = 0.0,
    u_point: float | None = None,
) -> OffsetPlane:
    """Surface plane from a point just before contact and the points of contact.

    Parameters
    ----------
    direction : (3,) the point D just before contact, mm.
    contacts : (n, 3) the points C1 … CN in contact, n ≥ 3, mm.
    offset : of the probe, its effective radius, mm.
    acceptance : largest angle A between the normal and D − C1 at which D is believed, rad.
    u_offset : standard uncertainty of the offset, mm.
    u_point : standard uncertainty of a contact point along the normal, mm; from the residuals when left out.

    Raises
    ------
    CmmUqError : too few points or on one line; an offset that is not positive; or a direction point that is rejected,
        with what to measure again.
    """
    if not (np.isfinite(offset) and offset > 0):
        raise CmmUqError(f"a probe offset of {offset} mm", fix="Give the probe's effective radius in mm, above 0")
    if not 0 < acceptance < np.pi / 2:
        raise CmmUqError(
            f"a range of acceptance of {np.degrees(acceptance):.4g}°", fix="Choose an angle between 0° and 90°"
        )
    plane = fit_plane(contacts, u_point=u_point)
    approach = np.asarray(direction, dtype=np.float64) - np.asarray(contacts, dtype=np.float64)[0]
    distance = float(np.linalg.norm(approach))
    if not distance > 0:
        raise CmmUqError(
            "the direction point is the first point of contact",
            fix="Measure the direction point again, before the probe touches the surface",
        )
    angle = float(np.arccos(np.clip(plane.normal @ approach / distance, -1, 1)))
    turned = angle > np.pi / 2
    normal, angle = (-plane.normal, np.pi - angle) if turned else (plane.normal, angle)
    if angle > acceptance:
        raise CmmUqError(
            f"the direction point is rejected: it was approached at {np.degrees(angle):.1f}° to the plane's normal, accepted "
            f"are {np.degrees(acceptance):.1f}°",
            fix="Measure the direction point again nearer to the normal, just before contact, and then the points of contact",
        )
    moved = np.vstack([np.hstack([np.eye(3), -offset * np.eye(3)]), np.hstack([np.zeros((3, 3)), np.eye(3)])])
    # turning the normal round turns the sign of its covariance with the point
    flip = np.diag([1.0] * 3 + [-1.0 if turned else 1.0] * 3)
    covariance = moved @ flip @ plane.covariance @ flip @ moved.T
    covariance[:3, :3] += u_offset**2 * np.outer(normal, normal)
    return OffsetPlane(plane.point - offset * normal, normal, covariance, angle, turned, plane)
