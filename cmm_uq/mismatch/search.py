"""The search for what was left out: a gate with a known false-alarm rate, then one explanation after the other.

At every step all rivals compete: each effect of the catalogue, smooth functions that nobody knows, and nothing. The gate's
statistic is the evidence of "something" over "nothing"; its distribution under nothing is drawn on the recording's own design.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import special

from cmm_uq.measurement import MeasurementModel
from cmm_uq.mismatch.evidence import Comparison
from cmm_uq.mismatch.explanations import EFFECT, SEVERAL, UNKNOWN, Explanation, known, mean_of, several, unknown
from cmm_uq.mismatch.noise import Kind, kinds, order_of, sigma_grid
from cmm_uq.physics.catalogue import CATALOGUE
from cmm_uq.points import Floats

SHARES = {EFFECT: 0.3, SEVERAL: 0.05, UNKNOWN: 0.15}
"""Probability, beforehand, of one effect of the catalogue, of several, and of the unknown; the rest is for nothing missing."""

NOTHING = 1 - sum(SHARES.values())

MOST_EFFECTS = 4
DRAWS = 200
_TAIL = 0.8
_MISFIT = 20.0
"""Largest misfit, over the noise, that is reckoned with when the noise is not stated."""

_TRY, _KEEP = 0.5, 3.0
"""Log Bayes factors from which an effect is tried once the gate is open, and that it must have in the end."""


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

    def best(self, kind: str) -> Explanation | None:
        """The most probable explanation of a kind."""
        of_kind = [(p, i) for i, p in enumerate(self.probability) if self.explanations[i].kind == kind]
        return self.explanations[max(of_kind)[1]] if of_kind else None

    def odds_of(self, name: str) -> float:
        """Log evidence of an explanation over nothing; minus infinity when it does not compete."""
        odds = {e.name: float(o) for e, o in zip(self.explanations, self.log_odds, strict=True)}
        return odds.get(name, -np.inf)

    def share(self, kind: str) -> float:
        """Probability of all explanations of a kind together."""
        return float(sum(p for p, e in zip(self.probability, self.explanations, strict=True) if e.kind == kind))


@dataclass(frozen=True, eq=False)
class Found:
    """What a search ends with.

    Parameters
    ----------
    first, last : races before anything is found, and after everything is.
    model : the job's model with what was left out.
    effects : names of what was left out, in the order found.
    unexplained : the unknown function that remains, if any.
    """

    first: Race
    last: Race
    model: MeasurementModel
    effects: tuple[str, ...]
    unexplained: Explanation | None


def search(model: MeasurementModel, stated: float | None, *, alpha: float, seed: int) -> Found:
    """Find what a model leaves out.

    Parameters
    ----------
    model : what the job names, with its recording.
    stated : standard uncertainty of a coordinate, mm, as the job states it.
    alpha : false-alarm rate of each step.
    seed : of the null distribution.
    """
    first = race_of(model, stated, (), seed)
    last, names = first, list[str]()
    while last.p_value < alpha and len(names) < MOST_EFFECTS:
        best = last.best(EFFECT)
        if best is None or last.odds_of(best.name) < _TRY:
            break
        names.append(best.name)
        last = race_of(with_effect(last, best), stated, (), seed)
    while names:
        remains = last.best(UNKNOWN) if last.p_value < alpha else None
        doubtful = [name for name in reversed(names) if _is_doubtful(last, name, names, remains, stated)]
        if not doubtful:
            break
        names.remove(doubtful[0])
        last = race_of(_only(model, last.model, names), stated, (), seed)
    return Found(first, last, last.model, tuple(names), last.best(UNKNOWN) if last.p_value < alpha else None)


def race_of(
    model: MeasurementModel,
    stated: float | None,
    extra: Sequence[Kind],
    seed: int | None,
    leave_out: Sequence[str] = (),
) -> Race:
    """Let all rivals compete for what a model leaves.

    Parameters
    ----------
    extra : further kinds of noise (an unknown function already granted).
    seed : of the null distribution; without one the p-value is not computed (1).
    leave_out : effects that do not compete.
    """
    estimate = model.estimate()
    values, linear = estimate.least_squares.value, estimate.linear
    named = (*(effect.name for effect in model.effects), *leave_out)
    singles = known(model, values, named)
    rivals = singles + several(singles) + unknown(model, values)
    sigma_left = max(estimate.least_squares.sigma_of_residuals, 1e-6)
    sigma, log_sigma = sigma_grid(stated, sigma_left)
    held = _held(model)
    rest = linear.observed - linear.design[:, held] @ linear.prior_mean[held]
    comparison = Comparison(
        rest / linear.noise_scale, np.hstack([linear.design[:, ~held], linear.placing]) / linear.noise_scale[:, None],
        [*extra] or noise_kinds(model, sigma_left), sigma, log_sigma, rivals, linear.noise_scale,
        stated or sigma_left / _MISFIT,
    )  # fmt: skip
    nothing, something = comparison.log_evidence()
    log_odds = something[:, 0] - nothing[0]
    log_prior = _log_prior(rivals)
    log_total = special.logsumexp(np.append(log_prior + log_odds, np.log(NOTHING)))
    p_value, maxima = (1.0, np.zeros(0)) if seed is None else _gate(comparison, log_prior, log_odds, seed)
    return Race(model, values, comparison, log_odds, np.exp(log_prior + log_odds - log_total), p_value, maxima)


def with_effect(race: Race, explanation: Explanation) -> MeasurementModel:
    """The race's model with one effect more; of its shapes the one with most evidence."""
    effect = CATALOGUE[explanation.name]
    shapes = dict(race.model.shapes)
    if effect.shape:
        alone = [replace(explanation, members=(member,)) for member in explanation.members]
        _, each = replace(race.comparison, explanations=alone).log_evidence()
        shapes[effect.name] = explanation.members[int(np.argmax(each[:, 0]))].shape
    return replace(race.model, effects=(*race.model.effects, effect), shapes=shapes)


def noise_kinds(model: MeasurementModel, sigma: float) -> list[Kind]:
    """Kinds of noise of the used observations; a certified size adds what its certificate leaves open, at this noise."""
    artefact = model.artefact
    time = model.artefact.points.columns.get("time_s")
    order = order_of(None if time is None else mean_of(model, time), int(model.used.sum()))
    found = kinds(artefact.measurement[model.used], order)
    certified = np.array([size.certified for size in artefact.sizes], dtype=bool)
    sds = np.array([size.sd for size in artefact.sizes])[certified]
    change = artefact.size_change()[model.used][:, certified] * sds / artefact.noise_scale[model.used, None]
    open_ = change @ change.T / sigma**2
    return [replace(kind, correlation=kind.correlation + open_) for kind in found]


def _held(model: MeasurementModel) -> NDArray[np.bool_]:
    """Which parameters of the linear model are sizes with a certificate; all others may take any value."""
    return np.array([unknown.known for unknown in model.unknowns], dtype=bool)


def _log_prior(rivals: Sequence[Explanation]) -> Floats:
    count = Counter(e.kind for e in rivals)
    return np.log([SHARES[e.kind] / count[e.kind] for e in rivals])


def _gate(comparison: Comparison, log_prior: Floats, log_odds: Floats, seed: int) -> tuple[float, Floats]:
    """Probability, under nothing, of as much evidence for something; and the unknown functions' largest under nothing."""
    statistic = float(special.logsumexp(log_prior + log_odds))
    g, s = np.unravel_index(
        int(np.argmax(comparison.noise_posterior())), (len(comparison.kinds), len(comparison.sigma))
    )
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(2,)))
    draws = comparison.sigma[s] * comparison.factors[g] @ random.standard_normal((len(comparison.left), DRAWS))
    nothing, something = comparison.log_evidence(draws)
    odds = something - nothing
    unknowns = [i for i, e in enumerate(comparison.explanations) if e.kind == UNKNOWN]
    maxima = odds[unknowns].max(axis=0) if unknowns else np.zeros(0)
    return tail_probability(special.logsumexp(log_prior[:, None] + odds, axis=0), statistic), maxima


def tail_probability(draws: Floats, value: float) -> float:
    """Probability of reaching a value, from draws; beyond their upper fifth with an exponential tail."""
    start = float(np.quantile(draws, _TAIL))
    if value <= start:
        return float((np.sum(draws >= value) + 1) / (len(draws) + 1))
    beyond = draws[draws > start] - start
    return float((1 - _TAIL) * np.exp(-(value - start) / beyond.mean()))


def _only(model: MeasurementModel, extended: MeasurementModel, names: Sequence[str]) -> MeasurementModel:
    kept = tuple(CATALOGUE[name] for name in names)
    return replace(model, effects=(*model.effects, *kept), shapes=extended.shapes)


def _is_doubtful(
    last: Race, name: str, names: Sequence[str], remains: Explanation | None, stated: float | None
) -> bool:
    """Whether an effect lacks evidence, or an unknown function in its place is more probable or leaves it without evidence."""
    fewer = replace(last.model, effects=tuple(e for e in last.model.effects if e.name != name))
    others = [other for other in names if other != name]
    race = race_of(fewer, stated, (), None, leave_out=others)
    if race.odds_of(name) < _KEEP or race.share(UNKNOWN) > race.share(EFFECT):
        return True
    return remains is not None and _granted(fewer, remains, stated, others).odds_of(name) < _KEEP


def _granted(model: MeasurementModel, unknown_: Explanation, stated: float | None, others: Sequence[str]) -> Race:
    """The race once an unknown function is granted, at any amplitude, as if it were noise."""
    estimate = model.estimate()
    scale = estimate.linear.noise_scale[:, None]
    sigma = max(estimate.least_squares.sigma_of_residuals, 1e-6)
    plain = noise_kinds(model, sigma)[0]
    granted = [
        Kind("granted", a, plain.correlation + (a * m.columns / scale) @ (a * m.columns / scale).T / sigma**2, 1.0)
        for m in unknown_.members
        for a in (0.01, 0.03, 0.1, 0.3, 1.0)
    ]
    return race_of(model, stated, granted, None, leave_out=others)
