"""Sums, tables, eigenvalues and precisions of many small arrays in few steps: a search asks for thousands of them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from cmm_uq.analysis.diagnosis.noise import NoiseKind
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass

_LEAST_PIVOT = 1e-3  # of a factor of one less what is taken: six digits of sixteen are lost there
_LARGEST_EXPONENT = 600.0  # of a factor that says how little something counts
_LEAST_BASE = 1e-300  # of a sum of squares that rounding took below it


def log_sum(log: Floats, axis: int) -> Floats:
    """Logarithm of sums of what has these finite logarithms, in the steps of ``scipy.special.logsumexp``."""
    largest = log.max(axis=axis, keepdims=True)
    most = log == largest
    count = most.sum(axis=axis, keepdims=True, dtype=np.float64)
    others = np.exp(np.where(most, -np.inf, log) - largest).sum(axis=axis, keepdims=True)
    return np.asarray((np.log1p(others / count) + np.log(count) + largest).squeeze(axis), dtype=np.float64)


def interpolated(at: Floats, nodes: Floats, values: Floats) -> Floats:
    """What ``np.interp`` gives for nodes (n,) at equal distances, which need no search; ``at`` is overwritten."""
    last = len(nodes) - 1
    at -= nodes[0]
    at *= last / (nodes[-1] - nodes[0])
    np.clip(at, 0, last, out=at)
    before = at.astype(np.intp)
    at -= before
    at *= np.append(np.diff(values), 0.0).take(before)
    at += values.take(before)
    return at


def log_sum_in(log: Floats, axis: int | tuple[int, ...]) -> Floats:
    """Logarithm of sums of what has these logarithms, which are overwritten; of each sum one is finite."""
    largest = log.max(axis=axis, keepdims=True)
    log -= largest
    np.exp(log, out=log)
    return np.asarray(np.log(log.sum(axis=axis)) + largest.squeeze(axis), dtype=np.float64)


def log_sum_of_powers(base: Floats, degrees: int, axis: int | tuple[int, ...]) -> Floats:
    """Logarithm of sums of bases, not negative but by rounding, to the power of −degrees/2; the bases are overwritten."""
    least = base.min(axis=axis, keepdims=True)
    if least.min() < _LEAST_BASE:
        np.maximum(base, _LEAST_BASE, out=base)
        np.maximum(least, _LEAST_BASE, out=least)
    # Numbers from nought to one, which are overwritten, to the power of degrees/2, by multiplications
    parts = np.divide(least, base, out=base)
    power, found = degrees // 2, np.sqrt(parts) if degrees % 2 else None
    while power:
        if power % 2:
            found = parts.copy() if found is None else np.multiply(found, parts, out=found)
        power //= 2
        if power:
            parts *= parts
    total = (np.ones_like(parts) if found is None else found).sum(axis=axis)
    return np.asarray(np.log(total) - 0.5 * degrees * np.log(least.squeeze(axis)), dtype=np.float64)


def eigen(blocks: Floats) -> tuple[Floats, Floats]:
    """Eigenvalues (…, r), vectors (…, r, r) of symmetric matrices; of two columns by Jacobi's rotation (Golub, Van Loan)."""
    if blocks.shape[-1] == 1:
        return blocks[..., 0], np.ones_like(blocks)
    if blocks.shape[-1] != 2:
        strengths, turn = np.linalg.eigh(blocks)
        return np.asarray(strengths), np.asarray(turn)
    first, second, twice = blocks[..., 0, 0], blocks[..., 1, 1], blocks[..., 0, 1] + blocks[..., 1, 0]
    apart = second - first
    length = np.abs(apart) + np.hypot(apart, twice)
    tangent = np.where(apart < 0, -twice, twice) / np.maximum(length, 1e-300)
    cosine = 1 / np.sqrt(1 + tangent**2)
    sine, shift = tangent * cosine, 0.5 * tangent * twice
    turn = np.stack([np.stack([cosine, sine], axis=-1), np.stack([-sine, cosine], axis=-1)], axis=-2)
    return np.stack([first - shift, second + shift], axis=-1), turn


def woodbury(gain: Floats, seen: Floats) -> tuple[Floats, Floats] | None:
    """What columns explain beside others, from what they explain by themselves (Woodbury's identity).

    ``gain`` (…, a, r) a²/(1 + a²λ) along each principal axis, of strength λ, for coefficients of standard deviation a;
    ``seen`` (…, r, 1 + g) what is seen along the axes of the data, and of rows of what is given (see ``Beside``). Gives
    the sum of squares (…, a) that is explained, and what is given's part (…, a) of half the logarithm of the
    determinant. ``None`` where digits would be lost, because what is given takes nearly all of the columns.
    """
    g = seen.shape[-1] - 1
    pairs = (seen[..., :, None] * seen[..., None, :]).reshape(*seen.shape[:-1], -1)
    whole = (gain @ pairs).reshape(*gain.shape[:-1], g + 1, g + 1)
    left, across = np.eye(g) - whole[..., 1:, 1:], whole[..., 1:, :1]
    try:
        pivots = np.einsum("...ii->...i", np.linalg.cholesky(left))
    except np.linalg.LinAlgError:
        return None
    if pivots.size and pivots.min() < _LEAST_PIVOT:
        return None
    explained = whole[..., 0, 0] + (across * np.linalg.solve(left, across)).sum(axis=(-2, -1))
    return explained, np.log(pivots).sum(axis=-1)


def log_diagonal(triangular: NDArray[np.floating[Any]]) -> float:
    """Logarithm of the determinant's amount of a triangular matrix (n, n)."""
    return float(np.log(np.abs(np.diag(triangular))).sum())


def squared(rows: Floats) -> Floats:
    """Products (…, r, r) of rows (…, r, g) with each other; of one or two, which abound, without a call for each matrix."""
    if rows.shape[-2] > 2:
        return np.asarray(rows @ rows.swapaxes(-1, -2))
    found = np.empty((*rows.shape[:-1], rows.shape[-2]))
    for i in range(rows.shape[-2]):
        for j in range(i + 1):
            found[..., i, j] = found[..., j, i] = np.einsum("...g,...g->...", rows[..., i, :], rows[..., j, :])
    return found


@dataclass(frozen=True, eq=False)
class SigmaIntegral:
    """Log of ∫ p(σ) σ^(−m') exp(−squares/2σ²) dσ: in closed form if ln σ is uniform, else from a table."""

    sigma: Floats  # sigma, log_sigma: (s,) grid, mm, and its log probability
    log_sigma: Floats
    degrees: int
    square: float

    def __call__(self, squares: Floats) -> Floats:
        np.maximum(squares, 1e-300, out=squares)
        np.log(squares, out=squares)
        if self.table is not None:
            return interpolated(squares, *self.table)
        squares *= -0.5 * self.degrees
        squares += self.uniform
        return squares

    def beside(self, squares: Floats, gain: Floats, square: Floats, constant: Floats, *, sizes: bool) -> Floats:
        """Log evidence (M, a, b) of members at every size, or (M, b) of all sizes together, summed over kinds of noise.

        ``squares`` (k, b) of the data; members with gains (k, M, a, r) explain of them the squares (k, M, r, b) along
        them; ``constant`` (k, M, a) to be added. In closed form constants are factors of the squares, which are few
        ahead of many data.
        """
        axes: int | tuple[int, ...] = 0 if sizes else (0, 2)
        if squares.shape[1] == 1:
            explained = np.einsum("kmar,kmr->kma", gain, square[..., 0])[..., None]
            return log_sum_in(self(squares[:, None, None, :] - explained) + constant[..., None], axes)
        every = np.broadcast_to(squares[:, None, None, :], (*square.shape[:2], 1, squares.shape[1]))
        whole = np.concatenate([square, every], axis=2)
        if self.table is not None or not self.degrees:
            left = np.concatenate([-gain, np.ones_like(gain[..., :1])], axis=3) @ whole
            return log_sum_in(np.add(self(left), constant[..., None], out=left), axes)
        half, most = 0.5 * self.degrees, float(constant.max())
        factor = np.exp(np.minimum((most - constant) / half, _LARGEST_EXPONENT))[..., None]
        left = np.concatenate([-factor * gain, factor], axis=3) @ whole
        if not sizes:
            return log_sum_of_powers(left, self.degrees, axes) + (most + self.uniform)
        # of versions that nothing parts the last digit chooses one: it stays the one that logarithms give
        np.log(np.maximum(left, 1e-300, out=left), out=left)
        left *= -half
        return log_sum_in(left, 0) + (most + self.uniform)

    @cached_property
    def uniform(self) -> float:
        """Constant of the gamma integral over a uniform ln σ."""
        half, step = 0.5 * self.degrees, float(np.log(self.sigma[1] / self.sigma[0]))
        return float(scipy.special.gammaln(half) + (half - 1) * np.log(2) + self.log_sigma[0] - np.log(step))

    @cached_property
    def table(self) -> tuple[Floats, Floats] | None:
        """Logarithms of squares and of the integrals over them; none where these have a closed form."""
        if np.ptp(self.log_sigma) == 0:
            return None
        nodes = np.linspace(-16.0, 8.0, 1500) + np.log(max(self.square, 1e-300))
        exponent = self.log_sigma - self.degrees * np.log(self.sigma) - 0.5 * np.exp(nodes)[:, None] / self.sigma**2
        return nodes, np.asarray(scipy.special.logsumexp(exponent, axis=1), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Precision:
    """Of one kind of noise, what the baseline reaches projected out.

    The precision of what is left is WᵀW − rowsᵀ·rows, with the whitening W (m, m); ``log``, the log probability less that of
    the determinant. ``basis`` (m, g) see :meth:`explained`.
    """

    whitening: scipy.sparse.csr_array
    rows: Floats
    log: float
    basis: Floats

    def white(self, columns: Floats) -> Floats:
        """Whitened columns (m, b)."""
        return np.asarray(self.whitening @ columns if self._diagonal is None else self._diagonal * columns)

    def __call__(self, columns: Floats) -> Floats:
        """Precision times columns (m, b)."""
        white = self.white(columns)
        whole = self.whitening.T @ white if self._diagonal is None else self._diagonal * white
        return np.asarray(whole - self.rows.T @ (self.rows @ columns), dtype=np.float64)

    def explained(self, white: Floats) -> Floats:
        """Of whitened observations (m, b), what the baseline takes, and what noise in common explains of the rest."""
        return np.asarray(self.basis @ (self.basis.T @ white), dtype=np.float64)

    @cached_property
    def _diagonal(self) -> Floats | None:
        """Of the whitening (m, 1), where it mixes no observations."""
        each = np.arange(self.whitening.shape[0])
        if self.whitening.nnz != len(each) or not np.array_equal(self.whitening.indices, each):
            return None
        return self.whitening.diagonal()[:, None]


def precisions(kinds: Sequence[NoiseKind], reached: Floats, certified: Floats) -> list[Precision]:
    """Of each kind of noise, the baseline's reach (m, q) projected out; ``certified`` (m, c) open by certificates."""
    found = []
    for kind in kinds:
        Q, R = np.linalg.qr(kind.white(reached))
        log = float(np.log(kind.probability)) + kind.log_factor + kind.log_whitening - log_diagonal(R)
        rows, basis = kind.whitening.T @ Q, Q
        shared = [columns for columns in (certified, kind.slow) if columns.size]
        if shared:
            white = kind.white(np.hstack(shared))
            white -= Q @ (Q.T @ white)
            factor = np.linalg.cholesky(np.eye(white.shape[1]) + white.T @ white)
            log -= log_diagonal(factor)
            own = np.linalg.solve(factor, white.T)
            rows, basis = np.hstack([rows, kind.whitening.T @ own.T]), np.hstack([Q, own.T])
        found.append(Precision(kind.whitening, np.asarray(rows.T, dtype=np.float64), log, basis))
    return found
