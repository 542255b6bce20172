"""The noise under which candidates are compared: a few shapes of it that stand for all that it could be.

A shape is the noise of sizes in proportion to the reading noise. Many are drawn from their prior, evenly; those that matter,
whether or not something is missing, are kept, each with a weight that makes their sum an unbiased estimate of the integral
over all. The noise belongs to the baseline: set-up offsets or slow drifts that are not modelled look like physics.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import sparse, special

from cmm_uq.inference.least_squares import LeastSquares
from cmm_uq.inference.linear_model import LinearModel, Unknown
from cmm_uq.inference.marginal import Marginal
from cmm_uq.inference.noise import Components, Sizes
from cmm_uq.points import Floats
from cmm_uq.units import unit

SHAPES, KEPT = 512, 7
"""How many are drawn, and how many stand for them."""

TAILS = 0.05
"""Probability of heavy tails."""

_TAILS_DOF = 4.0
_SHRINK = (_TAILS_DOF - 2) / _TAILS_DOF
"""Square of the t distribution's scale over its standard deviation."""

_STATED_IS_RIGHT = 0.9
_STATED_SPREAD = 0.2
_POINTS = 400


@dataclass(frozen=True, eq=False)
class Kind:
    """One shape of the noise.

    Parameters
    ----------
    name : ``components`` or ``tails``.
    whitening : (m, m) sparse W; W times the part of such noise that is independent, over that of a reading, is white.
    log_whitening : logarithm of its determinant.
    probability : beforehand.
    slow : (m, c) columns with standard normal coefficients that it has besides.
    log_factor : logarithm by which its density exceeds that of a normal distribution with this covariance.
    """

    name: str
    whitening: sparse.csr_array
    log_whitening: float
    probability: float
    slow: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    log_factor: float = 0.0

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


def kinds(
    linear: LinearModel, components: Components, estimate: LeastSquares, rivals: Floats, residuals: Floats
) -> list[Kind]:
    """Shapes of the noise that a recording could show.

    Parameters
    ----------
    linear : what is explained.
    components : of the noise.
    estimate : least squares of ``linear``.
    rivals : (m, r) columns, mm, of what could be missing, for coefficients of standard deviation one.
    residuals : (m,) of the estimate, mm.
    """
    components = _for_a_unit(components, estimate.sigma_of_residuals)
    shapes = drawn_shapes(components)
    wide = Marginal(_with_rivals(linear, rivals), components, _without_rivals(estimate, rivals.shape[1]))
    share = np.mean([_probability(Marginal(linear, components, estimate), shapes), _probability(wide, shapes)], axis=0)
    kept, weight = _representative(components.sizes(shapes), share)
    scale = linear.noise_scale
    found = [
        shape_of(components, components.sizes(shapes[[i]]), scale, (1 - TAILS) * w)
        for i, w in zip(kept, weight, strict=True)
    ]
    return [*found, tails(residuals / scale)]


def _for_a_unit(components: Components, scatter: float) -> Components:
    """The components with the display's step over the reading noise that the residuals leave it."""
    step = components.display
    if not step:
        return components
    reading = max(np.sqrt(max(scatter**2 - step**2 / 12, 0.0)), components.least)
    return replace(components, display=step / reading)


def drawn_shapes(components: Components) -> Floats:
    """Latent numbers (n, d) of shapes for a reading noise of 1 mm, spread evenly over their prior; the first is white."""
    d = components.dimension
    found = np.zeros((SHAPES, d))
    if d > 1:
        # a lattice by powers of the root of x^d = x + 1 (Roberts 2018), which leaves no gaps in any dimension
        root = 1.5
        for _ in range(30):
            root = (1 + root) ** (1 / d)
        steps = root ** -np.arange(1.0, d)
        found[:, 1:] = special.ndtri(np.clip((0.5 + np.outer(np.arange(SHAPES), steps)) % 1, 1e-6, 1 - 1e-6))
    found[:, 0] = components.log_scatter(found)
    return found


def _probability(marginal: Marginal, shapes: Floats) -> Floats:
    """Of each shape (n,), the reading noise integrated out: the sum of squares has a gamma distribution given the shape."""
    at, sigma = shapes.copy(), marginal.estimate.sigma_of_residuals or 1.0
    at[:, 0] += np.log(sigma)
    marginal = replace(marginal, noise=replace(marginal.noise, display=sigma * marginal.noise.display))
    log, squares = marginal.log_likelihood(marginal.noise.sizes(at))
    count = max(marginal.estimate.degrees_of_freedom, 1)
    value = log - 0.5 * count * np.log(np.maximum(squares, 1e-12))
    value = np.where(np.isfinite(value), value, -np.inf)
    return np.asarray(np.exp(value - special.logsumexp(value)))


def _representative(sizes: Sizes, share: Floats) -> tuple[list[int], Floats]:
    """Shapes that stand for all, and their weights: those of what each stands for (systematic resampling)."""
    table = np.column_stack(
        [sizes.reading, sizes.placing, sizes.growth, sizes.slow, np.where(sizes.slow > 0, sizes.rate, 0)]
    )
    _, first, index, count = np.unique(
        np.round(table, 9), axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    part = np.bincount(index.ravel(), share, len(first))
    part = 0.9 * part / part.sum() + 0.1 * count / count.sum()
    expected = KEPT * part
    certain = expected >= 1
    rest = np.where(certain, 0.0, part)
    places = max(KEPT - int(certain.sum()), 0)
    taken = np.zeros(len(part))
    if places and rest.sum() > 0:
        upper = np.cumsum(rest / rest.sum() * places)
        taken = np.floor(upper + 0.5) - np.floor(np.append(0.0, upper[:-1]) + 0.5)
        taken = taken * rest.sum() / (places * np.where(rest > 0, rest, 1.0))
    weight = np.where(certain, 1.0, taken) * count / count.sum()
    chosen = np.flatnonzero(weight > 0)
    return first[chosen].tolist(), weight[chosen]


def shape_of(components: Components, sizes: Sizes, noise_scale: Floats, probability: float) -> Kind:
    """A single draw of sizes as a kind of noise, over the noise scale (m,), for a reading noise of one."""
    variances, slow = components.variances(sizes)
    v = (variances @ components.shares.T)[0]
    whitening = sparse.diags_array(1 / np.sqrt(v)) @ components.turn @ sparse.diags_array(noise_scale)
    columns = components.slow * np.sqrt(slow[0]) / noise_scale[:, None] if np.any(slow) else np.zeros((0, 0))
    log = float(np.log(noise_scale).sum() - 0.5 * np.log(v).sum())
    return Kind("components", sparse.csr_array(whitening), log, probability, columns)


def _with_rivals(linear: LinearModel, rivals: Floats) -> LinearModel:
    more = tuple(Unknown(("rival", str(i)), unit("1"), 0.0, 1.0, 1.0) for i in range(rivals.shape[1]))
    return replace(linear, design=np.hstack([linear.design, rivals]), unknowns=(*linear.unknowns, *more))


def _without_rivals(estimate: LeastSquares, count: int) -> LeastSquares:
    return replace(estimate, value=np.append(estimate.value, np.zeros(count)))


def tails(residual: Floats) -> Kind:
    """Student's t with four degrees of freedom, by its tangent at residuals (m,) over the noise scale.

    ln t is convex in the square of its argument, so that the tangent is a normal density below it, wherever it touches: the
    evidence of this kind is never overstated. (σ stays the standard deviation of a reading.)
    """
    scale = 1.4826 * float(np.median(np.abs(residual)))
    squares = (residual / max(scale, 1e-300)) ** 2 / _SHRINK
    weight = (_TAILS_DOF + 1) / (_TAILS_DOF + squares)
    log_t = special.gammaln((_TAILS_DOF + 1) / 2) - special.gammaln(_TAILS_DOF / 2) - 0.5 * np.log(np.pi * _TAILS_DOF)
    log_t = log_t - 0.5 * (_TAILS_DOF + 1) * np.log1p(squares / _TAILS_DOF) - 0.5 * np.log(_SHRINK)
    normal = -0.5 * np.log(2 * np.pi * _SHRINK / weight) - 0.5 * weight * squares
    log_whitening = 0.5 * float(np.log(weight / _SHRINK).sum())
    whitening = sparse.csr_array(sparse.diags_array(np.sqrt(weight / _SHRINK)))
    return Kind("tails", whitening, log_whitening, TAILS, log_factor=float(np.sum(log_t - normal)))


def sigma_grid(stated: float | None, residual: float, least: float = 0.0) -> tuple[Floats, Floats]:
    """Values (s,) of the noise, mm, and their log probabilities beforehand.

    A stated value is mostly good to a fifth, and now and then simply wrong; without one, the logarithm is uniform.

    Parameters
    ----------
    stated : as the job states it.
    residual : standard deviation of what the baseline leaves.
    least : of the noise, whatever the residuals say; 0 where there is none.
    """
    centre = np.log(max(residual, least))
    grid = np.linspace(centre - 4.0, centre + 1.5, _POINTS)
    grid, log_weight = _grid(stated, grid)
    return np.exp(grid), np.where(np.exp(grid) >= least, log_weight, -np.inf) if least else log_weight


def _grid(stated: float | None, grid: Floats) -> tuple[Floats, Floats]:
    """Logarithms (s,) of the noise and their log probabilities, on a grid that holds a stated value too."""
    if stated is None:
        return grid, np.full(_POINTS, -np.log(_POINTS))
    at = np.log(stated)
    grid = np.unique(np.concatenate([grid, np.linspace(at - 5 * _STATED_SPREAD, at + 5 * _STATED_SPREAD, 60)]))
    right = np.exp(-0.5 * ((grid - at) / _STATED_SPREAD) ** 2) / _STATED_SPREAD
    wrong = np.exp(-0.5 * (grid - at) ** 2)
    weight = _STATED_IS_RIGHT * right + (1 - _STATED_IS_RIGHT) * wrong
    return grid, np.log(weight * np.gradient(grid) / np.sqrt(2 * np.pi))


def named(kinds: Sequence[Kind], weight: Floats) -> dict[str, float]:
    """Probability of each name of ``kinds`` by their weights (k,)."""
    total: dict[str, float] = {}
    for kind, part in zip(kinds, weight, strict=True):
        total[kind.name] = total.get(kind.name, 0.0) + float(part)
    return total
