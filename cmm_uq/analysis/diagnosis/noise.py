"""Kinds of noise under which candidates are compared: heavy tails, and a few weighted shapes that stand for all components."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, UNKNOWN, Explanation
from cmm_uq.base.points import Floats
from cmm_uq.base.units import unit
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.maths.inference.linear_model import LeastSquares, LinearModel, Unknown
from cmm_uq.maths.inference.marginal import Marginal
from cmm_uq.maths.inference.noise import NEGLIGIBLE, SLOW, Components, Sizes
from cmm_uq.maths.inference.presence import beginning, present

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
    name: str
    # (m, m) sparse W; W times the part of such noise that is independent, over that of a reading, is white
    whitening: scipy.sparse.csr_array
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
        return np.asarray(scipy.sparse.linalg.splu(self.whitening.tocsc()).solve(columns), dtype=np.float64)

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
    whitening = scipy.sparse.diags_array(1 / np.sqrt(v)) @ components.turn @ scipy.sparse.diags_array(noise_scale)
    log = float(np.log(noise_scale).sum() - 0.5 * np.log(v).sum())
    columns = columns / noise_scale[:, None] if columns.size else columns
    fine = replace(components, display=0.0) if components.display else None
    unrounded = shape_of(fine, sizes, noise_scale, probability) if fine else None
    return NoiseKind("components", scipy.sparse.csr_array(whitening), log, probability, columns, unrounded=unrounded)


def heavy_tails(residual: Floats) -> NoiseKind:
    """Student's t, four degrees, by its tangent at residuals (m,): a normal density below it, so never overstated."""
    scale = 1.4826 * float(np.median(np.abs(residual)))
    precision, log_factor = _tangent(residual / max(scale, _NANOMETRE))
    whitening = scipy.sparse.csr_array(scipy.sparse.diags_array(np.sqrt(precision)))
    return NoiseKind("tails", whitening, 0.5 * float(np.log(precision).sum()), TAILS, log_factor=log_factor)


def with_tails(kind: NoiseKind, residual: Floats, probability: float) -> NoiseKind:
    """A kind of noise whose independent part is of Student's t, by its tangent at whitened residuals."""
    precision, log_factor = _tangent(residual)
    whitening = scipy.sparse.csr_array(scipy.sparse.diags_array(np.sqrt(precision)) @ kind.whitening)
    log = kind.log_whitening + 0.5 * float(np.log(precision).sum())
    return replace(kind, name="tails", whitening=whitening, log_whitening=log, probability=probability,
                   log_factor=kind.log_factor + log_factor, unrounded=None)  # fmt: skip


def _tangent(residual: Floats) -> tuple[Floats, float]:
    """Precisions (m,) of the tangent at residuals (m,), and the sum by which ln t exceeds the normal density there."""
    squares, precision = residual**2 / _SHRINK, tail_precision(residual)
    gammaln = scipy.special.gammaln
    log_t = gammaln((_TAILS_DOF + 1) / 2) - gammaln(_TAILS_DOF / 2) - 0.5 * np.log(np.pi * _TAILS_DOF)
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
    log_t = (
        scipy.special.gammaln(2.5) - scipy.special.gammaln(2) - 0.5 * np.log(4 * np.pi) - 2.5 * np.log1p(t**2 / 4)
    ).sum(axis=1)
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


SHAPES, KEPT = 512, 7  # how many are drawn from the prior, and how many stand for all
# Drawn from what the recording says, with and without something missing; how many draws must matter for none of these
_MORE, _ENOUGH = 256, 32
_SLOW = 0.5  # probability of slow noise from which it is asked what the noise is beside a jump
_TRIED = 600  # draws by which it is found what the recording says of them, in each round
_READINGS = 24  # sizes of the reading noise that are tried beside a display's steps


@dataclass(frozen=True, eq=False)
class Shapes:
    """Latent numbers (n, d) of shapes for a reading noise of 1 mm, and their weights (n,), one in sum, for an average."""

    latent: Floats
    weight: Floats


def representative_kinds(
    linear: LinearModel, components: Components, estimate: LeastSquares, rivals: Floats, residuals: Floats,
    jumps: Floats | None = None,
) -> list[NoiseKind]:  # fmt: skip
    """Noise that a recording could show, from residuals (m,), mm, what could be missing and what may jump with time."""
    components = _for_a_unit(Marginal(linear, components, estimate))
    either = Marginal(linear, components, estimate), _beside(linear, components, estimate, rivals)
    taken = (0.0, _determined(linear, rivals, estimate.sigma_of_residuals))
    few = [_Density.of(*each, components.fewer) for each in zip(either, taken, strict=True)]
    shapes = Shapes(drawn_shapes(components), np.full(SHAPES, 1 / SHAPES))
    shares = [density.share(shapes) for density in few]
    if SLOW in components.possible and min(1 / np.sum(share**2) for share in shares) < _ENOUGH:
        quick, densities = np.mean(shares, axis=0) @ components.fewer.quick(components.sizes(shapes.latent)), few
        if quick >= NEGLIGIBLE:
            densities = [_Density.of(*each, components) for each in zip(either, taken, strict=True)]
        shapes = _more(shapes, few, densities)
        shares = [density.share(shapes) for density in densities]
    sizes = components.sizes(shapes.latent)
    if jumps is not None and jumps.shape[1] and np.mean(shares, axis=0)[sizes.slow > 0].sum() > _SLOW:
        used_up = _determined(linear, jumps, estimate.sigma_of_residuals)
        shares.append(_Density.of(_beside(linear, components, estimate, jumps), used_up, components).share(shapes))
    kept, weight = _representative(sizes, shapes.weight, np.mean(shares, axis=0))
    found = []
    for i, w in zip(kept, weight, strict=True):
        shape = shape_of(components, components.sizes(shapes.latent[[i]]), linear.noise_scale, (1 - TAILS) * w)
        found.append(replace(shape, scatter=float(np.exp(shapes.latent[i, 0]))))
    return [*found, heavy_tails(residuals / linear.noise_scale)]


def _for_a_unit(marginal: Marginal) -> Components:
    components = marginal.noise
    if not components.display:
        return components
    most = max(marginal.estimate.sigma_of_residuals, 2 * components.least)
    reading = np.geomspace(components.least, most, _READINGS)
    latent = _latent(components, np.zeros((_READINGS, components.dimension - 1)))
    latent[:, 0] += np.log(reading)
    log, squares = marginal.log_likelihood(components.sizes(latent))
    return replace(components, display=components.display / float(reading[np.argmax(log - 0.5 * squares)]))


def drawn_shapes(components: Components) -> Floats:
    """Latent numbers (n, d) of shapes for a reading noise of 1 mm, spread evenly over their prior; the first is white."""
    d = components.dimension
    numbers = np.zeros((SHAPES, d - 1))
    if d > 1:
        # a lattice by powers of the root of x^d = x + 1 (Roberts 2018), which leaves no gaps in any dimension
        root = 1.5
        for _ in range(30):
            root = (1 + root) ** (1 / d)
        steps = root ** -np.arange(1.0, d)
        numbers = scipy.special.ndtri(np.clip((0.5 + np.outer(np.arange(SHAPES), steps)) % 1, 1e-6, 1 - 1e-6))
    return _latent(components, numbers)


@dataclass(frozen=True, eq=False)
class _Density:
    """Of shapes, the reading noise integrated out."""

    marginal: Marginal  # with the noise in its own size, not that for a unit
    sigma: float  # mm, near which the reading noise is
    count: float  # observations that are left for the noise

    @classmethod
    def of(cls, marginal: Marginal, taken: float, components: Components) -> _Density:
        """Of a model's marginal density, ``taken`` observations being used up by rivals, with components for a unit."""
        sigma, count = marginal.estimate.sigma_of_residuals or 1.0, max(marginal.estimate.degrees_of_freedom - taken, 1)
        return cls(replace(marginal, noise=replace(components, display=sigma * components.display)), sigma, count)

    def log_probability(self, shapes: Floats) -> Floats:
        """Of each shape (n,): the sum of squares has a gamma distribution given the shape."""
        at = shapes.copy()
        at[:, 0] += np.log(self.sigma)
        log, squares = self.marginal.log_likelihood(self.marginal.noise.sizes(at))
        value = log - 0.5 * self.count * np.log(np.maximum(squares, 1e-12))
        return np.where(np.isfinite(value), value, -np.inf)

    def share(self, shapes: Shapes) -> Floats:
        """(n,) probability of each shape, in place of all."""
        log = self.log_probability(shapes.latent) + np.log(len(shapes.weight) * shapes.weight)
        return np.asarray(np.exp(log - scipy.special.logsumexp(log)))

    def __call__(self, numbers: Floats) -> Floats:
        """Log density (w,) of the standard normal numbers (w, d − 1) behind the ratios."""
        held = np.where(np.isfinite(numbers), numbers, 0.0)
        log = self.log_probability(_latent(self.marginal.noise, held)) - 0.5 * np.sum(held**2, axis=1)
        return np.asarray(log, dtype=np.float64)


def _latent(components: Components, numbers: Floats) -> Floats:
    """With the first, which makes the reading noise 1 mm: (w, d) of (w, d − 1)."""
    found = np.column_stack([np.zeros(len(numbers)), numbers])
    found[:, 0] = components.log_scatter(found)
    return found


def _more(shapes: Shapes, few: Sequence[_Density], densities: Sequence[_Density]) -> Shapes:
    """With draws from what is proposed for the densities; all together count as drawn from the mixture of what drew them."""
    n, d = shapes.latent.shape
    components = densities[0].marginal.noise
    near = present(few[0], beginning(components.names[1:]), 0, tried=_TRIED)
    proposals = []
    for seed, density in enumerate(densities):  # beside rivals it costs the more, and lies near that without them
        near = near if density is few[0] else present(density, near, seed, 1, _TRIED)
        proposals.append(near)
    random = np.random.RandomState(np.random.MT19937(np.random.SeedSequence(len(proposals))))
    drawn = [proposal.parameters(proposal.draws(_MORE, random)) for proposal in proposals]
    numbers = np.vstack([shapes.latent[:, 1:], *drawn])
    prior = -0.5 * np.sum(numbers**2, axis=1) - 0.5 * (d - 1) * np.log(2 * np.pi)
    by_any = [prior + np.log(n), *(proposal.log_probability(numbers) + np.log(_MORE) for proposal in proposals)]
    weight = np.exp(prior - scipy.special.logsumexp(by_any, axis=0))
    return Shapes(_latent(components, numbers), weight / weight.sum())


def _representative(sizes: Sizes, prior: Floats, share: Floats) -> tuple[list[int], Floats]:
    """Shapes that stand for all, and their weights: those of what each stands for (systematic resampling)."""
    table = np.column_stack(
        [np.where(sizes.slow > 0, sizes.rate, -1), sizes.slow, sizes.placing, sizes.growth, sizes.reading]
    )
    _, first, index = np.unique(np.round(table, 9), axis=0, return_index=True, return_inverse=True)
    before, part = (np.bincount(index.ravel(), each, len(first)) for each in (prior, share))
    part = 0.9 * part / part.sum() + 0.1 * before
    certain = KEPT * part >= 1
    rest, places, taken = np.where(certain, 0.0, part), max(KEPT - int(certain.sum()), 0), np.zeros(len(part))
    if places and rest.sum() > 0:
        upper = np.cumsum(rest / rest.sum() * places)
        taken = np.floor(upper + 0.5) - np.floor(np.append(0.0, upper[:-1]) + 0.5)
        taken = taken * rest.sum() / (places * np.where(rest > 0, rest, 1.0))
    weight = np.where(certain, 1.0, taken) * before
    chosen = np.flatnonzero(weight > 0)
    return first[chosen].tolist(), np.asarray(weight[chosen], dtype=np.float64)


def _determined(linear: LinearModel, rivals: Floats, sigma: float) -> float:
    """How many coefficients of columns (m, r) with standard deviation one a recording determines beside its model."""
    if not rivals.shape[1]:
        return 0.0
    rest = unreached(linear, rivals)
    strengths = np.linalg.eigvalsh(rest.T @ linear.reduce(rivals)) / max(sigma, _NANOMETRE) ** 2
    return float(np.sum(np.maximum(strengths, 0.0) / (1 + np.maximum(strengths, 0.0))))


def unreached(linear: LinearModel, columns: Floats) -> Floats:
    """What a model leaves of columns (m, r), mm, in units of the noise scale."""
    basis, s, _ = np.linalg.svd(linear.reduced.design, full_matrices=False)
    basis, rest = basis[:, s > 1e-9 * s.max(initial=0.0)], linear.reduce(columns)
    return np.asarray(rest - basis @ (basis.T @ rest))


def _beside(linear: LinearModel, noise: Components, estimate: LeastSquares, rivals: Floats) -> Marginal:
    """Of the model with columns (m, r) besides, whose coefficients have standard deviation one."""
    count = rivals.shape[1]
    more = tuple(Unknown(("rival", str(i)), unit("1"), 0.0, 1.0, 1.0) for i in range(count))
    wider = replace(linear, design=np.hstack([linear.design, rivals]), unknowns=(*linear.unknowns, *more))
    return Marginal(wider, noise, replace(estimate, value=np.append(estimate.value, np.zeros(count))))


_FEW = 2  # columns


def noise_kinds(model: RecordingModel, candidates: Sequence[Explanation]) -> list[NoiseKind]:
    estimate = model.estimate()
    linear, fitted, residuals = estimate.linear, estimate.least_squares, estimate.least_squares.residuals
    effects = [e for e in candidates if e.kind == EFFECT and not e.shaped]
    doubled = [e.effect is not None and e.effect.of_artefact and len(e.effect.coefficients) <= _FEW for e in effects]
    none = np.zeros((len(residuals), 0))
    rivals = [none, *(e.members[0].columns for e, twice in zip(effects, doubled, strict=True) if not twice)]
    # without a degree of freedom the recording says nothing of its noise, and what is stated holds
    components = noise_of(model if model.sigma is None or not fitted.degrees_of_freedom else replace(model, sigma=None))
    left, jumps = linear.reduce(residuals[:, None])[:, 0], [none]
    for function in [each for each in candidates if each.kind == UNKNOWN and each.covariate_name == "time_s"]:
        if steps := [member.columns for member in function.members if member.columns.shape[1] == 1]:
            rest = unreached(linear, np.hstack(steps))
            squares = np.sum(rest**2, axis=0)
            taken = (left @ rest) ** 2 / np.where(squares > 0, squares, np.inf)
            jumps.append(steps[int(taken.argmax())])
    return representative_kinds(linear, components, fitted, np.hstack(rivals), residuals, np.hstack(jumps))
