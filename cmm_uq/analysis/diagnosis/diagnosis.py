"""The diagnosis of a recording: whether something is missing, where, what, and whether modelling it predicts better."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy

from cmm_uq.analysis.diagnosis import joint as jointly
from cmm_uq.analysis.diagnosis.comparison.search import SearchResult, search, substitute, withhold
from cmm_uq.analysis.diagnosis.held_out import Improvement, improvement, thin_out
from cmm_uq.analysis.diagnosis.joint import JointPosterior, Mode, WithheldEffect, joint_posterior, period_modes
from cmm_uq.analysis.diagnosis.location import Place, locate
from cmm_uq.analysis.diagnosis.model_average import ModelAverage, average_models
from cmm_uq.analysis.diagnosis.noise import has_heavy_tails, probability_by_name
from cmm_uq.base.messages import Text
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.kind import Observed
from cmm_uq.machine.model.recorded import of_last_digit
from cmm_uq.maths.inference.ensembles import Progress
from cmm_uq.maths.inference.linear_model import LinearModel, solve, studentised
from cmm_uq.maths.inference.noise import Components
from cmm_uq.maths.inference.posterior import NoisyPosterior
from cmm_uq.maths.uncertainty.quantity import Quantity

FALSE_ALARMS = 0.01  # default rate at which a recording without any fault is found to have one
_TOLD_APART = 0.95
# Odds of another in the place of an effect from which both are named together: a set-up is suggested that gives 20 : 1
_ODDS = 0.05
_UNKNOWN = 0.5
_NOISE_KIND = 0.9


@dataclass(frozen=True)
class OmittedEffect:
    """An effect that the model left out."""

    effect: str  # effect, title: its name, and in words
    title: Text
    probability: float  # among all candidates that could stand in its place, nothing and nonparametric terms included
    parameters: Mapping[str, Quantity]  # reported parameters, from the joint posterior
    explained: float  # part of the misfit's sum of squares that it takes away
    together: float  # probability of it or one that these data cannot tell from it
    points_to: Text  # what a technician should look at
    # what these data cannot tell from it; with a probability below one half it is asserted as one of these
    group: tuple[Text, ...] = ()
    # other periods that fit, where it has one; all that fit, where none of them is settled
    modes: tuple[Mode, ...] = ()
    settled: bool = True  # whether its period, where it has one, is among the parameters


@dataclass(frozen=True)
class NoiseDiagnosis:
    """What the noise is like once everything found is modelled; lengths in µm."""

    coordinate: Quantity
    placing: Quantity
    correlated_in_time: bool
    heavy_tails: bool
    contradicts_stated: bool


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """See the module's docstring."""

    verdict: str  # consistent, explained, partial or unexplained
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


def diagnose(
    model: RecordingModel, *, stated_um: float | None, alpha: float, seed: int, progress: Progress | None = None,
    known: NoisyPosterior | None = None, observe: Observed | None = None,
) -> Diagnosis:  # fmt: skip
    stated = None if stated_um is None else stated_um * MICROMETRE
    least = of_last_digit(model.artefact.points.xyz, model.estimate().least_squares.sigma_of_residuals)
    model = replace(model, least_noise=least) if least > model.least_noise else model
    some = model if observe is None else thin_out(model, observe, seed)
    found, joint, withheld = _asserted(search(some, stated, alpha=alpha, seed=seed), model, seed, progress, known)
    gain = improvement(model, found.model)
    if found.effects and gain.elpd_gain <= gain.elpd_gain_se:
        withheld = (*withheld, *jointly.withhold_unpredicted(found, gain.unseen))
        found = _of_all(withhold(found, found.chosen), model)
        gain, joint = improvement(model, model), joint_posterior(found, seed, progress, known)
    noise, first = _noise(found, joint, stated), found.first
    after = replace(found.model, sigma=noise.coordinate.value * MICROMETRE)
    most = np.argsort(-first.probability)[:12]
    rivals = tuple((first.explanations[i].name, float(first.probability[i])) for i in most)
    verdict = "consistent" if first.p_value >= alpha else "unexplained"
    if first.p_value < alpha and found.effects:
        verdict = "partial" if found.rough or found.unexplained > _UNKNOWN else "explained"
    return Diagnosis(
        verdict, first.p_value, alpha, locate(first, alpha, found.chosen), _left_out(found, joint, model),
        _indistinguishable(found), rivals, noise, gain, model, after, joint.components, joint.posterior,
        int(some.used.sum()), found, withheld, average_models(found, joint, model, seed),
    )  # fmt: skip


def _asserted(
    result: SearchResult, model: RecordingModel, seed: int, progress: Progress | None, known: NoisyPosterior | None
) -> tuple[SearchResult, JointPosterior, tuple[WithheldEffect, ...]]:
    """What of a search may be asserted; where an effect's size is open its next probable is tried, else the least goes."""
    result, gone = jointly.withhold_unresolved(result)
    places: dict[int, WithheldEffect] = {}  # of each effect that was tried in the place of others, the first of these
    tried: frozenset[int] = frozenset()
    while True:
        result = _of_all(result, model)
        joint = joint_posterior(result, seed, progress, known)
        if not (more := jointly.effects_without_size(result, joint)):
            return result, joint, gone
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


def _left_out(result: SearchResult, joint: JointPosterior, before: RecordingModel) -> tuple[OmittedEffect, ...]:
    index = {str.__str__(result.first.explanations[i].name): i for i in result.chosen}
    posterior = joint.posterior
    column = {unknown.key: i for i, unknown in enumerate(posterior.unknowns)}
    linear, first = result.model.estimate().linear, _squares(before.estimate().linear, ())
    total = first - _squares(linear, ())
    listed = []
    for effect in (e for e in result.model.effects if e.name in result.effects):
        modes = period_modes(result, index[effect.name])
        known = not modes or jointly.period_settled(result, index[effect.name], modes)
        probability, together, group = _probability(result, index[effect.name], known=known)
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
            effect.name, effect.title, probability, parameters, explained, together, effect.points_to, group,
            modes[1:] if known else modes, known,
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


def _indistinguishable(result: SearchResult) -> tuple[tuple[str, ...], ...]:
    if result.combinations is None:
        return ()
    names, groups = [e.name for e in result.first.explanations], []
    for i in sorted(result.chosen):
        odds = result.combinations.instead(result.chosen, i)
        rivals = sorted((r for r in odds if odds[r] > _ODDS), key=lambda r: -odds[r])
        if rivals and result.combinations.of(i) < _TOLD_APART:
            groups.append((names[i], *(names[r] for r in rivals)))
    return tuple(groups)


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
