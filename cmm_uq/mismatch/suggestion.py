"""Which further placing would part effects that a recording cannot tell apart."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.jobs.job import ArtefactFacts
from cmm_uq.measurement import MeasurementModel
from cmm_uq.mismatch.diagnosis import Diagnosis
from cmm_uq.mismatch.explanations import shapes
from cmm_uq.physics.catalogue import CATALOGUE
from cmm_uq.points import Floats, Points
from cmm_uq.units import MICROMETRE

ODDS = 20.0
"""Odds that the suggested repetitions are expected to reach."""

_MOST = 30


@dataclass(frozen=True)
class Suggestion:
    """A placing, how often to repeat it, and what it is expected to decide."""

    separates: tuple[str, str]
    what: str
    repetitions: int


def suggestions(diagnosis: Diagnosis, facts: ArtefactFacts) -> tuple[Suggestion, ...]:
    """One placing for each pair that cannot be told apart; for a ballbar only, within the machine's travel."""
    bar = diagnosis.before.artefact
    if not isinstance(bar, Ballbar):
        return ()
    found = []
    for group in diagnosis.indistinguishable:
        for first, second in combinations(group[:3], 2):
            suggestion = _best(diagnosis, facts, bar, (first, second))
            if suggestion is not None:
                found.append(suggestion)
    return tuple(found)


def _best(diagnosis: Diagnosis, facts: ArtefactFacts, bar: Ballbar, pair: tuple[str, str]) -> Suggestion | None:
    places = _candidates(bar)
    if places is None:
        return None
    differing = np.abs(np.subtract(*(_predicted(diagnosis, facts, places, name, pair) for name in pair)))
    best = int(np.argmax(differing))
    sigma = diagnosis.noise.coordinate.value * MICROMETRE * float(bar.noise_scale[0])
    repetitions = int(np.ceil(2 * np.log(ODDS) * (sigma / max(differing[best], 1e-9)) ** 2))
    if repetitions > _MOST:
        return None
    ends = places.xyz[2 * best : 2 * best + 2] + places.machine.origin_mm
    start, stop = (", ".join(f"{value:.0f}" for value in end) for end in ends)
    what = (
        f"Place the bar from ({start}) to ({stop}) mm in scale readings and measure it {repetitions} times: the two predict "
        f"lengths {differing[best] / MICROMETRE:.1f} µm apart there, odds of {ODDS:.0f} : 1 are to be expected."
    )
    return Suggestion(pair, what, repetitions)


def _predicted(diagnosis: Diagnosis, facts: ArtefactFacts, places: Points, name: str, pair: tuple[str, str]) -> Floats:
    """What the model with one of the pair, fitted to the recording, predicts for new placings, (m,) mm."""
    after = diagnosis.after
    effect = CATALOGUE[name]
    others = tuple(e for e in after.effects if e.name not in pair)
    shape = dict(after.shapes)
    if effect.shape and name not in shape:
        shape[name] = next(iter(shapes(effect, after.artefact.points)))
    model = replace(after, effects=(*others, effect), shapes=shape)
    values = model.estimate().least_squares.value
    there = MeasurementModel(Ballbar(facts, places), model.effects, shapes=shape)
    return np.asarray(there.linearised(values).design @ values, dtype=np.float64)


def _candidates(bar: Ballbar) -> Points | None:
    """The bar in many places and directions inside the machine's travel (or the recorded volume), columns as on average."""
    points = bar.points
    travel = points.machine.travel_mm - points.machine.origin_mm[:, None]
    recorded = np.column_stack([points.xyz.min(axis=0), points.xyz.max(axis=0)])
    box = np.where(np.isfinite(travel), travel, recorded)
    half = 0.5 * bar.sizes[0].nominal
    middles, halves = [], []
    for direction in _directions():
        room = box[:, 1] - box[:, 0] - 2 * half * np.abs(direction)
        if np.any(room < 0):
            continue
        for corner in np.array(np.meshgrid(*[[0.0, 0.5, 1.0]] * 3)).reshape(3, -1).T:
            middles.append(box[:, 0] + half * np.abs(direction) + corner * room)
            halves.append(half * direction)
    if not middles:
        return None
    m, h = np.array(middles), np.array(halves)
    xyz = np.stack([m - h, m + h], axis=1).reshape(-1, 3)
    number = np.repeat(np.arange(1, len(m) + 1), 2)
    columns = {name: np.full(len(xyz), float(np.mean(values))) for name, values in points.columns.items()}
    return Points(xyz, number, np.tile([1, 2], len(m)), np.ones_like(number), points.machine, columns)


def _directions() -> Iterator[Floats]:
    """Thirteen directions of a cube: along edges, face diagonals and body diagonals."""
    for x in (0, 1):
        for y in (-1, 0, 1):
            for z in (-1, 0, 1):
                if (x, y, z) > (0, 0, 0):
                    yield np.array([x, y, z]) / np.sqrt(x * x + y * y + z * z)
