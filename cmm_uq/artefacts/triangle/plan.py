"""Placings of a triangle: the seven of the standard, and every plane, place and tip."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import cast

import numpy as np

from cmm_uq.analysis.planning.candidates import (
    ACROSS,
    THIRDS,
    RelocatedCandidates,
    across_planes,
    check_allowed,
    thinned,
)
from cmm_uq.analysis.planning.set_up import SetUp, split
from cmm_uq.analysis.planning.setting import Planning, Setting, Start
from cmm_uq.artefacts.triangle.facts import TriangleFacts
from cmm_uq.artefacts.triangle.placings import PLANES, SEVEN_PLACINGS, placed_triangle
from cmm_uq.artefacts.triangle.placings import Placing as TrianglePlacing
from cmm_uq.artefacts.triangle.standard import TriangleStandard
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, say


def triangle_placings(setting: Setting) -> tuple[SetUp, ...]:
    """The seven placings of the triangle standard."""
    sides = TriangleStandard.of(cast("TriangleFacts", setting.artefact)).sides
    machine = replace(setting.machine, travel_mm=setting.volume.box)
    for placing in SEVEN_PLACINGS:
        check_allowed(setting, np.eye(3)[3 - sum(PLANES[placing.plane])], ACROSS)
    points = placed_triangle(machine, sides, repeats=setting.plan.repeats)
    return tuple(
        SetUp(placing.title, replace(some.points, machine=setting.machine))
        for placing, some in zip(SEVEN_PLACINGS, split(points), strict=True)
    )


def candidates(setting: Setting, start: Start | None) -> tuple[SetUp, ...]:
    """Every plane, place and tip, at most as many as the plan says."""
    return thinned(_everywhere(setting), setting.plan.candidates, setting.volume)


def _title(plane: str, *, longer: bool) -> Text:
    named = Verbatim(plane)
    return say("in the plane {plane}, longer tip", plane=named) if longer else say("in the plane {plane}", plane=named)


def _everywhere(setting: Setting) -> Iterator[SetUp]:
    """Every plane, place and tip."""
    volume = setting.volume
    sides = TriangleStandard.of(cast("TriangleFacts", setting.artefact)).sides
    machine = replace(setting.machine, travel_mm=volume.box)
    normals = {plane: np.eye(3)[3 - a - b] for plane, (a, b) in PLANES.items()}
    for plane, normal in normals.items():
        if not volume.allows(normal):
            continue
        tipped = [
            TrianglePlacing(_title(plane, longer=long), plane, (x, y, z), long)
            for x, y, z in product(THIRDS, repeat=3)
            for long in (False, True)
        ]
        try:
            points = placed_triangle(machine, sides, tipped, repeats=setting.plan.repeats)
        except CmmUqError:  # it does not fit this plane
            continue
        for placing, some in zip(tipped, split(points), strict=True):
            if volume.heights[0] <= some.middle[2] <= volume.heights[1]:
                yield SetUp(placing.title, replace(some.points, machine=setting.machine))


PLANNING = Planning({"triangle placings": triangle_placings}, candidates, RelocatedCandidates(across_planes))
