"""Placings of a plate: three attitudes, two places each, and anywhere in the volume."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.planning.candidates import (
    ACROSS,
    PatternFor,
    RelocatedCandidates,
    VolumeCandidates,
    across_planes,
    check_allowed,
)
from cmm_uq.analysis.planning.set_up import PRINCIPAL_PLANES, Pattern, SetUp
from cmm_uq.analysis.planning.setting import Planning, Setting
from cmm_uq.base.points import AXES
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.plan import PlanFacts


def plate(facts: ArtefactFacts, plan: PlanFacts, size: float) -> Pattern:
    """A grid of balls; without a pitch as large as fits ``size`` mm."""
    columns, rows = plan.grid
    longest = max(columns, rows) - 1
    pitch = plan.pitch_mm or (facts.length_mm or plan.length_mm or size) / np.hypot(columns - 1, rows - 1)
    pitch = min(pitch, size / longest) if plan.pitch_mm is None else pitch
    i, j = np.meshgrid(np.arange(columns), np.arange(rows))
    reference = np.asarray(pitch * np.column_stack([i.ravel(), j.ravel(), np.zeros(i.size)]), dtype=np.float64)
    named = {f"reference_{a}_mm": reference[:, k] for k, a in enumerate(AXES)}
    one = Pattern(reference - reference.mean(axis=0), np.arange(1, i.size + 1), np.ones(i.size, dtype=np.int64), named)
    return one.repeated(plan.repeats)


def plate_placings(setting: Setting) -> tuple[SetUp, ...]:
    """Flat at two heights, upright along X front and back, upright along Y left and right."""
    volume = setting.volume
    pattern = plate(setting.artefact, setting.plan, float(volume.size.min()))
    found = []
    for (title, attitude), places in zip(PRINCIPAL_PLANES, (
        ((0.5, 0.5, 0.0), (0.5, 0.5, 1.0)), ((0.5, 0.0, 0.5), (0.5, 1.0, 0.5)), ((0.0, 0.5, 0.5), (1.0, 0.5, 0.5)),
    ), strict=True):  # fmt: skip
        check_allowed(setting, attitude[:, 2], ACROSS)
        found += [volume.set_up(pattern, attitude, place, title) for place in places]
    return tuple(found)


def _shape(setting: Setting) -> PatternFor:
    pattern = plate(setting.artefact, setting.plan, float(setting.volume.size.min()))
    return lambda _: pattern


_PLACES = VolumeCandidates(across_planes, _shape, RelocatedCandidates(across_planes))

PLANNING = Planning({"plate placings": plate_placings}, _PLACES.candidates, _PLACES.elsewhere)
