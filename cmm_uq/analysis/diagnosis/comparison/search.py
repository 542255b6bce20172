"""The search for what was left out: a lack-of-fit test with a known false-alarm rate, then a comparison of combinations."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import scipy

from cmm_uq.analysis.diagnosis.comparison import explanations as candidate
from cmm_uq.analysis.diagnosis.comparison.combinations import Combinations, Key, explore
from cmm_uq.analysis.diagnosis.comparison.conditional import AMPLITUDES, Version
from cmm_uq.analysis.diagnosis.comparison.evidence import CandidateComparison
from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, UNKNOWN, Explanation, Member
from cmm_uq.analysis.diagnosis.comparison.lack_of_fit import NOTHING, by_rearrangement, lack_of_fit, log_prior
from cmm_uq.analysis.diagnosis.comparison.lack_of_form import lack_of_form
from cmm_uq.analysis.diagnosis.empirical.functions import FunctionFamily, each_family, families_of
from cmm_uq.analysis.diagnosis.noise import noise_kinds, sigma_grid
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, replace
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.measurement import SMALL_LEAN
from cmm_uq.machine.model.noise import display_of

_MISFIT = 20.0  # largest misfit, over the noise, that is reckoned with when the noise is not stated
_OF_FORMS = 0.2  # part of the false-alarm rate at which forms speak where effects and smooth functions do not
ASSERTED = 0.5  # probability from which an effect, or one of those that cannot be told from it, is asserted
# Probability from which an effect is asserted when all that is asked is whether it has its own form or any other
_MECHANISM = 0.2
_PROBABLE = 0.02  # probability of a combination from which the period in it is refined
_SHOWN = 6.0  # log evidence of a period from which shorter ones are tried besides: less shows none
_FEW = 6  # periods that are refined where none shows
# Part of the log evidence that a period may lose where it lies between two trials (sinc² at half of a step, and more)
_BETWEEN = 0.12
_IMPROBABLE = 12.0  # log evidence below that of the best from which a period is not followed
_BEYOND_DOUBT = 1000.0  # factor below the false-alarm rate from which on a misfit is beyond doubt
_AGAIN = 3  # times that everything is compared again about what was found
# Part of an effect's squared visible length up to which a nonparametric term that leaves no more of it could pass for it
_PASSES = 0.1
NOT_TOLD_APART = 0.02  # odds from which another effect in the place of one counts as not told apart from it


@dataclass(frozen=True, eq=False)
class ModelComparison:
    model: RecordingModel  # model, values: what is explained so far, and its estimate
    values: Floats
    comparison: CandidateComparison
    log_odds: Floats  # (c,) log evidence of each over nothing
    probability: Floats  # (c,) of each explanation, nothing included in the comparison
    p_value: float
    by_rearrangement: float  # the same of what is left itself; zero where it is not in doubt
    null: Floats  # (draws,) test statistic under nothing
    null_maximum: Floats  # (draws,) largest log evidence of a nonparametric term over nothing, under nothing

    @property
    def explanations(self) -> Sequence[Explanation]:
        return self.comparison.explanations

    @cached_property
    def families(self) -> list[FunctionFamily]:
        """All functions of what is recorded that the misfit could be."""
        return families_of(self.model, self.values, self.comparison)


@dataclass(frozen=True, eq=False)
class SearchResult:
    first: ModelComparison  # comparison before anything is found
    last: CandidateComparison  # what is left after everything is, without candidates
    # of explanations, with their probabilities; None where the lack-of-fit test does not reject
    combinations: Combinations | None
    chosen: Key  # indices, among the candidates, of the known effects that are found
    versions: tuple[Version, ...]  # of them, and of what is unknown besides, in the most probable combination
    model: RecordingModel  # the job's model with what was left out
    unexplained: float  # probability that something unknown acts besides
    stated: float | None = None  # standard uncertainty of a coordinate, mm, as the job states it

    @property
    def effects(self) -> tuple[str, ...]:
        return tuple(self.first.explanations[i].name for i in sorted(self.chosen))


def search(model: RecordingModel, stated: float | None, *, alpha: float, seed: int) -> SearchResult:
    """Find what a model leaves out; squarenesses so large that the model bends are modelled, and all compared about them."""
    found = _search(model, stated, alpha, seed)
    own = dict(zip((u.key for u in model.unknowns), model.estimate().about, strict=True))
    for _ in range(_AGAIN):
        whole = found.model
        about, before = whole.estimate().about, np.array([own.get(unknown.key, 0.0) for unknown in whole.unknowns])
        if not found.effects or not whole.leans_beyond(about - before, np.zeros_like(about), SMALL_LEAN):
            break
        again = _search(replace(model, within=whole), stated, alpha, seed)
        if not again.effects:
            break
        effects, found = found.effects, again
        if found.effects == effects:
            break
    return found


def _search(model: RecordingModel, stated: float | None, alpha: float, seed: int) -> SearchResult:
    first = model_comparison(model, stated, seed, alpha)
    if first.p_value >= alpha:  # what no effect is, and no smooth function, may have a form
        about = first.model, first.values, first.comparison
        of_forms = lack_of_form(first.comparison, lambda: each_family(*about), seed, _OF_FORMS * alpha) / _OF_FORMS
        first = replace(first, p_value=of_forms) if of_forms < alpha else first
    if first.p_value >= alpha:
        return SearchResult(first, first.comparison, None, frozenset(), (), model, 0.0, stated=stated)
    combinations = explore(first.comparison)
    probable = (combinations.by_key[key].versions for key, p in combinations.probability.items() if p > _PROBABLE)
    members = [explanation.members for explanation in first.explanations]
    shaped = {v.explanation for versions in probable for v in versions if members[v.explanation][v.member].shape}
    if shaped:
        every = enumerate(first.explanations)
        explanations = [_refined(first, combinations, i) if i in shaped else e for i, e in every]
        first = replace(first, comparison=replace(first.comparison, explanations=explanations))
        combinations = explore(first.comparison, combinations, frozenset(shaped))
    combinations = replace(combinations, imitated=_imitated(first.comparison, combinations))
    chosen = effects_to_assert(combinations)
    result = _estimated(first, combinations, chosen, stated)
    return result if result.chosen == chosen else replace(result, unexplained=1.0)


def _estimated(first: ModelComparison, combinations: Combinations, chosen: Key, stated: float | None) -> SearchResult:
    """The result with these effects; without the least probable where least squares of all gives sizes that no machine has."""
    ordered = sorted(chosen, key=combinations.of)
    for kept in (chosen, *(chosen - {i} for i in ordered)):
        try:
            return _of(first, combinations, kept, stated)
        except CmmUqError:
            if not chosen:
                raise
    return _estimated(first, combinations, chosen - {ordered[0]}, stated)


def _of(first: ModelComparison, combinations: Combinations, chosen: Key, stated: float | None) -> SearchResult:
    versions = combinations.versions(chosen)
    found = first.model if not chosen else with_effects(first, versions, chosen)
    last, beside = comparison_of(found, stated, ()), combinations.unknown_beside(chosen)
    return SearchResult(first, last, combinations, chosen, versions, found, beside, stated)


def withhold(result: SearchResult, withheld: Key) -> SearchResult:
    """The same search with some of the effects not asserted: what they stood for stays unexplained."""
    first, chosen, combinations = result.first, result.chosen - withheld, result.combinations
    if combinations is None or not withheld:
        return result
    versions = combinations.versions(chosen)
    model = with_effects(first, versions, chosen) if chosen else first.model
    try:
        last = comparison_of(model, result.stated, ()) if chosen else first.comparison
    except CmmUqError:  # what went had kept the others to sizes that a machine can have
        return replace(_estimated(first, combinations, chosen, result.stated), unexplained=1.0)
    return replace(result, last=last, chosen=chosen, versions=versions, model=model, unexplained=1.0)


def substitute(result: SearchResult, index: int, tried: Key) -> tuple[SearchResult, int] | None:
    """The search with the next most probable in an effect's place, and which: not to be told from it, and half with it."""
    combinations = result.combinations
    if combinations is None:
        return None
    for other in sorted(rivals_of(combinations, result.chosen, index) - tried, key=lambda i: -combinations.of(i)):
        chosen = result.chosen - {index} | {other}
        if chosen not in combinations.of_effects or result.first.explanations[other].shaped:
            continue
        if combinations.of(other) >= _MECHANISM and probability_with_rivals(combinations, chosen, other) >= ASSERTED:
            try:
                instead = _of(result.first, combinations, chosen, result.stated)
            except CmmUqError:
                continue
            return replace(instead, unexplained=max(instead.unexplained, result.unexplained)), other
    return None


def _refined(first: ModelComparison, combinations: Combinations, index: int) -> Explanation:
    most = combinations.likeliest(key for key in combinations.by_key if index in key)
    others = [v for v in combinations.by_key[most].versions if v.explanation != index]
    explanation = first.explanations[index]
    gains = _gains(first, explanation, others)
    shows = bool(gains.max() > _SHOWN)
    if shows:
        explanation = candidate.with_shorter_periods(first.model, first.values, explanation)
        gains = _gains(first, explanation, others)
    below = gains.max() - gains
    shaped = np.array([bool(member.shape) for member in explanation.members])
    between = _BETWEEN * max(float(gains.max()), 0.0) + 1.0
    fits = [int(i) for i in np.argsort(below) if shaped[i] and below[i] < between][: None if shows else _FEW]
    refined = candidate.refine(first.model, first.values, explanation, fits)
    # what does not fit at all keeps its weight, and costs nothing: columns of zeros are invisible
    lost = set(np.flatnonzero(shaped & (below > max(_IMPROBABLE, between))).tolist())
    weight = sum(explanation.members[i].weight for i in lost)
    kept = tuple(member for i, member in enumerate(refined.members) if i not in lost)
    nothing = Member(np.zeros((len(first.comparison.left), 1)), weight=weight)
    return replace(refined, members=(*kept, nothing) if lost else kept)


def _gains(first: ModelComparison, explanation: Explanation, others: Sequence[Version]) -> Floats:
    """Log evidence (members,) of each version of an explanation beside others, over that of the others alone."""
    beside = [replace(e, members=(e.members[v.member],)) for v in others for e in [first.explanations[v.explanation]]]
    comparison = replace(first.comparison, explanations=[explanation, *beside])
    given = [Version(k, 0, v.amplitude) for k, v in enumerate(others, 1)]
    evidence = np.full(len(explanation.members), -np.inf)
    member, of_each, _ = comparison.of_versions(0, given)
    evidence[member] = of_each - np.log(AMPLITUDES)
    return np.asarray(evidence - comparison.log_evidence_of(given)[0], dtype=np.float64)


def effects_to_assert(combinations: Combinations) -> Key:
    """The most probable set of known effects, without those that something else could well be instead."""
    chosen = combinations.most_probable
    if not chosen:
        return _one_by_one(combinations)
    together = {i: probability_with_rivals(combinations, chosen, i) for i in chosen}
    doubtful = {i for i in chosen if max(combinations.of(i), together[i]) < ASSERTED}
    # and effects improbable only because a nonparametric term, which could be the same, describes them as well
    instead = {j for i in chosen for j, odds in combinations.instead(chosen, i).items() if odds > NOT_TOLD_APART}
    besides = frozenset(
        i for i, effect in enumerate(combinations.explanations)
        if effect.kind == EFFECT and i not in instead and combinations.of(i) >= _MECHANISM
        and any(combinations.of_any(frozenset((i, j))) >= ASSERTED for j in combinations.imitating(i))
    )  # fmt: skip
    return (chosen - doubtful) | besides


def _one_by_one(combinations: Combinations) -> Key:
    """Known effects of the best set of them, where nothing is most probable, that are more probable than not all the same."""
    known = {key: p for key, p in combinations.of_effects.items() if key}
    best, found = max(known, key=lambda key: known[key]) if known else frozenset[int](), frozenset[int]()
    for i in sorted(best, key=lambda i: -combinations.of(i)):
        alike = rivals_of(combinations, best, i) | {i}
        beside = sum(p for key, p in known.items() if found <= key) if found else 1.0
        own = sum(p for key, p in known.items() if found <= key and alike & key)
        if own >= _MECHANISM * beside and combinations.of_any(alike | combinations.imitating(i)) >= ASSERTED:
            found |= {i}
    return found


def _imitated(comparison: CandidateComparison, combinations: Combinations) -> dict[int, Key]:
    probable = [i for i in range(len(combinations.explanations)) if combinations.of(i) > _PROBABLE]
    kinds = {kind: [i for i in probable if combinations.explanations[i].kind == kind] for kind in (EFFECT, UNKNOWN)}
    best = {}
    for i in probable:
        most = combinations.likeliest(key for key in combinations.by_key if i in key)
        best[i] = next(v for v in combinations.by_key[most].versions if v.explanation == i)
    return {
        i: frozenset(j for j in kinds[UNKNOWN] if comparison.left_of(best[i], [best[j]]) < _PASSES)
        for i in kinds[EFFECT]
    }


def probability_with_rivals(combinations: Combinations, chosen: Key, index: int) -> float:
    """Probability of an effect or one that these data cannot tell from it."""
    return combinations.of_any(rivals_of(combinations, chosen, index) | {index})


def rivals_of(combinations: Combinations, chosen: Key, index: int) -> Key:
    """Known effects that these data cannot tell from one of those chosen."""
    return frozenset(i for i, odds in combinations.instead(chosen, index).items() if odds > NOT_TOLD_APART)


def model_comparison(
    model: RecordingModel, stated: float | None, seed: int, alpha: float | None = None
) -> ModelComparison:
    values = model.estimate().about
    singles = candidate.known_effects(model, values, tuple(effect.name for effect in model.effects))
    known_as = {term for single in singles if single.effect is not None for term in single.effect.stands_for}
    functions = [function for function in candidate.unknown_functions(model, values) if function.term not in known_as]
    candidates = singles + candidate.effects_together(singles) + functions
    comparison = comparison_of(model, stated, candidates)
    nothing, something = comparison.log_evidence()
    log_odds = something[:, 0] - nothing[0]
    prior = log_prior(candidates)
    log_total = scipy.special.logsumexp(np.append(prior + log_odds, np.log(NOTHING)))
    p_value, null, maxima = lack_of_fit(comparison, seed, alpha)
    probability = np.exp(prior + log_odds - log_total)
    near = alpha is not None and alpha / _BEYOND_DOUBT < p_value < alpha
    rearranged = by_rearrangement(comparison, seed) if near else 0.0
    return ModelComparison(model, values, comparison, log_odds, probability, p_value, rearranged, null, maxima)


def comparison_of(
    model: RecordingModel, stated: float | None, candidates: Sequence[Explanation]
) -> CandidateComparison:
    """Candidates, possibly none, against what a model leaves."""
    estimate = model.estimate()
    linear = estimate.linear
    sigma_left = max(estimate.least_squares.sigma_of_residuals, 1e-6)
    sigma, log_sigma = sigma_grid(stated, sigma_left, model.least_noise)
    held = np.array([unknown.known for unknown in model.unknowns], dtype=bool)
    rest = linear.observed - linear.design[:, held] @ linear.prior_mean[held]
    return CandidateComparison(
        rest / linear.noise_scale, np.hstack([linear.design[:, ~held], linear.freedoms.dense()]) / linear.noise_scale[:, None],
        noise_kinds(model, candidates), sigma, log_sigma, candidates, linear.noise_scale,
        max(stated or sigma_left / _MISFIT, model.least_noise), _certified(model, max(sigma_left, model.least_noise)),
        display_of(model),
    )  # fmt: skip


def with_effects(compared: ModelComparison, versions: Sequence[Version], chosen: Key) -> RecordingModel:
    """The model with known effects more, of the shapes that are most probable together."""
    shapes, added = dict(compared.model.shapes), []
    for version in sorted(versions, key=lambda v: v.explanation):
        if version.explanation in chosen:
            explanation = compared.explanations[version.explanation]
            if explanation.effect is None:
                continue
            added.append(explanation.effect)
            if added[-1].shape:
                shapes[explanation.name] = explanation.members[version.member].shape
    return replace(compared.model, effects=(*compared.model.effects, *added), shapes=shapes, within=None)


def _certified(model: RecordingModel, sigma: float) -> Floats:
    """What the certificates of sizes leave open (m, c), for one standard deviation, in units of this noise."""
    artefact = model.artefact
    certified = np.array([size.certified for size in artefact.sizes], dtype=bool)
    sds = np.array([size.sd for size in artefact.sizes])[certified]
    change = artefact.size_change()[model.used][:, certified] * sds
    return np.asarray(change / artefact.noise_scale[model.used, None] / sigma, dtype=np.float64)
