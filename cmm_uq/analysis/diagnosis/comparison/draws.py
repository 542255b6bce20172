"""Noise drawn so that nothing but the recording's values decides it: no order of rows, no numbering, no direction of an axis.

What is drawn first is white, in the order of what the baseline leaves of the observations and along it; the symmetric root of
the covariance turns it into noise. Rows that are exchanged, numbered anew or mirrored then have the same noise as before.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from cmm_uq.analysis.diagnosis.comparison.evidence import CandidateComparison
from cmm_uq.analysis.diagnosis.noise import NoiseKind, probable_tails
from cmm_uq.base.points import Floats, Ints

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
        heavy = uniform[columns] < probability_of_tails(comparison, comparison.kinds[g])
        drawn[:, columns] = left_of_noise(
            comparison, comparison.kinds[g], random, comparison.sigma[size[columns]], heavy
        )
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
    comparison: CandidateComparison,
    kind: NoiseKind,
    random: np.random.Generator,
    sigma: Floats,
    heavy: NDArray[np.bool_] | None = None,
) -> Floats:
    """What the baseline leaves (m, draws), mm, of noise of one kind and sizes (draws,), in heavy tails where these are."""
    fine = kind.unrounded if comparison.display else None
    # of a stream of its own: the others stay as they are
    wider = None if heavy is None else tail_widths(random.spawn(1)[0], heavy, len(comparison.left))
    standing = order_and_side(comparison.left, comparison.reached)
    drawn = draw_noise(fine or kind, random, len(sigma), comparison.noise_scale, standing, wider)
    if comparison.certified.size:
        drawn += comparison.certified @ random.standard_normal((comparison.certified.shape[1], len(sigma)))
    if not (comparison.display and fine):
        return sigma * comparison.rest(drawn)
    drawn, scale = sigma * drawn, comparison.noise_scale[:, None]
    return comparison.rest(drawn + comparison.display.rounded(scale * drawn) / scale)


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
    turned = kind.whitening @ sparse.diags_array(1 / noise_scale)
    squares = turned @ turned.T
    length = np.sqrt(squares.diagonal())
    if abs(squares - sparse.diags_array(length**2)).max() <= _ORTHOGONAL * float(length.max()) ** 2:
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
    square = (dof - 2) / random.chisquare(dof, found.shape)
    found[:, heavy] = np.sqrt(square[:, heavy])
    return found


def order_and_side(left: Floats, reached: Floats) -> tuple[Ints, Floats]:
    """Order (m,) by size of what is left, then by what ``reached`` (m, q) takes, and its sign (m,): free of numbering."""
    size = float(np.sqrt(np.mean(left**2))) or 1.0
    keys = (left / size, np.sum(reached**2, axis=1), np.abs(left) / size)
    return np.lexsort([np.round(key, _DIGITS) for key in keys]), np.where(left < 0, -1.0, 1.0)
