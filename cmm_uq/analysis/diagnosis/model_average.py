"""What each explanation that remains makes of the effects that a job names, and their average over all of them.

Of every combination that remains the posterior of all that is linear is exact, given the noise; the average is their mixture,
weighted by their probabilities and kept as draws, for an estimate under one alone is too sure.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from cmm_uq.analysis.diagnosis.comparison.combinations import Combinations, Key
from cmm_uq.analysis.diagnosis.comparison.explanations import UNKNOWN
from cmm_uq.analysis.diagnosis.comparison.search import SearchResult, with_effects
from cmm_uq.analysis.diagnosis.joint import JointPosterior
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats
from cmm_uq.base.units import unit
from cmm_uq.machine.model import RecordingModel
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown
from cmm_uq.maths.inference.posterior import Density
from cmm_uq.maths.uncertainty.quantity import Quantity, mixed

REMAINS = 0.01  # probability from which a combination of explanations remains
SETTLED = 0.95  # probability of one combination from which no other remains
# Log evidence up to which an explanation more is not worth more than a bare mention (Kass & Raftery 1995, JASA 90, 777)
_WORTH = float(np.log(3.2))
_MOST = 12
_DRAWS = 4000
_ROUNDS = 3
_AS_READINGS = 12  # readings that a stated noise is worth: it is good to a fifth
EffectParameters = Mapping[str, Mapping[str, Quantity]]


@dataclass(frozen=True, eq=False)
class Rival:
    """A combination of explanations that remains."""

    probability: float  # among all combinations, with what adds nothing to it
    effects: tuple[str, ...]  # names of the effects that it adds to the model
    functions: tuple[Text, ...]
    named: EffectParameters  # parameters of the effects that the job names, under it
    added: EffectParameters  # parameters of its own effects
    model: RecordingModel
    draws: Floats  # (N, k) of that model's unknowns


@dataclass(frozen=True, eq=False)
class ModelAverage:
    """All combinations that remain, most probable first, and their averages; empty where one is settled or none missing."""

    rivals: tuple[Rival, ...] = ()
    averaged: EffectParameters = field(default_factory=dict)
    draws: Floats | None = None

    @property
    def weights(self) -> list[float]:
        """Probabilities of the rivals, which leave out what is less probable than each of them."""
        return [rival.probability for rival in self.rivals]


def average_models(result: SearchResult, joint: JointPosterior, before: RecordingModel, seed: int) -> ModelAverage:
    """What remains of a search. ``before`` the job's model."""
    combinations = result.combinations
    if combinations is None:
        return ModelAverage()
    whole, total = result.first.model.artefact is before.artefact, dict[Key, float]()
    for key, p in needed_combinations(combinations).items():
        # functions are known where the candidates were compared: of a large recording, on some of the observations
        own = key if whole else combinations.effects_of(key)
        total[own] = total.get(own, 0.0) + p
    order = sorted((key for key in total if total[key] > REMAINS), key=lambda key: -total[key])[:_MOST]
    if len(order) < 2 or total[order[0]] >= SETTLED:
        return ModelAverage()
    typical = joint.posterior.sizes.typical
    noise = joint.components.white(typical), float(typical.coordinate[0])
    rivals = tuple(_rival(result, combinations, noise, before, key, total[key], seed) for key in order)
    keys, each = [unknown.key for unknown in before.unknowns], []
    for rival in rivals:
        column = {unknown.key: i for i, unknown in enumerate(rival.model.unknowns)}
        each.append(rival.draws[:, [column[key] for key in keys]])
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(18,)))
    draws = mixed(each, [rival.probability for rival in rivals], random)
    return ModelAverage(rivals, _reported(before, draws), draws)


def needed_combinations(combinations: Combinations) -> dict[Key, float]:
    """Probability of every combination; one with less than three times the evidence without a member gives it to that."""
    evidence = {key: one.log_posterior - one.log_prior for key, one in combinations.by_key.items()}
    total = dict(combinations.probability)
    for key in sorted(total, key=lambda key: -len(key)):
        fewer = [key - {i} for i in key if key - {i} in evidence]
        if enough := [one for one in fewer if evidence[key] - evidence[one] < _WORTH]:
            total[max(enough, key=lambda one: evidence[one])] += total.pop(key)
    return total


def _rival(
    result: SearchResult, combinations: Combinations, noise: tuple[Callable[[Floats], Floats], float],
    before: RecordingModel, key: Key, probability: float, seed: int,
) -> Rival:  # fmt: skip
    """One that remains; ``noise`` is what whitens observations, and its standard deviation of a reading, mm."""
    explanations, (white, sigma) = result.first.explanations, noise
    functions = sorted(i for i in key if explanations[i].kind == UNKNOWN)
    combination = combinations.likeliest(
        k for k in combinations.by_key if key <= k and combinations.effects_of(k) == combinations.effects_of(key)
    )
    versions, effects, model = combinations.by_key[combination].versions, key - frozenset(functions), before
    if effects:
        model = replace(with_effects(result.first, versions, effects), artefact=before.artefact, used=before.used)
    linear = replace(model.linearised(_about(model, before, result.model)), sigma=None)
    for version in [version for version in versions if version.explanation in functions]:
        columns, sd = explanations[version.explanation].members[version.member].columns, version.amplitude * sigma
        more = tuple(Unknown(("unknown", str(i)), unit("1"), 0.0, sd, sd) for i in range(columns.shape[1]))
        linear = replace(linear, design=np.hstack([linear.design, columns]), unknowns=(*linear.unknowns, *more))
    draws = _drawn(linear.uncorrelated(white), sigma, result.stated, seed)[:, : len(model.unknowns)]
    reported = _reported(model, draws)
    added = tuple(effect.name for effect in model.effects if effect.name not in {e.name for e in before.effects})
    return Rival(
        probability, added, tuple(explanations[i].name for i in functions),
        {effect.name: reported[effect.name] for effect in before.effects}, {name: reported[name] for name in added},
        model, draws,
    )  # fmt: skip


def _about(model: RecordingModel, *estimated: RecordingModel) -> Floats:
    """Parameters (k,) that a model is linear about: as the last of others estimates them, else as known beforehand."""
    values = {unknown.key: unknown.prior_mean for unknown in model.unknowns}
    for other in estimated:
        values |= dict(zip((unknown.key for unknown in other.unknowns), other.estimate().about, strict=True))
    return np.array([values[unknown.key] for unknown in model.unknowns])


def _drawn(linear: LinearModel, sigma: float, stated: float | None, seed: int) -> Floats:
    """Draws (N, k) from the multivariate t distribution of all that is linear, the noise estimated from what it leaves."""
    reduced = linear.reduced
    known = _AS_READINGS if stated is not None and 0.5 < sigma / stated < 2 else 0
    mean, covariance, degrees = np.zeros(0), np.zeros((0, 0)), 1.0
    for _ in range(_ROUNDS):
        mean, covariance, _ = Density(replace(linear, sigma=sigma)).conditional(float(np.log(sigma)))
        left = reduced.observed - reduced.design @ mean
        fitted = float(np.einsum("ij,jk,ik->", reduced.design, covariance, reduced.design)) / sigma**2
        degrees = max(reduced.count - fitted, 1.0) + known
        sigma = max(float(np.sqrt((left @ left + known * (stated or 0.0) ** 2) / degrees)), 1e-6)
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(17,)))
    scale = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    # The symmetric root: axes of equal length turn with the last digits, their sum does not.
    root = scale[:, None] * ((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)
    normal = random.standard_normal((_DRAWS, len(mean)))
    wider = np.sqrt(degrees / random.chisquare(degrees, _DRAWS))
    return np.asarray(mean + wider[:, None] * (normal @ root.T))


def _reported(model: RecordingModel, draws: Floats) -> dict[str, dict[str, Quantity]]:
    found, column = {}, 0
    for effect in model.effects:
        own = draws[:, column : column + len(effect.coefficients)]
        column += len(effect.coefficients)
        shape = np.tile(np.array(model.shapes.get(effect.name, ()), dtype=np.float64), (len(own), 1))
        units = {parameter.name: parameter.unit for parameter in effect.reported}
        # what shapes an effect is held here: neither it nor a phase, which goes with it, is estimated
        held = {shaped.name for shaped in effect.shape} | ({"phase_rad"} if effect.shape else set())
        each = {name: values for name, values in effect.to_reported(own, shape).items() if name not in held}
        found[effect.name] = {name: Quantity.of_draws(values, units[name]) for name, values in each.items()}
    return found
