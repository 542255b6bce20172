"""Frequencies of several errors at once, one of each, drawn by the evidence of a recording.

Cells of frequency come first (:mod:`cmm_uq.parts.combinations`); within them frequencies follow one after the other, each by
its evidence beside those that are there and the cells of the others; weights make them exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cmm_uq.parts.combinations import Combinations
from cmm_uq.parts.waves import Wave, evidence, mass, orthogonal
from cmm_uq.points import Floats, Ints

FINE = 16
"""Frequencies in a cell."""

_BLOCK = 500
"""Draws at once."""


@dataclass(frozen=True, eq=False)
class Found:
    """N frequencies of each wave (N, w), and what they are worth.

    Attributes
    ----------
    evidence : log of it, over that of no wave.
    effective : part of the draws that weights leave, in effect.
    """

    frequency: Floats
    evidence: float
    effective: float


def draw(v: Floats, waves: Sequence[Wave], count: int, random: np.random.Generator) -> Found:
    """Frequencies of one to three waves, given whitened observations v (r,) with a noise of variance one."""
    bounds = [wave.cells for wave in waves]
    cells = [wave.of_cells(each) for wave, each in zip(waves, bounds, strict=True)]
    prior = [np.log(mass(each, wave)) for wave, each in zip(waves, bounds, strict=True)]
    which, log_weight = Combinations(v, waves, cells, prior, random).found()
    return _within(v, waves, bounds, cells, which, log_weight, count, random)


def _within(
    v: Floats, waves: Sequence[Wave], bounds: Sequence[Floats], cells: Sequence[Floats], which: Ints, log_weight: Floats,
    count: int, random: np.random.Generator,
) -> Found:  # fmt: skip
    """Frequencies within combinations of cells (P, w) that stand for so much (P,)."""
    weight = np.exp(log_weight - log_weight.max())
    at = which[systematic(weight, count, random)]
    frequency, log = np.empty((count, len(waves))), np.empty(count)
    for begin in range(0, count, _BLOCK):
        part = slice(begin, begin + _BLOCK)
        frequency[part], log[part] = _fine(v, waves, bounds, cells, at[part], random)
    weights = np.exp(log - log.max())
    total = np.log(weight.sum()) + log_weight.max() + np.log(weights.mean()) + log.max()
    found = frequency[systematic(weights, count, random)]
    random.shuffle(found)
    return Found(found, float(total), float(weights.sum() ** 2 / (weights**2).sum()) / count)


def _fine(
    v: Floats, waves: Sequence[Wave], bounds: Sequence[Floats], cells: Sequence[Floats], which: Ints,
    random: np.random.Generator,
) -> tuple[Floats, Floats]:  # fmt: skip
    """Frequencies (P, w) in cells (P, w), and the logarithm of what they are worth over what their cells are (P,)."""
    P, w = which.shape
    columns = [each[at] for each, at in zip(cells, which.T, strict=True)]
    log, U = orthogonal(np.concatenate(columns, axis=2))
    worth = -log - 0.5 * np.sum((v @ U) ** 2, axis=-1)
    found, row = np.empty((P, w)), np.arange(P)
    for number, i in enumerate(random.permutation(w).tolist()):
        low, high = bounds[i][which[:, i]], bounds[i][which[:, i] + 1]
        steps = (np.arange(FINE) + random.random((P, 1))) / FINE
        f = low[:, None] + steps * (high - low)[:, None]
        tried = waves[i].columns(f)  # (P, FINE, r, 2)
        others = [np.zeros((P, len(v), 0)), *(columns[j] for j in range(w) if j != i)]
        each = _beside(v, np.concatenate(others, axis=2), tried)
        chance = each - np.log(f)
        sums = np.cumsum(np.exp(chance - chance.max(axis=1, keepdims=True)), axis=1)
        pick = (sums < random.random((P, 1)) * sums[:, -1:]).sum(axis=1).clip(max=FINE - 1)
        found[:, i], columns[i] = f[row, pick], tried[row, pick]
        # density beforehand in the cell over that by which it was drawn
        drawn = chance[row, pick] - chance.max(axis=1) - np.log(sums[:, -1]) + np.log(FINE / (high - low))
        worth -= np.log(found[:, i] * np.log(high / low)) + drawn
        if number == w - 1:
            worth += each[row, pick]
    return found, worth


def _beside(v: Floats, base: Floats, tried: Floats) -> Floats:
    """(P, F) log evidence of columns (P, F, r, 2) beside (P, r, b) that are there."""
    log, U = orthogonal(base)
    T = np.einsum("prb,pfrk->pfbk", U, tried, optimize=True)
    left = v @ U
    g = np.einsum("r,pfrk->pfk", v, tried, optimize=True) - np.einsum("pb,pfbk->pfk", left, T)
    G = np.einsum("pfrk,pfrl->pfkl", tried, tried, optimize=True) - np.einsum("pfbk,pfbl->pfkl", T, T, optimize=True)
    A = {(0, 0): 1 + G[..., 0, 0], (1, 0): G[..., 1, 0], (1, 1): 1 + G[..., 1, 1]}
    return np.asarray((log + 0.5 * np.sum(left**2, axis=-1))[:, None] + evidence(A, [g[..., 0], g[..., 1]]))


def systematic(weight: Floats, count: int, random: np.random.Generator) -> Ints:
    """Indices (count,), each as often as its weight says."""
    marks = np.cumsum(weight)
    found = np.searchsorted(marks / marks[-1], (np.arange(count) + random.random()) / count)
    return np.minimum(found, len(weight) - 1).astype(np.int64)
