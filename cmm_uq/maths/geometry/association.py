"""Association of a feature with measured points, by least squares or as a zone, an extreme size or a datum asks for it.

One question, :func:`associate`, and one answer, :class:`Associated`, for every feature of ISO 17450-1 and every criterion of
ISO 1101, ISO 5459 and ISO 14405-1 that this room knows. What is proved of an answer it says itself (``gap``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Ints
from cmm_uq.maths.geometry.extremes import Extreme, circumscribed, inscribed, least_zone
from cmm_uq.maths.geometry.minimax import CIRCLE, CYLINDER, LINE, LINE_IN_PLANE, PLANE, SPHERE
from cmm_uq.maths.geometry.placed import FeatureKind, Placed, placed

Association = Literal["least_squares", "minimum_zone", "maximum_inscribed", "minimum_circumscribed", "tangent"]
ASSOCIATIONS: tuple[Association, ...] = get_args(Association)
ALONG = 0.05  # cosine of the angle between a normal and ``outward`` below which the latter names no side
_WITH_SIZE = (CIRCLE, SPHERE, CYLINDER)
_STRAIGHT = (PLANE, LINE_IN_PLANE)
_CRITERIA: Mapping[Association, Callable[[Placed, Floats], Extreme]] = {
    "minimum_zone": least_zone,
    "maximum_inscribed": inscribed,
    "minimum_circumscribed": circumscribed,
}


@dataclass(frozen=True, eq=False, kw_only=True)
class Associated:
    """A feature associated with n points."""

    feature: FeatureKind
    association: Association
    # (d,) centre; or where the axis pierces the plane across the least-squares axis through the least-squares point; of a
    # plane, and of a line in a plane, the point of it above the centroid. mm.
    position: Floats
    # (d,) unit direction of the axis or line, of a plane its normal (outward where the material was told); None of a sphere
    # and of a circle, whose plane is that of least squares
    direction: Floats | None
    # diameter, mm; of a minimum zone that of its middle, of a cone at its position; None where there is none
    size: float | None
    half_angle: float | None  # of a cone, rad; None of others
    # form deviation against this feature, mm: range of the signed distances; of a line in space the diameter of the cylinder
    # about it that holds all points
    form: float
    deviations: Floats  # (n,) signed orthogonal distances, mm: positive outside, of a plane on the side of its normal
    contacts: Ints  # (p,) points that hold the feature; none of least squares
    multipliers: Floats  # (p,) of sum 1, none negative: the proof that the contacts hold it
    # of the least-squares problem with columns of unit length: large where the points cover little of the feature
    condition: float
    # no feature of this kind meets the criterion better by more than this, mm. Zero where all others were excluded; infinite
    # where only a local optimum is proved, as of cylinders and cones; ``nan`` of least squares.
    gap: float


def associate(
    feature: FeatureKind,
    points: ArrayLike,
    association: Association = "least_squares",
    *,
    outward: ArrayLike | None = None,
) -> Associated:
    """The feature that the criterion asks for.

    Parameters
    ----------
    feature : ``"line"``, ``"plane"``, ``"circle"``, ``"sphere"``, ``"cylinder"`` or ``"cone"``.
    points : (n, 3) in mm; (n, 2) of a line or circle in a plane. Points of a circle in space are projected along the normal
        of its least-squares plane.
    association : the criterion. ``"tangent"`` is of planes and of lines in a plane: outside the material, its largest distance
        from it the least, as ISO 5459 asks of datums. Its direction is that of the minimum zone.
    outward : (d,) direction out of the material, roughly: needed for ``"tangent"``; gives the normal of any plane its sense.

    Raises
    ------
    CmmUqError : an unknown feature or criterion, points that do not determine the feature, or a criterion that they, or no
        such feature, can meet.
    """
    if association not in ASSOCIATIONS:
        raise CmmUqError(f"{association!r} is no association", fix=f"Associations are {', '.join(ASSOCIATIONS)}")
    array = np.asarray(points, dtype=np.float64)
    of = placed(feature, array)
    local = of.local(array)
    if association == "tangent":
        return _tangent(feature, of, local, outward)
    if association in ("maximum_inscribed", "minimum_circumscribed") and of.shape not in _WITH_SIZE:
        raise CmmUqError(f"{feature}: it has no size to be inscribed or circumscribed",
                         fix="Ask for circles, spheres and cylinders")  # fmt: skip
    if association == "least_squares":
        extreme = Extreme(of.state, np.zeros(0, dtype=np.int64), np.zeros(0), np.nan)
    else:
        extreme = _CRITERIA[association](of, local)
    return _answer(feature, association, of, local, extreme, outward)


def _answer(
    feature: FeatureKind, association: Association, of: Placed, local: Floats, found: Extreme, outward: ArrayLike | None
) -> Associated:
    state = found.state[None]
    deviations = of.shape.distances(state, local[:, None])[0][0]
    direction, size, angle = of.direction(state), of.size(state), of.half_angle(state)
    pointing = None if direction is None else direction[0]
    if outward is not None and of.shape is PLANE and pointing is not None and _against(pointing, outward, feature):
        pointing, deviations = -pointing, -deviations
    return Associated(
        feature=feature,
        association=association,
        position=of.position(state)[0],
        direction=pointing,
        size=None if size is None else float(size[0]),
        half_angle=None if angle is None else float(angle[0]),
        form=float(2 * deviations.max() if of.shape is LINE else np.ptp(deviations)),
        deviations=deviations,
        contacts=found.contacts,
        multipliers=found.multipliers,
        condition=of.condition,
        gap=found.gap,
    )


def _tangent(feature: FeatureKind, of: Placed, local: Floats, outward: ArrayLike | None) -> Associated:
    """The side of the minimum zone that looks out of the material."""
    if of.shape not in _STRAIGHT:
        raise CmmUqError(f"{feature}: a tangent feature is a plane, or a line in a plane",
                         fix="Ask for maximum_inscribed or minimum_circumscribed")  # fmt: skip
    if outward is None:
        problem = f"{feature}: a tangent needs the side of the material"
        raise CmmUqError(problem, fix="Give the direction out of it (outward)")
    found = least_zone(of, local)
    slopes = np.append(-found.state[1:], 1.0)
    normal = slopes @ of.frame
    side = -1.0 if _against(normal, outward, feature) else 1.0
    d = of.shape.distances(found.state[None], local[:, None])[0][0]
    found.state[0] += side * (side * d).max() * np.linalg.norm(slopes)
    return _answer(feature, "tangent", of, local, found, outward)


def _against(normal: Floats, outward: ArrayLike, feature: str) -> bool:
    """Whether a normal points into the material."""
    toward = np.asarray(outward, dtype=np.float64)
    if toward.shape != normal.shape or not np.isfinite(toward).all():
        raise CmmUqError(f"{feature}: outward has to be {len(normal)} finite numbers", fix="Give a direction")
    share = float(normal @ toward)
    if abs(share) <= ALONG * float(np.linalg.norm(toward)) * float(np.linalg.norm(normal)):
        raise CmmUqError(f"{feature}: outward lies along it", fix="Give the direction out of the material, across it")
    return share < 0
