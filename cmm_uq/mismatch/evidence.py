"""Marginal likelihoods of rival explanations, in closed form.

Everything enters linearly with a normal prior whose standard deviation is a multiple of the noise, so that the evidence of an
explanation depends on the data through one quadratic form; its integral over the noise is tabulated once, and the multiples
are summed over a grid. What the baseline (the job's model and what has been found already) could absorb is projected out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg, special

from cmm_uq.mismatch.explanations import Explanation
from cmm_uq.mismatch.noise import Kind
from cmm_uq.points import Floats, Ints

_AMPLITUDES = 7
_SMALLEST = 0.4
"""Smallest rms of an explanation that is considered, over the noise."""

_ABSORBED = 1e-5
"""Part of its length below which a column is the baseline's own."""

_BLOCK = 1_500_000


@dataclass(frozen=True, eq=False)
class _Members:
    """Members with the same number of columns, r, in whitened coordinates.

    ``owner`` (M,) is the explanation of each and ``weight`` (M,) its log probability within it; ``directions`` (M, r, m')
    are orthonormal, ``strengths`` (M, r) their variances for coefficients of one, ``amplitudes`` (M, a) the standard
    deviations of the coefficients to try, in units of the noise.
    """

    owner: Ints
    weight: Floats
    directions: Floats
    strengths: Floats
    amplitudes: Floats


@dataclass(frozen=True, eq=False)
class Comparison:
    """Explanations against "nothing is missing".

    Parameters
    ----------
    observed : (m,) observations over their noise scale, mm.
    baseline : (m, p) columns over their noise scale that may take any coefficient.
    kinds : of noise.
    sigma, log_sigma : (s,) grid of the noise, mm, and its log probability.
    explanations : rivals; columns in mm.
    noise_scale : (m,).
    least_noise : mm, the least that the noise may be; with it the largest coefficients are as large as physics allows.
    """

    observed: Floats
    baseline: Floats
    kinds: Sequence[Kind]
    sigma: Floats
    log_sigma: Floats
    explanations: Sequence[Explanation]
    noise_scale: Floats
    least_noise: float

    @cached_property
    def rest(self) -> Floats:
        """(m, m') orthonormal basis of what the baseline leaves."""
        if not self.baseline.shape[1]:
            return np.eye(len(self.observed))
        length = np.linalg.norm(self.baseline, axis=0)
        U, s, _ = linalg.svd(self.baseline / np.where(length > 0, length, 1.0), full_matrices=True)
        return np.asarray(U[:, int(np.sum(s > 1e-9 * s[0])) :], dtype=np.float64)

    @cached_property
    def left(self) -> Floats:
        """(m',) what the baseline leaves of the observations."""
        return self.rest.T @ self.observed

    @cached_property
    def factors(self) -> list[Floats]:
        """Lower triangular factor (m', m') of each kind's covariance."""
        return [
            np.eye(self.rest.shape[1])
            if kind.name == "white"
            else np.asarray(linalg.cholesky(self.rest.T @ kind.correlation @ self.rest, lower=True))
            for kind in self.kinds
        ]

    @cached_property
    def columns(self) -> list[tuple[int, float, Floats]]:
        """What the baseline leaves: explanation, log probability of the member within it, columns (m', r)."""
        found = []
        for owner, explanation in enumerate(self.explanations):
            weight = -np.log(len(explanation.members))
            for member in explanation.members:
                whole = member.columns / self.noise_scale[:, None]
                left = self.rest.T @ whole
                if linalg.norm(left) > _ABSORBED * linalg.norm(whole):
                    found.append((owner, weight, left))
        return found

    @cached_property
    def members(self) -> list[list[_Members]]:
        """All members by kind of noise, those with equally many columns together."""
        sizes = sorted({columns.shape[1] for _, _, columns in self.columns})
        return [[self._together(factor, r) for r in sizes] for factor in self.factors]

    def _together(self, factor: Floats, r: int) -> _Members:
        chosen = [item for item in self.columns if item[2].shape[1] == r]
        stacked = np.concatenate([columns for _, _, columns in chosen], axis=1)
        white = (
            linalg.solve_triangular(factor, stacked, lower=True).reshape(len(factor), len(chosen), r).transpose(1, 0, 2)
        )
        strengths, turn = np.linalg.eigh(white.transpose(0, 2, 1) @ white)
        strengths = np.maximum(strengths, strengths[:, -1:] * 1e-12)
        directions = np.ascontiguousarray(((white @ turn) / np.sqrt(strengths)[:, None, :]).transpose(0, 2, 1))
        rms = np.sqrt(strengths.sum(axis=1) / len(factor))
        largest = 1 / self.least_noise
        smallest = np.minimum(_SMALLEST / rms, largest)
        amplitudes = largest * (smallest / largest)[:, None] ** np.linspace(0, 1, _AMPLITUDES)
        owner, weight = np.array([item[0] for item in chosen]), np.array([item[1] for item in chosen])
        return _Members(owner, weight, directions, strengths, amplitudes)

    def squares(self, left: Floats) -> list[Floats]:
        """Sum of squares (b,) of data (m', b), whitened for each kind of noise."""
        return [np.sum(linalg.solve_triangular(factor, left, lower=True) ** 2, axis=0) for factor in self.factors]

    def over_sigma(self, squares: Floats) -> Floats:
        """Log of ∫ p(σ) σ^(−m') exp(−squares/2σ²) dσ, same shape, from a table over ln(squares)."""
        nodes, values = self._table
        return np.interp(np.log(np.maximum(squares, 1e-300)), nodes, values)

    @cached_property
    def _table(self) -> tuple[Floats, Floats]:
        nodes = np.linspace(-16.0, 8.0, 1500) + np.log(float(self.left @ self.left))
        exponent = self.log_sigma - len(self.left) * np.log(self.sigma) - 0.5 * np.exp(nodes)[:, None] / self.sigma**2
        return nodes, np.asarray(special.logsumexp(exponent, axis=1), dtype=np.float64)

    @cached_property
    def _log_kinds(self) -> list[float]:
        """Log probability of each kind, and the logarithm of its determinant taken off."""
        return [
            float(np.log(kind.probability) - np.log(np.diag(factor)).sum())
            for kind, factor in zip(self.kinds, self.factors, strict=True)
        ]

    def null(self, left: Floats) -> Floats:
        """Log evidence (kinds, b) of no explanation for data (m', b), noise priors included."""
        return np.stack([
            self.over_sigma(squares) + log for squares, log in zip(self.squares(left), self._log_kinds, strict=True)
        ])  # fmt: skip

    def noise_posterior(self) -> Floats:
        """Probability (kinds, s) of each kind and size of the noise, given nothing beyond the baseline."""
        log = np.stack([
            log + self.log_sigma - len(self.left) * np.log(self.sigma) - 0.5 * float(squares[0]) / self.sigma**2
            for squares, log in zip(self.squares(self.left[:, None]), self._log_kinds, strict=True)
        ])  # fmt: skip
        return np.asarray(np.exp(log - special.logsumexp(log)), dtype=np.float64)

    def log_evidence(self, left: Floats | None = None) -> tuple[Floats, Floats]:
        """Log evidence of nothing (b,) and of each explanation (c, b), for data (m', b), by default the recording's."""
        data = self.left[:, None] if left is None else left
        total = np.full((len(self.explanations), data.shape[1]), -np.inf)
        for factor, members, log in zip(self.factors, self.members, self._log_kinds, strict=True):
            white = linalg.solve_triangular(factor, data, lower=True)
            for some in members:
                self._add(total, some, white, log)
        return np.asarray(special.logsumexp(self.null(data), axis=0), dtype=np.float64), total

    def _add(self, total: Floats, members: _Members, white: Floats, log: float) -> None:
        """Add the evidence of members under one kind of noise to that of their explanations, in blocks."""
        squares = np.sum(white**2, axis=0)
        block = max(1, _BLOCK // (_AMPLITUDES * white.shape[1] * members.directions.shape[1]))
        for start in range(0, len(members.owner), block):
            part = slice(start, start + block)
            some = members.directions[part]
            projected = (some.reshape(-1, len(white)) @ white).reshape(*some.shape[:2], -1) ** 2
            ratio = members.amplitudes[part, :, None] ** 2 * members.strengths[part, None, :]  # (k, a, r)
            unexplained = squares - (ratio / (1 + ratio)) @ projected  # (k, a, b)
            log_each = self.over_sigma(unexplained) - 0.5 * np.log1p(ratio).sum(axis=2)[..., None] + log
            gains = special.logsumexp(log_each, axis=1) - np.log(_AMPLITUDES) + members.weight[part, None]
            for owner, gain in zip(members.owner[part], gains, strict=True):
                total[owner] = np.logaddexp(total[owner], gain)
