"""What is measured of a step gauge or of gauge blocks in one placing, and the lines that the standard asks for.

Lines follow ISO 10360-2:2009, 6.3: the four space diagonals and the three axes, five lengths each.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cmm_uq.analysis.planning.candidates import MIDDLE, check_allowed
from cmm_uq.analysis.planning.set_up import Pattern, SetUp, attitude_along, direction_words, planned_length
from cmm_uq.analysis.planning.setting import Setting
from cmm_uq.base.points import Floats
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.plan import PlanFacts

PITCH = 20.0
"""mm, usual distance of the faces of a step gauge."""

FIVE = 5
"""Lengths on a line (ISO 10360-2:2009, 6.3)."""


def faces_of(facts: ArtefactFacts, plan: PlanFacts) -> Floats:
    """Distances of faces from the first, in ascending order, mm.

    Raises
    ------
    CmmUqError : nothing says how long the gauge is.
    """
    if plan.lengths_mm:
        return np.unique(np.array(plan.lengths_mm, dtype=np.float64))
    length = planned_length(facts, plan)
    pitch = plan.pitch_mm or PITCH
    faces: Floats = pitch * np.arange(1, int(length / pitch + 1e-9) + 1, dtype=np.float64)
    return faces if len(faces) else np.array([length])


def blocks_of(facts: ArtefactFacts, plan: PlanFacts) -> Floats:
    """Lengths of blocks, in ascending order, mm.

    Raises
    ------
    CmmUqError : nothing says how long they are.
    """
    if plan.lengths_mm:
        return np.unique(np.array(plan.lengths_mm, dtype=np.float64))
    return np.asarray(planned_length(facts, plan) * np.arange(1, FIVE + 1) / FIVE, dtype=np.float64)


def five_of(lengths: Floats, longest: float) -> Floats:
    """Five lengths, well spread from the shortest to the longest, that are not longer than ``longest``; fewer if there are."""
    fitting = lengths[lengths <= longest + 1e-6]
    if len(fitting) <= FIVE:
        return fitting
    wanted = np.linspace(fitting[0], fitting[-1], FIVE)
    return np.asarray(fitting[np.unique(np.abs(fitting[:, None] - wanted).argmin(axis=0))], dtype=np.float64)


def gauge(lengths: Floats, plan: PlanFacts) -> Pattern:
    """Faces at 0 and at some lengths (k,), met on the way out and, if the plan says so, on the way back."""
    out = np.concatenate([[0.0], lengths])
    faces = np.concatenate([out, out[::-1]]) if plan.both_ways else out
    n = len(faces)
    body, travel = np.zeros((n, 3)), np.zeros((n, 3))
    body[:, 0] = faces - 0.5 * out[-1]
    travel[:, 0] = np.where(np.arange(n) < len(out), 1.0, -1.0)
    one = Pattern(body, np.arange(1, n + 1), np.ones(n, dtype=np.int64), {"reference_mm": faces}, {"approach": travel})
    return one.repeated(plan.repeats)


def block(length: float, plan: PlanFacts) -> Pattern:
    """Two outer faces, each met from outside."""
    along = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    one = Pattern(
        -0.5 * length * along, np.array([1, 2]), np.ones(2, dtype=np.int64), {"reference_mm": np.array([0.0, length])},
        {"approach": along, "normal": -along},
    )  # fmt: skip
    return one.repeated(plan.repeats)


def seven_lines(setting: Setting, lengths: Floats, shapes: Callable[[Floats], list[Pattern]]) -> tuple[SetUp, ...]:
    """Four space diagonals and three axes through the middle of the volume, five lengths on each.

    Parameters
    ----------
    lengths : (k,) that there are, mm.
    shapes : what is measured, one after the other, of the lengths that fit a line.
    """
    volume = setting.volume
    size = volume.size
    diagonals = [size * signs for signs in ((1, 1, 1), (1, -1, 1), (-1, 1, 1), (-1, -1, 1))]
    found = []
    for direction in (*diagonals, *np.eye(3)):
        check_allowed(setting, direction)
        fitting = five_of(lengths, volume.chord(direction))
        if not len(fitting):
            raise volume.too_small(
                np.outer([-0.5, 0.5], lengths[0] * attitude_along(direction)[:, 0]), direction_words(direction)
            )
        found += [
            volume.set_up(shape, attitude_along(direction), MIDDLE, direction_words(direction))
            for shape in shapes(fitting)
        ]
    return tuple(found)
