"""Better plans: set-ups chosen one after the other, then exchanged as long as that helps.

Greedy choice with exchange (Fedorov 1972, *Theory of Optimal Experiments*) over candidate set-ups, whose information adds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cmm_uq.analysis.planning.information import Information, cosines, left_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats

CRITERIA = ("separation", "D", "A", "worst")
_FLOOR = (
    1e-3  # square of the sine below which a pair is as good as identical; keeps one such pair from hiding all others
)
_GAIN = 1e-6  # least gain in the score by which a set-up is chosen; else the one that tells most of everything
_BETTER, _MOST_TRIES = 1e-9, 2000
Score = Callable[[Floats], Floats]  # what is to become small, (c,), of information (c, k, k)


@dataclass(frozen=True, eq=False)
class Selection:
    """What a search ends with."""

    indices: tuple[int, ...]  # of the candidates taken, in ascending order
    after: float  # after, before: score with and without them; smaller is better
    before: float


def score_of(criterion: str, placings_information: Information, targets: Sequence[int]) -> Score:
    targets, least = list(targets), 2 if criterion == "separation" else 1
    if criterion not in CRITERIA:
        raise CmmUqError(f"no criterion {criterion!r}", fix=f"Known: {', '.join(CRITERIA)}")
    if len(targets) < least:
        raise CmmUqError(f"the criterion {criterion!r} needs at least {least} effects", where="job.toml [plan]",
                         fix="Name more effects, or rivals to tell apart")  # fmt: skip
    if criterion == "separation":
        base = [i for i in range(len(placings_information.prior)) if i not in targets]
        upper = np.triu_indices(len(targets), 1)

        def apart(information: Floats) -> Floats:
            alone = np.einsum("...ii->...i", information)[..., targets]
            sine = 1 - cosines(left_of(information, targets, base), alone)[..., upper[0], upper[1]] ** 2
            return np.asarray(-np.log(sine + _FLOOR).mean(axis=-1))

        return apart
    nuisance = placings_information.nuisance
    effects = [i for i in range(len(placings_information.prior)) if i not in nuisance]
    at = [effects.index(i) for i in targets]

    def uncertain(information: Floats) -> Floats:
        left = left_of(information, effects, nuisance) + np.eye(len(effects))
        covariance = np.linalg.inv(left)[..., at, :][..., :, at]
        if criterion == "D":
            return np.asarray(np.linalg.slogdet(covariance)[1] / len(targets))
        variances = np.einsum("...ii->...i", covariance)
        return np.asarray(np.log(variances.mean(axis=-1) if criterion == "A" else variances.max(axis=-1)))

    return uncertain


def step(score: Score, start: Floats, each: Floats) -> Floats:
    """Score (c,) with each candidate (c, k, k) added to what there is (k, k): one step of the search."""
    return score(start + each)


def choose(
    placings_information: Information, start: Floats, score: Score, count: int, *, again: bool = False
) -> Selection:
    """Take ``count`` candidates, greedily, then exchange them one for one; ``start`` (k, k) information already there."""
    each, nuisance = placings_information.each, placings_information.nuisance
    again = again or count > len(each)
    everything = score_of("D", placings_information, [i for i in range(len(start)) if i not in nuisance])
    taken: list[int] = []
    information, before = start.copy(), float(score(start[None])[0])
    now = before
    for _ in range(count):
        scores = _free(step(score, information, each), taken, again)
        best = int(np.argmin(scores))
        if scores[best] > now - _GAIN * (1 + abs(now)):
            best = int(np.argmin(_free(step(everything, information, each), taken, again)))
        taken.append(best)
        information, now = information + each[best], float(scores[best])
    return Selection(*_exchanged(each, information, score, taken, again), before)


def _free(scores: Floats, taken: Sequence[int], again: bool) -> Floats:
    if not again:
        scores = scores.copy()
        scores[list(taken)] = np.inf
    return scores


def _exchanged(
    each: Floats, information: Floats, score: Score, taken: list[int], again: bool
) -> tuple[tuple[int, ...], float]:
    now = float(score(information[None])[0])
    at, unchanged, tries = 0, 0, 0
    while unchanged < len(taken) and tries < _MOST_TRIES:
        without = information - each[taken[at]]
        scores = _free(step(score, without, each), taken, again)
        best = int(np.argmin(scores))
        unchanged, tries = unchanged + 1, tries + 1
        if scores[best] < now - _BETTER * (1 + abs(now)):
            taken[at], information, now, unchanged = best, without + each[best], float(scores[best]), 0
        at = (at + 1) % len(taken)
    return tuple(sorted(taken)), now
