"""Mistakes of a simulation as hypotheses: what is predicted, put right in one way after the other, is compared again.

All that is asked is how well the recording then agrees: the job's model and the freedoms of its set-ups absorb what they do of
either, the noise is estimated alike, and beside each mistake one known effect may act as well. Against it stands all that
the diagnosis compared with the prediction as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import scipy

from cmm_uq.analysis.diagnosis import mistakes
from cmm_uq.analysis.diagnosis.comparison.evidence import CandidateComparison
from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT
from cmm_uq.analysis.diagnosis.comparison.lack_of_fit import NOTHING, log_prior
from cmm_uq.analysis.diagnosis.comparison.search import SearchResult, comparison_of
from cmm_uq.analysis.diagnosis.held_out import held_out_groups, predictions
from cmm_uq.analysis.diagnosis.simulated import SimulationMistake, SimulationMistakes
from cmm_uq.base.messages import NOTHING as NO_TEXT, number, say, signed
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.base.values import dataclass, replace
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.predicted_errors import PredictedErrors
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown, solve

# Probability, beforehand, that a simulation is mistaken in one of these ways; its families share it evenly
MISTAKEN = 0.1
# Log odds over all else from which a mistake is named, and over another that it is told from
NAMED = float(np.log(20.0))
_TOLD = 0.05  # odds over the prediction as it is from which a mistake is told
_MOST_TOLD = 6
_KEPT = 8  # mistakes of a family whose evidence is reckoned with: those that leave least
_BESIDE = 12  # mistakes of all families beside which further explanations are compared
_FINE, _ROUNDS = 25, 6  # values about the best, and times that those tried close in upon it
_INVISIBLE = 1e-6  # part of the predicted errors, in what the model leaves, below which a mistake changes nothing
_ROUNDED = 0.1  # part of the noise's variance from which rounding is told


@dataclass(frozen=True, eq=False)
class _Weighed:
    hypothesis: mistakes.Hypothesis
    log: float  # evidence times the probability beforehand
    alone: float  # log evidence with nothing else missing
    change: Floats  # (m,) at its value, and (m, 0 or 1) for one unit of it
    slope: Floats
    value: float | None = None
    u: float | None = None


def simulation_mistakes(
    result: SearchResult, found: PredictedErrors, of: Points, whole: RecordingModel
) -> SimulationMistakes:
    """Mistakes of the prediction that could be what the diagnosis explains otherwise, calls noise, or left out as outliers.

    ``whole`` is the model of all observations, gross outliers included: two points or set-ups exchanged look like these.
    """
    first = result.first
    predicted = mistakes.PredictedObservations(first.model, first.values, found, of)
    said = _judged(first.comparison, predicted, _physics(result), mistakes.hypotheses)
    if said.named or first.model.artefact is not whole.artefact or np.array_equal(first.model.used, whole.used):
        return said
    every = replace(result.model, used=whole.used)
    comparison = comparison_of(every, result.stated, ())
    nothing = float(np.log(NOTHING) + comparison.log_evidence_of(())[0])
    seen = mistakes.PredictedObservations(every, every.estimate().about, found, of)
    of_all = _judged(comparison, seen, nothing, lambda p, _: mistakes.exchanged_rows(p))
    return of_all if of_all.named else said


def _judged(
    comparison: CandidateComparison,
    predicted: mistakes.PredictedObservations,
    physics: float,
    of: Callable[[mistakes.PredictedObservations, CandidateComparison], Iterator[mistakes.Hypothesis]],
) -> SimulationMistakes:
    model, found = predicted.model, predicted.found
    usual = comparison.rest_of(predicted.usual[:, None])[:, 0]
    tried = [h for h in of(predicted, comparison) if _shows(comparison, h, usual)]
    weighed = _weighed(comparison, tried)
    linear = model.estimate().linear
    base, groups = solve(linear), held_out_groups(model)[0]
    least = max(model.least_noise, 1e-7)
    before = predictions(linear, max(base.sigma_of_residuals, least), groups)
    rms = float(np.sqrt(np.mean(base.residuals**2)) / MICROMETRE)
    none = float(np.log(NOTHING) + comparison.log_evidence_of(())[0])
    rounded = _rounded(found, base.sigma_of_residuals, rms, before[0])
    empty = SimulationMistakes(len(tried), (), (), NO_TEXT, rms, before[0], rounded)
    total = scipy.special.logsumexp([physics, *(each.log for each in weighed)]) if weighed else physics
    likely = sorted((w for w in weighed if w.log - max(none, physics) > np.log(_TOLD)), key=lambda w: -w.log)
    if not likely:
        return empty
    told = []
    for each in likely[:_MOST_TOLD]:
        mended = _mended(linear, each)
        fit = solve(mended)
        after = predictions(mended, max(fit.sigma_of_residuals, least), groups)
        gain = after[1] - before[1]
        h, value, u = each.hypothesis, NO_TEXT, NO_TEXT
        if each.value is not None and each.u is not None:
            value, u = signed(each.value, ".3g"), number(each.u, ".2g")
        told.append(
            SimulationMistake(
                h.name, h.title(value, u), h.remedy, float(np.exp(each.log - total)), _odds(each.log - none),
                _odds(each.log - physics), float(np.sqrt(np.mean(fit.residuals**2)) / MICROMETRE), after[0],
                float(gain.sum()), float(np.sqrt(len(gain)) * gain.std(ddof=1)) if len(gain) > 1 else 0.0,
                each.value, each.u, h.unit,
            )
        )  # fmt: skip
    # those that cannot be told from the most probable, and as many more as leave all else improbable
    size = sum(likely[0].log - w.log < NAMED for w in likely)
    while (inside := _over(weighed, likely[:size], physics)) < NAMED and size < min(len(likely), _MOST_TOLD):
        size += 1
    best, why = told[0], NO_TEXT
    if rounded is not None:
        why = say("the predictions are rounded too far to tell what else is wrong with them")
    elif inside < NAMED:
        why = say(
            "what the diagnosis compares with the prediction as it is explains the recording as well (odds {odds:.2g})",
            odds=_odds(inside),
        )
    elif best.elpd_gain <= best.elpd_gain_se or best.heldout_rms_um >= before[0]:
        why = say("what was left out of the fit is not predicted better")
    named = () if why else tuple(told[:size])
    return replace(empty, told=tuple(told), named=named, why=why)


def _over(weighed: list[_Weighed], group: list[_Weighed], physics: float) -> float:
    """Log odds of a group of mistakes over all others and all that the diagnosis compared."""
    others = [w.log for w in weighed if all(w is not one for one in group)]
    return float(scipy.special.logsumexp([w.log for w in group]) - scipy.special.logsumexp([physics, *others]))


def _odds(log: float) -> float:
    return float(np.exp(min(log, 700.0)))


def _mended(linear: LinearModel, each: _Weighed) -> LinearModel:
    more = tuple(
        Unknown(("simulation", each.hypothesis.name), each.hypothesis.unit, 0.0, np.inf, each.u or 1.0)
        for _ in range(each.slope.shape[1])
    )
    return replace(
        linear,
        observed=linear.observed - each.change,
        design=np.hstack([linear.design, each.slope]),
        unknowns=(*linear.unknowns, *more),
    )


def _physics(result: SearchResult) -> float:
    """Log evidence of all explanations of the recording against the prediction as it is, times their probabilities."""
    first = result.first
    if result.combinations is not None:
        return float(scipy.special.logsumexp([one.log_posterior for one in result.combinations.by_key.values()]))
    every = log_prior(first.explanations) + first.log_odds
    nothing = float(first.comparison.log_evidence_of(())[0])
    return nothing + float(scipy.special.logsumexp([np.log(NOTHING), *every]))


def _with_one_more(comparison: CandidateComparison, data: Floats) -> Floats:
    """Log evidence (b,) of nothing, or one known effect, for data (m, b)."""
    known = [i for i, each in enumerate(comparison.explanations) if each.kind == EFFECT]
    nothing, something = comparison.log_evidence(data, among=known)
    every = np.vstack([np.log(NOTHING) + nothing, (log_prior(comparison.explanations)[:, None] + something)[known]])
    return np.asarray(scipy.special.logsumexp(every, axis=0), dtype=np.float64)


def _shows(comparison: CandidateComparison, h: mistakes.Hypothesis, usual: Floats) -> bool:
    """Whether a mistake changes anything that the model and the set-ups leave."""
    left = np.abs(comparison.rest_of(h.change)).max(initial=0.0)
    return bool(left > _INVISIBLE * max(float(np.abs(usual).max(initial=0.0)), MICROMETRE))


def _weighed(comparison: CandidateComparison, tried: list[mistakes.Hypothesis]) -> list[_Weighed]:
    families = sorted({h.family for h in tried})
    found: list[_Weighed] = []
    for family in families:
        own = [h for h in tried if h.family == family]
        prior = float(np.log(MISTAKEN / len(families) / len(own)))
        squares = [float(np.min(np.sum(_data(comparison, h.change) ** 2, axis=0))) for h in own]
        kept = np.argsort(squares, kind="stable")[:_KEPT].tolist()
        found += [_with_evidence(comparison, own[i], prior) for i in kept]
    best = sorted(range(len(found)), key=lambda i: -found[i].log)[:_BESIDE]
    if best:
        data = _data(comparison, np.column_stack([found[i].change for i in best]))
        for i, more, alone in zip(best, _with_one_more(comparison, data), _nothing(comparison, data), strict=True):
            each = found[i]
            found[i] = replace(each, log=each.log + float(more - alone))
    return found


def _data(comparison: CandidateComparison, change: Floats) -> Floats:
    """What the baseline leaves (m, v) of the observations without mistakes that change them."""
    return np.asarray(comparison.left[:, None] - comparison.rest_of(change))


def _nothing(comparison: CandidateComparison, data: Floats) -> Floats:
    return np.asarray(scipy.special.logsumexp(comparison.of_nothing(data), axis=0), dtype=np.float64)


def _with_evidence(comparison: CandidateComparison, h: mistakes.Hypothesis, prior: float) -> _Weighed:
    none = np.zeros((len(comparison.left), 0))
    if h.again is None:
        alone = float(_nothing(comparison, _data(comparison, h.change))[0])
        return _Weighed(h, alone + prior, alone, h.change[:, 0], none)
    low, high = float(h.values[0]), float(h.values[-1])
    values, change = h.values, h.change
    for _ in range(_ROUNDS):  # to where least is left, the squares there a parabola
        squares = np.sum(_data(comparison, change) ** 2, axis=0)
        i = int(np.clip(squares.argmin(), 1, len(values) - 2))
        step = float(values[i + 1] - values[i])
        bend = float(squares[i - 1] + squares[i + 1] - 2 * squares[i]) / step**2
        u = float(np.sqrt(2 * squares[i] / max(comparison.degrees_of_freedom, 1) / max(bend, 1e-300)))
        if u > step:
            break
        values = np.linspace(max(low, values[i] - step), min(high, values[i] + step), mistakes.VALUES)
        change = h.again(values)
    at = float(values[int(squares.argmin())]) if u > step else float(values[len(values) // 2])
    values = np.linspace(max(low, at - 6 * u), min(high, at + 6 * u), _FINE)
    change = h.again(values)
    evidence = _nothing(comparison, _data(comparison, change))
    alone = float(scipy.special.logsumexp(evidence) + np.log((values[1] - values[0]) / (high - low)))
    weight = np.exp(evidence - scipy.special.logsumexp(evidence))
    value = float(weight @ values)
    spread = float(np.sqrt(weight @ (values - value) ** 2))
    three = h.again(np.array([value - spread, value, value + spread]))
    return _Weighed(h, alone + prior, alone, three[:, 1], (three[:, [2]] - three[:, [0]]) / (2 * spread), value, spread)


def _rounded(found: PredictedErrors, sigma: float, rms_um: float, heldout_um: float) -> SimulationMistake | None:
    """Predictions that are multiples of a step which matters beside the noise, and no uncertainty that says so."""
    rounding = found.step / np.sqrt(12)
    if rounding**2 < _ROUNDED * sigma**2 or rounding <= float(np.sqrt(np.mean(found.u**2))):
        return None
    left = float(np.sqrt(max(1 - (rounding / sigma) ** 2, 0.0)))
    step = found.step / MICROMETRE
    title = say("predictions are rounded to {step:g} µm", step=step)
    u = rounding / MICROMETRE
    more = say("Let the simulation write more digits, or state u_um = {u:.2g} in [simulation].", u=u)
    gone = 1.0, None, None, left * rms_um, left * heldout_um, 0.0, 0.0
    return SimulationMistake("rounded", title, more, *gone, step, 0.0, unit("µm"))
