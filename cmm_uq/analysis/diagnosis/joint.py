"""The joint posterior of all that is modelled, every mode of a period, and what may be asserted of what was found by these."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy

from cmm_uq.analysis.diagnosis.comparison.combinations import Combinations, Key
from cmm_uq.analysis.diagnosis.comparison.explanations import STEP, effect_of, even_scale, from_even_scale
from cmm_uq.analysis.diagnosis.comparison.search import ASSERTED, SearchResult, rivals_of, withhold
from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import Unit
from cmm_uq.base.values import dataclass, fields, replace
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.measurement import with_curvature
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.maths.inference.curvature import Shaped, sample_shaped
from cmm_uq.maths.inference.ensembles import Progress
from cmm_uq.maths.inference.linear_model import solve
from cmm_uq.maths.inference.noise import Components
from cmm_uq.maths.inference.posterior import NoisyPosterior, sample_with_noise
from cmm_uq.maths.uncertainty.quantity import Quantity

_LIKELY = 1e-4  # part of the largest probability below which a trial parts one mode from the next
# Frequencies that are this far apart, over one in the range of the readings, with nothing likely between, are two modes
_APART = 0.5
_VALLEY = 0.1  # evidence over that of the lower of two peaks below which what lies between parts two modes
NAMED = 0.9  # probability from which an effect is named, alone or as one of a group
_TOLD = 1e-3  # probability from which a mode is told


@dataclass(frozen=True)
class Mode:
    period: Quantity
    probability: float
    ends: tuple[float, float]  # are the lowest and the highest value that belong to it

    def holds(self, shape: Floats) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        return (shape >= self.ends[0]) & (shape <= self.ends[1])


def period_modes(result: SearchResult, index: int) -> tuple[Mode, ...]:
    """All modes of an effect's period, shorter than searched too, the most probable first; none of one without a period."""
    explanation = result.first.explanations[index]
    effect = effect_of(explanation)
    if not (effect.shape and effect.shape[0].period_along):
        return ()
    given = [v for v in result.versions if v.explanation != index]
    member, evidence, before = result.first.comparison.of_versions(index, given)
    total = evidence + before
    weight = np.exp(total - scipy.special.logsumexp(total))
    frequency = even_scale(effect, np.array([explanation.members[m].shape[0] for m in member]))
    likely = np.flatnonzero(weight > _LIKELY * weight.max())
    likely = likely[np.argsort(frequency[likely])]
    span = _span(result, effect.shape[0].period_along)
    apart = np.split(likely, np.flatnonzero(np.diff(frequency[likely]) > _APART / span) + 1)
    found = []
    for part in (peak for trials in apart for peak in _peaks(trials, evidence)):
        step = 0.5 * STEP / span
        even = np.array([frequency[part].max() + step, max(frequency[part].min() - step, 1e-9)])
        ends = from_even_scale(effect, even)
        period = _within(from_even_scale(effect, frequency[part]), weight[part], effect.shape[0].unit, ends)
        found.append(Mode(period, float(weight[part].sum()), (float(ends[0]), float(ends[1]))))
    return tuple(sorted((mode for mode in found if mode.probability > _TOLD), key=lambda mode: -mode.probability))


def _peaks(trials: Ints, evidence: Floats) -> Iterator[Ints]:
    log = evidence[trials]
    lower = np.minimum(np.maximum.accumulate(log), np.maximum.accumulate(log[::-1])[::-1])
    valley = int(np.argmin(log - lower))
    if log[valley] - lower[valley] < np.log(_VALLEY):
        yield from _peaks(trials[:valley], evidence)
        yield from _peaks(trials[valley:], evidence)
    else:
        yield trials


def _span(result: SearchResult, axis: str) -> float:
    return float(np.ptp(result.first.model.artefact.points.readings[axis]))


def _within(periods: Floats, weight: Floats, unit: Unit, ends: Floats) -> Quantity:
    """Mean, standard deviation and interval of periods with weights; of a single trial, as wide as trials are apart."""
    weight = weight / weight.sum()
    value = float(weight @ periods)
    own = float(np.ptp(ends)) / np.sqrt(12) / max(len(periods), 1)
    u = float(np.sqrt(weight @ (periods - value) ** 2 + own**2))
    return Quantity(value, u, (value - 1.96 * u, value + 1.96 * u), unit)


_FINER = 12  # nodes of a shape between two of the search's
_IMPROBABLE = 12.0  # shapes less probable than the best by this, in logarithm, are not followed


@dataclass(frozen=True, eq=False)
class JointPosterior:
    """A posterior, the components of its noise, and the draws (N, s) of each effect's shape, by its name."""

    posterior: NoisyPosterior
    components: Components
    shapes: dict[str, Floats]


def joint_posterior(
    result: SearchResult, seed: int, progress: Progress | None = None, known: NoisyPosterior | None = None
) -> JointPosterior:
    """Sample everything at once. ``known`` posterior of the job's own model, which it stays where nothing is found."""
    model = result.model
    components = replace(noise_of(model), known=model.least_noise)
    if known is not None and not result.effects:
        return JointPosterior(known, components, {})
    estimate = model.estimate()
    new = [e for e in model.effects if e.shape and e.name in result.effects]
    posterior = sample_with_noise(estimate.linear, components, estimate.least_squares, seed, None if new else progress)
    if not new:
        return JointPosterior(with_curvature(model, components, posterior), components, {})
    # what shapes columns is sampled under the noise that is typical with the shapes held
    white = components.white(posterior.sizes.typical)
    linear, values = estimate.linear.uncorrelated(white), estimate.about
    shaped = [_shaped(result, model, effect, values) for effect in new]
    shaped = [replace(some, table=np.stack([white(columns) for columns in some.table])) for some in shaped]
    drawn = sample_shaped(replace(linear, sigma=None), shaped, seed, progress)
    sizes = posterior.sizes.at(np.resize(np.arange(len(posterior.draws)), len(drawn.draws)))
    shapes = {e.name: drawn.shapes[:, j : j + 1] for j, e in enumerate(new)}
    both = NoisyPosterior(**{f.name: getattr(drawn, f.name) for f in fields(drawn)}, sizes=sizes)
    return JointPosterior(both, components, shapes)


def finer(likely: Floats, step: float, low: float, high: float) -> Floats:
    """Shapes about the likely ones, two at least, between the ends of what they may be."""
    offsets = np.arange(-_FINER, _FINER + 1) / _FINER
    fine = np.unique(np.round((likely[:, None] + step * offsets).ravel() / step * _FINER)) * step / _FINER
    found = np.unique(np.clip(fine, low, high))
    if len(found) == 1:  # all beyond one end
        within = found + step / _FINER * np.array([0, 1 - 2 * (found[0] == high)])
        found = np.linspace(low, high, 2) if high - low < step else within
    return np.sort(found)


def _shaped(result: SearchResult, model: RecordingModel, effect: Effect, values: Floats) -> Shaped:
    """An effect's columns on a fine grid of its shape, wherever the search found some probability."""
    explanations = result.first.explanations
    index = next(i for i in result.chosen if explanations[i].name == effect.name)
    given = [v for v in result.versions if v.explanation != index]
    member, evidence, _ = result.first.comparison.of_versions(index, given)
    even = even_scale(effect, np.array([explanations[index].members[m].shape[0] for m in member]))
    step = float(np.median(np.diff(np.sort(even)))) if len(even) > 1 else 0.1 * abs(float(even[0]))
    likely = even[evidence > evidence.max() - _IMPROBABLE]
    (shape,) = effect.shape
    low, high = np.sort(even_scale(effect, np.array([shape.low, shape.high])))
    nodes = np.sort(from_even_scale(effect, finer(likely, step, low, high)))
    table = np.stack([model.seen(model.columns(effect, (float(node),), values), values) for node in nodes])
    keys = [unknown.key for unknown in model.unknowns]
    return Shaped([keys.index((effect.name, c.name)) for c in effect.coefficients], nodes, table)


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
            gone[i] = replace(withheld_effect(result, i, why), modes=modes)
    return (withhold(result, frozenset(gone)), tuple(gone.values())) if gone else (result, ())


def period_settled(result: SearchResult, index: int, modes: tuple[Mode, ...]) -> bool:
    """Whether an effect with the most probable of its periods is more probable than not, as asked of any effect."""
    combinations = result.combinations
    group = frozenset[int]() if combinations is None else group_of(combinations, result.chosen, index) | {index}
    return combinations is not None and combinations.of_any(group) * modes[0].probability >= ASSERTED


def _too_little(result: SearchResult, index: int, modes: tuple[Mode, ...]) -> Text | None:
    combinations, axis = result.combinations, effect_of(result.first.explanations[index]).shape[0].period_along
    # less than a whole period is a bow, or any other curve
    if combinations is None or (axis is not None and modes[0].period.interval95[1] > _span(result, axis)):
        return NOT_WHOLE
    return None if period_settled(result, index, modes) or combinations.of(index) >= ASSERTED else UNRESOLVED


def withhold_unpredicted(result: SearchResult, unseen: Text) -> tuple[WithheldEffect, ...]:
    """All that was found, withheld because held-out set-ups, or points, do not speak for it."""
    why = say("it does not predict {unseen} that the fit had not seen better than noise would", unseen=unseen)
    return tuple(replace(withheld_effect(result, i, why), modes=period_modes(result, i)) for i in sorted(result.chosen))


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
            gone[i] = replace(withheld_effect(result, i, why), modes=modes)
    return gone


def group_of(combinations: Combinations, chosen: Key, index: int) -> Key:
    """Explanations that could stand in the place of one; functions only where without them it is no more than one half."""
    group = rivals_of(combinations, chosen, index)
    return group if combinations.of_any(group | {index}) >= ASSERTED else group | combinations.imitating(index)


def withheld_effect(result: SearchResult, index: int, why: Text) -> WithheldEffect:
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
    return distance < 2 * float(scipy.special.gammaincinv(draws.shape[1] / 2, _COVERED))  # quantile of χ²


def _phase_known(draws: Floats) -> bool:
    """Whether the phases of draws (N, 2) lie within half a turn."""
    return float(np.mean(draws @ draws.mean(axis=0) > 0)) >= _COVERED


def _chance(result: SearchResult, joint: JointPosterior) -> dict[str, float]:
    """Of each effect found, the probability that noise alone gives it as much of the misfit (F test of what it takes last)."""
    if not result.chosen:
        return {}
    white = joint.components.white(joint.posterior.sizes.typical)
    linear = replace(result.model.estimate().linear.uncorrelated(white), sigma=None)
    whole, chance = solve(linear), {}
    left, dof = float(whole.residuals @ whole.residuals), max(whole.degrees_of_freedom, 1)
    for name in result.effects:
        others = [i for i, unknown in enumerate(linear.unknowns) if unknown.key[0] != name]
        count, rest = len(linear.unknowns) - len(others), solve(linear.only(others)).residuals
        ratio = max(float(rest @ rest) - left, 0.0) / count / max(left / dof, 1e-300)
        chance[name] = float(scipy.special.fdtrc(count, dof, ratio))
    return chance
