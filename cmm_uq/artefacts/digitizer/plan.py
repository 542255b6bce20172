"""Attitudes in which to align a digitizer: the three of the source, the sphere staying where it is."""

from __future__ import annotations

from typing import cast

import numpy as np

from cmm_uq.analysis.planning.set_up import SetUp
from cmm_uq.analysis.planning.setting import Planning, Setting, Start
from cmm_uq.artefacts.digitizer.attitudes import ANGLES, SCAN
from cmm_uq.artefacts.digitizer.facts import AlignmentFacts
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats, Points
from cmm_uq.machine.physics.digitizer import euler_313

THREE = ((90.0, 90.0, 0.0), (90.0, 90.0, 90.0), (180.0, 90.0, 0.0))
"""α, β, γ in degrees of the source's alignments 1, 2 and 3 (Harris 2004 section 5.3)."""

RINGS = ((0.0, 1), (25.0, 6), (50.0, 12), (75.0, 18))
"""Points over what the digitizer sees of the sphere: degrees from the line of sight, how many."""


def seen_directions() -> Floats:
    """(n, 3) from the centre of the sphere to its points, along u, v, w: the digitizer looks along −v."""
    found = []
    for down, count in RINGS:
        around = 2 * np.pi * np.arange(count) / count
        flat, up = np.sin(np.radians(down)), np.cos(np.radians(down))
        found.append(np.column_stack([flat * np.cos(around), np.full(count, up), flat * np.sin(around)]))
    return np.vstack(found)


def scan(attitude: Floats, offset: Floats, radius: float) -> tuple[Floats, Floats]:
    """Scan of a sphere about the origin: u, v (n, 2) and scale readings (n, 3), mm; the machine moves along w."""
    seen = radius * seen_directions()
    along = np.column_stack([np.zeros((len(seen), 2)), seen[:, 2]])
    return seen[:, :2], (along + offset) @ attitude.T


def three_attitudes(setting: Setting) -> tuple[SetUp, ...]:
    """The source's three; scans where the job gives the sphere's diameter, else centres.

    Raises
    ------
    CmmUqError : the job does not say where the mount lies, or the readings leave the volume.
    """
    facts, plan, volume = cast("AlignmentFacts", setting.artefact), setting.plan, setting.volume
    if facts.offset_mm is None:
        raise CmmUqError("where the mount lies is needed", where="job.toml [artefact] offset_mm",
                         fix="Give [U1, V1, W1] by the drawing, mm; it is not taken as known")  # fmt: skip
    offset, radius = np.array(facts.offset_mm), 0.5 * (facts.length_mm or 0.0)
    parts = []
    for angles in THREE:
        attitude = euler_313(*np.radians(angles))
        parts.append(scan(attitude, offset, radius) if radius else (np.zeros((0, 2)), (attitude @ offset)[None]))
    readings = np.vstack([part for _, part in parts])
    room = volume.room(readings - readings.mean(axis=0))
    if room is None:
        raise volume.too_small(readings, say("over the three attitudes"))
    middle = room.mean(axis=1) - readings.mean(axis=0)
    found = []
    for angles, (seen, moved) in zip(THREE, parts, strict=True):
        count, times = len(moved), plan.repeats
        columns = {name: np.full(count * times, angle) for name, angle in zip(ANGLES, angles, strict=True)}
        if radius:
            columns |= {name: np.tile(seen[:, i], times) for i, name in enumerate(SCAN)}
        xyz = np.tile(middle + moved - setting.machine.origin_mm, (times, 1))
        points = Points(
            xyz, np.ones(len(xyz), dtype=np.int64), np.tile(np.arange(1, count + 1), times),
            np.repeat(np.arange(1, times + 1), count), setting.machine, columns,
        )  # fmt: skip
        alpha, beta, gamma = angles
        title = say("α = {alpha:g}°, β = {beta:g}°, γ = {gamma:g}°", alpha=alpha, beta=beta, gamma=gamma)
        found.append(SetUp(title, points))
    return tuple(found)


def candidates(setting: Setting, start: Start | None) -> tuple[SetUp, ...]:
    """None: the wrist has the attitudes that it has.

    Raises
    ------
    CmmUqError : says so.
    """
    raise CmmUqError("the attitudes of a digitizer are those of its wrist, and none are searched for",
                     where="job.toml [plan] criterion", fix="Leave it out, or record further attitudes")  # fmt: skip


PLANNING = Planning({"three attitudes": three_attitudes}, candidates, shared=True, sought=True)
