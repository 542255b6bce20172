"""Patterns of contact points in a feature's own frame: u, v across its direction, w along it, from its point.

Points that are spread evenly stand in the order of a Hammersley set (base 2), on a sphere in that of a Fibonacci lattice: no
pattern of lobes or waves falls into step with them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.jobs.part.feature import FeatureFacts, Kind, Pattern, Strategy

_GOLDEN = np.pi * (3 - np.sqrt(5))
"""rad: by which a Fibonacci lattice turns from point to point."""


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
