"""Error maps of one machine against each other: the rivals for how they differ, and how large an expansion they show.

Every error of every carriage is a free function of position, the same in all maps; what is left is how the maps differ. Each
map starts anywhere, and a straightness points anywhere. The rivals for what is left: the scale expands; the function changes
in proportion to the temperature; one map differs, by a smooth function of position.

A map is one run of an interferometer, whose wavelength and whose reading of the scale's temperature are as wrong as they
are that day: each map has a scale error of its own beside the expansion. How large such errors are is little known
beforehand, and the k − 2 contrasts between k maps that no expansion makes say something of it; the coefficient is averaged
over the rest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse, special

from cmm_uq.analysis.diagnosis.comparison.combinations import Combinations, Key, explore
from cmm_uq.analysis.diagnosis.comparison.conditional import Version
from cmm_uq.analysis.diagnosis.comparison.evidence import CandidateComparison
from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, UNKNOWN, Explanation, Member, smooth_functions
from cmm_uq.analysis.diagnosis.comparison.lack_of_fit import lack_of_fit
from cmm_uq.analysis.diagnosis.noise import TAILS, NoiseKind, heavy_tails
from cmm_uq.artefacts.error_maps.columns import MapColumn, roughness
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import PPM, REFERENCE_TEMPERATURE, unit
from cmm_uq.base.values import dataclass
from cmm_uq.machine.physics.effects.thermal import EXPANSION, SCALE_EXPANSION
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown
from cmm_uq.maths.inference.posterior import Density

WHITE = "white"


def kinds_along(chain: Ints, white: float, correlations: Sequence[float]) -> list[NoiseKind]:
    """Kinds of noise of readings (m,) in the order of their positions.

    ``chain`` (m,) readings with one number follow each other.
    """
    identity = sparse.csr_array(sparse.eye_array(len(chain)))
    share = (1 - white) / len(correlations)
    return [NoiseKind(WHITE, identity, 0.0, white - TAILS), *(_correlated(phi, chain, share) for phi in correlations)]


def _correlated(phi: float, chain: Ints, probability: float) -> NoiseKind:
    """First-order autoregression along each chain."""
    m, innovation = len(chain), np.sqrt(1 - phi**2)
    follows = np.append(False, chain[1:] == chain[:-1])
    diagonal = np.where(follows, 1 / innovation, 1.0)
    after = np.flatnonzero(follows)
    rows, columns = np.append(np.arange(m), after), np.append(np.arange(m), after - 1)
    values = np.append(diagonal, np.full(len(after), -phi / innovation))
    whitening = sparse.csr_array((values, (rows, columns)), shape=(m, m))
    return NoiseKind("correlated", whitening, float(np.log(diagonal).sum()), probability)


_SIGMAS = 300
_ASSERTED = 0.8  # probability from which an effect is asserted: what one map that is off can imitate is not

# noise of a map: its readings are taken one after the other in one run, while interferometer and air drift
_WHITE, _CORRELATIONS = 0.5, (0.4, 0.6, 0.8, 0.9)


@dataclass(frozen=True, eq=False)
class CandidateCause:
    """An explanation of how the maps of a column differ: over the maps (k,), and over position (p, r) mm."""

    name: Text
    short: Text  # its name beside the column's
    over_maps: Floats
    functions: tuple[Floats, ...]
    map: int | None = None  # is the one that differs, if one does
    effect: str | None = None  # the effect's name, if it is one


@dataclass(frozen=True, eq=False)
class ColumnComparison:
    """One column with the rivals for how its maps differ.

    The observations are the k − 1 orthonormal contrasts between the maps at each position: the function that they share is
    gone, and white noise is white still.
    """

    column: MapColumn  # what is compared
    rivals: tuple[CandidateCause, ...]  # that compete for how the maps differ
    given: tuple[CandidateCause, ...]  # what the job knows of how they differ; of any size
    seed: int  # of the null distribution and the draws

    @cached_property
    def contrasts(self) -> Floats:
        """(k − 1, k) orthonormal."""
        return np.asarray(linalg.null_space(np.ones((1, len(self.column.values)))).T, dtype=np.float64)

    @cached_property
    def observed(self) -> Floats:
        """((k − 1)·p,) mm."""
        return np.asarray(self.contrasts @ self.column.values, dtype=np.float64).ravel()

    def seen(self, over_maps: Floats, function: Floats) -> Floats:
        """What the observations show (m, r) of a function (p, r) that counts in each map as ``over_maps`` (k,) says."""
        return np.asarray(np.kron((self.contrasts @ over_maps)[:, None], function), dtype=np.float64)

    @cached_property
    def baseline(self) -> Floats:
        """Where each map starts, where a straightness points, and the expansion that the job names (m, b)."""
        place, maps = self.column.positions - self.column.positions.mean(), np.eye(len(self.column.values))
        columns = [self.seen(one, np.ones((len(place), 1))) for one in maps]
        if self.column.is_straightness:
            columns += [self.seen(one, place[:, None]) for one in maps]
        return np.hstack([*columns, *(self.seen(rival.over_maps, rival.functions[0]) for rival in self.given)])

    @cached_property
    def comparison(self) -> CandidateComparison:
        m, p = len(self.observed), len(self.column.positions)
        rough = roughness(self.column)
        Q = linalg.orth(self.baseline / np.linalg.norm(self.baseline, axis=0).clip(1e-300))
        left = self.observed - Q @ (Q.T @ self.observed)
        sigma = np.geomspace(rough / 10, 4 * max(rough, float(left.std())), _SIGMAS)
        noises = kinds_along(np.repeat(np.arange(m // p), p), _WHITE, _CORRELATIONS)
        explanations = [
            Explanation(
                rival.name,
                EFFECT if rival.effect else UNKNOWN,
                tuple(Member(self.seen(rival.over_maps, f), values=f) for f in rival.functions),
            )
            for rival in self.rivals
        ]
        # no heavy tails in what is drawn: p-values are corrected for all columns, and few draws do not tell that far a tail
        return CandidateComparison(
            self.observed, self.baseline, [*noises, heavy_tails(left)], sigma, np.full(_SIGMAS, -np.log(_SIGMAS)),
            explanations, np.ones(m), rough, often_heavy=0.0,
        )  # fmt: skip

    @cached_property
    def p_value(self) -> float:
        return lack_of_fit(self.comparison, self.seed)[0]

    @cached_property
    def combinations(self) -> Combinations:
        return explore(self.comparison)

    @cached_property
    def best(self) -> Key:
        probability = self.combinations.probability
        return max(probability, key=lambda key: probability[key])

    @cached_property
    def versions(self) -> tuple[Version, ...]:
        return self.combinations.by_key[self.best].versions

    @cached_property
    def effect(self) -> int | None:
        return next(
            (i for i, rival in enumerate(self.rivals) if rival.effect and self.combinations.of(i) >= _ASSERTED), None
        )

    @cached_property
    def unknown(self) -> tuple[int, ...]:
        return tuple(sorted(i for i in self.best if not self.rivals[i].effect))

    def instead(self, least: float) -> tuple[int, ...]:
        """Rivals at least as probable as this that are not in the most probable combination, the most probable first."""
        others = [i for i in range(len(self.rivals)) if i not in self.best and self.combinations.of(i) >= least]
        return tuple(sorted(others, key=lambda i: -self.combinations.of(i)))

    def columns_of(self, versions: Sequence[Version]) -> tuple[Floats, Floats]:
        """Columns (m, r) of some versions, and the standard deviation of each coefficient over the noise (r,)."""
        explanations = self.comparison.explanations
        columns = [explanations[v.explanation].members[v.member].columns for v in versions]
        spread = [np.full(c.shape[1], v.amplitude) for c, v in zip(columns, versions, strict=True)]
        return np.hstack([np.zeros((len(self.observed), 0)), *columns]), np.concatenate([np.zeros(0), *spread])


def column_comparison(column: MapColumn, named: Sequence[str], seed: int) -> ColumnComparison:
    rivals: list[CandidateCause] = []
    given: list[CandidateCause] = []
    place, temperatures = column.positions, column.temperatures
    functions = tuple(smooth_functions(place))
    changes = float(np.ptp(temperatures)) > 0
    if column.is_scale and changes:
        scale, excess = SCALE_EXPANSION[column.axis], temperatures - REFERENCE_TEMPERATURE
        short, grown = say("{title:small}", title=scale.title), (EXPANSION.prior_sd * place[:, None],)
        expansion = CandidateCause(Verbatim(scale.name), short, excess, grown, effect=scale.name)
        (given if scale.name in named else rivals).append(expansion)
    if len(temperatures) == 2:
        short = say("difference of the two maps")
        name = say("{error}, difference of the two maps", error=column.title)
        rivals.append(CandidateCause(name, short, np.array([-0.5, 0.5]), functions))
    else:
        if changes:
            share = (temperatures - temperatures.mean()) / np.ptp(temperatures)
            short = say("in proportion to the temperature")
            name = say("{error}, in proportion to the temperature", error=column.title)
            rivals.append(CandidateCause(name, short, share, functions))
        for k, one in enumerate(np.eye(len(temperatures))):
            short = say("in the map at {temperature:g} °C", temperature=temperatures[k])
            name = say("{error} in the map at {temperature:g} °C", error=column.title, temperature=temperatures[k])
            rivals.append(CandidateCause(name, short, one, functions, map=k))
    return ColumnComparison(column, tuple(rivals), tuple(given), seed)


BLOCKS = 5  # parts of the travel that are held out in turn
_LEAST_NOISE = 1e-7  # mm; figures that agree to their last digit have no less


def function(compared: ColumnComparison, index: int) -> tuple[Floats, Floats]:
    """An unknown function of the best combination at the positions, and its standard uncertainty, mm, each (p,).

    A straightness is about its best line; anything else is zero where a map begins, nearest to the origin.
    """
    columns, spread = _given(compared, compared.versions)
    sigma = _sigma(compared, compared.versions, compared.observed, np.arange(len(compared.observed)))
    precision = columns.T @ columns / sigma**2 + np.diag(1 / (spread * sigma) ** 2)
    covariance = np.linalg.inv(precision)
    mean = covariance @ (columns.T @ compared.comparison.rest(compared.observed[:, None])[:, 0]) / sigma**2
    begin = 0
    for version in compared.versions:
        values = compared.comparison.explanations[version.explanation].members[version.member].values
        if version.explanation == index:
            break
        begin += values.shape[1]
    part = slice(begin, begin + values.shape[1])
    if compared.column.is_straightness:
        place = compared.column.positions - compared.column.positions.mean()
        lines = np.column_stack([np.ones_like(place), place])
        values = values - lines @ np.linalg.lstsq(lines, values, rcond=None)[0]
    else:
        values = values - values[np.argmin(np.abs(compared.column.positions))]
    return values @ mean[part], np.sqrt(np.einsum("pi,ij,pj->p", values, covariance[part, part], values))


def held_out(compared: ColumnComparison, versions: Sequence[Version]) -> tuple[Floats, Floats]:
    """Errors (m,), mm, of predictions of parts of the travel from the rest, and log predictive densities (blocks,)."""
    p = len(compared.column.positions)
    block = np.tile(np.arange(p) * min(BLOCKS, p // 2) // p, len(compared.observed) // p)
    errors, densities = np.zeros(len(compared.observed)), []
    columns, spread = compared.columns_of(versions)
    covariance = np.eye(len(compared.observed)) + (columns * spread**2) @ columns.T
    for k in np.unique(block):
        out, kept = block == k, block != k
        sigma = _sigma(compared, versions, compared.observed, np.flatnonzero(kept))
        factor = linalg.cho_factor(covariance[np.ix_(kept, kept)])
        across = linalg.cho_solve(factor, covariance[np.ix_(kept, out)]).T
        known = compared.baseline[kept]
        weighed = linalg.cho_solve(factor, known)
        free = np.linalg.pinv(known.T @ weighed, rcond=1e-10, hermitian=True)
        level = free @ (weighed.T @ compared.observed[kept])
        error = (
            compared.observed[out] - compared.baseline[out] @ level - across @ (compared.observed[kept] - known @ level)
        )
        open_to = compared.baseline[out] - across @ known
        spread_out = covariance[np.ix_(out, out)] - across @ covariance[np.ix_(kept, out)] + open_to @ free @ open_to.T
        lower = sigma * np.linalg.cholesky(spread_out)
        white = np.linalg.solve(lower, error)
        errors[out] = error
        densities.append(-0.5 * white @ white - np.log(np.diag(lower)).sum() - 0.5 * len(error) * np.log(2 * np.pi))
    return errors, np.array(densities)


def residual(compared: ColumnComparison, versions: Sequence[Version]) -> Floats:
    """What is left of the observations (m,), mm."""
    if not versions:
        return compared.comparison.rest(compared.observed[:, None])[:, 0]
    columns, spread = _given(compared, versions)
    left = compared.comparison.rest(compared.observed[:, None])[:, 0]
    mean = np.linalg.solve(columns.T @ columns + np.diag(1 / spread**2), columns.T @ left)
    return left - columns @ mean


def noise_of(compared: ColumnComparison, versions: Sequence[Version]) -> tuple[float, int]:
    """Variance of a reading once versions are given, mm², and its degrees of freedom."""
    every = np.arange(len(compared.observed))
    return _sigma(compared, versions, compared.observed, every) ** 2, compared.comparison.degrees_of_freedom


def _given(compared: ColumnComparison, versions: Sequence[Version]) -> tuple[Floats, Floats]:
    columns, spread = compared.columns_of(versions)
    return compared.comparison.rest(columns), spread


def _sigma(compared: ColumnComparison, versions: Sequence[Version], observed: Floats, rows: NDArray[np.intp]) -> float:
    """Noise of some rows, mm, once versions are given."""
    columns, spread = compared.columns_of(versions)
    Q = linalg.orth(compared.baseline[rows] / np.linalg.norm(compared.baseline[rows], axis=0).clip(1e-300))
    left, columns = observed[rows] - Q @ (Q.T @ observed[rows]), columns[rows] - Q @ (Q.T @ columns[rows])
    covariance = np.eye(len(rows)) + (columns * spread**2) @ columns.T
    squares = float(left @ linalg.solve(covariance, left, assume_a="pos"))
    return max(float(np.sqrt(squares / max(len(rows) - Q.shape[1], 1))), _LEAST_NOISE)


# normal distributions that are mixed: log weights, means, standard deviations, each (n,)
Normals = tuple[Floats, Floats, Floats]

# probability of a combination, and of a kind of noise, from which it counts for the coefficient's distribution
_FOLLOWED = 0.05

_DRAWS = 20_000

# scale of the half-Cauchy prior (Gelman 2006) of the standard deviation of the maps' own scale errors, ppm: 0.2 K of
# a steel scale's temperature, or 2 K of the air's, or 7 hPa of its pressure (the refractive index of air, Edlén)
_OWN_PPM = 2.0

_SIZES_PPM = np.geomspace(0.125, 64.0, 19)  # standard deviations that are tried, ppm
_LOG_SIGMA = np.linspace(-1.5, 1.5, 31)  # about the likeliest ln σ, where the noise is integrated


def expansion(compared: ColumnComparison, index: int) -> Floats:
    """Draws (n,) of an effect's coefficient, 1/K; rivals, kinds of noise and own scale errors count by their probability.

    None where no combination of rivals that has the effect is probable.
    """
    found = list(_weighted(compared, index))
    if not found:
        return np.zeros(0)
    log, mean, sd = (np.concatenate(each) for each in zip(*found, strict=True))
    weight = special.softmax(log)
    random = np.random.default_rng(compared.seed)
    # systematic draws of the mixture: of each normal as many as it is probable
    places = (np.arange(_DRAWS) + random.random()) / _DRAWS
    chosen = np.searchsorted(np.cumsum(weight), places).clip(max=len(weight) - 1)
    return np.asarray(mean[chosen] + sd[chosen] * random.standard_normal(_DRAWS))


def _weighted(compared: ColumnComparison, index: int) -> Iterator[Normals]:
    linear = [_linear(compared, index, size) for size in _SIZES_PPM]
    for key, probability in compared.combinations.probability.items():
        if index not in key or probability < _FOLLOWED:
            continue
        versions = compared.combinations.by_key[key].versions
        for kind, share in zip(compared.comparison.kinds, compared.comparison.noise_probability(versions), strict=True):
            if share <= _FOLLOWED:
                continue
            whiten = _whitening(compared, kind, versions, index)
            found = [_normals(model.uncorrelated(whiten), size) for model, size in zip(linear, _SIZES_PPM, strict=True)]
            log, mean, sd = (np.concatenate(each) for each in zip(*found, strict=True))
            yield np.log(probability * share) + log - special.logsumexp(log), mean, sd


def _linear(compared: ColumnComparison, index: int, size: float) -> LinearModel:
    """The coefficient, and scale errors of the maps' contrasts with a standard deviation ``size``, ppm."""
    rival, place = compared.rivals[index], compared.column.positions
    (function,) = rival.functions
    own = np.kron(np.eye(len(compared.contrasts)), PPM * place[:, None])
    first = Unknown((str(rival.effect), EXPANSION.name), EXPANSION.unit, 0.0, EXPANSION.prior_sd, EXPANSION.prior_sd)
    others = [Unknown(("map", str(i)), unit("ppm"), 0.0, size, size) for i in range(own.shape[1])]
    design = np.hstack([compared.seen(rival.over_maps, function) / EXPANSION.prior_sd, own])
    count = np.ones(len(compared.observed))
    return LinearModel(compared.observed, design, (first, *others), compared.baseline, count, None)


def _normals(model: LinearModel, size: float) -> Normals:
    """What a model says of the coefficient for each size of the noise, the maps' own scale errors of ``size`` ppm."""
    density, own = Density(model), len(model.unknowns) - 1
    likeliest = density.laplace()[0][-1]
    given = [density.conditional(float(likeliest + step)) for step in _LOG_SIGMA]
    prior = -own * np.log(size) + np.log(size) - np.log1p((size / _OWN_PPM) ** 2)
    mean, variance = (np.array(each) for each in zip(*((m[0], c[0, 0]) for m, c, _ in given), strict=True))
    return np.array([log for *_, log in given]) + prior, mean, np.sqrt(variance)


def _whitening(
    compared: ColumnComparison, kind: NoiseKind, versions: Sequence[Version], index: int
) -> Callable[[Floats], Floats]:
    """What whitens noise of one kind together with the given rivals but one."""
    columns, spread = compared.columns_of([v for v in versions if v.explanation != index])
    factor = kind.coloured(np.eye(len(compared.observed)))
    lower = np.linalg.cholesky(factor @ factor.T + (columns * spread**2) @ columns.T)
    return lambda some: np.asarray(linalg.solve_triangular(lower, some, lower=True), dtype=np.float64)
