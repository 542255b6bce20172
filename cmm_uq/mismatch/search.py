"""The search for what was left out: a gate with a known false-alarm rate, then one explanation after the other.

At every step all rivals compete: each effect of the catalogue, smooth functions that nobody knows, and nothing. The gate's
statistic is the evidence of "something" over "nothing"; its distribution under nothing is drawn on the recording's own design.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import comb

import numpy as np
from numpy.typing import NDArray
from scipy import special

from cmm_uq.measurement import MeasurementModel
from cmm_uq.mismatch.combinations import EFFECTS, Combinations, Key, explore
from cmm_uq.mismatch.evidence import Comparison, Version
from cmm_uq.mismatch.explanations import (
    EFFECT,
    SEVERAL,
    UNKNOWN,
    Explanation,
    directions,
    finer,
    known,
    mean_of,
    several,
    unknown,
)
from cmm_uq.mismatch.noise import Kind, kinds, order_of, sigma_grid, tails
from cmm_uq.physics.catalogue import EVERY
from cmm_uq.points import Floats, Ints

SHARES = {EFFECT: 0.3, SEVERAL: 0.06, UNKNOWN: 0.08}
"""Probability, beforehand, of one effect of the catalogue, of several, and of the unknown; the rest is for nothing missing."""

NOTHING = 1 - sum(SHARES.values())

DRAWS = 200
_TAIL = 0.8
_MISFIT = 20.0
"""Largest misfit, over the noise, that is reckoned with when the noise is not stated."""

ASSERTED = 0.5
"""Probability from which an effect, or one of those that cannot be told from it, is asserted."""

_MECHANISM = 0.2
"""Probability from which an effect is asserted when all that is asked is whether it has its own form or any other."""

_PROBABLE = 0.02
"""Probability from which the period in a combination is refined."""

NOT_TOLD_APART = 0.02
"""Odds from which another effect in the place of one counts as not told apart from it."""


@dataclass(frozen=True, eq=False)
class Race:
    """All rivals of one step.

    Parameters
    ----------
    model, values : what is explained so far, and its estimate.
    comparison : rivals.
    log_odds : (c,) log evidence of each over nothing.
    probability : (c,) of each explanation, nothing included in the race.
    p_value : of "nothing is missing".
    null_maximum : (draws,) largest log evidence of an unknown function over nothing, under nothing.
    """

    model: MeasurementModel
    values: Floats
    comparison: Comparison
    log_odds: Floats
    probability: Floats
    p_value: float
    null_maximum: Floats

    @property
    def explanations(self) -> Sequence[Explanation]:
        """The rivals."""
        return self.comparison.explanations


@dataclass(frozen=True, eq=False)
class Found:
    """What a search ends with.

    Parameters
    ----------
    first : race before anything is found.
    last : what is left after everything is, without rivals.
    combinations : of explanations, with their probabilities; ``None`` while the gate is closed.
    chosen : indices, in the first race, of the known effects that are found.
    versions : of them, and of what is unknown besides, in the most probable combination.
    model : the job's model with what was left out.
    unexplained : probability that something unknown acts besides.
    rough : of the effects found, those of which another form is more probable than their own.
    """

    first: Race
    last: Comparison
    combinations: Combinations | None
    chosen: Key
    versions: tuple[Version, ...]
    model: MeasurementModel
    unexplained: float
    rough: Key = frozenset()

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of what was left out."""
        return tuple(self.first.explanations[i].name for i in sorted(self.chosen))


def search(model: MeasurementModel, stated: float | None, *, alpha: float, seed: int) -> Found:
    """Find what a model leaves out.

    Parameters
    ----------
    model : what the job names, with its recording.
    stated : standard uncertainty of a coordinate, mm, as the job states it.
    alpha : false-alarm rate.
    seed : of the null distribution.
    """
    first = race_of(model, stated, seed)
    if first.p_value >= alpha:
        return Found(first, first.comparison, None, frozenset(), (), model, 0.0)
    combinations = explore(first.comparison)
    if shapes := _shapes(combinations):
        explanations = [
            finer(first.model, first.values, e, shapes[i]) if i in shapes else e
            for i, e in enumerate(first.explanations)
        ]
        first = replace(first, comparison=replace(first.comparison, explanations=explanations))
        combinations = explore(first.comparison)
    chosen = _asserted(combinations)
    versions = combinations.versions(chosen)
    found = model if not chosen else _with(first, versions, chosen)
    last = comparison_of(found, stated, ())
    rough = frozenset(i for i in chosen if _rough(first.comparison, versions, i) > ASSERTED)
    return Found(first, last, combinations, chosen, versions, found, combinations.unknown_beside(chosen), rough)


def _rough(comparison: Comparison, versions: Sequence[Version], index: int) -> float:
    """Probability that an effect, beside the others, has another form than its own."""
    members = comparison.explanations[index].members
    evidence = np.full(len(members), -np.inf)
    for group, cube in comparison.each(None, [v for v in versions if v.explanation != index], (index,)):
        evidence[group.member] = special.logsumexp(cube[:, :, 0], axis=1) + group.weight
    weight = np.exp(evidence - special.logsumexp(evidence))
    return float(weight[[member.rough for member in members]].sum())


def _shapes(combinations: Combinations) -> dict[int, set[int]]:
    """Members of the effects with a nonlinear parameter, by explanation, that probable combinations contain."""
    found: dict[int, set[int]] = {}
    for key, probability in combinations.probability.items():
        for version in combinations.found[key].versions if probability > _PROBABLE else ():
            if combinations.explanations[version.explanation].members[version.member].shape:
                found.setdefault(version.explanation, set()).add(version.member)
    return found


def _asserted(combinations: Combinations) -> Key:
    """The most probable set of known effects, without those that something else could well be instead."""
    chosen = max(combinations.of_effects, key=lambda key: combinations.of_effects[key])
    doubtful = [i for i in chosen if combinations.of(i) < ASSERTED and _with_rivals(combinations, chosen, i) < ASSERTED]
    return (chosen - frozenset(doubtful)) | _of_any_form(combinations)


def _of_any_form(combinations: Combinations) -> Key:
    """Effects that are improbable only because an unknown function of the same mechanism describes them as well."""
    index, found = {e.name: i for i, e in enumerate(combinations.explanations)}, set()
    for j, function in enumerate(combinations.explanations):
        i = index.get(function.mechanism)
        if i is None or combinations.of(i) < _MECHANISM:
            continue
        if sum(p for key, p in combinations.probability.items() if i in key or j in key) >= ASSERTED:
            found.add(i)
    return frozenset(found)


def _with_rivals(combinations: Combinations, chosen: Key, index: int) -> float:
    """Probability of an effect or one that these data cannot tell from it."""
    rivals = combinations.instead(chosen, index)
    return combinations.of(index) + sum(combinations.of(i) for i, odds in rivals.items() if odds > NOT_TOLD_APART)


def race_of(model: MeasurementModel, stated: float | None, seed: int) -> Race:
    """Let all rivals compete for what a model leaves; ``seed`` is that of the null distribution."""
    values = model.estimate().least_squares.value
    singles = known(model, values, tuple(effect.name for effect in model.effects))
    rivals = singles + several(singles) + unknown(model, values)
    comparison = comparison_of(model, stated, rivals)
    nothing, something = comparison.log_evidence()
    log_odds = something[:, 0] - nothing[0]
    log_prior = _log_prior(rivals)
    log_total = special.logsumexp(np.append(log_prior + log_odds, np.log(NOTHING)))
    p_value, maxima = _gate(comparison, seed)
    return Race(model, values, comparison, log_odds, np.exp(log_prior + log_odds - log_total), p_value, maxima)


def comparison_of(model: MeasurementModel, stated: float | None, rivals: Sequence[Explanation]) -> Comparison:
    """Rivals, possibly none, against what a model leaves."""
    estimate = model.estimate()
    linear = estimate.linear
    sigma_left = max(estimate.least_squares.sigma_of_residuals, 1e-6)
    sigma, log_sigma = sigma_grid(stated, sigma_left)
    held = _held(model)
    rest = linear.observed - linear.design[:, held] @ linear.prior_mean[held]
    return Comparison(
        rest / linear.noise_scale, np.hstack([linear.design[:, ~held], linear.placing]) / linear.noise_scale[:, None],
        noise_kinds(model), sigma, log_sigma, rivals, linear.noise_scale,
        stated or sigma_left / _MISFIT, _certified(model, sigma_left),
    )  # fmt: skip


def _with(race: Race, versions: Sequence[Version], chosen: Key) -> MeasurementModel:
    """The race's model with known effects more, of the shapes that are most probable together."""
    shapes, added = dict(race.model.shapes), []
    for version in sorted(versions, key=lambda v: v.explanation):
        if version.explanation in chosen:
            explanation = race.explanations[version.explanation]
            added.append(EVERY[explanation.name])
            if added[-1].shape:
                shapes[explanation.name] = explanation.members[version.member].shape
    return replace(race.model, effects=(*race.model.effects, *added), shapes=shapes)


def noise_kinds(model: MeasurementModel) -> list[Kind]:
    """Kinds of noise of the used observations."""
    time = model.artefact.points.columns.get("time_s")
    order = order_of(None if time is None else mean_of(model, time), int(model.used.sum()))
    least_squares, linear = model.estimate().least_squares, model.estimate().linear
    return [
        *kinds(repeated_quantity(model), order, directions(model)),
        tails(least_squares.residuals / linear.noise_scale),
    ]


def repeated_quantity(model: MeasurementModel) -> Ints:
    """Numbers (m,) that used observations share when they repeat one quantity: one point, or pair, of one placing."""
    artefact = model.artefact
    key = np.column_stack([artefact.measurement, _points_of(model), _direction(model)])
    _, number = np.unique(key, axis=0, return_inverse=True)
    return np.asarray(number.ravel()[model.used], dtype=np.int64)


def _points_of(model: MeasurementModel) -> Ints:
    return np.sort(model.artefact.points.point[model.artefact.rows], axis=1)


def _direction(model: MeasurementModel) -> Ints:
    """Which of the observations of one reading each is (m,): the coordinates of a point are observations of their own."""
    artefact = model.artefact
    key = np.column_stack([artefact.measurement, artefact.repeat, _points_of(model)])
    _, reading = np.unique(key, axis=0, return_inverse=True)
    order = np.argsort(reading.ravel(), kind="stable")
    first = np.concatenate([[True], np.diff(reading.ravel()[order]) > 0])
    place = np.arange(len(order))
    direction = np.empty_like(place)
    direction[order] = place - np.maximum.accumulate(np.where(first, place, 0))
    return direction


def _certified(model: MeasurementModel, sigma: float) -> Floats:
    """What the certificates of sizes leave open (m, c), for one standard deviation, in units of this noise."""
    artefact = model.artefact
    certified = np.array([size.certified for size in artefact.sizes], dtype=bool)
    sds = np.array([size.sd for size in artefact.sizes])[certified]
    change = artefact.size_change()[model.used][:, certified] * sds
    return np.asarray(change / artefact.noise_scale[model.used, None] / sigma, dtype=np.float64)


def _held(model: MeasurementModel) -> NDArray[np.bool_]:
    """Which parameters of the linear model are sizes with a certificate; all others may take any value."""
    return np.array([unknown.known for unknown in model.unknowns], dtype=bool)


def _log_prior(rivals: Sequence[Explanation]) -> Floats:
    total = dict.fromkeys(SHARES, 0.0)
    for e in rivals:
        total[e.kind] += e.weight
    return np.log([SHARES[e.kind] * e.weight / total[e.kind] for e in rivals])


def _gate(comparison: Comparison, seed: int) -> tuple[float, Floats]:
    """Probability, under nothing, of as much evidence for something; and the unknown functions' largest under nothing."""
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(2,)))
    draws = np.empty((len(comparison.left), DRAWS))
    sizes = comparison.sigma[comparison.noise_posterior().argmax(axis=1)]
    probability = np.array([kind.probability for kind in comparison.kinds])
    chosen = random.choice(len(sizes), DRAWS, p=probability / probability.sum())
    for g in np.unique(chosen):
        columns = np.flatnonzero(chosen == g)
        draws[:, columns] = sizes[g] * comparison.noise(comparison.kinds[g], random, len(columns))
    statistic, odds = statistic_of(comparison, np.column_stack([comparison.left, draws]))
    unknowns = [i for i, e in enumerate(comparison.explanations) if e.kind == UNKNOWN]
    maxima = odds[unknowns, 1:].max(axis=0) if unknowns else np.zeros(0)
    return tail_probability(statistic[1:], float(statistic[0])), maxima


def statistic_of(comparison: Comparison, data: Floats) -> tuple[Floats, Floats]:
    """Log odds (b,) of something for data (m', b): one explanation, or the best known effect with any other.

    Also the log evidence (c, b) of each explanation over nothing.
    """
    nothing, something = comparison.log_evidence(data)
    odds = something - nothing
    log_odds = special.logsumexp(_log_prior(comparison.explanations)[:, None] + odds, axis=0)
    single = [
        i
        for i, e in enumerate(comparison.explanations)
        if e.kind == EFFECT and e.weight == 1 and not e.shaped and i in comparison.visible
    ]
    if len(single) < 2:
        return log_odds, odds
    pair = np.log(EFFECTS[2] / EFFECTS[0]) - np.log(comb(len(single), 2)) + np.log(NOTHING)
    together: dict[Version, list[int]] = {}
    for column, version in enumerate(comparison.best(data, single)):
        together.setdefault(version, []).append(column)
    for version, columns in together.items():
        alone, both = comparison.log_evidence(data[:, columns], [version], single)
        others = [i for i in single if i != version.explanation]
        gain = special.logsumexp(both[others], axis=0) - alone + odds[version.explanation, columns]
        log_odds[columns] = np.logaddexp(log_odds[columns], pair + gain)
    return log_odds, odds


def tail_probability(draws: Floats, value: float) -> float:
    """Probability of reaching a value, from draws; beyond their upper fifth with an exponential tail."""
    start = float(np.quantile(draws, _TAIL))
    if value <= start:
        return float((np.sum(draws >= value) + 1) / (len(draws) + 1))
    beyond = draws[draws > start] - start
    return float((1 - _TAIL) * np.exp(-(value - start) / beyond.mean()))
