"""Type A evaluation from repeated readings and from a straight line; effective degrees of freedom and coverage factors.

Sources: JCGM 100:2008 4.2 (repeated readings), 5.2.3 and annex H.2 (simultaneous readings), annex H.3 (line by least
squares); JCGM 101:2008 6.4.9 and JCGM 102:2011 5.3.2 for the t distributions that Monte Carlo draws.

The formula of Welch and Satterthwaite (JCGM 100:2008 G.4.1) asks for independent inputs. Means of simultaneous readings are
not: their covariances rest on the same readings, and a quantity computed from them has the degrees of freedom of the set
(annex H.2, approach 2), whatever the correlation. So each set of correlated inputs with equal finite degrees of freedom
counts as one contribution here. Its known limits: it holds approximately, and poorly where a contribution with very few
degrees of freedom dominates or where the model is not linear (JCGM 100 G.4.1; JCGM 101 D.3; Ballico, Metrologia 37, 2000).

Correlation between inputs, and draws from their joint distribution.

Inputs that nothing ties are drawn one by one. Tied ones are drawn jointly: normal ones as a multivariate normal (JCGM
101:2008 6.4.8), the means of simultaneous readings as a multivariate t (JCGM 102:2011 5.3.2), the columns of an earlier
sample row by row. Other distributions have no standard joint form: a Gaussian copula gives each its own distribution
and the pair the stated correlation coefficient (Cario and Nelson 1997, "NORmal To Anything").
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import combinations

import numpy as np
import scipy

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, field
from cmm_uq.maths.uncertainty.distributions import Distribution, normal, student_t
from cmm_uq.maths.uncertainty.quantity import Quantity

Correlations = Mapping[tuple[str, str], float]
_ZERO = 1e-9


def correlation_matrix(names: Sequence[str], correlations: Correlations) -> Floats:
    """Matrix (m, m) from the coefficients of pairs; pairs that are not given are uncorrelated."""
    matrix = np.eye(len(names))
    for (a, b), r in correlations.items():
        where = f"correlation {a},{b}"
        for name in (a, b):
            if name not in names:
                raise CmmUqError(f"there is no input {name!r}", where=where, fix=suggestion(name, names))
        i, j = names.index(a), names.index(b)
        if i == j:
            raise CmmUqError("an input is not correlated with itself", where=where, fix="Leave the line out")
        if not abs(r) <= 1:
            raise CmmUqError(f"a correlation coefficient of {r}", where=where, fix="It lies between -1 and 1")
        if matrix[i, j] not in (0.0, r):
            raise CmmUqError("the pair is given twice", where=where, fix="Keep one of the two lines")
        matrix[i, j] = matrix[j, i] = r
    eigenvalues, vectors = np.linalg.eigh(matrix)
    if eigenvalues[0] < -_ZERO * len(names):
        involved = [name for name, weight in zip(names, vectors[:, 0], strict=True) if abs(weight) > 1e-6]
        raise CmmUqError(
            f"the correlations of {', '.join(involved)} contradict each other: the matrix is not positive semidefinite "
            f"(smallest eigenvalue {eigenvalues[0]:.3g})",
            where="correlation",
            fix="Give the coefficients with more digits, or mend the one that is wrong",
        )
    return matrix


def square_root(matrix: Floats) -> Floats:
    """L with L Lᵀ = matrix, also where the matrix is singular."""
    eigenvalues, vectors = np.linalg.eigh(matrix)
    return np.asarray(vectors * np.sqrt(np.maximum(eigenvalues, 0.0)))


def tied(matrix: Floats) -> list[list[int]]:
    """Groups of inputs that are correlated with each other, directly or through others; single inputs are groups too."""
    remaining, groups = set(range(len(matrix))), []
    while remaining:
        group, new = set(), {min(remaining)}
        while new:
            group |= new
            new = {int(j) for i in new for j in np.flatnonzero(matrix[i])} - group
        remaining -= group
        groups.append(sorted(group))
    return groups


def correlation_of(covariance: Floats) -> Floats:
    """Correlation matrix (p, p) of a covariance matrix; ``nan`` where an uncertainty is zero."""
    u = np.sqrt(np.diagonal(covariance))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(covariance / np.outer(u, u))


@dataclass(frozen=True, eq=False)
class Covariance:
    parameters: tuple[str, ...]  # k names
    units: tuple[str, ...]  # of each, as printed
    matrix: Floats  # (k, k); an element is in the product of the units of its row and column

    @classmethod
    def of_draws(cls, draws: Mapping[str, tuple[Floats, str]]) -> Covariance:
        """From joint draws (N,) of each parameter and its unit, by name."""
        columns = np.array([values for values, _ in draws.values()])
        matrix = np.atleast_2d(np.cov(columns)) if len(columns) else np.zeros((0, 0))
        return cls(tuple(draws), tuple(unit for _, unit in draws.values()), np.asarray(matrix, dtype=np.float64))


Draw = Callable[[np.random.Generator, int], Iterable[Floats]]
_HERMITE_NODES, _SEARCH_STEPS, _SERIES_REMAINDER = 80, 60, 2e-3


def joint_draws(
    inputs: Mapping[str, Distribution], matrix: Floats
) -> Callable[[np.random.Generator, int], list[Floats]]:
    """Function that draws all inputs together: ``draw(rng, n)`` gives one array (n,) an input."""
    names, given = list(inputs), list(inputs.values())
    linked = matrix != 0
    for i, a in enumerate(given):
        for j, b in enumerate(given):
            linked[i, j] |= bool(a.together) and a.together == b.together
    groups = [
        (group, _group_draw([names[i] for i in group], [given[i] for i in group], matrix[np.ix_(group, group)]))
        for group in tied(linked.astype(float))
    ]

    def draw(rng: np.random.Generator, n: int) -> list[Floats]:
        drawn: list[Floats] = [np.empty(0)] * len(given)
        for group, draw_group in groups:
            for i, values in zip(group, draw_group(rng, n), strict=True):
                drawn[i] = values
        return drawn

    return draw


def _group_draw(names: Sequence[str], inputs: Sequence[Distribution], matrix: Floats) -> Draw:
    if len(inputs) == 1:
        return lambda rng, n: [inputs[0].sample(rng, n)]
    for name, given in zip(names, inputs, strict=True):
        if given.kind == "constant":
            raise CmmUqError(f"{name} is a constant and is correlated with nothing", where="correlation")
    if all(given.together and given.together == inputs[0].together for given in inputs):
        columns = np.stack([given.draws for given in inputs if given.draws is not None])
        return lambda rng, n: columns[:, rng.integers(columns.shape[1], size=n)]
    if all(given.kind in ("normal", "t") for given in inputs) and len({float(given.dof) for given in inputs}) == 1:
        return _elliptical(inputs, matrix)
    return _copula(names, inputs, matrix)


def _elliptical(inputs: Sequence[Distribution], matrix: Floats) -> Draw:
    root, dof = square_root(matrix), float(inputs[0].dof)

    def draw(rng: np.random.Generator, n: int) -> list[Floats]:
        standard = root @ rng.standard_normal((len(inputs), n))
        if np.isfinite(dof):
            standard /= np.sqrt(rng.chisquare(dof, n) / dof)
        return [given.location + given.scale * z for given, z in zip(inputs, standard, strict=True)]

    return draw


def _copula(names: Sequence[str], inputs: Sequence[Distribution], matrix: Floats) -> Draw:
    underlying = np.eye(len(inputs))
    for i, j in combinations(range(len(inputs)), 2):
        r = _underlying_correlation((names[i], inputs[i]), (names[j], inputs[j]), matrix[i, j])
        underlying[i, j] = underlying[j, i] = r
    if np.linalg.eigvalsh(underlying)[0] < -1e-9:
        problem = f"the correlations of {', '.join(names)} cannot be had together with their distributions"
        fix = "Describe them by a joint sample, or by quantities that are independent"
        raise CmmUqError(problem, where="correlation", fix=fix)
    root = square_root(underlying)

    def draw(rng: np.random.Generator, n: int) -> list[Floats]:
        probabilities = _inside(scipy.special.ndtr(root @ rng.standard_normal((len(inputs), n))))
        return [given.quantile(p) for given, p in zip(inputs, probabilities, strict=True)]

    return draw


def _inside(probabilities: Floats) -> Floats:
    return np.clip(probabilities, np.finfo(float).tiny, 1 - np.finfo(float).epsneg)


def _underlying_correlation(a: tuple[str, Distribution], b: tuple[str, Distribution], wanted: float) -> float:
    """Correlation of two normal variables that gives the two transformed ones the wanted correlation."""
    if wanted == 0:
        return 0.0
    nodes, weights = scipy.special.roots_hermitenorm(_HERMITE_NODES)
    weights = weights / np.sqrt(2 * np.pi)
    inside = _inside(scipy.special.ndtr(nodes))
    orders = np.arange(1, _HERMITE_NODES // 2)
    basis = scipy.special.eval_hermitenorm(orders[:, None], nodes) / np.sqrt(scipy.special.factorial(orders))[:, None]
    # by Mehler's formula the covariance of the two is a power series in the correlation of the normal variables
    terms = np.prod([basis @ (weights * given.quantile(inside)) for _, given in (a, b)], axis=0)
    spread = float(a[1].standard_deviation) * float(b[1].standard_deviation)
    if not np.isfinite(spread):
        problem = f"{a[0]} or {b[0]} has no standard deviation (ν ≤ 2), hence no correlation"
        raise CmmUqError(problem, where="correlation")

    def reached(r: float) -> float:
        return float(np.sum(terms * r**orders) / spread)

    low, high = -1.0, 1.0
    if not reached(low) - _SERIES_REMAINDER <= wanted <= reached(high) + _SERIES_REMAINDER:
        raise CmmUqError(
            f"{a[1].kind} and {b[1].kind} distributions can have correlations from {reached(low):.3f} to "
            f"{reached(high):.3f} only, not {wanted}",
            where=f"correlation {a[0]},{b[0]}",
        )
    for _ in range(_SEARCH_STEPS):
        middle = (low + high) / 2
        low, high = (middle, high) if reached(middle) < wanted else (low, middle)
    return (low + high) / 2


_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class JointInputs:
    """Inputs that belong together, with the correlation of each pair; both go into a measurement model as they are."""

    inputs: Mapping[str, Distribution]
    correlation: Mapping[tuple[str, str], float] = field(default_factory=dict)


def repeated_readings(readings: Sequence[float] | Floats) -> Distribution:
    """Mean of n independent readings of one quantity: u = s/√n with n − 1 degrees of freedom (JCGM 100 4.2)."""
    return simultaneous_readings({"the quantity": readings}).inputs["the quantity"]


def simultaneous_readings(readings: Mapping[str, Sequence[float] | Floats]) -> JointInputs:
    """Means of quantities that were read together n times, in the same order, and their correlation (JCGM 100 annex H.2)."""
    table = _table(readings)
    n = table.shape[1]
    covariance = np.atleast_2d(np.cov(table)) / n
    return _joint(list(readings), table.mean(axis=1), covariance, lambda x, u: student_t(x, u, n - 1.0))


def multivariate_normal(names: Sequence[str], mean: Floats, covariance: Floats) -> JointInputs:
    """Normal quantities with a covariance matrix (JCGM 101 6.4.8); mean (m,), covariance (m, m)."""
    matrix = np.asarray(covariance, dtype=np.float64)
    if matrix.shape != (len(names), len(names)) or not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0):
        raise CmmUqError("the covariance matrix is not symmetric with one row a quantity", where=", ".join(names))
    if not np.all(np.diagonal(matrix) > 0):
        raise CmmUqError("a variance is not positive", where=", ".join(names), fix="Leave constants out of the matrix")
    return _joint(names, mean, matrix, normal)


def _joint(
    names: Sequence[str], mean: Floats, covariance: Floats, distribution: Callable[[float, float], Distribution]
) -> JointInputs:
    u, r = np.sqrt(np.diagonal(covariance)), np.clip(correlation_of(covariance), -1.0, 1.0)
    pairs = {(names[i], names[j]): float(r[i, j]) for j in range(len(names)) for i in range(j) if r[i, j] != 0}
    return JointInputs(
        {name: distribution(float(x), float(s)) for name, x, s in zip(names, mean, u, strict=True)}, pairs
    )


@dataclass(frozen=True, eq=False)
class StraightLine:
    """Straight line y = intercept + slope (x − reference) by least squares (JCGM 100 annex H.3)."""

    reference: float
    intercept: float
    slope: float
    covariance: Floats  # (2, 2) of intercept and slope
    residual_sd: float  # standard deviation of the residuals, n − 2 degrees of freedom
    dof: int

    def at(self, x: Floats | float) -> tuple[Floats, Floats]:
        """The line's value at x and its standard uncertainty, shape of x."""
        step = np.asarray(x, dtype=np.float64) - self.reference
        (v11, v12), (_, v22) = self.covariance
        return self.intercept + self.slope * step, np.sqrt(v11 + 2 * step * v12 + step**2 * v22)

    def inputs(self, intercept: str, slope: str) -> JointInputs:
        """Intercept and slope as correlated inputs of a measurement model."""
        estimates, dof = np.array([self.intercept, self.slope]), float(self.dof)
        return _joint([intercept, slope], estimates, self.covariance, lambda x, u: student_t(x, u, dof))


def straight_line(x: Sequence[float] | Floats, y: Sequence[float] | Floats, reference: float = 0.0) -> StraightLine:
    """Fit a line to readings y of equal, unknown uncertainty at positions x that are known (JCGM 100 annex H.3)."""
    table = _table({"x": x, "y": y})
    n = table.shape[1]
    step, readings = table[0] - reference, table[1]
    if n < 3 or np.ptp(step) == 0:
        raise CmmUqError("a line needs three points or more that are not all at the same place")
    design = np.column_stack([np.ones(n), step])
    q, r = np.linalg.qr(design)
    intercept, slope = np.linalg.solve(r, q.T @ readings)
    variance = float(np.sum((readings - design @ [intercept, slope]) ** 2) / (n - 2))
    inverse = np.linalg.inv(r)
    return StraightLine(reference, float(intercept), float(slope), variance * inverse @ inverse.T, variance**0.5, n - 2)


def _table(readings: Mapping[str, Sequence[float] | Floats]) -> Floats:
    lengths = {name: np.size(column) for name, column in readings.items()}
    if len(set(lengths.values())) != 1:
        told = ", ".join(f"{name} {n}" for name, n in lengths.items())
        raise CmmUqError(f"the numbers of readings differ: {told}", fix="Give one reading of each quantity at a time")
    table = np.array([np.asarray(column, dtype=np.float64) for column in readings.values()])
    for name, column in zip(readings, table, strict=True):
        if len(column) < 2:
            problem = f"{len(column)} reading of {name} says nothing of its scatter"
            raise CmmUqError(problem, fix="Read it at least twice")
        if not np.all(np.isfinite(column)):
            raise CmmUqError(f"a reading of {name} is not finite")
        if np.ptp(column) == 0:
            fix = "Their scatter is below the resolution: state that as a rectangular input"
            raise CmmUqError(f"all readings of {name} are the same", fix=fix)
    return table


def effective_dof(contributions: Floats, matrix: Floats, dof: Sequence[Floats | float], variance: Floats) -> Floats:
    """Effective degrees of freedom (p, ...) of the outputs, infinite where all that contributes is known.

    ``contributions``: (p, m, ...) sensitivity × standard uncertainty of each input, with its sign. ``matrix``: (m, m)
    correlation of the inputs. ``dof``: m degrees of freedom, floats or (...). ``variance``: (p, ...) combined variance,
    which may hold further terms of infinite degrees of freedom. A set of correlated inputs whose degrees of freedom differ
    was not read simultaneously; the formula does not cover it, and the smallest of them is taken for the whole set.
    """
    # fourth powers leave a double's range long before u does; a power of two in common changes no digit of the ratio
    _, exponent = np.frexp(np.max(np.abs(contributions), initial=0.0))
    contributions, variance = np.ldexp(contributions, -exponent), np.ldexp(variance, -2 * exponent)
    known = [bool(np.all(np.isinf(nu))) for nu in dof]
    denominator = np.zeros_like(variance)
    for group in tied(matrix):
        doubtful = [i for i in group if not known[i]]
        if not doubtful:
            continue
        part = contributions[:, doubtful]
        together = np.einsum("pi...,ij,pj...->p...", part, matrix[np.ix_(doubtful, doubtful)], part)
        nu = np.min(np.broadcast_arrays(*(np.asarray(dof[i], dtype=np.float64) for i in doubtful)), axis=0)
        denominator += together**2 / nu
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(denominator > 0, variance**2 / denominator, np.inf)


def coverage_factor(dof: Floats | float, coverage: float) -> Floats:
    """K for a symmetric interval: the t quantile for ν truncated to an integer (JCGM 100 G.4.1, G.6.4), shape of ``dof``."""
    check_coverage(coverage)
    nu = np.asarray(dof, dtype=np.float64)
    truncated = np.floor(nu * (1 + _ROUNDING))
    if np.any(truncated < 1) or np.any(np.isnan(nu)):
        fix = "Repeat the readings that dominate the uncertainty"
        raise CmmUqError(f"{float(np.min(nu)):.3g} effective degrees of freedom support no coverage interval", fix=fix)
    p = (1 + coverage) / 2
    # a t quantile with very many degrees of freedom is that of the normal distribution
    many = truncated > 1e10
    return np.asarray(np.where(many, scipy.special.ndtri(p), scipy.special.stdtrit(np.where(many, 1.0, truncated), p)))


def factor_of_noise(noise: Quantity, u_noise: float = 1.0, u_known: float = 0.0) -> float:
    """K for 95 % of what is uncertain by a noise whose size is itself uncertain, and besides by what is known well."""
    more = float(np.hypot(u_noise, u_known)) / u_noise if u_noise > 0 else np.inf
    return float(coverage_factor(noise.degrees_of_freedom * more**4, 0.95))


def check_coverage(coverage: float) -> None:
    if not 0 < coverage < 1:
        raise CmmUqError(f"a coverage probability of {coverage}", fix="It lies between 0 and 1, such as 0.95")
