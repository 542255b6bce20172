"""Places of a test sphere: once in the middle of the volume, or anywhere."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.planning.candidates import MIDDLE, PatternFor, RelocatedCandidates, VolumeCandidates, upright
from cmm_uq.analysis.planning.set_up import Pattern, SetUp, planned_length
from cmm_uq.analysis.planning.setting import Planning, Setting
from cmm_uq.base.messages import say
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.plan import PlanFacts

RINGS = ((0.0, 1, 0.0), (22.5, 4, 0.0), (45.0, 8, 22.5), (67.5, 4, 0.0), (90.0, 8, 22.5))
"""Points over a hemisphere: degrees from the pole, how many, degrees turned. The usual twenty-five of ISO 10360-5."""


def sphere(facts: ArtefactFacts, plan: PlanFacts) -> Pattern:
    """Twenty-five points over the upper hemisphere, each probed along its normal."""
    normals = []
    for down, count, turn in RINGS:
        polar = np.radians(down)
        azimuth = np.radians(turn) + 2 * np.pi * np.arange(count) / count
        ring = [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.full(count, np.cos(polar))]
        normals.append(np.column_stack(ring))
    n = np.vstack(normals)
    one = Pattern(
        0.5 * planned_length(facts, plan) * n, np.arange(1, len(n) + 1), np.ones(len(n), dtype=np.int64), {},
        {"normal": n, "approach": -np.where(np.abs(n) > 1e-9, n, 0.0)},
    )  # fmt: skip
    return one.repeated(plan.repeats)


def sphere_places(setting: Setting) -> tuple[SetUp, ...]:
    """Once in the middle of the volume."""
    pattern = sphere(setting.artefact, setting.plan)
    return (setting.volume.set_up(pattern, np.eye(3), MIDDLE, say("in the middle")),)


def _shape(setting: Setting) -> PatternFor:
    pattern = sphere(setting.artefact, setting.plan)
    return lambda _: pattern


_PLACES = VolumeCandidates(upright, _shape, RelocatedCandidates(lambda volume: []))

PLANNING = Planning({"ISO 10360-5": sphere_places}, _PLACES.candidates, _PLACES.elsewhere)
