"""What is asserted of a recording: each effect with its size, its probability, and what could stand in its place.

A name is for a technician who acts on it: four in five is asked of an effect, or of it with what the readings cannot tell from
it. Its form is held against every function that an error could be (:mod:`~cmm_uq.analysis.diagnosis.empirical`): one that is
more probable in its place, or that has odds of 20 : 1 beside it and is of the same covariate, says that it has another form.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from cmm_uq.analysis.diagnosis import joint as jointly
from cmm_uq.analysis.diagnosis.comparison.equivalence import AlternativeSet, alternative_sets
from cmm_uq.analysis.diagnosis.comparison.explanations import effect_of
from cmm_uq.analysis.diagnosis.comparison.search import SearchResult, withhold
from cmm_uq.analysis.diagnosis.empirical.evidence import FunctionFit
from cmm_uq.analysis.diagnosis.empirical.functions import FunctionFamily, FunctionTerm, families_of
from cmm_uq.analysis.diagnosis.empirical.model import ODDS
from cmm_uq.analysis.diagnosis.joint import JointPosterior, Mode, WithheldEffect, period_modes, withheld_effect
from cmm_uq.base.messages import Text, say
from cmm_uq.machine.model import RecordingModel
from cmm_uq.maths.inference.linear_model import LinearModel, solve
from cmm_uq.maths.uncertainty.quantity import Quantity

NAMED = 0.8  # probability from which an effect is named, alone or as one of a group
IMPROBABLE = say("it is too improbable to be named, alone or together with what the readings do not tell from it")
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
    # what these data cannot tell from it; with a probability below 0.8 it is named as one of these
    group: tuple[Text, ...] = ()
    # other periods that fit, where it has one; all that fit, where none of them is settled
    modes: tuple[Mode, ...] = ()
    settled: bool = True  # whether its period, where it has one, is among the parameters
    alternatives: tuple[AlternativeSet, ...] = ()  # sets that the readings alone do not tell from it


def left_out(result: SearchResult, joint: JointPosterior, before: RecordingModel) -> tuple[OmittedEffect, ...]:
    index = {str.__str__(result.first.explanations[i].name): i for i in result.chosen}
    posterior = joint.posterior
    column = {unknown.key: i for i, unknown in enumerate(posterior.unknowns)}
    linear, first = result.model.estimate().linear, _squares(before.estimate().linear, ())
    total = first - _squares(linear, ())
    listed, sets, combinations = [], tuple[AlternativeSet, ...](), result.combinations
    if combinations is not None and result.chosen:
        sets = alternative_sets(result.first.comparison, combinations, result.chosen, result.versions)
    for effect in (e for e in result.model.effects if e.name in result.effects):
        modes = period_modes(result, index[effect.name])
        known = not modes or jointly.period_settled(result, index[effect.name], modes)
        probability, together, group = _probability(result, index[effect.name], known=known)
        stand_ins = tuple(one for one in sets if effect.name in one.instead_of)
        # that it is one effect and not two is no evidence: by the readings alone
        fewer = [1 / one.odds for one in stand_ins if len(one.effects) != len(one.instead_of)]
        by_readings = min(probability, together / (1 + sum(fewer))) if fewer else probability
        group = group if probability < NAMED or by_readings == probability else ()
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
        parameters = {
            name: Quantity.of_draws(values, units[name])
            for name, values in reported.items()
            if known or name not in {"phase_rad", *(shape.name for shape in effect.shape)}
        }
        explained = max(share, 0.0) if total > 0 else 0.0
        listed.append(OmittedEffect(
            effect.name, effect.title, by_readings, parameters, explained, together, effect.points_to, group,
            modes[1:] if known else modes, known, stand_ins,
        ))  # fmt: skip
    return tuple(sorted(listed, key=lambda item: -item.probability))


def _probability(result: SearchResult, index: int, *, known: bool) -> tuple[float, float, tuple[Text, ...]]:
    """Of an effect by itself, and with all that could stand in its place; and the names of those."""
    combinations = result.combinations
    if combinations is None:
        return 0.0, 0.0, ()
    group = jointly.group_of(combinations, result.chosen, index)
    group |= frozenset() if known else combinations.imitating(index)
    ordered = sorted((i for i in group if combinations.of(i) > 0), key=lambda i: -combinations.of(i))
    names = tuple(combinations.explanations[i].name for i in ordered)
    return combinations.of(index), combinations.of_any(group | {index}), names


def _squares(linear: LinearModel, without: Sequence[int]) -> float:
    kept = [i for i in range(len(linear.unknowns)) if i not in without]
    return float(np.sum(solve(linear.only(kept)).residuals ** 2))


def indistinguishable(result: SearchResult) -> tuple[tuple[str, ...], ...]:
    if result.combinations is None:
        return ()
    names, groups = [e.name for e in result.first.explanations], []
    for i in sorted(result.chosen):
        odds = result.combinations.instead(result.chosen, i)
        rivals = sorted((r for r in odds if odds[r] > _ODDS), key=lambda r: -odds[r])
        if rivals and result.combinations.of(i) < _TOLD_APART:
            groups.append((names[i], *(names[r] for r in rivals)))
    return tuple(groups)


def doubted(result: SearchResult) -> tuple[dict[int, WithheldEffect], bool]:
    """Effects that are not to be named; where there are none, whether a function is shown beside those that are."""
    gone = dict[int, WithheldEffect]()
    for i in result.chosen if result.combinations is not None else ():
        if _probability(result, i, known=_known(result, i))[1] < NAMED:
            gone[i] = withheld_effect(result, i, IMPROBABLE)
    data = FunctionFit.of(result, families_of(result)) if result.chosen and not gone else None
    if data is None or not data.families or not data.degrees:
        return gone, False
    beside = _likeliest(data) if data.total - data.nothing > np.log(ODDS) else None
    for i in sorted(result.chosen):
        effect = effect_of(result.first.explanations[i])
        if effect.everywhere or not _known(result, i):  # a straight line has no other form
            continue
        of = {*effect.columns, *(one.of for one in effect.imitated_by)}
        without = replace(data, free=withhold(result, frozenset({i})).last.baseline)
        if without.total > _own(result, i, without):
            other: FunctionTerm | None = _likeliest(without)
        else:  # an idealised effect has other forms, which make it one in part
            other = beside if beside and effect.idealised_over is None and of & set(beside.of.split(",")) else None
        if other is not None:
            why = say("the readings show another form: {function}", function=other.title)
            gone[i] = withheld_effect(result, i, why)
    return gone, beside is not None


def _known(result: SearchResult, index: int) -> bool:
    """Whether an effect has no period, or one that is settled; of others functions of the same reading are named with it."""
    modes = period_modes(result, index)
    return not modes or jointly.period_settled(result, index, modes)


def _likeliest(data: FunctionFit) -> FunctionTerm:
    return data.families[data.versions(1)[0].family].term


def _own(result: SearchResult, index: int, data: FunctionFit) -> float:
    """Log evidence of an effect, in the forms that it may have, as if it were a function of :class:`FunctionFit`."""
    members, scale = result.first.explanations[index].members, result.first.comparison.noise_scale[:, None, None]
    whole, logs = sum(one.weight for one in members), []
    for width in {one.columns.shape[1] for one in members}:
        some = [one for one in members if one.columns.shape[1] == width]
        columns = np.stack([one.columns for one in some], axis=1) / scale
        family = FunctionFamily(data.families[0].term, "", columns, 0.0, np.zeros(0), np.zeros((0, *columns.shape[1:])))
        weight = np.log([one.weight / whole for one in some])
        logs.append(scipy.special.logsumexp(data.of_family(family)[0] + weight[:, None]))
    return float(scipy.special.logsumexp(logs))
