"""What is asserted of a recording: each effect with its size, its probability, and what could stand in its place.

Some sets of effects no recording tells from one, whatever was known beforehand. On seven lines of a gauge a roll of X is −0.3
of the squareness X–Y and −0.6 of Z–X, to the last digit: that one effect is more probable beforehand than two is no evidence.
Sets of one, two and three others are compared with an effect by what the readings say alone: all are as large beforehand as
each other in what they show. Up to 20 : 1 they are one class, where no number of repeats would part them, or what is known
beforehand does not either. Of fifty effects some three imitate any weak one within its noise: that is chance, more readings
end it, and it is no reason to doubt what is found.

A name is for a technician who acts on it: nine in ten is asked of an effect, or of it with what the readings do not tell from
it, and four in five of its form among all that an error could be (:mod:`~cmm_uq.analysis.diagnosis.empirical.own_form`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations as subsets

import numpy as np
import scipy

from cmm_uq.analysis.diagnosis import joint as jointly
from cmm_uq.analysis.diagnosis.comparison.combinations import (
    CombinationPrior,
    Combinations,
    Key,
    effects_of_every_machine,
)
from cmm_uq.analysis.diagnosis.comparison.conditional import AMPLITUDES, Version
from cmm_uq.analysis.diagnosis.comparison.evidence import CandidateComparison
from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, SEVERAL, UNKNOWN, Explanation, Member, effect_of
from cmm_uq.analysis.diagnosis.comparison.lack_of_fit import NOTHING
from cmm_uq.analysis.diagnosis.comparison.search import SearchResult, rivals_of
from cmm_uq.analysis.diagnosis.empirical.evidence import FunctionFit
from cmm_uq.analysis.diagnosis.empirical.model import ALIKE, ODDS
from cmm_uq.analysis.diagnosis.empirical.own_form import FormCheck, checked_forms
from cmm_uq.analysis.diagnosis.joint import NAMED, JointPosterior, Mode, WithheldEffect, period_modes, withheld_effect
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass, replace
from cmm_uq.machine.model import RecordingModel
from cmm_uq.maths.inference.linear_model import LinearModel, solve
from cmm_uq.maths.uncertainty.quantity import Quantity

_MOST, _TRIED = 3, 60  # effects of a set; sets whose evidence is computed
_ALLOWED = 3.0  # prior standard deviations that an effect of a set may have
_SEEN = 1e-9  # part of an effect's length that the baseline must leave of it
_DISTINCT = 1e-6  # part of a member's squared length that the others of a set must leave


@dataclass(frozen=True)
class AlternativeSet:
    """Effects that together could stand in the place of others."""

    instead_of: tuple[str, ...]  # names
    effects: tuple[str, ...]
    titles: tuple[Text, ...]  # of these, in words
    sizes: tuple[float, ...]  # of these then, in prior standard deviations
    # of what they stand for over them by the readings alone: what of it they cannot be, one where they can be all of it
    odds: float
    prior_odds: float  # by what is known beforehand alone


def alternative_sets(
    comparison: CandidateComparison, combinations: Combinations, chosen: Key, versions: Sequence[Version]
) -> tuple[AlternativeSet, ...]:
    """Of each effect, and of each two of one coefficient, the smallest sets that the readings do not tell from them."""
    every, sets, found = comparison.explanations, list[tuple[Key, Key]](), list[AlternativeSet]()
    prior = CombinationPrior(every, combinations.counts, comparison.visible)
    names = [str.__str__(one.name) for one in every]
    single = [i for i in sorted(chosen) if _single(every[i])]
    rigid = frozenset(effects_of_every_machine(comparison))
    alone = [i for i in sorted(chosen) if every[i].kind == EFFECT and not every[i].members[0].shape]
    for taken in (*((i,) for i in alone), *subsets(single, 2)):
        always = frozenset() if rigid >= set(taken) else rigid
        for members, sizes, lost, part in _instead(comparison, chosen, versions, taken, always):
            own = frozenset(taken), frozenset(members)
            if any(one[0] <= own[0] and one[1] <= own[1] for one in sets):
                continue
            odds, after = float(np.exp(lost)), (chosen - own[0]) | own[1]
            beforehand = float(np.exp(np.clip(prior.log(chosen) - prior.log(after), -700, 700)))
            if part <= ALIKE or odds * beforehand <= ODDS or own[1] <= always:
                sets.append(own)
                named, titles = tuple(names[i] for i in members), tuple(effect_of(every[i]).title for i in members)
                found.append(AlternativeSet(tuple(names[i] for i in taken), named, titles, sizes, odds, beforehand))
    return tuple(found)


def _instead(
    comparison: CandidateComparison, chosen: Key, versions: Sequence[Version], taken: tuple[int, ...], always: Key
) -> list[tuple[tuple[int, ...], tuple[float, ...], float, float]]:
    """Smallest sets in the place of some effects, their sizes, what they lose of the log likelihood and of what is shown.

    That those ``always`` there are more, or differ in size, is no evidence against them.
    """
    others = [i for i in sorted(comparison.visible) if i not in chosen and _single(comparison.explanations[i])]
    given = [v for v in versions if v.explanation in chosen and v.explanation not in taken]
    forms, lengths = _forms(comparison, given, np.array([*others, *taken], dtype=np.intp))
    own = forms[:, len(others) :]
    shown = own @ np.linalg.lstsq(own, comparison.left, rcond=None)[0]
    size = float(np.linalg.norm(shown))
    seen = np.flatnonzero(lengths[: len(others)])
    if size == 0 or not len(seen):
        return []
    square = float(comparison.left @ comparison.left) - size**2
    variance = max(square / max(comparison.degrees_of_freedom - len(taken) - len(given), 1), comparison.least_noise**2)
    largest, spare = _MOST if len(taken) == 1 else 1, own.shape[1] if own.shape[1] > len(taken) else 0
    candidates = _like(forms[:, seen], lengths[seen], shown / size, size, variance, largest, spare)
    tried = sorted(candidates, key=lambda one: one[0])[:_TRIED]
    names = [tuple(others[seen[k]] for k in each) for _, each, _ in tried]
    fitted = [one for one in _fitted(comparison.left, forms, lengths, others, always) if one[0] not in names]
    evidence = _evidence(comparison, given, [taken, *names, *(members for members, _ in fitted)])
    less_than = (evidence[0] - evidence[1:]).tolist()
    found: list[tuple[tuple[int, ...], tuple[float, ...], float, float]] = []
    for (less, _, sizes), members, log_odds in zip(tried, names, less_than, strict=False):
        lost = max(less - 0.5 * max(spare - len(members), 0), 0.0)  # without what so many more fit of noise alone
        if log_odds <= np.log(ODDS) or always >= set(members):
            found.append((members, tuple(sizes.tolist()), lost, 2 * less * variance / size**2))
    for (members, sizes), log_odds in zip(fitted, less_than[len(names) :], strict=True):
        if log_odds <= np.log(ODDS):
            found.append((members, tuple(sizes.tolist()), max(log_odds, 0.0), 1.0))
    return [one for one in found if not any(set(fewer[0]) < set(one[0]) for fewer in found)]


def _fitted(
    left: Floats, forms: Floats, lengths: Floats, others: Sequence[int], always: Key
) -> Iterator[tuple[tuple[int, ...], Floats]]:
    """Sets of what every machine has, and its sizes, prior sd's: they may fit all readings as well, in another form."""
    free = [k for k, i in enumerate(others) if i in always and lengths[k] > 0]
    for each in (one for count in range(1, _MOST + 1) for one in subsets(free, count)):
        own = forms[:, each]
        if np.linalg.det(own.T @ own) > _DISTINCT:
            sizes = np.linalg.lstsq(own, left, rcond=None)[0] / lengths[list(each)]
            if np.all(np.abs(sizes) < _ALLOWED):
                yield tuple(others[k] for k in each), sizes


def _single(explanation: Explanation) -> bool:
    first = explanation.members[0]
    return explanation.kind == EFFECT and first.columns.shape[1] == 1 and not first.shape


def _forms(comparison: CandidateComparison, given: Sequence[Version], numbers: Ints) -> tuple[Floats, Floats]:
    """Forms (m, n) of length one that the baseline and what is given leave, and lengths (n,) for prior sd's, mm."""
    scale, explanations = comparison.noise_scale[:, None], comparison.explanations
    whole = np.hstack([explanations[i].members[0].columns for i in numbers]) / scale
    left = comparison.rest(whole)
    if given:
        beside = np.hstack([explanations[v.explanation].members[v.member].columns for v in given]) / scale
        basis = np.linalg.qr(comparison.rest(beside))[0]
        left = left - basis @ (basis.T @ left)
    lengths = np.linalg.norm(left, axis=0)
    lengths = np.where(lengths > _SEEN * np.linalg.norm(whole, axis=0), lengths, 0.0)
    return left / np.where(lengths > 0, lengths, 1.0), lengths


def _like(
    forms: Floats, lengths: Floats, target: Floats, size: float, variance: float, largest: int, coefficients: int
) -> Iterator[tuple[float, tuple[int, ...], Floats]]:
    """Sets, what they lose of the log likelihood, and how large each member is then, in prior standard deviations."""
    cosine, gram = forms.T @ target, forms.T @ forms
    for count in range(1, largest + 1):
        most = (2 * np.log(ODDS) + max(coefficients - count, 0)) * variance / size**2
        every = np.array(list(subsets(range(len(cosine)), count)), dtype=np.intp).reshape(-1, count)
        blocks = gram[every[:, :, None], every[:, None, :]]
        sound = np.linalg.det(blocks) > _DISTINCT
        every, blocks = every[sound], blocks[sound]
        amounts = np.linalg.solve(blocks, cosine[every][:, :, None])[:, :, 0]
        lost = 1 - np.sum(amounts * cosine[every], axis=1)
        sds = size * amounts / lengths[every]
        fits = (lost < most) & np.all(np.abs(sds) < _ALLOWED, axis=1) & np.all(np.abs(amounts) > 1e-3, axis=1)
        for k in np.flatnonzero(fits):
            yield 0.5 * float(lost[k]) * size**2 / variance, tuple(every[k].tolist()), sds[k]


def _evidence(comparison: CandidateComparison, given: Sequence[Version], sets: Sequence[tuple[int, ...]]) -> Floats:
    """Log evidence of each set beside what is given, its members as large as each other in what they show."""
    every, beside, conditions = comparison.explanations, list[Explanation](), list[Version]()
    for k, version in enumerate(given):
        own = every[version.explanation]
        beside.append(replace(own, members=(own.members[version.member],)))
        conditions.append(Version(len(sets) + k, 0, version.amplitude))
    tried = []
    for members in sets:
        columns = np.hstack([every[i].members[0].columns for i in members])
        length = np.linalg.norm(comparison.rest(columns / comparison.noise_scale[:, None]), axis=0)
        columns = columns / np.where(length > 0, length, 1.0) * length.max()
        tried.append(Explanation(Verbatim("set"), SEVERAL, (Member(columns),)))
    whole = replace(comparison, explanations=[*tried, *beside])
    found = np.full(len(sets), -np.inf)
    for k in range(len(sets)):
        member, log, _ = whole.of_versions(k, conditions)
        if len(member):
            found[k] = float(scipy.special.logsumexp(log)) - np.log(AMPLITUDES)
    return found


IMPROBABLE = say("it is too improbable to be named, alone or together with what the readings do not tell from it")
UNSUPPORTED = say("others of its kind make it probable, and the readings alone do not speak for it by 20 to 1")
_TOLD_APART = 0.95
# Odds of another in the place of an effect from which both are named together: a set-up is suggested that gives 20 : 1
_ODDS = 0.05


@dataclass(frozen=True)
class OmittedEffect:
    effect: str  # effect, title: its name, and in words
    title: Text
    probability: float  # among all candidates that could stand in its place, nothing and nonparametric terms included
    parameters: Mapping[str, Quantity]  # reported parameters, from the joint posterior
    explained: float  # part of the misfit's sum of squares that it takes away
    together: float  # probability of it or one that these data cannot tell from it
    points_to: Text  # what a technician should look at
    # what these data cannot tell from it; with a probability below 0.9 it is named as one of these
    group: tuple[Text, ...] = ()
    # other periods that fit, where it has one; all that fit, where none of them is settled
    modes: tuple[Mode, ...] = ()
    settled: bool = True  # whether its period, where it has one, is among the parameters
    alternatives: tuple[AlternativeSet, ...] = ()  # sets that the readings alone do not tell from it


def left_out(
    result: SearchResult, joint: JointPosterior, before: RecordingModel, forms: FormCheck
) -> tuple[OmittedEffect, ...]:
    index = {str.__str__(result.first.explanations[i].name): i for i in result.chosen}
    posterior = joint.posterior
    column = {unknown.key: i for i, unknown in enumerate(posterior.unknowns)}
    linear, first = result.model.estimate().linear, _squares(before.estimate().linear, ())
    total = first - _squares(linear, ())
    listed, sets, combinations, alone = [], tuple[AlternativeSet, ...](), result.combinations, _by_readings(result)
    if combinations is not None and result.chosen:
        sets = alternative_sets(result.first.comparison, combinations, result.chosen, result.versions)
    rigid = {str(result.first.explanations[i].name) for i in effects_of_every_machine(result.first.comparison)}
    for effect in (e for e in result.model.effects if e.name in result.effects):
        modes = period_modes(result, index[effect.name])
        known = not modes or jointly.period_settled(result, index[effect.name], modes)
        probability, together, group = probability_of(result, index[effect.name], forms.acting, known=known)
        stand_ins = tuple(one for one in sets if effect.name in one.instead_of)
        # that it is one effect and not two is no evidence: by the readings alone
        fewer = [1 / s.odds for s in stand_ins if len(s.effects) != len(s.instead_of) or {*s.effects} <= rigid]
        by_readings = min(probability, together / (1 + sum(fewer)), alone.get(index[effect.name], 1.0))
        group = group if probability < NAMED else ()
        draws = posterior.draws[:, [column[effect.name, c.name] for c in effect.coefficients]]
        shapes = joint.shapes.get(effect.name, np.zeros((len(draws), 0)))
        if modes and known:  # what is reported of a period is reported of one
            own = modes[0].holds(shapes[:, 0])
            draws, shapes = (draws[own], shapes[own]) if own.any() else (draws, shapes)
        reported = effect.to_reported(draws, shapes)
        units = {parameter.name: parameter.unit for parameter in effect.reported}
        share = (_squares(linear, [column[effect.name, c.name] for c in effect.coefficients]) - first + total) / first
        if "phase_rad" in reported:  # unwrapped about its middle
            turned = np.exp(1j * reported["phase_rad"])
            middle = float(np.angle(np.mean(turned)))
            reported["phase_rad"] = np.asarray(middle + np.angle(np.exp(1j * (reported["phase_rad"] - middle))))
        open_ = set[str]() if known else {"phase_rad", *(shape.name for shape in effect.shape)}
        parameters = {name: Quantity.of_draws(v, units[name]) for name, v in reported.items() if name not in open_}
        explained = max(share, 0.0) if total > 0 else 0.0
        listed.append(OmittedEffect(
            effect.name, effect.title, by_readings, parameters, explained, together, effect.points_to, group,
            modes[1:] if known else modes, known, stand_ins,
        ))  # fmt: skip
    return tuple(sorted(listed, key=lambda item: -item.probability))


def probability_of(
    result: SearchResult, index: int, acting: Mapping[int, float] | None = None, *, known: bool
) -> tuple[float, float, tuple[Text, ...]]:
    """Of an effect by itself, and with all that could stand in its place; and the names of those.

    ``acting``: of effects that they act and no function does (:class:`FormCheck`); one by default. What a smooth function
    takes that could pass for a scale or a squareness is the straight line's as far as that is more probable than any
    function. No evidence is better than what as many recordings with nothing missing show by chance.
    """
    combinations = result.combinations
    if combinations is None:
        return 0.0, 0.0, ()
    group_of = jointly.group_of if known else rivals_of  # without functions: a few places show any period, and none
    group = _as_well(result, index, group_of(combinations, result.chosen, index))
    ordered = sorted((i for i in group if combinations.of(i) > 0), key=lambda i: -combinations.of(i))
    names = tuple(combinations.explanations[i].name for i in ordered)
    own, together = combinations.of(index), combinations.of_any(group | {index})
    acts, first = (acting or {}).get(index, 1.0), result.first
    some = better_than_chance(max(first.p_value, first.by_rearrangement))
    if effect_of(first.explanations[index]).everywhere:
        alike = combinations.imitating(index)
        own += acts * (combinations.of_any(alike | {index}) - own)
        together += acts * (combinations.of_any(alike | group | {index}) - together)
        acts = 1.0
    return acts * some * own, acts * some * together, names


def better_than_chance(p_value: float) -> float:
    """Largest probability that something is missing, by a p-value (Sellke, Bayarri & Berger 2001, Am. Stat. 55, 62)."""
    least = -np.exp(1) * p_value * np.log(p_value) if 0 < p_value < np.exp(-1) else float(p_value > 0)
    return float(1 / (1 + least * NOTHING / (1 - NOTHING)))


def _as_well(result: SearchResult, index: int, others: Iterable[int]) -> Key:
    """Of others, functions and the effects in whose favour the readings alone speak within 20 : 1 of one, all else kept.

    Of each in its own form: another form of it is no more it than one of this effect would be.
    """
    given, every = [v for v in result.versions if v.explanation != index], result.first.explanations
    least = _in_own_form(result, given, index) - np.log(ODDS)
    return frozenset(i for i in others if every[i].kind == UNKNOWN or _in_own_form(result, given, i) >= least)


def _in_own_form(result: SearchResult, given: Sequence[Version], index: int) -> float:
    member, log, weight = result.first.comparison.of_versions(index, given)
    own = np.array([not result.first.explanations[index].members[m].rough for m in member], dtype=bool)
    return float(np.logaddexp.reduce((log + weight)[own], initial=-np.inf))


def _squares(linear: LinearModel, without: Sequence[int]) -> float:
    kept = [i for i in range(len(linear.unknowns)) if i not in without]
    return float(np.sum(solve(linear.only(kept)).residuals ** 2))


def indistinguishable(result: SearchResult) -> tuple[tuple[str, ...], ...]:
    if result.combinations is None:
        return ()
    names, groups = [e.name for e in result.first.explanations], []
    for i in sorted(result.chosen):
        odds = result.combinations.instead(result.chosen, i)
        alike = _as_well(result, i, (r for r in odds if odds[r] > _ODDS))
        rivals = sorted(alike, key=lambda r: -odds[r])
        if rivals and result.combinations.of(i) < _TOLD_APART:
            groups.append((names[i], *(names[r] for r in rivals)))
    return tuple(groups)


def doubted(result: SearchResult) -> tuple[dict[int, WithheldEffect], FormCheck]:
    """Effects that are not to be named, and how probable all are in their forms."""
    gone, none = dict[int, WithheldEffect](), FormCheck({}, {}, beside=False)
    for i in result.chosen if result.combinations is not None else ():
        if probability_of(result, i, known=_known(result, i))[1] < NAMED:
            gone[i] = withheld_effect(result, i, IMPROBABLE)
    data = FunctionFit.of(result, result.first.families) if result.chosen and not gone else None
    if data is None or not data.families or not data.degrees:
        return gone, none
    found = checked_forms(result, data, [i for i in sorted(result.chosen) if _known(result, i)])
    shown = {i: say("the readings show another form: {function}", function=own.title) for i, own in found.other.items()}
    gone = {i: withheld_effect(result, i, why) for i, why in shown.items()}
    if not gone:
        less = (i for i in result.chosen if probability_of(result, i, found.acting, known=_known(result, i))[1] < NAMED)
        gone = {i: withheld_effect(result, i, IMPROBABLE) for i in less}
    return gone, found


def least_supported(result: SearchResult) -> dict[int, WithheldEffect]:
    """The scale or squareness that the readings alone speak for least, where they do not by 20 : 1.

    Those of a machine out of adjustment make each other probable, and none of them is ever exactly zero: that is no evidence.
    """
    alone = _by_readings(result)
    if not alone or alone[weakest := min(alone, key=lambda i: alone[i])] >= ODDS / (1 + ODDS):
        return {}
    return {weakest: replace(withheld_effect(result, weakest, UNSUPPORTED), probability=alone[weakest])}


def _by_readings(result: SearchResult) -> dict[int, float]:
    """Probability of each scale and squareness by the readings alone, all else kept."""
    comparison, own = result.first.comparison, dict[int, float]()
    for i in (i for i in sorted(result.chosen) if result.first.explanations[i].together):
        given = [v for v in result.versions if v.explanation != i]
        odds = comparison.beside(given, (i,))[i][0] - float(comparison.log_evidence_of(given)[0])
        own[i] = float(scipy.special.expit(odds))
    return own


def _known(result: SearchResult, index: int) -> bool:
    """Whether an effect has no period, or one that is settled; of others no form is known that functions could deny."""
    modes = period_modes(result, index)
    return not modes or jointly.period_settled(result, index, modes)
