"""What is measured of each kind of artefact in one placing, from what the job says of it."""

from __future__ import annotations

import numpy as np

from cmm_uq.errors import CmmUqError
from cmm_uq.jobs.job import ArtefactFacts
from cmm_uq.jobs.plan import PlanFacts
from cmm_uq.planning.placing import Pattern
from cmm_uq.points import AXES, Floats

PITCH = 20.0
"""mm, usual distance of the faces of a step gauge."""

FIVE = 5
"""Lengths on a line (ISO 10360-2:2009, 6.3)."""

RINGS = ((0.0, 1, 0.0), (22.5, 4, 0.0), (45.0, 8, 22.5), (67.5, 4, 0.0), (90.0, 8, 22.5))
"""Points over a hemisphere: degrees from the pole, how many, degrees turned. The usual twenty-five of ISO 10360-5."""


def length_of(facts: ArtefactFacts, plan: PlanFacts) -> float:
    """Length, mm, by which a bar is planned.

    Raises
    ------
    CmmUqError : neither its certificate nor the plan gives one.
    """
    length = facts.length_mm or plan.length_mm
    if length is None:
        raise CmmUqError("the length of the artefact is needed", where="job.toml [plan] length_mm",
                         fix="Give it roughly, in mm; it is not taken as certified")  # fmt: skip
    return length


def ballbar(facts: ArtefactFacts, plan: PlanFacts) -> Pattern:
    """Both balls."""
    half = 0.5 * length_of(facts, plan)
    one = Pattern(np.array([[-half, 0.0, 0.0], [half, 0.0, 0.0]]), np.array([1, 2]), np.ones(2, dtype=np.int64))
    return one.repeated(plan.repeats)


def distances(facts: ArtefactFacts, plan: PlanFacts) -> Floats:
    """Distances of faces from the first, or lengths of blocks, in ascending order, mm.

    Raises
    ------
    CmmUqError : nothing says how long the gauge is.
    """
    if plan.lengths_mm:
        return np.unique(np.array(plan.lengths_mm, dtype=np.float64))
    length = length_of(facts, plan)
    if facts.kind == "gauge_blocks":
        return np.asarray(length * np.arange(1, FIVE + 1) / FIVE, dtype=np.float64)
    pitch = plan.pitch_mm or PITCH
    faces: Floats = pitch * np.arange(1, int(length / pitch + 1e-9) + 1, dtype=np.float64)
    return faces if len(faces) else np.array([length])


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
        0.5 * length_of(facts, plan) * n, np.arange(1, len(n) + 1), np.ones(len(n), dtype=np.int64), {},
        {"normal": n, "approach": -np.where(np.abs(n) > 1e-9, n, 0.0)},
    )  # fmt: skip
    return one.repeated(plan.repeats)


def surface(facts: ArtefactFacts, plan: PlanFacts, size: Floats) -> Pattern:
    """A grid of points of contact over ``size`` (2,) mm; with a probe offset also the point just before the first contact."""
    columns, rows = plan.grid
    i, j = np.meshgrid(np.linspace(-0.5, 0.5, columns), np.linspace(-0.5, 0.5, rows))
    touched = np.column_stack([i.ravel() * size[0], j.ravel() * size[1], np.zeros(i.size)])
    number = np.arange(1, len(touched) + 1)
    if facts.probe_offset_mm is not None:
        before = touched[:1] + np.array([0.0, 0.0, 4 * facts.probe_offset_mm])
        touched = np.vstack([before, touched])
        number = np.concatenate([[0], number])
    return Pattern(touched, number, np.ones(len(touched), dtype=np.int64)).repeated(plan.repeats)
