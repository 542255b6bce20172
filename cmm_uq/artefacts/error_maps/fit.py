"""How error maps of one machine differ, their squareness, and how large an expansion is that they show.

A map is one run of an interferometer, whose wavelength and whose reading of the scale's temperature are as wrong as they
are that day: each map has a scale error of its own beside the expansion. How large such errors are is little known
beforehand, and the k − 2 contrasts between k maps that no expansion makes say something of it; the coefficient is averaged
over the rest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, special

from cmm_uq.analysis.diagnosis.comparison.conditional import Version
from cmm_uq.analysis.diagnosis.noise import NoiseKind
from cmm_uq.analysis.screening.columns import Finding
from cmm_uq.artefacts.error_maps.search import ColumnComparison
from cmm_uq.base.messages import Text, Verbatim, commas, number, say, signed
from cmm_uq.base.points import Floats
from cmm_uq.base.units import ARCSECOND, PPM, unit
from cmm_uq.certificate.document import Column, Section, Table
from cmm_uq.machine.physics.effects.thermal import EXPANSION
from cmm_uq.machine.physics.error_map import ErrorMap
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown
from cmm_uq.maths.inference.posterior import Density

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


def squareness_data(maps: Sequence[ErrorMap]) -> list[dict[str, float]]:
    """Of each map for ``results.json``, ″; empty where no map states any."""
    if not _stated(maps):
        return []
    return [{"temperature_c": m.temperature, **m.squareness_arcsec} for m in _by_temperature(maps)]


def squareness_findings(maps: Sequence[ErrorMap]) -> list[Finding]:
    if not _stated(maps):
        return []
    same: dict[tuple[float, ...], list[float]] = {}
    for m in _by_temperature(maps):
        same.setdefault(tuple(m.squareness.tolist()), []).append(m.temperature)
    return [
        Finding(
            "copied",
            (),
            (),
            say(
                "squareness: the maps at {temperatures} °C give the same figures. They were measured once, and say "
                "nothing of how it changes; measure it at each temperature",
                temperatures=commas(number(t, "g") for t in temperatures),
            ),
        )
        for temperatures in same.values()
        if len(temperatures) > 1
    ]


def squareness_sections(maps: Sequence[ErrorMap]) -> tuple[Section, ...]:
    if not _stated(maps):
        return ()
    ordered = _by_temperature(maps)
    figures = np.array([m.squareness for m in ordered]) / ARCSECOND
    rows: list[tuple[Text, ...]] = [
        (say("{temperature:g}\u00a0°C", temperature=m.temperature), *(signed(value, ".5g") for value in row))
        for m, row in zip(ordered, figures, strict=True)
    ]
    rows.append((say("Largest less smallest"), *(number(value, ".5g") for value in np.ptp(figures, axis=0))))
    heads = (
        Column(say("Map"), numeric=False),
        *(Column(say("{pair} / ″", pair=Verbatim(pair))) for pair in ("XY", "YZ", "ZX")),
    )
    note = say(
        "There is one figure a map, without an uncertainty: whether they differ is not tested. One "
        "arc second moves a point by 2.4 µm over 500 mm."
    )
    return (Section(say("Squareness of the axes"), (Table(say("Squareness"), heads, tuple(rows), (note,)),)),)


def _stated(maps: Sequence[ErrorMap]) -> bool:
    return any(m.squareness.any() for m in maps)


def _by_temperature(maps: Sequence[ErrorMap]) -> list[ErrorMap]:
    return sorted(maps, key=lambda m: m.temperature)


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
