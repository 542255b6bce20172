"""What may be asserted of the effects that a search found, and why others are withheld.

A probable effect is no finding where the recording does not say of which size it is: where the interval of its size holds
zero, where it takes no more of the misfit than noise gives to something tried as often, where no period of several that fit
is more probable than not, or where the phase of a period is open. That an error of an axis is periodic is one statement, its
period another: without a settled period the first alone is asserted, where it is more probable than not by itself, over all
periods. Any other effect less probable than one half is asserted as one of a group, whose names go with it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from cmm_uq.analysis.diagnosis.comparison.combinations import Combinations, Key
from cmm_uq.analysis.diagnosis.comparison.explanations import effect_of
from cmm_uq.analysis.diagnosis.comparison.search import ASSERTED, SearchResult, rivals_of, withhold
from cmm_uq.analysis.diagnosis.joint import JointPosterior, Mode, holds_whole_period, period_modes
from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import Floats
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.maths.inference.least_squares import solve

_COVERED = 0.95  # of the region of a size that must not hold zero, and of the phases that must lie within half a turn
_BY_NOISE = 0.05  # probability, under noise, of taking as much of the misfit, from which on it is the noise's share
_FEW = 100  # draws within the most probable mode from which its sizes are judged by these
UNRESOLVED = say("the positions do not tell its period from others that fit as well")
NOT_WHOLE = say("the readings do not hold a whole one of its periods, of which any curve can be a part")
PHASE_OPEN = say("the positions leave its phase open")
HOLDS_ZERO = say("the interval of its size holds zero")
WITHIN_NOISE = say("it explains no more of the misfit than noise alone would give it")


@dataclass(frozen=True)
class WithheldEffect:
    """An effect that is probable, or one of a probable group, and yet is not asserted."""

    effect: str  # effect, title: its name, and in words
    title: Text
    probability: float  # as that of an effect that is asserted
    why: Text
    modes: tuple[Mode, ...] = ()  # periods that fit, where it has one


def withhold_unresolved(result: SearchResult) -> tuple[SearchResult, tuple[WithheldEffect, ...]]:
    """Without the effects that have a period, and of which the positions tell too little, and these."""
    gone = {}
    for i in sorted(result.chosen):
        modes = period_modes(result, i)
        if modes and (why := _too_little(result, i, modes)) is not None:
            gone[i] = replace(_withheld(result, i, why), modes=modes)
    return (withhold(result, frozenset(gone)), tuple(gone.values())) if gone else (result, ())


def period_settled(result: SearchResult, index: int, modes: tuple[Mode, ...]) -> bool:
    """Whether an effect with the most probable of its periods is more probable than not, as asked of any effect."""
    combinations = result.combinations
    group = frozenset[int]() if combinations is None else group_of(combinations, result.chosen, index) | {index}
    return combinations is not None and combinations.of_any(group) * modes[0].probability >= ASSERTED


def _too_little(result: SearchResult, index: int, modes: tuple[Mode, ...]) -> Text | None:
    combinations = result.combinations
    if combinations is None or not holds_whole_period(result, index, modes[0]):
        return NOT_WHOLE
    return None if period_settled(result, index, modes) or combinations.of(index) >= ASSERTED else UNRESOLVED


def withhold_unpredicted(result: SearchResult, unseen: Text) -> tuple[WithheldEffect, ...]:
    """All that was found, withheld because held-out set-ups, or points, do not speak for it."""
    why = say("it does not predict {unseen} that the fit had not seen better than noise would", unseen=unseen)
    return tuple(replace(_withheld(result, i, why), modes=period_modes(result, i)) for i in sorted(result.chosen))


def effects_without_size(result: SearchResult, joint: JointPosterior) -> dict[int, WithheldEffect]:
    """The effects of whose size the joint posterior says too little."""
    gone, shares = {}, _chance(result, joint)
    for i in sorted(result.chosen):
        explanation, modes = result.first.explanations[i], period_modes(result, i)
        effect = effect_of(explanation)
        sizes = _sizes(result, joint, effect, modes)
        # of noise, the best of many periods takes more than one
        tried = float(sum(member.weight for member in explanation.members)) if explanation.shaped else 1.0
        why = None
        if _holds_zero(sizes):
            why = HOLDS_ZERO
        elif modes and not _phase_known(sizes):
            why = PHASE_OPEN
        elif shares[effect.name] * tried > _BY_NOISE:
            why = WITHIN_NOISE
        if why is not None:
            gone[i] = replace(_withheld(result, i, why), modes=modes)
    return gone


def group_of(combinations: Combinations, chosen: Key, index: int) -> Key:
    """Explanations that could stand in the place of one; functions only where without them it is no more than one half."""
    group = rivals_of(combinations, chosen, index)
    return group if combinations.of_any(group | {index}) >= ASSERTED else group | combinations.imitating(index)


def _withheld(result: SearchResult, index: int, why: Text) -> WithheldEffect:
    effect = effect_of(result.first.explanations[index])
    probability = result.combinations.of(index) if result.combinations is not None else 0.0
    return WithheldEffect(effect.name, effect.title, probability, why)


def _sizes(result: SearchResult, joint: JointPosterior, effect: Effect, modes: tuple[Mode, ...]) -> Floats:
    """Draws (N, k) of an effect's coefficients; of a period those of its sine and cosine about the middle of the readings."""
    column = {unknown.key: i for i, unknown in enumerate(joint.posterior.unknowns)}
    draws = joint.posterior.draws[:, [column[effect.name, c.name] for c in effect.coefficients]]
    axis = effect.shape[0].period_along if effect.shape else None
    if axis is None:
        return draws
    readings = result.first.model.artefact.points.readings[axis]
    middle = 0.5 * (float(readings.min()) + float(readings.max()))
    period = joint.shapes[effect.name][:, 0]
    own = modes[0].holds(period) if modes else np.ones(len(period), dtype=np.bool_)
    if own.sum() >= _FEW:
        draws, period = draws[own], period[own]
    turned = (draws[:, 0] + 1j * draws[:, 1]) * np.exp(2j * np.pi * middle / period)
    return np.column_stack([turned.real, turned.imag])


def _holds_zero(draws: Floats) -> bool:
    """Whether the 95 % region of a size (N, k) holds zero: an interval, or an ellipsoid."""
    if draws.shape[1] == 1:
        low, high = np.quantile(draws[:, 0], [0.5 - _COVERED / 2, 0.5 + _COVERED / 2])
        return bool(low <= 0 <= high)
    mean = draws.mean(axis=0)
    distance = float(mean @ np.linalg.solve(np.cov(draws, rowvar=False), mean))
    return distance < 2 * float(special.gammaincinv(draws.shape[1] / 2, _COVERED))  # quantile of χ²


def _phase_known(draws: Floats) -> bool:
    """Whether the phases of draws (N, 2) lie within half a turn."""
    return float(np.mean(draws @ draws.mean(axis=0) > 0)) >= _COVERED


def _chance(result: SearchResult, joint: JointPosterior) -> dict[str, float]:
    """Of each effect found, the probability that noise alone gives it as much of the misfit (F test of what it takes last)."""
    if not result.chosen:
        return {}
    linear = result.model.estimate().linear.uncorrelated(joint.components.white(joint.posterior.sizes.typical))
    linear = replace(linear, sigma=None)
    whole = solve(linear)
    left, dof = float(whole.residuals @ whole.residuals), max(whole.degrees_of_freedom, 1)
    chance = {}
    for name in result.effects:
        own = [i for i, unknown in enumerate(linear.unknowns) if unknown.key[0] == name]
        rest = solve(linear.only([i for i in range(len(linear.unknowns)) if i not in own])).residuals
        more = float(rest @ rest) - left
        ratio = max(more, 0.0) / len(own) / max(left / dof, 1e-300)
        chance[name] = float(special.fdtrc(len(own), dof, ratio))
    return chance
