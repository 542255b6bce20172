"""Whether an effect has the form that the readings show, among all that an error could be."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations as subsets

import numpy as np

from cmm_uq.analysis.diagnosis.comparison.explanations import UNKNOWN, Explanation, effect_of, refine
from cmm_uq.analysis.diagnosis.comparison.lack_of_fit import SHARES, log_prior
from cmm_uq.analysis.diagnosis.comparison.search import SearchResult, withhold
from cmm_uq.analysis.diagnosis.empirical.evidence import FunctionFit
from cmm_uq.analysis.diagnosis.empirical.functions import PRODUCT, SINE, FunctionTerm, waves
from cmm_uq.analysis.diagnosis.empirical.model import ALIKE, MOST, ODDS, likeliest, of_effect
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, replace

_MATTERS = 1e-3  # probability that is told
_OWN = 0.8  # probability of an effect's own form, from which it keeps its name


@dataclass(frozen=True, eq=False)
class FormCheck:
    """How probable effects are in their forms among all that an error could be."""

    other: dict[int, FunctionTerm]  # of effects that have another form what the readings show in their place
    # of each the probability that it acts, in whatever form of its own, and not a function
    acting: dict[int, float]
    beside: bool  # whether a function is shown beside all


def checked_forms(result: SearchResult, data: FunctionFit, of: Sequence[int]) -> FormCheck:
    data = replace(data, free=np.hstack([data.free, _straight_lines(result)]))
    beside, finer = list[FunctionTerm](), data.refined()
    while len(beside) < MOST and finer.total - finer.nothing > np.log(ODDS):
        beside.append(likeliest(finer))
        data = replace(finer.with_function(finer.versions(1)[0]), families=data.families)
        finer = data.refined()
    each = {i: _own_form(result, data, i, beside) for i in of}
    other = {i: term for i, (_, term) in each.items() if term is not None}
    if not other:
        other = {k: term for two in subsets(of, 2) for term in _one_of_both(result, data, *two) for k in two}
    return FormCheck(other, {i: p for i, (p, _) in each.items()}, bool(beside))


def _own_form(
    result: SearchResult, data: FunctionFit, i: int, beside: Sequence[FunctionTerm]
) -> tuple[float, FunctionTerm | None]:
    """Probability of an effect over all functions, and what the readings show in its place, or of what it is a function."""
    known, without = result.first.explanations[i], _without(result, data, i)
    effect, terms = effect_of(known), {(t.of, t.along) for t in known.imitated_by}
    of, straight, periodic = {*effect.columns, *(t.of for t in known.imitated_by)}, effect.everywhere, _periodic(known)
    if periodic:  # half way between two periods a strong wave loses evidence, and waves that wander do not
        member, log, _ = result.first.comparison.of_versions(i, [v for v in result.versions if v.explanation != i])
        known = refine(result.first.model, result.first.values, known, [int(member[np.argmax(log)])])
    if straight and not _doubtful(result, i):
        return 1.0, None
    if not straight and (other := next((one for one in beside if of & set(one.of.split(","))), None)):
        return 0.0, other
    shown = without.rest(known.members[0].columns / result.first.comparison.noise_scale[:, None])
    # a product of which it is a part, or one wave, is no other form: what that has besides would show beside it
    one_wave = (f for f in data.families if f.form == SINE and f.columns.shape[2] == 2)
    itself = {id(f) for f in one_wave if periodic and (f.term.of, f.term.along) in terms}
    others = [f for f in data.families if id(f) not in itself]
    alike = [f for f in others if f.form == PRODUCT or f.term.lever not in (None, f.term.along)]
    alike = [f for f in alike if _part(shown, without.rest(f.columns[:, 0]))]
    # a curve of rotation of which it is the straight line is another form of it
    curves = [np.logaddexp.reduce(without.of_family(f)[0], axis=None) for f in alike if f.form != PRODUCT]
    without = replace(without, families=[f for f in others if not any(f is one for one in alike)]).refined()
    own, another = np.array(of_effect(result, i, without, known)) - np.log(known.weight)  # its rarity was counted
    another = np.logaddexp.reduce([another, *curves])
    functions = np.logaddexp(without.total, _waves(result, without, known, i) if periodic else -np.inf)
    mechanism, every = np.logaddexp(own, another), np.logaddexp.reduce([own, another, functions])
    acting = float(np.exp(mechanism - np.logaddexp(mechanism, functions)))
    # a straight line has no other form
    return acting, likeliest(without) if own < np.log(_OWN) + every and not straight else None


def _doubtful(result: SearchResult, i: int) -> bool:
    """Whether functions that could pass for an effect are probable enough that it matters by how much it is more so."""
    combinations = result.combinations
    alike = None if combinations is None else combinations.imitating(i) | {i}
    return alike is not None and combinations is not None and combinations.of_any(alike) > combinations.of(i) + _MATTERS


def _periodic(known: Explanation) -> bool:
    return any(shape.period_along for shape in effect_of(known).shape)


def _waves(result: SearchResult, data: FunctionFit, known: Explanation, index: int) -> float:
    """Log evidence and prior of waves of an effect's periods that are no sine, together as probable as it."""
    terms, members = {(t.of, t.along) for t in known.imitated_by}, [m for m in known.members if m.shape]
    every = (f for f in data.families if f.seen and f.term.lever is None and (f.term.of, f.term.along) in terms)
    if (like := next(every, None)) is None:
        return -np.inf
    like = replace(like, log_prior=float(log_prior(result.first.explanations)[index] - np.log(SHARES[UNKNOWN])))
    weight = np.log([m.weight / sum(one.weight for one in known.members) for m in members])[:, None]
    each = (data.of_family(one)[0] + weight for one in waves(like, np.array([m.shape[0] for m in members])))
    return float(np.logaddexp.reduce([np.logaddexp.reduce(log, axis=None) for log in each]))


def _one_of_both(result: SearchResult, data: FunctionFit, one: int, other: int) -> Iterator[FunctionTerm]:
    """A function of two readings in the place of two effects along one axis, each by one of them: of wear twice, a hill."""
    of_one, of_other = (result.first.explanations[i].imitated_by for i in (one, other))
    both = {(frozenset((a.of, b.of)), a.along) for a in of_one for b in of_other if a.along == b.along and a.of != b.of}
    families = [f for f in data.families if (frozenset(f.term.of.split(",")), f.term.along) in both]
    if families:
        without, beside = replace(_without(result, data, one, other), families=families), _without(result, data, one)
        own = of_effect(result, other, without)[0] + of_effect(result, one, beside)[0] - beside.nothing
        if own < np.log(_OWN) + np.logaddexp(own, without.total):
            yield likeliest(without)


def _without(result: SearchResult, data: FunctionFit, *gone: int) -> FunctionFit:
    return replace(data, free=np.hstack([withhold(result, frozenset(gone)).last.baseline, _straight_lines(result)]))


def _straight_lines(result: SearchResult) -> Floats:
    """Columns (m, k) of scales and squarenesses that are probable and not asserted: no other error is to stand for them."""
    probable = frozenset[int]() if result.combinations is None else result.combinations.most_probable
    every = (result.first.explanations[i] for i in sorted(probable - result.chosen))
    some = [one.members[0].columns for one in every if one.together]
    return np.hstack([np.zeros((len(result.last.baseline), 0)), *some]) / result.first.comparison.noise_scale[:, None]


def _part(columns: Floats, whole: Floats) -> bool:
    left = columns - whole @ np.linalg.lstsq(whole, columns, rcond=None)[0]
    return bool(np.sum(left**2) < ALIKE * np.sum(columns**2))
