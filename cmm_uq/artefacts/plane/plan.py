"""Places of a probed plane: flat on the floor of the volume, or anywhere."""

from __future__ import annotations

from typing import cast

import numpy as np

from cmm_uq.analysis.planning.candidates import PatternFor, RelocatedCandidates, VolumeCandidates, across_planes
from cmm_uq.analysis.planning.set_up import Pattern, SetUp
from cmm_uq.analysis.planning.setting import Planning, Setting
from cmm_uq.artefacts.plane.facts import PlaneFacts
from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.plan import PlanFacts


def surface(facts: ArtefactFacts, plan: PlanFacts, size: Floats) -> Pattern:
    """A grid of points of contact over ``size`` (2,) mm; with a probe offset also the point just before the first contact."""
    columns, rows = plan.grid
    offset = cast("PlaneFacts", facts).probe_offset_mm
    i, j = np.meshgrid(np.linspace(-0.5, 0.5, columns), np.linspace(-0.5, 0.5, rows))
    touched = np.column_stack([i.ravel() * size[0], j.ravel() * size[1], np.zeros(i.size)])
    number = np.arange(1, len(touched) + 1)
    if offset is not None:
        before = touched[:1] + np.array([0.0, 0.0, 4 * offset])
        touched = np.vstack([before, touched])
        number = np.concatenate([[0], number])
    return Pattern(touched, number, np.ones(len(touched), dtype=np.int64)).repeated(plan.repeats)


def surface_places(setting: Setting) -> tuple[SetUp, ...]:
    """A grid over the lower face of the volume."""
    pattern = surface(setting.artefact, setting.plan, setting.volume.size[:2])
    return (setting.volume.set_up(pattern, np.eye(3), (0.5, 0.5, 0.0), say("flat")),)


def _shape(setting: Setting) -> PatternFor:
    pattern = surface(setting.artefact, setting.plan, np.full(2, 0.5 * setting.volume.size.min()))
    return lambda _: pattern


_PLACES = VolumeCandidates(across_planes, _shape, RelocatedCandidates(across_planes))

PLANNING = Planning({"surface plate": surface_places}, _PLACES.candidates, _PLACES.elsewhere)
