"""Recordings made for tests: exact constructions, without any use of the code under test."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from cmm_uq.analysis.planning.set_up import Suggestion, suggestions
from cmm_uq.analysis.planning.setting import Planning
from cmm_uq.analysis.planning.suggestion import next_plan
from cmm_uq.analysis.screening import screening
from cmm_uq.analysis.screening.screening import ScreenedRecording
from cmm_uq.analysis.screening.shape import Screening
from cmm_uq.artefacts import artefact_facts, kind_named
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.base.rotary import RotaryAxis, RotaryMachine
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.physics.effect import Effect

TRAVEL = np.array([[0.0, 900.0], [0.0, 550.0], [-500.0, 0.0]])
"""Of the DEA Iota 1102, mm."""


def bars(random: np.random.Generator, count: int, length: float, machine: Machine) -> Points:
    """A bar in random places inside the machine's travel."""
    direction = random.standard_normal((count, 3))
    half = 0.5 * length * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    room = TRAVEL[:, 1] - TRAVEL[:, 0] - 2 * np.abs(half)
    low = TRAVEL[:, 0] + np.abs(half)
    middle = low + np.maximum(room, 0) * random.random((count, 3))
    xyz = np.stack([middle - half, middle + half], axis=1).reshape(-1, 3)
    number = np.repeat(np.arange(1, count + 1), 2)
    return Points(xyz, number, np.tile([1, 2], count), np.ones_like(number), machine, {}, np.arange(2, 2 * count + 2))


def bar_facts(length_mm: float | None = 400.0, u_um: float | None = 0.5) -> ArtefactFacts:
    return artefact_facts(kind="ballbar", length_mm=length_mm, u_um=None if length_mm is None else u_um)


def with_columns(points: Points, **columns: Floats) -> Points:
    """The same points with further recorded columns."""
    return Points(points.xyz, points.measurement, points.point, points.repeat, points.machine,
                  {**points.columns, **columns}, points.lines)  # fmt: skip


def on_table(points: Points, effect: Effect) -> Points:
    """The same on the turning table that an effect is of, where it is of one; with that machine, and its columns."""
    letter = effect.columns[0][0] if effect.mechanism == "rotary axis" else ""
    if not letter:
        return points
    old, random = points.machine, np.random.default_rng(3)
    own = RotaryAxis(letter, np.array([1.0, 2.0, 3.0]), head=getattr(effect, "head", False))
    stylus = np.array([10.0, -20.0, -150.0])
    machine = RotaryMachine(old.name, old.chain, old.travel_mm, old.origin_mm, rotary=(own,), stylus_mm=stylus)
    approach = random.choice([-1.0, 1.0], len(points))
    turned = with_columns(
        points, **{f"{letter}_deg": random.uniform(0, 360, len(points)), f"{letter}_approach": approach}
    )
    return replace(turned, machine=machine)


def screened(points: Points, facts: ArtefactFacts, **how: Any) -> ScreenedRecording:
    """A recording screened by what its kind asks of it."""
    kind = kind_named(facts.kind)
    assert kind is not None
    return screening.screen_recording(
        points, facts, kind.offers("screen", Screening), kind.observing("screened"), **how
    )


def suggested(diagnosis: Any, facts: ArtefactFacts) -> tuple[Suggestion, ...]:
    """Placings that would part what a diagnosis cannot, by what its kind offers."""
    kind = kind_named(facts.kind)
    assert kind is not None
    plan = next_plan(diagnosis, facts, kind.observing("diagnosed"), kind.offers("plan", Planning))
    return suggestions(plan, diagnosis.after.artefact.title)
