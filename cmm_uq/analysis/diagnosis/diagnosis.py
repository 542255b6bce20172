"""The diagnosis of a recording: whether something is missing, where, what, and whether modelling it predicts better.

Of every combination of explanations that remains the posterior of all that is linear is exact, given the noise; the average is
their mixture, weighted by their probabilities and kept as draws, for an estimate under one alone is too sure.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import scipy

from cmm_uq.analysis.diagnosis import joint as jointly
from cmm_uq.analysis.diagnosis.asserted import OmittedEffect, doubted, indistinguishable, least_supported, left_out
from cmm_uq.analysis.diagnosis.comparison.combinations import Combinations, Key
from cmm_uq.analysis.diagnosis.comparison.explanations import UNKNOWN
from cmm_uq.analysis.diagnosis.comparison.search import SearchResult, search, substitute, with_effects, withhold
from cmm_uq.analysis.diagnosis.empirical.model import BestKnown, EmpiricalModel, best_known, empirical_model
from cmm_uq.analysis.diagnosis.empirical.own_form import FormCheck
from cmm_uq.analysis.diagnosis.held_out import Improvement, RepeatComparison, against_repeats, improvement, thin_out
from cmm_uq.analysis.diagnosis.joint import JointPosterior, WithheldEffect, joint_posterior
from cmm_uq.analysis.diagnosis.location import Place, locate
from cmm_uq.analysis.diagnosis.noise import has_heavy_tails, probability_by_name
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.jobs.verdicts import AGREES
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.kind import Observed
from cmm_uq.machine.model.recorded import of_last_digit
from cmm_uq.maths.inference.ensembles import Progress
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown, studentised
from cmm_uq.maths.inference.noise import Components
from cmm_uq.maths.inference.posterior import Density, NoisyPosterior, symmetric_root
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
    about, unknowns = _about(model, before, result.model)
    linear = replace(model.linearised(about), sigma=None, unknowns=unknowns)
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


def _about(model: RecordingModel, *estimated: RecordingModel) -> tuple[Floats, tuple[Unknown, ...]]:
    """Parameters (k,) that a model is linear about, and their priors: as the last of others has them, else as beforehand."""
    unknowns = {unknown.key: unknown for unknown in model.unknowns}
    values = {key: unknown.prior_mean for key, unknown in unknowns.items()}
    for other in estimated:
        found = other.estimate()
        values |= {one.key: value for one, value in zip(found.linear.unknowns, found.about.tolist(), strict=True)}
        unknowns |= {one.key: one for one in found.linear.unknowns}
    keys = [unknown.key for unknown in model.unknowns]
    return np.array([values[key] for key in keys]), tuple(unknowns[key] for key in keys)


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
    normal = random.standard_normal((_DRAWS, len(mean)))
    wider = np.sqrt(degrees / random.chisquare(degrees, _DRAWS))
    return np.asarray(mean + wider[:, None] * (normal @ symmetric_root(covariance).T))


def _reported(model: RecordingModel, draws: Floats) -> dict[str, dict[str, Quantity]]:
    found: dict[str, dict[str, Quantity]] = {effect.name: {} for effect in model.effects}
    for (owner, name), drawn in model.reported(draws, found).items():
        found[owner][name] = Quantity.of_draws(*drawn)
    return found


FALSE_ALARMS = 0.01  # default rate at which a recording without any fault is found to have one
_UNKNOWN = 0.5
_NOISE_KIND = 0.9


@dataclass(frozen=True)
class NoiseDiagnosis:
    coordinate: Quantity
    placing: Quantity
    correlated_in_time: bool
    heavy_tails: bool
    contradicts_stated: bool


@dataclass(frozen=True, eq=False)
class Diagnosis:
    verdict: str  # one of :data:`VERDICTS`
    p_value: float
    alpha: float
    where: tuple[Place, ...]
    effects: tuple[OmittedEffect, ...]  # what is asserted, most probable first
    indistinguishable: tuple[tuple[str, ...], ...]  # groups of effects that this recording cannot tell apart
    rivals: tuple[tuple[Text, float], ...]  # every candidate by itself with its probability, most probable first
    noise: NoiseDiagnosis  # noise, improvement: see their classes
    improvement: Improvement
    before: RecordingModel  # before, after: the job's model, and with what was left out
    after: RecordingModel
    components: Components  # of the noise, for the model after
    posterior: NoisyPosterior
    compared: int  # observations that the candidates were compared on; what was found is estimated from all
    search: SearchResult
    withheld: tuple[WithheldEffect, ...] = ()  # effects that are probable, and yet not asserted
    # combinations of explanations that remain, and what they make of the named effects
    remaining: ModelAverage = field(default_factory=ModelAverage)
    empirical: EmpiricalModel | None = None  # of what no effect accounts for
    repeats: RepeatComparison | None = None  # of what the model after leaves
    best_known: BestKnown | None = None  # where something is missing

    @property
    def agrees(self) -> bool:
        return self.verdict in AGREES


def diagnose(
    model: RecordingModel, *, stated_um: float | None, alpha: float, seed: int, progress: Progress | None = None,
    known: NoisyPosterior | None = None, observe: Observed | None = None,
) -> Diagnosis:  # fmt: skip
    stated = None if stated_um is None else stated_um * MICROMETRE
    least = of_last_digit(model.artefact.points.xyz, model.estimate().least_squares.sigma_of_residuals)
    model = replace(model, least_noise=least) if least > model.least_noise else model
    some = model if observe is None else thin_out(model, observe, seed)
    found, joint, withheld, forms = _asserted(
        search(some, stated, alpha=alpha, seed=seed), model, seed, progress, known
    )
    gain = improvement(model, found.model)
    if found.effects and (gain.elpd_gain <= gain.elpd_gain_se or gain.worse):
        withheld = (*withheld, *jointly.withhold_unpredicted(found, gain.unseen))
        found = _of_all(withhold(found, found.chosen), model)
        gain, joint = improvement(model, model), joint_posterior(found, seed, progress, known)
    noise, first = _noise(found, joint, stated), found.first
    after = replace(found.model, sigma=noise.coordinate.value * MICROMETRE)
    most = np.argsort(-first.probability)[:12]
    rivals = tuple((first.explanations[i].name, float(first.probability[i])) for i in most)
    repeats, wrong = against_repeats(found.model), first.p_value < alpha
    shared = repeats is not None and repeats.p_value < alpha
    doubtful = found.unexplained > _UNKNOWN or shared or forms.beside
    empirical = empirical_model(found) if wrong and (doubtful or not found.effects) else None
    modelled = empirical is not None and empirical.predicts
    verdict = "undetermined" if shared else "consistent"
    if wrong:
        named, unnamed = "partial" if doubtful else "explained", "empirical" if modelled else "unexplained"
        verdict = named if found.effects else unnamed
    return Diagnosis(
        verdict, first.p_value, alpha, locate(first, alpha, found.chosen), left_out(found, joint, model, forms),
        indistinguishable(found), rivals, noise, gain, model, after, joint.components, joint.posterior,
        int(some.used.sum()), found, withheld, average_models(found, joint, model, seed), empirical, repeats,
        best_known(found) if wrong else None,
    )  # fmt: skip


def _asserted(
    result: SearchResult, model: RecordingModel, seed: int, progress: Progress | None, known: NoisyPosterior | None
) -> tuple[SearchResult, JointPosterior, tuple[WithheldEffect, ...], FormCheck]:
    """What of a search may be asserted, and how probable its forms are.

    Where an effect's size is open its next probable is tried, else the least goes.
    """
    result, gone = jointly.withhold_unresolved(result)
    places: dict[int, WithheldEffect] = {}  # of each effect that was tried in the place of others, the first of these
    tried: frozenset[int] = frozenset()
    while True:
        while weak := least_supported(result):  # within the noise: nothing more is unexplained without it
            result = replace(withhold(result, frozenset(weak)), unexplained=result.unexplained)
            gone = (*gone, *weak.values())
        doubtful, forms = doubted(result)
        while doubtful:
            tried |= frozenset(doubtful)  # none of them takes the place of another
            result, gone = withhold(result, frozenset(doubtful)), (*gone, *doubtful.values())
            doubtful, forms = doubted(result)
        result = _of_all(result, model)
        joint = joint_posterior(result, seed, progress, known)
        if not (more := jointly.effects_without_size(result, joint)):
            return result, joint, gone, forms
        tried |= frozenset(more)
        alone = []
        for i, withheld in more.items():
            if (instead := substitute(result, i, tried)) is not None:
                result, other = instead
                places[other] = places.get(i, withheld)
            else:
                alone.append(i)
        if len(alone) == len(more):
            least = min(alone, key=lambda i: more[i].probability)
            result, gone = withhold(result, frozenset({least})), (*gone, places.get(least, more[least]))


def _of_all(result: SearchResult, model: RecordingModel) -> SearchResult:
    if not result.chosen or result.model.artefact is model.artefact:
        return result if result.chosen else replace(result, model=model)
    return replace(result, model=replace(result.model, artefact=model.artefact, used=model.used))


def _noise(result: SearchResult, joint: JointPosterior, stated: float | None) -> NoiseDiagnosis:
    """The noise, given what is modelled; a kind is named when it has nine parts of ten."""
    sizes, last, weight = joint.posterior.sizes, result.last, result.last.noise_posterior().sum(axis=1)
    estimate = result.model.estimate()
    residuals = studentised(estimate.linear, joint.components, sizes.typical, estimate.least_squares.residuals)
    likeliest = int(weight.argmax())  # quick noise is no other noise than a reading's for who states that
    squares = last.squares[likeliest] * last.kinds[likeliest].scatter ** 2
    # two-sided χ² test of the stated noise at 1 %
    p = 0.5 if stated is None else float(scipy.special.chdtrc(last.degrees_of_freedom, squares / stated**2))
    heavy = probability_by_name(last.kinds, weight).get("tails", 0.0) > _NOISE_KIND or has_heavy_tails(residuals)
    of_point, offset = (Quantity.of_draws(size / MICROMETRE, unit("µm")) for size in (sizes.coordinate, sizes.placing))
    return NoiseDiagnosis(of_point, offset, float(np.mean(sizes.slow > 0)) > _NOISE_KIND, heavy, min(p, 1 - p) < 0.005)
