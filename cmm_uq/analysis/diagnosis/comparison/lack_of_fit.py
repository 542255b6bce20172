"""Whether anything is missing: evidence of something over nothing, and how often drawn noise, tails and all, shows as much."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import comb

import numpy as np
import scipy
from numpy.typing import NDArray

from cmm_uq.analysis.diagnosis.comparison.combinations import EFFECTS
from cmm_uq.analysis.diagnosis.comparison.conditional import AMPLITUDES, Version
from cmm_uq.analysis.diagnosis.comparison.evidence import CandidateComparison
from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, SEVERAL, UNKNOWN, Explanation
from cmm_uq.analysis.diagnosis.noise import NoiseKind, probable_tails, tail_precision, with_tails
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass

_ORTHOGONAL = 1e-9  # of the largest square of a row's length, what products of rows that are at right angles come to
# Of freedom, of Student's t where noise has heavy tails: the fewest that have a variance, and those of the noise's model
DEGREES = (3.0, 4.0)
_DIGITS = 7  # of what is left, over its root mean square, that rounding spares
_LEAST_LEFT = 0.1  # part of a residual's variance that the fit must leave for it to tell of tails


def draw_nothing(comparison: CandidateComparison, random: np.random.Generator, draws: int) -> Floats:
    """What the baseline leaves (m, draws), mm, of recordings with nothing missing, their noise and tails by its posterior."""
    weight = comparison.noise_posterior()
    chosen = random.choice(weight.size, draws, p=weight.ravel() / weight.sum())
    kind, size = np.unravel_index(chosen, weight.shape)
    uniform = random.spawn(1)[0].random(draws)
    drawn = np.empty((len(comparison.left), draws))
    for g in np.unique(kind):
        columns = np.flatnonzero(kind == g)
        own, sigma = comparison.kinds[g], comparison.sigma[size[columns]]
        heavy = uniform[columns] < probability_of_tails(comparison, own)
        drawn[:, columns] = left_of_noise(comparison, own, random, sigma, heavy)
    return drawn


def probability_of_tails(comparison: CandidateComparison, kind: NoiseKind) -> float:
    """Probability of heavy tails beside what a kind of noise is otherwise."""
    if kind.name == "tails":
        return 0.0
    reached = np.linalg.qr(kind.white(comparison.reached))[0]
    own = kind.white(comparison.left[:, None])[:, 0]
    own -= reached @ (reached.T @ own)
    left = 1 - np.sum(reached**2, axis=1)
    enough = left > _LEAST_LEFT
    return probable_tails(own[enough] / np.sqrt(left[enough]), comparison.often_heavy)


def left_of_noise(
    comparison: CandidateComparison, kind: NoiseKind, random: np.random.Generator, sigma: Floats,
    heavy: NDArray[np.bool_] | None = None,
) -> Floats:  # fmt: skip
    """What the baseline leaves (m, draws), mm, of noise of one kind and sizes (draws,), in heavy tails where these are."""
    fine, display = kind.unrounded if comparison.display else None, comparison.display
    # of a stream of its own: the others stay as they are
    wider = None if heavy is None else tail_widths(random.spawn(1)[0], heavy, len(comparison.left))
    standing = order_and_side(comparison.left, comparison.reached)
    drawn = draw_noise(fine or kind, random, len(sigma), comparison.noise_scale, standing, wider)
    if comparison.certified.size:
        drawn += comparison.certified @ random.standard_normal((comparison.certified.shape[1], len(sigma)))
    if not (display and fine):
        return sigma * comparison.rest(drawn)
    drawn, scale = sigma * drawn, comparison.noise_scale[:, None]
    return comparison.rest(drawn + display.rounded(scale * drawn) / scale)


def draw_noise(
    kind: NoiseKind, random: np.random.Generator, draws: int, noise_scale: Floats, standing: tuple[Ints, Floats],
    wider: Floats | None = None,
) -> Floats:  # fmt: skip
    """Noise (m, draws) over that of a reading; ``wider`` (m, draws): how much wider than normal (:func:`tail_widths`)."""
    order, side = standing
    white = np.empty((len(order), draws))
    white[order] = random.standard_normal((len(order), draws)) * (1.0 if wider is None else wider)
    white *= side[:, None]
    # the whitening is mostly an orthogonal matrix T between two diagonal ones: D·T·S; the root is then S⁻¹·Tᵀ·D⁻¹·T
    turned = kind.whitening @ scipy.sparse.diags_array(1 / noise_scale)
    squares = turned @ turned.T
    length = np.sqrt(squares.diagonal())
    if abs(squares - scipy.sparse.diags_array(length**2)).max() <= _ORTHOGONAL * float(length.max()) ** 2:
        found = kind.coloured((turned @ white) / length[:, None])
    else:  # as of readings that follow each other: the symmetric root (m, m) of the covariance without what is slow
        half = kind.coloured(np.eye(len(order)))
        values, vectors = np.linalg.eigh(half @ half.T)
        found = np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T, dtype=np.float64) @ white
    return found + kind.slow @ random.standard_normal((kind.slow.shape[1], draws)) if kind.slow.size else found


def tail_widths(random: np.random.Generator, heavy: NDArray[np.bool_], count: int) -> Floats:
    """Factors (count, draws) that make normal draws those of Student's t where these (draws,) are heavy, of one variance."""
    found = np.ones((count, len(heavy)))
    dof = random.choice(DEGREES, len(heavy))
    found[:, heavy] = np.sqrt((dof - 2) / random.chisquare(dof, found.shape))[:, heavy]
    return found


def order_and_side(left: Floats, reached: Floats) -> tuple[Ints, Floats]:
    """Order (m,) by size of what is left, then by what ``reached`` (m, q) takes, and its sign (m,): free of numbering."""
    size = float(np.sqrt(np.mean(left**2))) or 1.0
    keys = (left / size, np.sum(reached**2, axis=1), np.abs(left) / size)
    return np.lexsort([np.round(key, _DIGITS) for key in keys]), np.where(left < 0, -1.0, 1.0)


_STEPS = 50  # of reweighting: whatever weights it ends with, the evidence is not overstated
_TINY = 1e-300
_LEAST = 0.05  # part of the evidence of nothing below which tails are left out: log odds would change by no more


def under_heavy_tails(normal: CandidateComparison, data: Floats) -> Iterator[tuple[int, CandidateComparison]]:
    """Columns of data (m, b), mm, the baseline taken, for which heavy tails matter, each with its comparison under them."""
    often = normal.often_heavy
    evidence = normal.of_nothing(data)
    likeliest, total = evidence.argmax(axis=0), np.logaddexp.reduce(evidence, axis=0)
    for g in np.unique(likeliest):
        columns, kind = np.flatnonzero(likeliest == g), normal.kinds[g]
        noise, count = normal.precisions[int(g)], max(normal.degrees_of_freedom, 1)
        white = noise.whitening @ data[:, columns]
        fit, most = noise.explained(white), float(tail_precision(np.zeros(1))[0])
        size = np.sqrt(np.sum((white - fit) ** 2, axis=0) / count)
        for _ in range(_STEPS):
            rest = white - fit
            precision = tail_precision(rest / np.maximum(size, _TINY))
            size = np.sqrt(np.sum(precision * rest**2, axis=0) / count)
            fit = noise.explained(fit + precision / most * rest)
        residuals = np.asarray((white - fit) / np.maximum(size, _TINY), dtype=np.float64)
        for j, residual in zip(columns.tolist(), residuals.T, strict=True):
            # as probable as tails on all kinds: those on the others stand to the others as these do to this one
            share = kind.probability * float(np.exp(total[j] - evidence[g, j]))
            own = normal.under([with_tails(kind, residual, often * share)], data[:, j])
            if own.log_evidence_of(())[0] > total[j] + np.log(_LEAST * (1 - often)):
                yield j, own


# Probability, beforehand, of one effect of the catalogue, of several, and of the unknown; the rest is for nothing missing
SHARES = {EFFECT: 0.3, SEVERAL: 0.06, UNKNOWN: 0.08}
NOTHING = 1 - sum(SHARES.values())
DRAWS = 200
TAIL = 0.8
# Factor from the false-alarm rate within which a probability is found more closely: 200 draws know one of 0.01 to a factor
# of three, and heavy tails that are reckoned with make it as much smaller
_NEAR = 10.0
_REARRANGED = 800  # times that what is left is
_MOST = 1000  # draws that there are then at most
_CLEAR = 3.0  # standard errors from the false-alarm rate at which a probability is on one side of it
_STEEPEST = 1.0  # mean excess of log odds whose tail is that of Markov's inequality
# Mean excess below which draws lie at the floor: tails of tests with a few candidates have one half or more
_CROWDED = 0.25


def log_prior(candidates: Sequence[Explanation]) -> Floats:
    """Log probability, beforehand, of each candidate alone (c,)."""
    total = dict.fromkeys(SHARES, 0.0)
    for e in candidates:
        total[e.kind] += e.weight
    return np.log([SHARES[e.kind] * e.weight / total[e.kind] for e in candidates])


def lack_of_fit(comparison: CandidateComparison, seed: int, alpha: float | None = None) -> tuple[float, Floats, Floats]:
    """Probability, under nothing, of as much evidence for something."""
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(2,)))
    draws = draw_nothing(comparison, random, DRAWS)
    statistic, odds = statistic_of(comparison, np.column_stack([comparison.left, draws]))
    unknowns = [i for i, e in enumerate(comparison.explanations) if e.kind == UNKNOWN]
    maxima = odds[unknowns, 1:].max(axis=0) if unknowns else np.zeros(0)
    p_value = tail_probability(statistic[1:], float(statistic[0]))
    if alpha is not None and alpha / _NEAR < p_value < alpha * _NEAR:
        p_value = _nearer(comparison, draws, random, alpha)
    return p_value, statistic[1:], maxima


def by_rearrangement(comparison: CandidateComparison, seed: int) -> float:
    """The same from what is left itself, signs and places at random: as much of it is then as large as in the recording."""
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(20,)))
    each = zip(comparison.noise_probability(()).tolist(), comparison.kinds, strict=True)
    kind = max(((p, kind) for p, kind in each if kind.name != "tails"), key=lambda one: one[0])[1]
    sizes = np.sort(np.abs(kind.white(comparison.left[:, None])[:, 0]))
    order, side = order_and_side(comparison.left, comparison.reached)
    shuffled = np.column_stack([random.permutation(sizes) for _ in range(_REARRANGED)])
    white = np.empty_like(shuffled)
    white[order] = shuffled * random.choice([-1.0, 1.0], shuffled.shape)
    drawn = comparison.rest(kind.coloured(side[:, None] * white))
    value, *draws = statistic_of(comparison, np.column_stack([comparison.left, drawn]))[0].tolist()
    return max(tail_probability(np.array(draws), value), float(np.mean(np.array(draws) >= value)))


def _nearer(comparison: CandidateComparison, draws: Floats, random: np.random.Generator, alpha: float) -> float:
    """The same probability by odds that reckon with heavy tails, from as many draws as say on which side of the rate it is."""
    normal = comparison.only([k for k, kind in enumerate(comparison.kinds) if kind.name != "tails"])
    least = float(np.quantile(statistic_of(normal, draws)[0], TAIL))
    value = float(robust_statistic_of(normal, comparison.left[:, None], least)[0])
    found = robust_statistic_of(normal, draws, least)
    while True:
        share = (1 - TAIL) * DRAWS / len(found)
        p_value = tail_probability(found, value, 1 - share)
        if len(found) >= _MOST or is_clear(p_value, alpha, share * len(found), share):
            return p_value
        more = draw_nothing(comparison, random, DRAWS)
        found = np.append(found, robust_statistic_of(normal, more, least))


def is_clear(p_value: float, alpha: float, draws: float, tail: float = 1 - TAIL) -> bool:
    """Whether a probability from an exponential tail, with so many draws in it, is on one side of a rate."""
    error = np.sqrt((1 + np.log(tail / p_value) ** 2) / draws)  # relative: of the part that is in it, and of its mean
    return bool(abs(np.log(p_value / alpha)) > _CLEAR * error)


def statistic_of(
    comparison: CandidateComparison, data: Floats, single: tuple[Floats, Floats] | None = None
) -> tuple[Floats, Floats]:
    """Log odds (b,) of something for data (m', b): one explanation, or the best effect with any other; and (c, b) of each.

    ``single``: log evidence of nothing, and of each explanation, where that is known.
    """
    found = _Evidence.of(comparison, data, single=single)
    return found.log_odds(), found.something - found.nothing


def robust_statistic_of(normal: CandidateComparison, data: Floats, least: float) -> Floats:
    """Log odds (b,) as of :func:`statistic_of`, the noise of each data (m', b), mm, with tails as heavy as probable."""
    found, often = _Evidence.of(normal, data), normal.often_heavy
    high = np.flatnonzero(found.log_odds() > least)
    if not often or not len(high):
        return found.log_odds()
    found.share(1 - often)
    for at, own in under_heavy_tails(normal, data[:, high]):
        j = int(high[at])
        found.add(j, _Evidence.of(own, data[:, [j]], None if found.lead is None else [found.lead[j]]))
    return found.log_odds()


def known_singles(comparison: CandidateComparison) -> list[int]:
    """Visible effects of the catalogue of one version, of which two are tried together."""
    known = ((i, e) for i, e in enumerate(comparison.explanations) if e.kind == EFFECT and not e.shaped)
    return [i for i, e in known if e.weight == 1 and i in comparison.visible]


@dataclass(frozen=True, eq=False)
class _Evidence:
    """Log evidence of data (m, b)."""

    explanations: Sequence[Explanation]
    nothing: Floats  # nothing, something: (b,) of nothing, and (c, b) of each explanation
    something: Floats
    single: Sequence[int]  # known effects of which two are tried together
    lead: list[Version] | None  # the best of them for each of the data; None where there are no two
    alone: Floats  # alone, both: (b,) of it, and (c, b) of each of them beside it
    both: Floats

    @classmethod
    def of(
        cls, comparison: CandidateComparison, data: Floats, lead: list[Version] | None = None,
        single: tuple[Floats, Floats] | None = None,
    ) -> _Evidence:  # fmt: skip
        nothing, something = single or comparison.log_evidence(data)
        known = known_singles(comparison)
        alone, both = np.zeros_like(nothing), np.full_like(something, -np.inf)
        if len(known) > 1:
            lead = best_versions(comparison, data, known) if lead is None else lead
            for version, columns in _together(lead).items():
                alone[columns], both[:, columns] = comparison.log_evidence(data[:, columns], [version], known)
        return cls(comparison.explanations, nothing, something, known, lead, alone, both)

    def share(self, part: float) -> None:
        """Make it that of noise that has a part of the probability."""
        for evidence in (self.nothing, self.something, self.alone, self.both):
            evidence += np.log(part)

    def add(self, j: int, other: _Evidence) -> None:
        """To that of one of the data, that under other noise."""
        for name in ("nothing", "something", "alone", "both"):
            own, more = getattr(self, name), getattr(other, name)
            own[..., j] = np.logaddexp(own[..., j], more[..., 0])

    def log_odds(self) -> Floats:
        """Log odds (b,) of something; see :func:`statistic_of`."""
        odds = self.something - self.nothing
        log_odds = scipy.special.logsumexp(log_prior(self.explanations)[:, None] + odds, axis=0)
        if self.lead is None:
            return np.asarray(log_odds, dtype=np.float64)
        pair = np.log(EFFECTS[2] / EFFECTS[0]) - np.log(comb(len(self.single), 2)) + np.log(NOTHING)
        for version, columns in _together(self.lead).items():
            first = version.explanation
            beside = np.ascontiguousarray(self.both[:, columns])[[i for i in self.single if i != first]]
            gain = scipy.special.logsumexp(beside, axis=0) - self.alone[columns]
            log_odds[columns] = np.logaddexp(log_odds[columns], pair + (gain + odds[first, columns]))
        return np.asarray(log_odds, dtype=np.float64)


def best_versions(comparison: CandidateComparison, data: Floats, explanations: Sequence[int]) -> list[Version]:
    """Version with most evidence among some visible explanations, for each column of data (m, b)."""
    found = [Version(0, 0, 0.0)] * data.shape[1]
    most = np.full(data.shape[1], -np.inf)
    for group, each in comparison.each(data, (), explanations):
        weight = np.where(np.isin(group.explanation, explanations), group.weight, -np.inf)
        flat = (each + weight[:, None, None]).reshape(-1, data.shape[1])
        at = flat.argmax(axis=0)
        for column in np.flatnonzero(flat.max(axis=0) > most):
            m, a = divmod(int(at[column]), AMPLITUDES)
            found[column] = Version(int(group.explanation[m]), int(group.member[m]), float(group.amplitudes[m, a]))
            most[column] = flat[at[column], column]
    return found


def _together(versions: Sequence[Version]) -> dict[Version, list[int]]:
    found: dict[Version, list[int]] = {}
    for column, version in enumerate(versions):
        found.setdefault(version, []).append(column)
    return found


def tail_probability(draws: Floats, value: float, tail: float = TAIL) -> float:
    """Probability of reaching a value of log odds, from draws; beyond a quantile of theirs with an exponential tail.

    Log odds have a floor. Where draws crowd at it they show no tail, and beyond the largest draw they show none in any case:
    there it is no steeper than Markov's inequality has it. The odds of what is not there have a mean of one, and so
    reach e^x in no more than e^−x of all cases.
    """
    largest = float(draws.max())
    if np.isneginf(largest):  # nothing that is thought of could show at all
        return 1.0
    start = float(np.quantile(draws, tail))
    if value <= start:
        return float((np.sum(draws >= value) + 1) / (len(draws) + 1))
    beyond = draws[draws > start]
    excess = float((beyond - start).mean()) if len(beyond) else 0.0  # all crowd where nothing but the digits is left
    if excess < _CROWDED:
        return float(max((1 - tail) * np.exp(-(value - start)), np.mean(draws >= value)))
    shown = (1 - tail) * np.exp(-(min(value, largest) - start) / excess)
    if value <= largest:
        return float(shown)
    return float(max(shown, 1 / (len(draws) + 1)) * np.exp(-(value - largest) / max(excess, _STEEPEST)))
