"""Candidate placings: the artefact in many places and attitudes inside the machine's volume."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from cmm_uq.artefacts.triangle_placings import PLANES as TRIANGLE_PLANES
from cmm_uq.artefacts.triangle_placings import Placing as TrianglePlacing
from cmm_uq.artefacts.triangle_placings import placed_triangle
from cmm_uq.artefacts.triangle_standard import TriangleStandard
from cmm_uq.errors import CmmUqError
from cmm_uq.planning import patterns
from cmm_uq.planning.directions import PLANES, attitudes_of_lines
from cmm_uq.planning.placing import Pattern, Placing, split
from cmm_uq.planning.setting import Setting
from cmm_uq.planning.swept import swept
from cmm_uq.planning.volume import Volume
from cmm_uq.points import Floats

LINES = ("ballbar", "step_gauge", "gauge_blocks")
SURFACES = ("plate", "plane")

_THIRDS = (0.0, 0.5, 1.0)
_FIFTHS = (0.0, 0.25, 0.5, 0.75, 1.0)

Shape = Callable[[Floats], Pattern | None]
"""The pattern for an attitude; ``None`` where it does not fit."""


def candidates(setting: Setting, centre: Floats | None = None) -> tuple[Placing, ...]:
    """Placings that the volume and the fixtures allow, at most as many as the plan says.

    Parameters
    ----------
    centre : (3,) of the fixed ball of a swept bar, in scale readings.

    Raises
    ------
    CmmUqError : there is none.
    """
    kind, plan, volume = setting.artefact.kind, setting.plan, setting.volume
    if kind == "shift":
        raise CmmUqError("a shift job has its series, and no other placings to choose from",
                         where="job.toml [plan] criterion", fix="Leave it out; shifts_mm says what is measured")  # fmt: skip
    if kind == "bryan":
        return swept(volume, patterns.length_of(setting.artefact, plan), plan.candidates, plan.repeats, centre)
    if kind == "triangle":
        return thinned(_triangles(setting), plan.candidates, volume)
    return thinned(_everywhere(volume, attitudes(kind, volume), _shape(setting)), plan.candidates, volume)


def like(pattern: Pattern, kind: str, volume: Volume, recorded: Floats, count: int) -> tuple[Placing, ...]:
    """The same pattern elsewhere: attitudes of its kind and, first of all, the recorded one (3, 3)."""
    ways = [("as recorded", recorded)] + ([] if kind == "sphere" else attitudes(kind, volume))
    return thinned(_everywhere(volume, ways, lambda _: pattern), count, volume)


def attitudes(kind: str, volume: Volume) -> list[tuple[str, Floats]]:
    """Ways of setting up an artefact of a kind, those that fixtures allow; a plate is held by its normal."""
    if kind in LINES:
        return [(title, way) for title, way in attitudes_of_lines(volume.size) if volume.allows(way[:, 0])]
    if kind in (*SURFACES, "triangle"):
        return [(title, way) for title, way in PLANES if volume.allows(way[:, 2])]
    return [("upright", np.eye(3))]


def thinned(placings: Iterator[Placing], count: int, volume: Volume) -> tuple[Placing, ...]:
    """At most so many of them, spread evenly over the list.

    Raises
    ------
    CmmUqError : there are none at all.
    """
    found = tuple(placings)
    if not found:
        raise CmmUqError(
            "no placing is possible: the artefact does not fit the volume in any direction that the fixtures allow",
            where="job.toml [plan]",
            fix=f"The volume is {' × '.join(f'{v:.0f}' for v in volume.size)} mm; allow other directions or heights, or use "
            "a smaller artefact",
        )  # fmt: skip
    if len(found) <= count:
        return found
    return tuple(found[i] for i in np.unique(np.linspace(0, len(found) - 1, count).round().astype(int)))


def _shape(setting: Setting) -> Shape:
    facts, plan, volume = setting.artefact, setting.plan, setting.volume
    if facts.kind in ("step_gauge", "gauge_blocks"):
        lengths = patterns.distances(facts, plan)

        def gauge(attitude: Floats) -> Pattern | None:
            fitting = patterns.five_of(lengths, volume.chord(attitude[:, 0]))
            if not len(fitting):
                return None
            return (
                patterns.gauge(fitting, plan)
                if facts.kind == "step_gauge"
                else patterns.block(float(fitting[-1]), plan)
            )

        return gauge
    if facts.kind == "ballbar":
        pattern = patterns.ballbar(facts, plan)
    elif facts.kind == "plate":
        pattern = patterns.plate(facts, plan, float(volume.size.min()))
    elif facts.kind == "plane":
        pattern = patterns.surface(facts, plan, np.full(2, 0.5 * volume.size.min()))
    else:
        pattern = patterns.sphere(facts, plan)
    return lambda _: pattern


def _everywhere(volume: Volume, ways: Sequence[tuple[str, Floats]], shape: Shape) -> Iterator[Placing]:
    """Every attitude in the corners, on the edges and in the middle of the room that it has."""
    steps = _FIFTHS if len(ways) < 4 else _THIRDS
    for title, attitude in ways:
        pattern = shape(attitude)
        room = None if pattern is None else volume.room(pattern.turned(attitude))
        if pattern is None or room is None:
            continue
        spare = room[:, 1] - room[:, 0]
        seen: set[tuple[float, ...]] = set()
        for place in product(steps, repeat=3):
            middle = room[:, 0] + spare * place
            key = tuple(middle.round(3).tolist())
            if key not in seen:
                seen.add(key)
                yield pattern.placed(volume.machine, attitude, middle, title)


def _triangles(setting: Setting) -> Iterator[Placing]:
    """Every plane, place and tip."""
    volume = setting.volume
    sides = TriangleStandard.of(setting.artefact).sides
    machine = replace(setting.machine, travel_mm=volume.box)
    normals = {plane: np.eye(3)[3 - a - b] for plane, (a, b) in TRIANGLE_PLANES.items()}
    for plane, normal in normals.items():
        if not volume.allows(normal):
            continue
        tipped = [
            TrianglePlacing(f"in the plane {plane}{', longer tip' if long else ''}", plane, (x, y, z), long)
            for x, y, z in product(_THIRDS, repeat=3)
            for long in (False, True)
        ]
        try:
            points = placed_triangle(machine, sides, tipped, repeats=setting.plan.repeats)
        except CmmUqError:  # it does not fit this plane
            continue
        for placing, some in zip(tipped, split(points), strict=True):
            if volume.heights[0] <= some.middle[2] <= volume.heights[1]:
                yield Placing(placing.title, replace(some.points, machine=setting.machine))
