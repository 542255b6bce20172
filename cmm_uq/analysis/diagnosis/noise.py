"""Kinds of noise under which candidates are compared: shapes of its components, and heavy tails.

The noise belongs to the baseline: set-up offsets or slow drifts that are not modelled look like physics.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import sparse, special

from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.noise import NEGLIGIBLE, Components, Sizes

TAILS = 0.05  # probability of heavy tails
# The same for the test whether anything is missing, whose false alarms are promised whatever the tails are. Many series of
# routine measurements have longer tails than the normal distribution (Jeffreys 1938, Phil. Trans. A 237, 231; Hampel et al.
# 1986, Robust Statistics, 1.2c)
OFTEN = 0.25
_TAILS_DOF = 4.0
_SHRINK = (_TAILS_DOF - 2) / _TAILS_DOF  # square of the t distribution's scale over its standard deviation
# Residuals of which tails can be told, and logarithm of the ratio of likelihoods from which they are
_FEWEST, _BETTER = 15, 4.0
_SCALES = np.geomspace(0.3, 1.2, 40)  # of the t distribution, over the residuals' root mean square, that are tried
_NANOMETRE = 1e-6  # mm: of residuals that are smaller, as of exact figures, the last bits say nothing of tails
_STATED_IS_RIGHT = 0.9
_STATED_SPREAD = 0.2
_POINTS = 400


@dataclass(frozen=True, eq=False)
class NoiseKind:
    """One shape of the noise."""

    name: str
    # (m, m) sparse W; W times the part of such noise that is independent, over that of a reading, is white
    whitening: sparse.csr_array
    log_whitening: float  # logarithm of its determinant
    probability: float
    # (m, c) columns with standard normal coefficients that it has besides
    slow: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    log_factor: float = 0.0  # logarithm by which its density exceeds that of a normal distribution with this covariance
    unrounded: NoiseKind | None = None  # the same without the display's steps, where there are any
    # standard deviation of neighbouring readings about each other, over √2, over that of a reading alone
    scatter: float = 1.0

    def white(self, columns: Floats) -> Floats:
        """W times columns (m, b)."""
        return np.asarray(self.whitening @ columns, dtype=np.float64)

    def coloured(self, columns: Floats) -> Floats:
        """The inverse of W times columns (m, b)."""
        return np.asarray(sparse.linalg.splu(self.whitening.tocsc()).solve(columns), dtype=np.float64)

    def noise(self, random: np.random.Generator, draws: int) -> Floats:
        """Noise (m, draws) of this shape, a reading's standard deviation being one."""
        found = self.coloured(random.standard_normal((self.whitening.shape[0], draws)))
        return found + self.slow @ random.standard_normal((self.slow.shape[1], draws)) if self.slow.size else found


def shape_of(components: Components, sizes: Sizes, noise_scale: Floats, probability: float) -> NoiseKind:
    """A single draw of sizes as a kind of noise, over the noise scale (m,), for a reading noise of one."""
    variances, slow = components.variances(sizes)
    columns = components.waves(sizes) if np.any(slow) else np.zeros((0, 0))
    if components.time.size and components.quick(sizes)[0] > NEGLIGIBLE:
        variances, _ = components.variances(replace(sizes, slow=np.zeros(1)))
        columns = components.exact(sizes)
    v = (variances @ components.shares.T)[0]
    whitening = sparse.diags_array(1 / np.sqrt(v)) @ components.turn @ sparse.diags_array(noise_scale)
    log = float(np.log(noise_scale).sum() - 0.5 * np.log(v).sum())
    columns = columns / noise_scale[:, None] if columns.size else columns
    fine = replace(components, display=0.0) if components.display else None
    unrounded = shape_of(fine, sizes, noise_scale, probability) if fine else None
    return NoiseKind("components", sparse.csr_array(whitening), log, probability, columns, unrounded=unrounded)


def heavy_tails(residual: Floats) -> NoiseKind:
    """Student's t, four degrees, by its tangent at residuals (m,): a normal density below it, so never overstated."""
    scale = 1.4826 * float(np.median(np.abs(residual)))
    precision, log_factor = _tangent(residual / max(scale, _NANOMETRE))
    whitening = sparse.csr_array(sparse.diags_array(np.sqrt(precision)))
    return NoiseKind("tails", whitening, 0.5 * float(np.log(precision).sum()), TAILS, log_factor=log_factor)


def with_tails(kind: NoiseKind, residual: Floats, probability: float) -> NoiseKind:
    """A kind of noise whose independent part is of Student's t, by its tangent at whitened residuals."""
    precision, log_factor = _tangent(residual)
    whitening = sparse.csr_array(sparse.diags_array(np.sqrt(precision)) @ kind.whitening)
    log = kind.log_whitening + 0.5 * float(np.log(precision).sum())
    return replace(kind, name="tails", whitening=whitening, log_whitening=log, probability=probability,
                   log_factor=kind.log_factor + log_factor, unrounded=None)  # fmt: skip


def _tangent(residual: Floats) -> tuple[Floats, float]:
    """Precisions (m,) of the tangent at residuals (m,), and the sum by which ln t exceeds the normal density there."""
    squares, precision = residual**2 / _SHRINK, tail_precision(residual)
    log_t = special.gammaln((_TAILS_DOF + 1) / 2) - special.gammaln(_TAILS_DOF / 2) - 0.5 * np.log(np.pi * _TAILS_DOF)
    log_t = log_t - 0.5 * (_TAILS_DOF + 1) * np.log1p(squares / _TAILS_DOF) - 0.5 * np.log(_SHRINK)
    weight = precision * _SHRINK
    normal = -0.5 * np.log(2 * np.pi * _SHRINK / weight) - 0.5 * weight * squares
    return precision, float(np.sum(log_t - normal))


def tail_precision(residual: Floats) -> Floats:
    """Of the tangent of ln t, over that of a reading, at residuals over their standard deviation; largest at zero."""
    weight = (_TAILS_DOF + 1) / (_TAILS_DOF + residual**2 / _SHRINK)
    return np.asarray(weight / _SHRINK, dtype=np.float64)


def has_heavy_tails(residuals: Floats) -> bool:
    """Whether Student's t with four degrees of freedom describes residuals (n,) e⁴ times better than a normal distribution."""
    return len(residuals) >= _FEWEST and _tails_over_normal(residuals) > _BETTER


def probable_tails(residuals: Floats, often: float = OFTEN) -> float:
    """Probability that residuals (n,), each of the same variance, have heavy tails; ``often`` is it beforehand."""
    odds = often / (1 - often) * np.exp(min(_tails_over_normal(residuals), _BETTER))
    return float(odds / (1 + odds))


def _tails_over_normal(residuals: Floats) -> float:
    if not np.any(residuals):
        return 0.0
    z = residuals / np.sqrt(np.mean(residuals**2))
    t = np.outer(1 / _SCALES, z)
    log_t = (special.gammaln(2.5) - special.gammaln(2) - 0.5 * np.log(4 * np.pi) - 2.5 * np.log1p(t**2 / 4)).sum(axis=1)
    normal = -0.5 * len(z) * (np.log(2 * np.pi) + 1)
    return float((log_t - len(z) * np.log(_SCALES)).max() - normal)


def sigma_grid(stated: float | None, residual: float, least: float = 0.0) -> tuple[Floats, Floats]:
    """Noise (s,), mm, and log probabilities beforehand: a stated one mostly good to a fifth, else ln σ uniform."""
    centre = np.log(max(residual, least))
    grid, log_weight = np.linspace(centre - 4.0, centre + 1.5, _POINTS), np.full(_POINTS, -np.log(_POINTS))
    if stated is not None:
        at = np.log(stated)
        grid = np.unique(np.concatenate([grid, np.linspace(at - 5 * _STATED_SPREAD, at + 5 * _STATED_SPREAD, 60)]))
        right = np.exp(-0.5 * ((grid - at) / _STATED_SPREAD) ** 2) / _STATED_SPREAD
        weight = _STATED_IS_RIGHT * right + (1 - _STATED_IS_RIGHT) * np.exp(-0.5 * (grid - at) ** 2)
        log_weight = np.log(weight * np.gradient(grid) / np.sqrt(2 * np.pi))
    return np.exp(grid), np.where(np.exp(grid) >= least, log_weight, -np.inf) if least else log_weight


def probability_by_name(kinds: Sequence[NoiseKind], weight: Floats) -> dict[str, float]:
    """Probability of each name of ``kinds`` by their weights (k,)."""
    total = dict.fromkeys((kind.name for kind in kinds), 0.0)
    for kind, part in zip(kinds, weight, strict=True):
        total[kind.name] += float(part)
    return total
