"""How far the set-ups of a job reach: what of every effect, and of the artefact's faults, they can show at all."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from cmm_uq.base.messages import Text
from cmm_uq.base.units import Unit
from cmm_uq.laboratory.proving.design import Design
from cmm_uq.laboratory.proving.sensitivity import ALLOWED, Sensitivity, possible_effects, remaining_length, unrecorded
from cmm_uq.laboratory.proving.unknown_causes import possible_faults
from cmm_uq.machine.physics.catalogue import every

DRAWN, UNRECORDED, TAKEN, TOO_SMALL, NO_TRAVEL = "drawn", "unrecorded", "taken", "too small", "no travel"
_NOTHING_SHOWS = 0.05  # √λ of the largest size that physics allows below which an effect shows nothing at all
_ALIKE = 0.1  # part of an effect that another leaves of it below which the two look alike
_TRIALS = 5  # draws of a fault by which it is judged


@dataclass(frozen=True)
class Reach:
    """What the set-ups show of an effect under the job's own noise."""

    effect: str  # effect, title: its name, and in words
    title: Text
    standing: str  # drawn; or why no case hides it
    parameter: str  # parameter, unit: its first reported parameter
    unit: Unit
    per_unit: float = 0.0  # √λ of one unit of it; 0 where nothing shows
    allowed: float = 0.0  # largest size that physics allows, in the unit
    columns: tuple[str, ...] = ()  # that it goes by and that the recording has not
    alike: str = ""  # another effect that these set-ups hardly tell from it; empty where there is none

    def amplitude(self, strength: float) -> float | None:
        """Size of this strength; ``None`` beyond what physics allows."""
        size = strength / self.per_unit if self.per_unit else np.inf
        return float(size) if size <= self.allowed else None


def reaches(design: Design) -> tuple[Reach, ...]:
    sight = design.sight(design.noise)
    named = {effect.name for effect in design.model.effects}
    possible = {effect.name for effect in possible_effects(design.model)}
    drawn, found = {effect.name for effect in design.effects}, []
    for effect in every().values():
        if effect.name in named:
            continue
        first, prior = effect.reported[0], effect.coefficients[0].prior_sd
        columns = unrecorded(design.model, effect)
        common = (effect.name, effect.title)
        if effect.name not in possible:
            standing = UNRECORDED if columns else NO_TRAVEL
            found.append(Reach(*common, standing, first.name, first.unit, columns=columns))
            continue
        versions = sight.candidates[effect.name]
        typical = float(np.median([np.sqrt(np.sum(v**2) / v.shape[1]) for v in versions]))
        standing = DRAWN if effect.name in drawn else TAKEN if typical * ALLOWED < _NOTHING_SHOWS else TOO_SMALL
        alike = _alike(sight, effect.name) if standing == DRAWN and not effect.shape else ""
        found.append(Reach(*common, standing, first.name, first.unit, typical / prior, ALLOWED * prior, alike=alike))
    return tuple(found)


def _alike(sight: Sensitivity, name: str) -> str:
    column = sight.candidates[name][0][:, 0]
    length = float(np.linalg.norm(column))
    others = [
        (min(remaining_length(column, version) for version in versions), other)
        for other, versions in sight.candidates.items()
        if other != name
    ]
    left, nearest = min(others, default=(np.inf, ""))
    return nearest if left < _ALIKE * length else ""


@dataclass(frozen=True)
class FaultReach:
    """What the set-ups show of a fault of the artefact."""

    what: str
    shows: bool  # whether it shows at a size that is reckoned with
    left: float = 0.0  # part of it that the nearest effect of the machine leaves, typically; 0 where nothing shows
    like: str = ""

    @property
    def hidden(self) -> bool:
        """Whether one set of set-ups cannot tell it from the machine, however large it is drawn."""
        return not self.shows or self.left < _ALIKE


def fault_reaches(design: Design) -> Iterator[FaultReach]:
    sight = design.sight(design.noise)
    for what in possible_faults(design.model):
        tried = [
            design.stranger(sight, what, np.random.default_rng(np.random.SeedSequence(0, spawn_key=(7, i))))
            for i in range(_TRIALS)
        ]
        seen = sorted((one.left / one.strength, one.like) for one in tried if one is not None)
        yield FaultReach(what, True, *seen[len(seen) // 2]) if seen else FaultReach(what, False)
