"""Contact points and normals of a feature by its strategy: on its nominal surface, normals out of the material.

A feature's own frame is its direction w, its ``along`` u (made perpendicular to it) and v = w × u, from its point. Points that
are spread evenly stand in the order of a Hammersley set (base 2), on a sphere in that of a Fibonacci lattice: no pattern of
lobes or waves falls into step with them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.part.feature import FEWEST, ROUND, FeatureFacts, Pattern, Strategy

_GOLDEN = np.pi * (3 - np.sqrt(5))  # rad: by which a Fibonacci lattice turns from point to point


def radius_of(facts: FeatureFacts, height: Floats) -> Floats:
    """Of a cone or cylinder at heights (n,) above its point."""
    slope = np.tan(_half_angle(facts)) if facts.kind == "cone" else 0.0
    return np.asarray((facts.diameter_mm or 0.0) / 2 + slope * height)


def _half_angle(facts: FeatureFacts) -> float:
    """Of a cone, rad; 0 of all else."""
    return float(np.radians((facts.angle_deg or 0.0) / 2))


def _steps(low: float, high: float, count: int) -> Floats:
    """Evenly from end to end; the middle where it is one."""
    return np.linspace(low, high, count) if count > 1 else np.array([0.5 * (low + high)])


def _angles(strategy: Strategy, count: int) -> Floats:
    """All around without meeting the first again, or from end to end of a part of it; rad."""
    start, sweep = np.radians(strategy.start_deg), np.radians(strategy.sweep_deg)
    whole = strategy.sweep_deg == 360
    return np.asarray(start + (np.arange(count) * sweep / count if whole else _steps(0, sweep, count)))


def _spread(count: int) -> tuple[Floats, Floats]:
    """Two coordinates in (0, 1) of a Hammersley set: even steps, and the digits of the count in base 2 mirrored."""
    mirrored, scale, left = np.zeros(count), 0.5, np.arange(count)
    while left.any():
        mirrored += scale * (left % 2)
        left, scale = left // 2, scale / 2
    return (np.arange(count) + 0.5) / count, mirrored + 0.5 / count


def _reach(facts: FeatureFacts, strategy: Strategy) -> tuple[float, float]:
    """Between which heights it is probed, or between which radii of a round plane, or polar angles of a sphere."""
    if facts.kind == "sphere":
        return 0.0, float(np.radians(strategy.cap_deg))
    if facts.kind == "plane" and facts.diameter_mm is not None:
        inner = facts.inner_diameter_mm
        low = 0.0 if inner is None else inner / 2 + strategy.margin_mm
        return low, max(facts.diameter_mm / 2 - strategy.margin_mm, low)
    half = max((facts.length_mm or 0.0) / 2 - strategy.margin_mm, 0.0)
    return -half, half


def _placed(facts: FeatureFacts, at: Floats, angle: Floats) -> Floats:
    """(n, 3) at angles about w: at heights of a circle, cylinder or cone, at radii of a plane, at polar angles of a sphere."""
    if facts.kind == "sphere":
        return _on_sphere(facts, np.cos(at), angle)
    radius, height = (at, np.zeros(len(at))) if facts.kind == "plane" else (radius_of(facts, at), at)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height])


def _on_sphere(facts: FeatureFacts, cosine: Floats, angle: Floats) -> Floats:
    sine = np.sqrt(np.clip(1 - cosine**2, 0.0, 1.0))
    unit = np.column_stack([sine * np.cos(angle), sine * np.sin(angle), cosine])
    return np.asarray((facts.diameter_mm or 0.0) / 2 * unit)


def _points(facts: FeatureFacts, strategy: Strategy) -> Floats:
    """Spread evenly over what is probed."""
    count, (low, high), start = strategy.points or 0, _reach(facts, strategy), np.radians(strategy.start_deg)
    if facts.kind == "line":
        return np.column_stack([np.zeros(count), np.zeros(count), _steps(low, high, count)])
    if facts.kind == "circle":
        return _placed(facts, np.zeros(count), _angles(strategy, count))
    if facts.kind == "sphere":
        depth = (np.arange(count) + 0.5) / count * (1 - np.cos(high))
        return _on_sphere(facts, 1 - depth, start + _GOLDEN * np.arange(count))
    first, second = _spread(count)
    if facts.kind != "plane":
        return _placed(facts, high * (2 * first - 1), start + np.radians(strategy.sweep_deg) * second)
    if facts.diameter_mm is None:
        return np.column_stack([high * (2 * first - 1), _across(facts, strategy) * (2 * second - 1), np.zeros(count)])
    return _placed(facts, np.sqrt(low**2 + first * (high**2 - low**2)), 2 * np.pi * second)  # even over the area


def _across(facts: FeatureFacts, strategy: Strategy) -> float:
    """Half of the width of a plane that is probed."""
    return max((facts.width_mm or 0.0) / 2 - strategy.margin_mm, 0.0)


def _grid(facts: FeatureFacts, strategy: Strategy) -> Floats:
    across = _across(facts, strategy)
    x, y = _steps(*_reach(facts, strategy), strategy.columns or 0), _steps(-across, across, strategy.rows or 0)
    return np.column_stack([np.tile(x, len(y)), np.repeat(y, len(x)), np.zeros(len(x) * len(y))])


def _sections(facts: FeatureFacts, strategy: Strategy) -> Floats:
    """Sections across an axis, circles on a plane; of a sphere the pole, and circles of latitude to the end of the cap."""
    count, angle = strategy.sections or strategy.circles or 0, _angles(strategy, strategy.points or 0)
    low, high = _reach(facts, strategy)
    whole = facts.kind == "sphere" or (facts.kind == "plane" and facts.inner_diameter_mm is None)
    at = np.repeat(high * np.arange(1, count + 1) / count if whole else _steps(low, high, count), len(angle))
    around = np.tile(angle, count)
    if facts.kind == "sphere":
        at, around = np.append(0.0, at), np.append(0.0, around)
    return _placed(facts, at, around)


def _lines(facts: FeatureFacts, strategy: Strategy) -> Floats:
    angle, heights = _angles(strategy, strategy.lines or 0), _steps(*_reach(facts, strategy), strategy.points or 0)
    return _placed(facts, np.tile(heights, len(angle)), np.repeat(angle, len(heights)))


def _spiral(facts: FeatureFacts, strategy: Strategy) -> Floats:
    even, (low, high) = _steps(0, 1, strategy.points or 0), _reach(facts, strategy)
    at = high * even if facts.kind == "sphere" else _steps(low, high, len(even))
    return _placed(facts, at, np.radians(strategy.start_deg) + 2 * np.pi * (strategy.turns or 0.0) * even)


# (n, 3) mm, by pattern
_PATTERNS: Mapping[Pattern, Callable[[FeatureFacts, Strategy], Floats]] = {
    "points": _points, "grid": _grid, "sections": _sections, "circles": _sections, "lines": _lines, "spiral": _spiral,
}  # fmt: skip


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
    axes = _axes(facts, where)
    stated = np.array(facts.points_mm or [], dtype=np.float64).reshape(-1, 3)
    if facts.kind == "point":
        local = np.zeros((1, 3))
    elif facts.strategy is not None:
        local = _PATTERNS[facts.strategy.pattern](facts, facts.strategy)
    else:
        local = (stated - facts.point_mm) @ axes.T
        _refuse_off(facts, local, where)
    _refuse_few(facts, local, where)
    if facts.kind == "cone" and np.any(radius_of(facts, local[:, 2]) <= 0):
        raise CmmUqError("the cone ends before its length does", where=where,
                         fix="Shorten length_mm, or give point_mm, diameter_mm and angle_deg of one place")  # fmt: skip
    points = facts.point_mm + local @ axes if facts.points_mm is None else stated
    return Probed(
        facts, points, _normals(facts, local) @ axes, axes[2] if facts.kind not in ("point", "sphere") else None
    )


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


def _axes(facts: FeatureFacts, where: str) -> Floats:
    """(3, 3) u, v, w of a feature, a row each; for a line v is the normal of its surface."""
    w = _unit(facts.direction or [0.0, 0.0, 1.0])
    key, given = ("normal", facts.normal) if facts.kind == "line" else ("along", facts.along)
    across = np.eye(3)[int(np.argmin(np.round(np.abs(w), 6)))] if given is None else _unit(given)
    across = across - (across @ w) * w
    if np.linalg.norm(across) < _ACROSS:
        raise CmmUqError(f"{key} lies along the direction", where=where, fix=f"Give {key} across it, as [x, y, z]")
    u = _unit(across)
    return np.array([np.cross(u, w), u, w] if facts.kind == "line" else [u, np.cross(w, u), w])


def _unit(vector: object) -> Floats:
    given = np.array(vector, dtype=np.float64)
    return np.asarray(given / np.linalg.norm(given))


def _normals(facts: FeatureFacts, local: Floats) -> Floats:
    """(n, 3) unit vectors out of the material, in the feature's frame."""
    if facts.kind not in ROUND:
        return np.tile([0.0, 1.0, 0.0] if facts.kind == "line" else [0.0, 0.0, 1.0], (len(local), 1))
    out = local * ([1.0, 1.0, 1.0] if facts.kind == "sphere" else [1.0, 1.0, 0.0])
    out = out / np.linalg.norm(out, axis=1, keepdims=True)
    if facts.kind == "cone":
        half = _half_angle(facts)
        out = np.column_stack([np.cos(half) * out[:, :2], np.full(len(out), -np.sin(half))])
    return np.asarray(-out if facts.inner else out)


def _off(facts: FeatureFacts, local: Floats) -> Floats:
    """(n,) distances from the nominal surface or curve, mm."""
    radial, height = np.hypot(local[:, 0], local[:, 1]), local[:, 2]
    if facts.kind in ("line", "plane"):
        return np.asarray(radial if facts.kind == "line" else np.abs(height))
    if facts.kind == "sphere":
        return np.asarray(np.abs(np.hypot(radial, height) - radius_of(facts, height)))
    away = np.abs(radial - radius_of(facts, height)) * np.cos(_half_angle(facts))
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
