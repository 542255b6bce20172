"""Expected standard uncertainties of a plan under its noise: generalised least squares, for every size of the noise at once.

The weights of least squares are those of the noise, as in the posterior of a recording that shows it. Sums over observations
are made of columns that are orthonormal under white noise, so that no noise makes them worse than itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from cmm_uq.analysis.planning.information import certified, scales
from cmm_uq.analysis.planning.noise import PlannedNoise
from cmm_uq.base.points import Floats
from cmm_uq.machine.model import MeasurementModel
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.maths.inference.freedoms import reached
from cmm_uq.maths.inference.least_squares import RANK_TOLERANCE
from cmm_uq.maths.inference.linear_model import LinearModel
from cmm_uq.maths.inference.noise import Components, Sizes

_ROUNDING = 1e-9
_ZERO = 1e-8


@dataclass(frozen=True, eq=False)
class Expected:
    """Standard uncertainties (k,) of each parameter, in its unit.

    Parameters
    ----------
    u : of the least-squares estimate, infinite where the placings leave it free; as :meth:`PlannedNoise.spread` averages.
    with_prior : the same when what physics allows is used too.
    """

    u: Floats
    with_prior: Floats


def expected(model: MeasurementModel, noise: PlannedNoise) -> Expected:
    """What placings will determine under a noise.

    Parameters
    ----------
    model : of the artefact in these placings.
    noise : known or not.
    """
    values = np.array([unknown.prior_mean for unknown in model.unknowns])
    linear, components = model.linearised(values), noise.components(model, values)
    sizes, weight = noise.spread(components)
    u, with_prior = uncertainties(linear, components, sizes)
    return Expected(_averaged(u, weight), _averaged(with_prior, weight))


def uncertainties(linear: LinearModel, components: Components, sizes: Sizes) -> tuple[Floats, Floats]:
    """Standard uncertainties (w, k) for each of w sizes of the noise: of least squares, and with the prior of the effects.

    Parameters
    ----------
    linear : whose certified sizes are held.
    components : of its noise; slow noise is not reckoned with.
    """
    unknowns, scale = linear.unknowns, scales(linear.unknowns)
    held = np.array([unknown.known for unknown in unknowns], dtype=bool)
    design = linear.design * scale * _there(linear)
    basis, free = _determined(linear.reduced.design * scale * _there(linear), held)
    place = reached(linear.freedoms.dense())
    columns = np.asarray(components.turn @ np.hstack([place, design @ basis, design]))
    q, r = place.shape[1], basis.shape[1]
    prior = certified(unknowns) + np.diag([float(unknown.key[0] != ARTEFACT) for unknown in unknowns])
    variances = components.variances(sizes)[0] @ components.shares.T
    u, with_prior = np.full((len(variances), len(unknowns)), np.inf), np.empty((len(variances), len(unknowns)))
    for i, variance in enumerate(variances):
        information = columns.T @ (columns / variance[:, None])
        left = information[q:, q:] - information[q:, :q] @ np.linalg.solve(information[:q, :q], information[:q, q:])
        covariance = np.linalg.inv(left[:r, :r])
        passed = -basis @ covariance @ left[:r, r:][:, held]
        passed[held] += np.eye(int(held.sum()))
        squares = np.einsum("kr,rs,ks->k", basis, covariance, basis)
        squares += passed**2 @ (linear.prior_sd[held] / scale[held]) ** 2
        u[i, ~free] = np.sqrt(squares[~free])
        with_prior[i] = np.sqrt(np.maximum(np.diag(linalg.pinvh(left[r:, r:] + prior)), 0.0))
    return u * scale, with_prior * scale


def _there(linear: LinearModel) -> Floats:
    """(k,) 0 for columns of which the placing leaves nothing but rounding, lest they determine each other; else 1."""
    whole = np.linalg.norm(linear.design / linear.noise_scale[:, None], axis=0)
    return np.asarray(np.linalg.norm(linear.reduced.design, axis=0) > _ROUNDING * whole, dtype=np.float64)


def _determined(reduced: Floats, held: NDArray[np.bool_]) -> tuple[Floats, NDArray[np.bool_]]:
    """Combinations (k, r) that observations determine, orthonormal under white noise; and which parameters (k,) stay free."""
    k = len(held)
    _, s, Vt = linalg.svd(np.vstack([reduced[:, ~held], np.zeros((k, k))[:, ~held]]), full_matrices=False)
    rank = int(np.sum(s > RANK_TOLERANCE * s[0])) if s.size and s[0] > 0 else 0
    basis, free = np.zeros((k, rank)), np.zeros(k, dtype=bool)
    basis[~held] = Vt[:rank].T / s[:rank]
    free[~held] = np.linalg.norm(Vt[rank:], axis=0) > _ZERO
    return basis, free


def _averaged(values: Floats, weight: Floats) -> Floats:
    """Geometric mean (k,) of values (w, k), infinite where one is."""
    with np.errstate(divide="ignore"):
        return np.asarray(np.exp(weight @ np.log(values)) if len(weight) > 1 else values[0])
