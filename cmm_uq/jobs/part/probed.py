"""Patterns of contact points in a feature's own frame: u, v across its direction, w along it, from its point.

Points that are spread evenly stand in the order of a Hammersley set (base 2), on a sphere in that of a Fibonacci lattice: no
pattern of lobes or waves falls into step with them.

Contact points and normals of a feature by its strategy: on its nominal surface, normals out of the material.

A feature's own frame is its direction w, its ``along`` u (made perpendicular to it) and v = w × u.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.jobs.part.feature import FEWEST, ROUND, FeatureFacts, Kind, Pattern, Strategy

_GOLDEN = np.pi * (3 - np.sqrt(5))  # rad: by which a Fibonacci lattice turns from point to point


def radius_of(facts: FeatureFacts, height: Floats) -> Floats:
    """Of a cone or cylinder at heights (n,) above its point."""
    slope = np.tan(np.radians(angle_of(facts) / 2)) if facts.kind == "cone" else 0.0
    return np.asarray((facts.diameter_mm or 0.0) / 2 + slope * height)


def angle_of(facts: FeatureFacts) -> float:
    """Whole angle of a cone, °; 0 of all else."""
    return facts.angle_deg or 0.0


def _steps(low: float, high: float, count: int) -> Floats:
    """Evenly from end to end; the middle where it is one."""
    return np.linspace(low, high, count) if count > 1 else np.array([0.5 * (low + high)])


def _angles(strategy: Strategy, count: int) -> Floats:
    """All around without meeting the first again, or from end to end of a part of it; rad."""
    start, sweep = np.radians(strategy.start_deg), np.radians(strategy.sweep_deg)
    return np.asarray(
        start + (np.arange(count) * sweep / count if strategy.sweep_deg == 360 else _steps(0, sweep, count))
    )


def _spread(count: int) -> tuple[Floats, Floats]:
    """Two coordinates in (0, 1) of a Hammersley set: even steps, and the digits of the count in base 2 mirrored."""
    mirrored, scale, left = np.zeros(count), 0.5, np.arange(count)
    while left.any():
        mirrored += scale * (left % 2)
        left, scale = left // 2, scale / 2
    return (np.arange(count) + 0.5) / count, mirrored + 0.5 / count


def _ends(facts: FeatureFacts, strategy: Strategy) -> float:
    """Half of the length that is probed."""
    return max((facts.length_mm or 0.0) / 2 - strategy.margin_mm, 0.0)


def _around(facts: FeatureFacts, angle: Floats, height: Floats) -> Floats:
    radius = radius_of(facts, height)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height])


def _line_points(facts: FeatureFacts, strategy: Strategy) -> Floats:
    half, count = _ends(facts, strategy), strategy.points or 0
    return np.column_stack([np.zeros(count), np.zeros(count), _steps(-half, half, count)])


def _circle_points(facts: FeatureFacts, strategy: Strategy) -> Floats:
    angle = _angles(strategy, strategy.points or 0)
    return _around(facts, angle, np.zeros(len(angle)))


def _along_axis(facts: FeatureFacts, strategy: Strategy) -> Floats:
    """Of a cylinder or cone: spread evenly over what is probed of it."""
    height, angle = _spread(strategy.points or 0)
    half = _ends(facts, strategy)
    start, sweep = np.radians(strategy.start_deg), np.radians(strategy.sweep_deg)
    return _around(facts, start + sweep * angle, half * (2 * height - 1))


def _axis_sections(facts: FeatureFacts, strategy: Strategy) -> Floats:
    half, angle = _ends(facts, strategy), _angles(strategy, strategy.points or 0)
    heights = _steps(-half, half, strategy.sections or 0)
    return _around(facts, np.tile(angle, len(heights)), np.repeat(heights, len(angle)))


def _axis_lines(facts: FeatureFacts, strategy: Strategy) -> Floats:
    half, angle = _ends(facts, strategy), _angles(strategy, strategy.lines or 0)
    heights = _steps(-half, half, strategy.points or 0)
    return _around(facts, np.repeat(angle, len(heights)), np.tile(heights, len(angle)))


def _axis_spiral(facts: FeatureFacts, strategy: Strategy) -> Floats:
    half, count = _ends(facts, strategy), strategy.points or 0
    return _around(facts, _turned(strategy, count), _steps(-half, half, count))


def _turned(strategy: Strategy, count: int) -> Floats:
    return np.asarray(np.radians(strategy.start_deg) + 2 * np.pi * (strategy.turns or 0.0) * _steps(0, 1, count))


def _in_plane(x: Floats, y: Floats) -> Floats:
    return np.column_stack([x, y, np.zeros(len(x))])


def _ring(facts: FeatureFacts, strategy: Strategy) -> tuple[float, float]:
    """Radii between which a round plane is probed."""
    inner = facts.inner_diameter_mm
    low = 0.0 if inner is None else inner / 2 + strategy.margin_mm
    return low, max((facts.diameter_mm or 0.0) / 2 - strategy.margin_mm, low)


def _plane_grid(facts: FeatureFacts, strategy: Strategy) -> Floats:
    half, across = _ends(facts, strategy), max((facts.width_mm or 0.0) / 2 - strategy.margin_mm, 0.0)
    x, y = _steps(-half, half, strategy.columns or 0), _steps(-across, across, strategy.rows or 0)
    return _in_plane(np.tile(x, len(y)), np.repeat(y, len(x)))


def _plane_points(facts: FeatureFacts, strategy: Strategy) -> Floats:
    first, second = _spread(strategy.points or 0)
    if facts.diameter_mm is None:
        half, across = _ends(facts, strategy), max((facts.width_mm or 0.0) / 2 - strategy.margin_mm, 0.0)
        return _in_plane(half * (2 * first - 1), across * (2 * second - 1))
    low, high = _ring(facts, strategy)
    radius, angle = np.sqrt(low**2 + first * (high**2 - low**2)), 2 * np.pi * second  # even over the area
    return _in_plane(radius * np.cos(angle), radius * np.sin(angle))


def _plane_circles(facts: FeatureFacts, strategy: Strategy) -> Floats:
    low, high = _ring(facts, strategy)
    count = strategy.circles or 0
    radii = _steps(low, high, count) if facts.inner_diameter_mm is not None else high * np.arange(1, count + 1) / count
    angle = _angles(strategy, strategy.points or 0)
    radius, angle = np.repeat(radii, len(angle)), np.tile(angle, count)
    return _in_plane(radius * np.cos(angle), radius * np.sin(angle))


def _plane_spiral(facts: FeatureFacts, strategy: Strategy) -> Floats:
    low, high = _ring(facts, strategy)
    count = strategy.points or 0
    radius, angle = _steps(low, high, count), _turned(strategy, count)
    return _in_plane(radius * np.cos(angle), radius * np.sin(angle))


def _on_sphere(facts: FeatureFacts, cosine: Floats, angle: Floats) -> Floats:
    sine = np.sqrt(np.clip(1 - cosine**2, 0.0, 1.0))
    unit = np.column_stack([sine * np.cos(angle), sine * np.sin(angle), cosine])
    return np.asarray((facts.diameter_mm or 0.0) / 2 * unit)


def _sphere_points(facts: FeatureFacts, strategy: Strategy) -> Floats:
    count = strategy.points or 0
    depth = (np.arange(count) + 0.5) / count * (1 - np.cos(np.radians(strategy.cap_deg)))
    return _on_sphere(facts, 1 - depth, np.radians(strategy.start_deg) + _GOLDEN * np.arange(count))


def _sphere_sections(facts: FeatureFacts, strategy: Strategy) -> Floats:
    """The pole, and circles of latitude at even angles from it down to the end of the cap."""
    count, each = strategy.sections or 0, strategy.points or 0
    polar = np.radians(strategy.cap_deg) * np.arange(1, count + 1) / count
    angle = _angles(strategy, each)
    around = _on_sphere(facts, np.cos(np.repeat(polar, each)), np.tile(angle, count))
    return np.concatenate([_on_sphere(facts, np.ones(1), np.zeros(1)), around])


def _sphere_spiral(facts: FeatureFacts, strategy: Strategy) -> Floats:
    count = strategy.points or 0
    polar = np.radians(strategy.cap_deg) * _steps(0, 1, count)
    return _on_sphere(facts, np.cos(polar), _turned(strategy, count))


_AXIS: Mapping[Pattern, Callable[[FeatureFacts, Strategy], Floats]] = {
    "points": _along_axis, "sections": _axis_sections, "lines": _axis_lines, "spiral": _axis_spiral,
}  # fmt: skip
PATTERNS_OF: Mapping[tuple[Kind, Pattern], Callable[[FeatureFacts, Strategy], Floats]] = {
    ("line", "points"): _line_points, ("circle", "points"): _circle_points,
    ("plane", "points"): _plane_points, ("plane", "grid"): _plane_grid, ("plane", "circles"): _plane_circles,
    ("plane", "spiral"): _plane_spiral, ("sphere", "points"): _sphere_points, ("sphere", "sections"): _sphere_sections,
    ("sphere", "spiral"): _sphere_spiral,
    **{("cylinder", pattern): make for pattern, make in _AXIS.items()},
    **{("cone", pattern): make for pattern, make in _AXIS.items()},
}  # fmt: skip
"""By kind and pattern, (n, 3) mm."""


# from the nominal surface: a contact point farther away from it belongs to another surface, or is a mistake
OFF_MM = 0.1
_ACROSS = 1e-3  # sine of the angle below which two directions are one, a twentieth of a degree
_TOGETHER_MM = 1e-6  # below which two contact points are one


@dataclass(frozen=True, eq=False)
class Probed:
    """A feature with the points at which it is probed."""

    facts: FeatureFacts  # what the job says of it
    # points, normals: (n, 3) nominal contact points, mm, and unit vectors out of the material, in the frame of the part
    points: Floats
    normals: Floats
    direction: Floats | None  # (3,) unit vector; ``None`` of a sphere and a point, which have none of their own


def probed(facts: FeatureFacts, where: str) -> Probed:
    """A feature with its contact points."""
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

    Returns ``None`` where its extent is not said, or it has none.
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
        w = _unit(facts.direction or [0.0, 0.0, 1.0])
        key = "normal" if facts.kind == "line" else "along"
        given = facts.normal if facts.kind == "line" else facts.along
        across = np.eye(3)[int(np.argmin(np.round(np.abs(w), 6)))] if given is None else _unit(given)
        across = across - (across @ w) * w
        if np.linalg.norm(across) < _ACROSS:
            raise CmmUqError(f"{key} lies along the direction", where=where, fix=f"Give {key} across it, as [x, y, z]")
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
