"""Placings of a ballbar: the twenty positions of the standard, and anywhere in the volume.

The twenty positions follow figure 26 of ASME B89.4.1-1997 as the recording of Harris (2004, figures C 1 and C 2) carries them
out; its position 18, which repeats 14 there, is taken between 14 and 11.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from cmm_uq.analysis.conformity.plans import B89
from cmm_uq.analysis.planning.candidates import (
    MIDDLE,
    PatternFor,
    RelocatedCandidates,
    VolumeCandidates,
    along_lines,
    check_allowed,
)
from cmm_uq.analysis.planning.set_up import Pattern, SetUp, attitude_along, direction_words, planned_length
from cmm_uq.analysis.planning.setting import Planning, Setting
from cmm_uq.analysis.planning.volume import Volume
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.plan import PlanFacts

_DIAGONALS = (
    (1, 1, 0), (1, -1, 0), (0, 1, -1), (0, 1, 1), (1, 0, -1), (1, 0, 1),
    (1, 1, 1), (1, 1, -1), (1, -1, -1), (1, -1, 1),
)  # fmt: skip
_PARALLELS = (
    ((0, 1, 0), (0.6, 0.5, 0.5)), ((1, 0, 0), (0.5, 0.85, 0.5)), ((1, 0, 0), (0.5, 0.25, 0.5)),
    ((0, 1, 0), (0.3, 0.5, 0.5)), ((0, 1, 0), (0.7, 0.5, 0.5)), ((1, 0, 0), (0.65, 0.1, 0.5)),
    ((1, 0, 0), (0.5, 0.5, 0.5)), ((0, 1, 0), (0.4, 0.5, 0.5)), ((0, 0, 1), (0.65, 0.55, 0.5)),
    ((0, 0, 1), (0.45, 0.3, 0.5)),
)  # fmt: skip


def ballbar(facts: ArtefactFacts, plan: PlanFacts) -> Pattern:
    """Both balls."""
    half = 0.5 * planned_length(facts, plan)
    one = Pattern(np.array([[-half, 0.0, 0.0], [half, 0.0, 0.0]]), np.array([1, 2]), np.ones(2, dtype=np.int64))
    return one.repeated(plan.repeats)


def ballbar_positions(setting: Setting) -> tuple[SetUp, ...]:
    """Twenty positions for a nearly cubic volume; in a longer one ten diagonals more for each further cube along it."""
    pattern = ballbar(setting.artefact, setting.plan)
    sections = _sections(setting.volume)
    wanted = [(d, MIDDLE) for d in _DIAGONALS] + list(_PARALLELS)
    placings = _lines(setting, sections[0], pattern, wanted)
    for section in sections[1:]:
        placings += _lines(setting, section, pattern, wanted[: len(_DIAGONALS)])
    return tuple(placings)


def _lines(
    setting: Setting, volume: Volume, pattern: Pattern,
    wanted: list[tuple[tuple[int, int, int], tuple[float, float, float]]],
) -> list[SetUp]:  # fmt: skip
    found = []
    for direction, place in wanted:
        u = np.array(direction, dtype=np.float64)
        check_allowed(setting, u)
        found.append(volume.set_up(pattern, attitude_along(u), place, direction_words(u)))
    return found


def _sections(volume: Volume) -> list[Volume]:
    """Nearly cubic parts of the volume, overlapping by no more than they must."""
    size = volume.size
    counts = B89.cubes(size)
    edge = B89.nearly_cubic * size.min()
    found = []
    for at in product(*(range(count) for count in counts)):
        length = np.minimum(size, np.where(np.array(counts) > 1, edge, size))
        start = volume.box[:, 0] + (size - length) * np.array(
            [i / (count - 1) if count > 1 else 0.0 for i, count in zip(at, counts, strict=True)]
        )
        found.append(replace(volume, box=np.column_stack([start, start + length])))
    return found


def _shape(setting: Setting) -> PatternFor:
    pattern = ballbar(setting.artefact, setting.plan)
    return lambda _: pattern


_PLACES = VolumeCandidates(along_lines, _shape, RelocatedCandidates(along_lines))

PLANNING = Planning({"ASME B89.4.1": ballbar_positions}, _PLACES.candidates, _PLACES.elsewhere)
