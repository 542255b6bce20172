"""Correlation between inputs, and draws from their joint distribution.

Inputs that nothing ties are drawn one by one. Tied ones are drawn jointly: normal ones as a multivariate normal (JCGM
101:2008 6.4.8), the means of simultaneous readings as a multivariate t (JCGM 102:2011 5.3.2), the columns of an earlier
sample row by row. Other distributions have no standard joint form: a Gaussian copula gives each its own distribution
and the pair the stated correlation coefficient (Cario and Nelson 1997, "NORmal To Anything").
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import scipy

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.points import Floats
from cmm_uq.maths.uncertainty.distributions import Distribution

Correlations = Mapping[tuple[str, str], float]
_ROUNDING = 1e-9


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
    if eigenvalues[0] < -_ROUNDING * len(names):
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
