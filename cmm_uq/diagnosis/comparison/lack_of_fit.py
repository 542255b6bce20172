"""Whether anything is missing: the evidence of something over nothing, and how often nothing shows as much."""

from __future__ import annotations

from collections.abc import Sequence
from math import comb

import numpy as np
from scipy import special

from cmm_uq.diagnosis.comparison.combinations import EFFECTS
from cmm_uq.diagnosis.comparison.evidence import Comparison
from cmm_uq.diagnosis.comparison.explanations import EFFECT, SEVERAL, UNKNOWN, Explanation
from cmm_uq.diagnosis.comparison.stack import Version
from cmm_uq.points import Floats

SHARES = {EFFECT: 0.3, SEVERAL: 0.06, UNKNOWN: 0.08}
"""Probability, beforehand, of one effect of the catalogue, of several, and of the unknown; the rest is for nothing missing."""

NOTHING = 1 - sum(SHARES.values())

DRAWS = 200
_TAIL = 0.8
_STEEPEST = 1.0
"""Mean excess of log odds whose tail is that of Markov's inequality."""
_CROWDED = 0.25
"""Mean excess below which draws lie at the floor: tails of tests with a few candidates have one half or more."""


def log_prior(candidates: Sequence[Explanation]) -> Floats:
    """Log probability, beforehand, of each candidate alone (c,)."""
    total = dict.fromkeys(SHARES, 0.0)
    for e in candidates:
        total[e.kind] += e.weight
    return np.log([SHARES[e.kind] * e.weight / total[e.kind] for e in candidates])


def lack_of_fit(comparison: Comparison, seed: int) -> tuple[float, Floats, Floats]:
    """Probability, under nothing, of as much evidence for something.

    Also what is drawn under nothing: the statistic, and the largest log evidence of a nonparametric term.
    """
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(2,)))
    draws = comparison.nothing(random, DRAWS)
    statistic, odds = statistic_of(comparison, np.column_stack([comparison.left, draws]))
    unknowns = [i for i, e in enumerate(comparison.explanations) if e.kind == UNKNOWN]
    maxima = odds[unknowns, 1:].max(axis=0) if unknowns else np.zeros(0)
    return tail_probability(statistic[1:], float(statistic[0])), statistic[1:], maxima


def statistic_of(comparison: Comparison, data: Floats) -> tuple[Floats, Floats]:
    """Log odds (b,) of something for data (m', b): one explanation, or the best known effect with any other.

    Also the log evidence (c, b) of each explanation over nothing.
    """
    nothing, something = comparison.log_evidence(data)
    odds = something - nothing
    log_odds = special.logsumexp(log_prior(comparison.explanations)[:, None] + odds, axis=0)
    single = [
        i
        for i, e in enumerate(comparison.explanations)
        if e.kind == EFFECT and e.weight == 1 and not e.shaped and i in comparison.visible
    ]
    if len(single) < 2:
        return log_odds, odds
    pair = np.log(EFFECTS[2] / EFFECTS[0]) - np.log(comb(len(single), 2)) + np.log(NOTHING)
    together: dict[Version, list[int]] = {}
    for column, version in enumerate(comparison.best(data, single)):
        together.setdefault(version, []).append(column)
    for version, columns in together.items():
        alone, both = comparison.log_evidence(data[:, columns], [version], single)
        others = [i for i in single if i != version.explanation]
        gain = special.logsumexp(both[others], axis=0) - alone + odds[version.explanation, columns]
        log_odds[columns] = np.logaddexp(log_odds[columns], pair + gain)
    return log_odds, odds


def tail_probability(draws: Floats, value: float) -> float:
    """Probability of reaching a value of log odds, from draws; beyond their upper fifth with an exponential tail.

    Log odds have a floor. Where draws crowd at it they show no tail, and beyond the largest draw they show none in any case:
    there it is no steeper than Markov's inequality has it. The odds of what is not there have a mean of one, and so
    reach e^x in no more than e^−x of all cases.
    """
    largest = float(draws.max())
    if np.isneginf(largest):  # nothing that is thought of could show at all
        return 1.0
    start = float(np.quantile(draws, _TAIL))
    if value <= start:
        return float((np.sum(draws >= value) + 1) / (len(draws) + 1))
    excess = float((draws[draws > start] - start).mean())
    if excess < _CROWDED:
        return float(max((1 - _TAIL) * np.exp(-(value - start)), np.mean(draws >= value)))
    shown = (1 - _TAIL) * np.exp(-(min(value, largest) - start) / excess)
    if value <= largest:
        return float(shown)
    return float(max(shown, 1 / (len(draws) + 1)) * np.exp(-(value - largest) / max(excess, _STEEPEST)))
