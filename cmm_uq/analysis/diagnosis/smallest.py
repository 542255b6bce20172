"""What a recording would not have shown: of each effect the smallest amplitude that its diagnosis would have found.

On the recording's own design and noise, beside what was asserted, in closed form (``visibility``) and not drawn as in
``power``; how far the two differ is in docs/diagnosis.md.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.diagnosis.comparison.explanations import Explanation
from cmm_uq.analysis.diagnosis.comparison.search import SearchResult
from cmm_uq.analysis.diagnosis.power import ALLOWED
from cmm_uq.analysis.diagnosis.visibility import HIDDEN, Thresholds, Visibility, aliased, phases, thresholds
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats
from cmm_uq.base.units import Unit
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.machine.physics.effect import CONTRACT, Effect

POWER = 0.9
# Part of what physics allows, half of its standard deviation, that a recording with power shows of a common effect
BLIND = 1 / 6
USUAL_LENGTH = 6.0  # visible length, over the noise, from which on a usual diagnosis detects an effect
_FAINT = 0.5  # visible length of the largest allowed amplitude below which an effect is not looked at
ABSORBED = 1e-5  # part of its length below which a column is the baseline's own


@dataclass(frozen=True)
class PeriodRange:
    """Of an effect with a nonlinear parameter, for which values of it the figures hold."""

    parameter: str  # parameter, unit: its name and unit
    unit: Unit
    low: float  # low, high: range of what is tried
    high: float
    worst: float | None  # largest of the smallest amplitudes that are detected, over all resolved values and any phase
    # ranges of values that the positions do not resolve: nothing of them is left, or another looks the same
    unresolved: tuple[tuple[float, float], ...]


@dataclass(frozen=True, eq=False)
class SmallestEffect:
    """How large one effect must have been for the recording to show it."""

    effect: str  # effect, title: its name, and in words
    title: Text
    parameter: str  # parameter, unit: its (first) parameter
    unit: Unit
    allowed: float  # largest amplitude that physics allows
    # amplitude detected with a probability of 90 %, though beyond what is allowed; None where hardly any is
    detected: float | None
    named: float | None  # amplitude named rightly with this probability; None where none that is allowed is
    share: float  # part of the effect's length in the observations that what is fitted leaves
    taken_up: tuple[str, ...]  # names of what is fitted that takes up the rest, where that is most of it
    common: bool  # whether it is one of the common effects
    # where it has a nonlinear parameter, of which the figures are then the typical ones
    periods: PeriodRange | None = None
    # of what is left of it over the noise, from which on it is detected; None where it was not computed
    length: float | None = None

    @property
    def shown(self) -> bool:
        """Whether an amplitude that physics allows would have been detected."""
        return self.detected is not None and self.detected <= self.allowed

    @property
    def blind(self) -> bool:
        """Whether not even a plausible amplitude of a common effect would have been detected, though it shows at all."""
        there = self.share > 0 or bool(self.taken_up)
        return self.common and there and (self.detected is None or self.detected > BLIND * self.allowed)


def smallest_effects(result: SearchResult, alpha: float, model: RecordingModel) -> tuple[SmallestEffect, ...]:
    """The smallest amplitude of each effect that a recording would have shown; those that it could least come first."""
    view = Visibility.of(result)
    named = {effect.name for effect in model.effects}
    listed = [
        (i, explanation, effect)
        for i, explanation in enumerate(view.explanations)
        if (effect := explanation.effect) is not None and not effect.of_artefact and explanation.name not in named
    ]
    signals = _signals(view, listed)
    visible = [signal for signal in signals if signal.unit_length * ALLOWED > _FAINT]
    which, columns = [s.index for s in visible], np.array([s.column / s.unit_length for s in visible])
    each = dict(zip(which, thresholds(view, which, columns, alpha), strict=True))
    rows = [signal.smallest(view, each.get(signal.index)) for signal in signals]
    for effect in _motionless(result.first.model, named | {explanation.name for explanation in view.explanations}):
        name, first = effect.reported[0].name, effect.coefficients[0]
        never = (ALLOWED * first.prior_sd, None, None, 0.0, (), effect.tier == CONTRACT)
        rows.append(SmallestEffect(effect.name, effect.title, name, first.unit, *never))
    return tuple(
        sorted(rows, key=lambda row: -min(np.inf if row.detected is None else row.detected / row.allowed, 1e9))
    )


def _motionless(model: RecordingModel, known: set[str]) -> Iterator[Effect]:
    """Common effects of which nothing shows here, though they could act and all that they need is recorded."""
    points = model.artefact.points
    for effect in every().values():
        if effect.name in known or effect.tier != CONTRACT or effect.shape:
            continue
        if any(column not in points.columns for column in effect.columns) or effect.unfit(points) is not None:
            continue
        try:
            effect.basis(points)
        except CmmUqError:  # the job does not give the travel that this effect needs
            continue
        yield effect


@dataclass(frozen=True, eq=False)
class _Signal:
    """What an effect shows, for a coefficient as large as its prior standard deviation."""

    index: int
    effect: Effect
    raw: Floats  # (m,) the whole. Of an effect with a nonlinear parameter it is the typical one
    column: Floats  # (m,) is what is left of it, unit_length its visible length
    unit_length: float
    values: Floats
    worst: Floats  # worst, typical: (p,) are then the lengths at each value of values
    typical: Floats
    resolved: NDArray[np.bool_]

    @classmethod
    def shaped(cls, view: Visibility, index: int, explanation: Explanation, effect: Effect) -> _Signal:
        scale = view.result.first.comparison.noise_scale[:, None]
        members = [member for member in explanation.members if member.shape and not member.rough]
        raws = np.stack([member.columns / scale for member in members])
        p, m, r = raws.shape
        lefts = view.rest(raws.transpose(1, 0, 2).reshape(m, p * r)).reshape(m, p, r).transpose(1, 0, 2)
        worst, typical, way = phases(view, lefts)
        middle, values = int(np.argsort(typical)[p // 2]), np.array([member.shape[0] for member in members])
        raw, column = raws[middle] @ way[middle], lefts[middle] @ way[middle]
        length, resolved = float(view.lengths(column[:, None])[0]), ~aliased(view, lefts, values)
        return cls(index, effect, raw, column, length, values, worst, typical, resolved)

    def smallest(self, view: Visibility, thresholds: Thresholds | None) -> SmallestEffect:
        effect, parameter, whole = self.effect, self.effect.coefficients[0], float(np.linalg.norm(self.raw))
        share = float(np.linalg.norm(self.column)) / whole if whole else 0.0
        length, detected, named = float(np.inf), None, None
        if thresholds is not None:
            length = thresholds.length_detected(POWER)
            detected = _amplitude(length, self.unit_length, parameter.prior_sd)
            if length <= self.unit_length * ALLOWED:
                named = _amplitude(thresholds.length_named(POWER), self.unit_length, parameter.prior_sd)
        return SmallestEffect(
            effect.name, effect.title, effect.reported[0].name, parameter.unit, ALLOWED * parameter.prior_sd, detected, named,
            share, view.taking(self.raw) if share < HIDDEN else (), effect.tier == CONTRACT,
            self._periods(length) if len(self.values) else None, length if np.isfinite(length) else None,
        )  # fmt: skip

    def _periods(self, length: float) -> PeriodRange:
        parameter, shape, order = self.effect.coefficients[0], self.effect.shape[0], np.argsort(self.values)
        shown, values = self.resolved & (self.worst * ALLOWED >= length), self.values[order]
        worst = _amplitude(length, float(self.worst[shown].min()), parameter.prior_sd) if shown.any() else None
        runs = np.flatnonzero(np.diff(~shown[order], prepend=False, append=False)).reshape(-1, 2)
        unresolved = tuple((float(values[start]), float(values[end - 1])) for start, end in runs)
        return PeriodRange(shape.name, shape.unit, float(values[0]), float(values[-1]), worst, unresolved)


def _signals(view: Visibility, listed: Sequence[tuple[int, Explanation, Effect]]) -> list[_Signal]:
    """What each of some effects shows; of several coefficients the first."""
    straight = [row for row in listed if not row[1].shaped]
    scale, none = view.result.first.comparison.noise_scale, np.zeros(0)
    raws = np.column_stack([np.zeros((len(scale), 0)), *(e.members[0].columns[:, 0] / scale for _, e, _ in straight)])
    lefts = view.rest(raws)
    lefts = np.where(np.linalg.norm(lefts, axis=0) > ABSORBED * np.linalg.norm(raws, axis=0), lefts, 0.0)
    found = [
        _Signal(i, effect, raw, left, length, none, none, none, none > 0)
        for (i, _, effect), raw, left, length in zip(
            straight, raws.T, lefts.T, view.lengths(lefts).tolist(), strict=True
        )
    ]
    return found + [_Signal.shaped(view, *row) for row in listed if row[1].shaped]


def _amplitude(length: float, unit_length: float, unit: float) -> float | None:
    return length / unit_length * unit if np.isfinite(length) and unit_length > 0 else None
