"""How large an expansion is that error maps of one machine show, as one scale error among others that a map may have.

A map is one run of an interferometer, whose wavelength (air, laser, alignment) and whose reading of the scale's temperature
are as wrong as they are that day. So each map has a scale error of its own beside the expansion, however many positions it
has. How large such errors are is little known beforehand, and the k − 2 contrasts between k maps that no expansion makes say
something of it: the coefficient is averaged over what they leave open.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from scipy import linalg, special

from cmm_uq.analysis.diagnosis.comparison.conditional import Version
from cmm_uq.analysis.diagnosis.noise import NoiseKind
from cmm_uq.artefacts.error_maps.search import ColumnComparison
from cmm_uq.base.points import Floats
from cmm_uq.base.units import PPM, unit
from cmm_uq.machine.physics.effects.thermal import EXPANSION
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown
from cmm_uq.maths.inference.posterior import Density

Normals = tuple[Floats, Floats, Floats]
"""Normal distributions that are mixed: log weights, means, standard deviations, each (n,)."""

_FOLLOWED = 0.05
"""Probability of a combination, and of a kind of noise, from which it counts for the coefficient's distribution."""

_DRAWS = 20_000

_OWN_PPM = 2.0
"""Scale of the half-Cauchy prior (Gelman 2006) of the standard deviation of the maps' own scale errors, ppm: 0.2 K of a steel
scale's temperature, or 2 K of the air's, or 7 hPa of its pressure (the refractive index of air, Edlén)."""

_SIZES_PPM = np.geomspace(0.125, 64.0, 19)
"""Standard deviations that are tried, ppm."""

_LOG_SIGMA = np.linspace(-1.5, 1.5, 31)
"""About the likeliest ln σ, where the noise is integrated."""


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
    """Of each combination with each kind of noise, weighted by their probability."""
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
