"""Which sets of known effects a recording cannot tell from one that was found, whatever was known beforehand.

On seven lines of a gauge a roll of X is −0.3 of the squareness X–Y and −0.6 of Z–X, to the last digit: that one effect is more
probable beforehand than two is no evidence. Sets of one, two and three others are compared with the effect by what the
readings say alone: all are as large beforehand as each other in what they show. Up to 20 : 1 they are one class, where no
number of repeats would part them, or what is known beforehand does not either. Of fifty effects some three imitate any
weak one within its noise: that is chance, more readings end it, and it is no reason to doubt what is found.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations as subsets

import numpy as np
import scipy

from cmm_uq.analysis.diagnosis.comparison.combinations import CombinationPrior, Combinations, Key
from cmm_uq.analysis.diagnosis.comparison.conditional import AMPLITUDES, Version
from cmm_uq.analysis.diagnosis.comparison.evidence import CandidateComparison
from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, SEVERAL, Explanation, Member, effect_of
from cmm_uq.base.messages import Text, Verbatim
from cmm_uq.base.points import Floats, Ints

ODDS = 20.0
_MOST, _TRIED = 3, 60  # effects of a set; sets whose evidence is computed
_ALLOWED = 3.0  # prior standard deviations that an effect of a set may have
_SEEN = 1e-9  # part of an effect's length that the baseline must leave of it
_ALIKE = 1e-3  # part of an effect's squared length that a set leaves of it, up to which no number of repeats parts them
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
    """Of each effect of one coefficient, and of each two, the smallest sets that the readings do not tell from them."""
    every, sets, found = comparison.explanations, list[tuple[Key, Key]](), list[AlternativeSet]()
    prior = CombinationPrior(every, combinations.counts, comparison.visible)
    names = [str.__str__(one.name) for one in every]
    single = [i for i in sorted(chosen) if _single(every[i])]
    for taken in (*((i,) for i in single), *subsets(single, 2)):
        for members, sizes, lost, part in _instead(comparison, chosen, versions, taken):
            own = frozenset(taken), frozenset(members)
            if any(one[0] <= own[0] and one[1] <= own[1] for one in sets):
                continue
            odds, after = float(np.exp(lost)), (chosen - own[0]) | own[1]
            beforehand = float(np.exp(np.clip(prior.log(chosen) - prior.log(after), -700, 700)))
            if part <= _ALIKE or odds * beforehand <= ODDS:
                sets.append(own)
                named, titles = tuple(names[i] for i in members), tuple(effect_of(every[i]).title for i in members)
                found.append(AlternativeSet(tuple(names[i] for i in taken), named, titles, sizes, odds, beforehand))
    return tuple(found)


def _instead(
    comparison: CandidateComparison, chosen: Key, versions: Sequence[Version], taken: tuple[int, ...]
) -> list[tuple[tuple[int, ...], tuple[float, ...], float, float]]:
    """Smallest sets in the place of some effects, their sizes, what they lose of the log likelihood and of what is shown."""
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
    candidates = _like(forms[:, seen], lengths[seen], shown / size, size, variance, _MOST if len(taken) == 1 else 1)
    tried = sorted(candidates, key=lambda one: one[0])[:_TRIED]
    names = [tuple(others[seen[k]] for k in each) for _, each, _ in tried]
    evidence = _evidence(comparison, given, [taken, *names])
    found: list[tuple[tuple[int, ...], tuple[float, ...], float, float]] = []
    for (lost, _, sizes), members, log in zip(tried, names, evidence[1:], strict=True):
        if evidence[0] - log <= np.log(ODDS):
            found.append((members, tuple(sizes.tolist()), lost, 2 * lost * variance / size**2))
    return [one for one in found if not any(set(less[0]) < set(one[0]) for less in found)]


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
    forms: Floats, lengths: Floats, target: Floats, size: float, variance: float, largest: int
) -> Iterator[tuple[float, tuple[int, ...], Floats]]:
    """Sets, what they lose of the log likelihood, and how large each member is then, in prior standard deviations."""
    cosine, gram, most = forms.T @ target, forms.T @ forms, 2 * np.log(ODDS) * variance / size**2
    for count in range(1, largest + 1):
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
