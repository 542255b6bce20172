"""Waves of a reading in whitened observations: their columns, their evidence, and draws of their amplitudes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cmm_uq.points import Floats

CELLS = 4
"""Cells of frequency in one over the span of the readings."""

_BLOCK = 500
"""Draws at once."""


@dataclass(frozen=True, eq=False)
class Wave:
    """An error A·sin(2πf·x) + B·cos(2πf·x) of a reading x, f evenly distributed in its logarithm.

    Parameters
    ----------
    reading : (n,) mm.
    shown : (r, n) of a millimetre of error at each reading in r whitened observations.
    sd : of A and of B, mm.
    low, high : bounds of f, 1/mm.
    """

    reading: Floats
    shown: Floats
    sd: float
    low: float
    high: float

    @property
    def cells(self) -> Floats:
        """(c + 1,) their bounds."""
        span = max(float(np.ptp(self.reading)), 1.0 / self.high)
        count = int(np.ceil((self.high - self.low) * CELLS * span))
        return np.linspace(self.low, self.high, count + 1)

    def columns(self, frequency: Floats) -> Floats:
        """(…, r, 2) of frequencies (…), for one standard deviation of either."""
        angle = 2 * np.pi * frequency[..., None] * (self.reading - self._middle)
        waves = np.stack([np.sin(angle), np.cos(angle)], axis=-1)
        return np.asarray(self.sd * (self.shown @ waves))

    @property
    def _middle(self) -> float:
        return 0.5 * float(self.reading.min() + self.reading.max())

    def of_cells(self, bounds: Floats) -> Floats:
        """(c, r, 4) of cells: their middles, and changes for one standard deviation of the frequency."""
        x = self.reading - self._middle
        angle = np.pi * (bounds[1:] + bounds[:-1])[:, None] * x
        spread = 2 * np.pi * np.diff(bounds)[:, None] / np.sqrt(12) * x
        s, c = np.sin(angle), np.cos(angle)
        return np.asarray(self.sd * (self.shown @ np.stack([s, c, spread * c, -spread * s], axis=-1)))

    def beforehand(self) -> Floats:
        """(r, r) covariance of what observations show, of any frequency."""
        bounds = self.cells
        own = self.of_cells(bounds)[:, :, :2] * np.sqrt(mass(bounds, self))[:, None, None]
        own = own.transpose(1, 0, 2).reshape(own.shape[1], -1)
        return np.asarray(own @ own.T)

    def at_origin(self, frequency: Floats, coefficients: Floats) -> Floats:
        """Coefficients (N, 2), in standard deviations about the middle of the readings, as those about zero, in mm."""
        turn = 2 * np.pi * frequency * self._middle
        a, b = self.sd * coefficients.T
        return np.column_stack([a * np.cos(turn) + b * np.sin(turn), b * np.cos(turn) - a * np.sin(turn)])


def mass(bounds: Floats, wave: Wave) -> Floats:
    """Probabilities of cells beforehand."""
    return np.asarray(np.diff(np.log(bounds)) / np.log(wave.high / wave.low))


def evidence_of(v: Floats, waves: Sequence[Wave], frequency: Floats) -> Floats:
    """(N,) log of the evidence of frequencies (N, w), over that of no wave."""
    found = np.empty(len(frequency))
    for part, base in _columns(waves, frequency):
        log, U = orthogonal(base)
        found[part] = log + 0.5 * np.sum((v @ U) ** 2, axis=-1)
    return found


def coefficients_given(v: Floats, waves: Sequence[Wave], frequency: Floats, random: np.random.Generator) -> Floats:
    """(N, 2w) exact draws of the amplitudes of sine and cosine, mm, at frequencies (N, w)."""
    w = len(waves)
    found = np.empty((len(frequency), 2 * w))
    for part, base in _columns(waves, frequency):
        L = np.linalg.cholesky(np.eye(2 * w) + np.swapaxes(base, 1, 2) @ base)
        normal = np.linalg.solve(L, (v @ base)[:, :, None]) + random.standard_normal((len(base), 2 * w, 1))
        found[part] = np.linalg.solve(np.swapaxes(L, 1, 2), normal)[:, :, 0]
    turned = [wave.at_origin(frequency[:, i], found[:, 2 * i : 2 * i + 2]) for i, wave in enumerate(waves)]
    return np.hstack(turned)


def _columns(waves: Sequence[Wave], frequency: Floats) -> Iterator[tuple[slice, Floats]]:
    """Columns (…, r, 2w) of frequencies (N, w), block by block."""
    for begin in range(0, len(frequency), _BLOCK):
        part = slice(begin, begin + _BLOCK)
        yield part, np.concatenate([wave.columns(frequency[part, i]) for i, wave in enumerate(waves)], axis=2)


def orthogonal(base: Floats) -> tuple[float, Floats]:
    """−½ log det(1 + BᵀB), and U (…, r, b) with (1 + BBᵀ)⁻¹ = 1 − UUᵀ."""
    b = base.shape[-1]
    L = np.linalg.cholesky(np.eye(b) + np.swapaxes(base, -1, -2) @ base)
    U = np.swapaxes(np.linalg.solve(L, np.swapaxes(base, -1, -2)), -1, -2)
    return -np.log(np.einsum("...ii->...i", L)).sum(axis=-1), U


def evidence(A: dict[tuple[int, int], Floats], g: list[Floats]) -> Floats:
    """−½ log det A + ½ gᵀA⁻¹g of symmetric matrices by their entries, by elimination; A and g are used up."""
    k = len(g)
    square, det = np.zeros_like(g[0]), np.ones_like(g[0])
    for i in range(k):
        pivot = A[i, i]
        det = det * pivot
        square = square + g[i] ** 2 / pivot
        for j in range(i + 1, k):
            ratio = A[j, i] / pivot
            g[j] = g[j] - ratio * g[i]
            for m in range(i + 1, j + 1):
                A[j, m] = A[j, m] - ratio * A[m, i]
    return np.asarray(0.5 * square - 0.5 * np.log(det))
