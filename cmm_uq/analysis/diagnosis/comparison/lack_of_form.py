"""Whether anything is missing that has the form of no effect and of no smooth function: all of a dictionary's at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.diagnosis.comparison.algebra import Precision, eigen, log_sum, log_sum_in, squared
from cmm_uq.analysis.diagnosis.comparison.evidence import CandidateComparison
from cmm_uq.analysis.diagnosis.comparison.lack_of_fit import TAIL, draw_nothing, is_clear, tail_probability
from cmm_uq.analysis.diagnosis.empirical.functions import FunctionFamily
from cmm_uq.base.points import Floats

_SIZES = np.geomspace(0.4, 12.0, 5)  # rms of a function of many coefficients over the noise, as tried
_FITTED = 2  # coefficients up to which a function takes what fits best
_SHOWS = 0.4  # rms over the noise that the largest must reach
_UNABSORBED = 1e-5  # part of its length that the baseline leaves
_BEGIN, _OPEN, _FURTHER = 50, 0.1, 400  # draws; probability from which on they are enough; draws more
_NUMBERS = 400_000  # of a block of columns


def lack_of_form(
    comparison: CandidateComparison, families: Callable[[], Iterable[FunctionFamily]], seed: int, alpha: float
) -> float:
    """Probability, under nothing, of as much evidence for a function of closed form, or a rough one.

    Noise is of any kind but heavy tails; what is drawn has these too. ``families``: called for them, once or twice; what
    is common to their log priors does not matter.
    """
    if comparison.degrees_of_freedom < 2:
        return 1.0
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(19,)))
    normal = comparison.only([k for k, kind in enumerate(comparison.kinds) if kind.name != "tails"])
    data = np.column_stack([comparison.left, draw_nothing(comparison, random, _BEGIN)])
    value, *draws = _log_odds(normal, families(), data).tolist()
    p_value = tail_probability(np.array(draws), value)
    if p_value < _OPEN and not is_clear(p_value, alpha, (1 - TAIL) * _BEGIN):
        draws += _log_odds(normal, families(), draw_nothing(comparison, random, _FURTHER)).tolist()
        p_value = tail_probability(np.array(draws), value)
    return p_value


def likeliest_noise(comparison: CandidateComparison, families: Sequence[FunctionFamily]) -> int:
    """Kind of noise that is most probable of the recording beside a function, whichever it is; heavy tails are none."""
    normal = [k for k, kind in enumerate(comparison.kinds) if kind.name != "tails"]
    own, left = comparison.only(normal), comparison.left[:, None]
    return normal[int(np.logaddexp(_of_forms(own, families, left), own.of_nothing(left)).argmax())]


def _log_odds(comparison: CandidateComparison, families: Iterable[FunctionFamily], data: Floats) -> Floats:
    """Log odds (b,) of any function over nothing for data (m, b)."""
    found, nothing = _of_forms(comparison, families, data), comparison.of_nothing(data)
    return np.asarray(np.logaddexp.reduce(found) - log_sum(nothing, 0))


def _of_forms(comparison: CandidateComparison, families: Iterable[FunctionFamily], data: Floats) -> Floats:
    """Log evidence (k, b) of functions, by kind of noise, for data (m, b), the size of few coefficients at its likeliest."""
    degrees, found = comparison.degrees_of_freedom, np.full((len(comparison.kinds), data.shape[1]), -np.inf)
    weighed = [noise(data) for noise in comparison.precisions]
    for columns, log_prior in map(joined, alike(families)):
        rows = np.ascontiguousarray(columns.transpose(1, 2, 0))
        for k, (noise, square, by) in enumerate(zip(comparison.precisions, comparison.squares, weighed, strict=True)):
            turn, strengths, seen = _along_axes(noise, rows, _SHOWS**2 * float(square))
            if strengths.shape[1] <= _FITTED:
                gain = 1 / strengths[:, None]
                constant = np.full((len(strengths), 1), -0.5 * strengths.shape[1] * np.log(degrees))
            else:
                part = strengths / strengths.sum(axis=1, keepdims=True)
                ratio = (_SIZES**2 * degrees)[:, None] * part[:, None]
                gain = ratio / (1 + ratio) / strengths[:, None]
                constant = -0.5 * np.log1p(ratio).sum(axis=2) - np.log(len(_SIZES))
            constant += noise.log + log_prior[seen, None]
            if len(strengths):
                shown = turn.swapaxes(1, 2) @ (rows[seen] @ by)
                log = comparison.integrated(np.einsum("mb,mb->b", data, by) - gain @ shown**2) + constant[:, :, None]
                found[k] = np.logaddexp(found[k], log_sum_in(log.reshape(-1, data.shape[1]), 0))
    return found


def alike(families: Iterable[FunctionFamily]) -> Iterator[list[FunctionFamily]]:
    """Families of as many coefficients, so many at once as a block may hold."""
    waiting: dict[int, list[FunctionFamily]] = {}
    for family in families:
        some = waiting.setdefault(family.columns.shape[2], [])
        some.append(family)
        if sum(each.columns.size for each in some) > _NUMBERS:
            yield waiting.pop(family.columns.shape[2])
    yield from waiting.values()


def joined(some: Sequence[FunctionFamily]) -> tuple[Floats, Floats]:
    """All functions (m, K, r) of families of as many coefficients, and the log prior of each (K,)."""
    log_prior = np.repeat([each.log_prior for each in some], [each.columns.shape[1] for each in some])
    return np.concatenate([each.columns for each in some], axis=1), log_prior


def _along_axes(noise: Precision, rows: Floats, least: float) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Principal axes (K', r, r) and strengths (K', r) of functions as rows (K, r, m), and which show so much."""
    flat = rows.reshape(-1, rows.shape[2])
    whole, taken = (squared(part.reshape(*rows.shape[:2], -1)) for part in (noise.white(flat.T).T, flat @ noise.rows.T))
    strengths, turn = eigen(whole - taken)
    most = _UNABSORBED**2 * np.einsum("krr->k", whole)
    seen = strengths.sum(axis=1) > np.maximum(least, most)
    return turn[seen], np.maximum(strengths[seen], most[seen, None]), seen
