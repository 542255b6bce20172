"""Set-ups that determine most: chosen among candidates one after the other, then exchanged one for one (Fedorov 1972)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from cmm_uq.analysis.planning.candidates import Information, cosines, left_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass

CRITERIA = ("separation", "D", "A", "worst")
# square of the sine below which a pair is as good as identical; keeps one such pair from hiding all others
_FLOOR = 1e-3
_GAIN = 1e-6  # least gain in the score by which a set-up is chosen; else the one that tells most of everything
_BETTER, _MOST_TRIES = 1e-9, 2000
_MANY = 4  # set-ups from which on it pays to look first at what candidates change
# Difference of scores from which on a candidate is hopeless; part of that by which they may be off, else all are looked at
_NEAR, _RIGHT = 1e-6, 0.01
_SINGULAR = 1e-13  # added to information of which nothing may be known
_FAINTEST = 1e-12  # part of the largest of a candidate's information that is rounding
Score = Callable[[Floats], Floats]  # what is to become small, (c,), of information (c, k, k)


@dataclass(frozen=True, eq=False)
class Selection:
    """What a search ends with."""

    indices: tuple[int, ...]  # of the candidates taken, in ascending order
    after: float  # after, before: score with and without them; smaller is better
    before: float


def score_of(criterion: str, placings_information: Information, targets: Sequence[int]) -> Score:
    targets, least, rows = list(targets), 2 if criterion == "separation" else 1, range(len(placings_information.prior))
    if criterion not in CRITERIA:
        raise CmmUqError(f"no criterion {criterion!r}", fix=f"Known: {', '.join(CRITERIA)}")
    if len(targets) < least:
        raise CmmUqError(f"the criterion {criterion!r} needs at least {least} effects", where="job.toml [plan]",
                         fix="Name more effects, or rivals to tell apart")  # fmt: skip
    if criterion == "separation":
        base, upper = [i for i in rows if i not in targets], np.triu_indices(len(targets), 1)

        def apart(information: Floats) -> Floats:
            alone = np.einsum("...ii->...i", information)[..., targets]
            sine = 1 - cosines(left_of(information, targets, base), alone)[..., upper[0], upper[1]] ** 2
            return np.asarray(-np.log(sine + _FLOOR).mean(axis=-1))

        return apart
    nuisance = placings_information.nuisance
    effects = [i for i in rows if i not in nuisance]
    return _Uncertainty(criterion, targets, effects, nuisance)


@dataclass(frozen=True, eq=False)
class _Uncertainty:
    """How uncertain targets are with what physics allows of all effects."""

    criterion: str
    targets: list[int]
    effects: list[int]
    nuisance: list[int]

    def __call__(self, information: Floats) -> Floats:
        at = [self.effects.index(i) for i in self.targets]
        left = left_of(information, self.effects, self.nuisance) + np.eye(len(self.effects))
        return self._of(np.asarray(np.linalg.inv(left)[..., at, :][..., :, at], dtype=np.float64))

    def beside(self, information: Floats, factors: Floats) -> Floats:
        """Nearly the same of information (k, k) and V·Vᵀ of each of ``factors`` (c, k, r), by Woodbury's identity."""
        with_prior = information.copy()
        with_prior[self.effects, self.effects] += 1
        scale = np.sqrt(np.maximum(np.diag(with_prior), 1e-12))
        inverse = np.linalg.inv(with_prior / np.outer(scale, scale) + _SINGULAR * np.eye(len(scale))) / np.outer(
            scale, scale
        )
        turned = inverse @ factors
        own, within = turned[:, self.targets], np.eye(factors.shape[2]) + factors.swapaxes(1, 2) @ turned
        less = own @ np.linalg.solve(within, own.swapaxes(1, 2))
        return self._of(inverse[np.ix_(self.targets, self.targets)] - less)

    def _of(self, covariance: Floats) -> Floats:
        if self.criterion == "D":
            return np.asarray(np.linalg.slogdet(covariance)[1] / len(self.targets))
        variances = np.einsum("...ii->...i", covariance)
        return np.asarray(np.log(variances.mean(axis=-1) if self.criterion == "A" else variances.max(axis=-1)))


def choose(
    placings_information: Information, start: Floats, score: Score, count: int, *, again: bool = False
) -> Selection:
    """Take ``count`` candidates, greedily, then exchange them one for one; ``start`` (k, k) information already there."""
    each, nuisance = placings_information.each, placings_information.nuisance
    again = again or count > len(each)
    everything = score_of("D", placings_information, [i for i in range(len(start)) if i not in nuisance])
    scored = _scoring(each, score, count)
    taken: list[int] = []
    information, before = start.copy(), float(score(start[None])[0])
    now = before
    for _ in range(count):
        scores = scored(information, [] if again else taken)
        best = int(np.argmin(scores))
        if scores[best] > now - _GAIN * (1 + abs(now)):
            best = int(np.argmin(_free(everything(information + each), [] if again else taken)))
        taken.append(best)
        information, now = information + each[best], float(scores[best])
    return Selection(*_exchanged(each, information, score, scored, taken, again), before)


def _scoring(each: Floats, score: Score, count: int) -> Callable[[Floats, Sequence[int]], Floats]:
    """Scores (c,) of information (k, k) with each candidate beside it; infinite of those that are taken, and of hopeless ones.

    Where candidates tell of few combinations, what these change says nearly by how much each is worse than the best.
    """

    def exact(information: Floats, taken: Sequence[int]) -> Floats:
        return _free(score(information + each), taken)

    if not isinstance(score, _Uncertainty) or count < _MANY or (factors := _factors(each)) is None:
        return exact

    def scored(information: Floats, taken: Sequence[int]) -> Floats:
        nearly = _free(score.beside(information, factors), taken)
        apart = _NEAR * (1 + abs(float(nearly.min())))
        some = np.flatnonzero(nearly <= nearly.min() + apart)
        found = np.full(len(each), np.inf)
        found[some] = score(information + each[some])
        right = np.abs(found[some] - nearly[some]) < _RIGHT * apart
        return found if len(some) and np.all(right) else exact(information, taken)

    return scored


def _factors(each: Floats) -> Floats | None:
    """(c, k, r) V with V·Vᵀ the information of each candidate; ``None`` where it is of many combinations."""
    values, vectors = np.linalg.eigh(each)
    values = np.where(values > _FAINTEST * values[:, -1:], values, 0.0)
    r = max(1, int((values > 0).sum(axis=1).max()))
    return None if 4 * r > each.shape[1] else vectors[:, :, -r:] * np.sqrt(values[:, None, -r:])


def _free(scores: Floats, taken: Sequence[int]) -> Floats:
    scores = scores.copy()
    scores[list(taken)] = np.inf
    return scores


def _exchanged(
    each: Floats,
    information: Floats,
    score: Score,
    scored: Callable[[Floats, Sequence[int]], Floats],
    taken: list[int],
    again: bool,
) -> tuple[tuple[int, ...], float]:
    now = float(score(information[None])[0])
    at, unchanged, tries = 0, 0, 0
    while unchanged < len(taken) and tries < _MOST_TRIES:
        without = information - each[taken[at]]
        scores = scored(without, [] if again else taken)
        best = int(np.argmin(scores))
        unchanged, tries = unchanged + 1, tries + 1
        if scores[best] < now - _BETTER * (1 + abs(now)):
            taken[at], information, now, unchanged = best, without + each[best], float(scores[best]), 0
        at = (at + 1) % len(taken)
    return tuple(sorted(taken)), now
