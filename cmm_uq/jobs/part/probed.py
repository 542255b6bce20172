"""Contact points and normals of a feature by its strategy: on its nominal surface, normals out of the material.

A feature's own frame is its direction w, its ``along`` u (made perpendicular to it) and v = w × u.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.jobs.part.feature import FEWEST, ROUND, FeatureFacts, Strategy
from cmm_uq.jobs.part.patterns import PATTERNS_OF, angle_of, radius_of

OFF_MM = 0.1
"""From the nominal surface: a contact point farther away from it belongs to another surface, or is a mistake."""

_ACROSS = 1e-3
"""Sine of the angle below which two directions are one, a twentieth of a degree."""

_TOGETHER_MM = 1e-6
"""Below which two contact points are one."""


@dataclass(frozen=True, eq=False)
class Probed:
    """A feature with the points at which it is probed.

    Parameters
    ----------
    facts : what the job says of it.
    points, normals : (n, 3) nominal contact points, mm, and unit vectors out of the material, in the frame of the part.
    direction : (3,) unit vector; ``None`` of a sphere and a point, which have none of their own.
    """

    facts: FeatureFacts
    points: Floats
    normals: Floats
    direction: Floats | None


def probed(facts: FeatureFacts, where: str) -> Probed:
    """A feature with its contact points.

    Parameters
    ----------
    where : file and table, for messages.

    Raises
    ------
    CmmUqError : too few points, or points that are one, lie off the nominal surface or beyond the tip of a cone.
    """
    frame = _Frame.of(facts, where)
    if facts.kind == "point":
        local = np.zeros((1, 3))
    elif facts.strategy is not None:
        local = PATTERNS_OF[facts.kind, facts.strategy.pattern](facts, facts.strategy)
    else:
        local = (np.array(facts.points_mm, dtype=np.float64).reshape(-1, 3) - facts.point_mm) @ frame.axes.T
        _refuse_off(facts, local, where)
    _refuse_few(facts, local, where)
    _refuse_beyond_the_tip(facts, local, where)
    if facts.points_mm is not None:
        points = np.array(facts.points_mm, dtype=np.float64).reshape(-1, 3)
    else:
        points = facts.point_mm + local @ frame.axes
    own = frame.axes[2] if facts.kind not in ("point", "sphere") else None
    return Probed(facts, points, _normals(facts, local, frame), own)


def whole_surface(facts: FeatureFacts, count: int) -> Probed | None:
    """A feature probed evenly from end to end, so closely that it stands for its surface.

    Parameters
    ----------
    count : of points.

    Returns
    -------
    ``None`` where its extent is not said, or it has none.
    """
    sized = {
        "line": facts.length_mm, "plane": facts.diameter_mm or (facts.length_mm and facts.width_mm), "circle": 1, "sphere": 1,
        "cylinder": facts.length_mm, "cone": facts.length_mm,
    }  # fmt: skip
    if count < FEWEST[facts.kind] or not sized.get(facts.kind):
        return None
    own = facts.strategy or Strategy(pattern="points", points=count)
    evenly = Strategy(
        pattern="points", points=count, start_deg=own.start_deg, sweep_deg=own.sweep_deg, cap_deg=own.cap_deg
    )
    return probed(facts.model_copy(update={"strategy": evenly, "points_mm": None}), facts.name)


@dataclass(frozen=True, eq=False)
class _Frame:
    """(3, 3) u, v, w of a feature, a row each; for a line v is the normal of its surface."""

    axes: Floats

    @classmethod
    def of(cls, facts: FeatureFacts, where: str) -> _Frame:
        """See above.

        Raises
        ------
        CmmUqError : two directions that ought to be across each other are one.
        """
        w = _unit(facts.direction or [0.0, 0.0, 1.0])
        key = "normal" if facts.kind == "line" else "along"
        given = facts.normal if facts.kind == "line" else facts.along
        across = np.eye(3)[int(np.argmin(np.round(np.abs(w), 6)))] if given is None else _unit(given)
        across = across - (across @ w) * w
        if np.linalg.norm(across) < _ACROSS:
            raise CmmUqError(f"{key} lies along the direction", where=where,
                             fix=f"Give {key} across it, as [x, y, z]")  # fmt: skip
        u = _unit(across)
        if facts.kind == "line":
            return cls(np.array([np.cross(u, w), u, w]))
        return cls(np.array([u, np.cross(w, u), w]))


def _unit(vector: object) -> Floats:
    given = np.array(vector, dtype=np.float64)
    return np.asarray(given / np.linalg.norm(given))


def _normals(facts: FeatureFacts, local: Floats, frame: _Frame) -> Floats:
    """(n, 3) unit vectors out of the material, in the frame of the part."""
    out = np.tile([0.0, 0.0, 1.0], (len(local), 1))
    if facts.kind == "line":
        out = np.tile([0.0, 1.0, 0.0], (len(local), 1))
    elif facts.kind in ROUND:
        out = local * ([1.0, 1.0, 1.0] if facts.kind == "sphere" else [1.0, 1.0, 0.0])
        out = out / np.linalg.norm(out, axis=1, keepdims=True)
        if facts.kind == "cone":
            half = np.radians(angle_of(facts) / 2)
            out = np.column_stack([np.cos(half) * out[:, :2], np.full(len(out), -np.sin(half))])
        out = -out if facts.inner else out
    return np.asarray(out @ frame.axes)


def _off(facts: FeatureFacts, local: Floats) -> Floats:
    """(n,) distances from the nominal surface or curve, mm."""
    radial, height = np.hypot(local[:, 0], local[:, 1]), local[:, 2]
    if facts.kind == "line":
        return np.asarray(radial)
    if facts.kind == "plane":
        return np.asarray(np.abs(height))
    if facts.kind == "sphere":
        return np.asarray(np.abs(np.hypot(radial, height) - radius_of(facts, height)))
    away = np.abs(radial - radius_of(facts, height)) * np.cos(np.radians(angle_of(facts) / 2))
    return np.asarray(np.hypot(away, height) if facts.kind == "circle" else away)


def _refuse_off(facts: FeatureFacts, local: Floats, where: str) -> None:
    away = _off(facts, local)
    if len(away) and away.max() > OFF_MM:
        row = int(np.argmax(away))
        raise CmmUqError(f"point {row + 1} lies {away[row]:.3g} mm from the nominal {facts.kind}", where=f"{where} points_mm",
                         fix="Give contact points on its surface, not centres of the tip, or mend the nominal")  # fmt: skip


def _refuse_few(facts: FeatureFacts, local: Floats, where: str) -> None:
    least = FEWEST[facts.kind]
    if len(local) < least:
        count = "1 point is" if len(local) == 1 else f"{len(local)} points are"
        raise CmmUqError(f"{count} too few for a {facts.kind}", where=where, fix=f"Probe at least {least}")
    apart = np.unique(np.round(local / _TOGETHER_MM), axis=0)
    if len(apart) < least:
        raise CmmUqError(f"{len(apart)} of {len(local)} points lie apart, too few for a {facts.kind}", where=where,
                         fix=f"Probe it at {least} places at least")  # fmt: skip


def _refuse_beyond_the_tip(facts: FeatureFacts, local: Floats, where: str) -> None:
    if facts.kind == "cone" and np.any(radius_of(facts, local[:, 2]) <= 0):
        raise CmmUqError("the cone ends before its length does", where=where,
                         fix="Shorten length_mm, or give point_mm, diameter_mm and angle_deg of one place")  # fmt: skip
