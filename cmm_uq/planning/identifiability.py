"""What placings determine of the effects that a job names, from singular values of the whitened design.

Least squares on a design needs no readings: which unknowns it determines, with what uncertainty, and which combinations it
leaves free follow from the placings alone. Beside it stands what is left of the prior standard deviation that physics allows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from cmm_uq.inference.least_squares import LeastSquares, solve
from cmm_uq.inference.linear_model import LinearModel, Unknown
from cmm_uq.measurement import MeasurementModel
from cmm_uq.measurement.model import ARTEFACT
from cmm_uq.physics.effect import Effect
from cmm_uq.planning.information import certified, gram, scales
from cmm_uq.planning.separation import cosines, left_of, visible
from cmm_uq.points import Floats

NOT_TOLD_APART = 0.98
"""Cosine from which on two effects could hardly be told apart: a fifth of one is all that the other cannot imitate."""

_ROUNDING = 1e-9

WEAK = 0.1
"""Part of the prior variance from which on a parameter counts as weakly determined."""


@dataclass(frozen=True)
class Determined:
    """What to expect of one parameter.

    Parameters
    ----------
    unknown : the parameter.
    u : standard uncertainty of its least-squares estimate, in its unit; ``None`` where the placings leave it free.
    u_with_prior : the same when what physics allows is used too.
    status : ``determined``, ``weak`` (the prior says almost as much) or ``free``.
    """

    unknown: Unknown
    u: float | None
    u_with_prior: float
    status: str


@dataclass(frozen=True, eq=False)
class Identifiability:
    """What placings determine.

    Parameters
    ----------
    parameters : of the effects named, and the sizes of the artefact that no certificate gives.
    free : combinations, each by the keys of its parameters and their parts, that leave every observation as it is.
    singular_values : of the design whitened by the noise and scaled by the prior standard deviations, largest first.
    alike : pairs of effects, and their cosine, that could not be told apart.
    unseen : effects, not named by the job, of which nothing would show.
    """

    parameters: tuple[Determined, ...]
    free: tuple[Mapping[tuple[str, str], float], ...]
    singular_values: Floats
    alike: tuple[tuple[str, str, float], ...]
    unseen: tuple[str, ...]

    @property
    def complete(self) -> bool:
        """Whether every parameter is determined."""
        return all(parameter.status != "free" for parameter in self.parameters)


def identifiability(model: MeasurementModel, rivals: Sequence[Effect] = ()) -> Identifiability:
    """What the placings of a model's artefact determine of its effects, and how rivals would show besides.

    Parameters
    ----------
    model : effects that are to be determined, with the noise.
    rivals : effects that might act and are not named.
    """
    values = np.array([unknown.prior_mean for unknown in model.unknowns])
    linear = model.linearised(values)
    estimate = solve(_enough(linear))
    alike, unseen = _pairs(model, rivals, values)
    return Identifiability(
        _parameters(linear, estimate), _free(estimate), _singular_values(linear), alike, unseen,
    )  # fmt: skip


def _enough(linear: LinearModel) -> LinearModel:
    """The same with observations that say nothing, so that few placings are a finding and no error.

    Columns of which the placing leaves nothing but rounding become zero, lest they determine each other.
    """
    k = len(linear.unknowns)
    whole = np.linalg.norm(linear.design / linear.noise_scale[:, None], axis=0)
    there = np.linalg.norm(linear.reduced.design, axis=0) > _ROUNDING * whole
    return replace(
        linear, observed=np.concatenate([linear.observed, np.zeros(k + 1)]),
        design=np.vstack([linear.design * there, np.zeros((k + 1, k))]),
        placing=np.vstack([linear.placing, np.zeros((k + 1, linear.placing.shape[1]))]),
        noise_scale=np.concatenate([linear.noise_scale, np.ones(k + 1)]),
    )  # fmt: skip


def _singular_values(linear: LinearModel) -> Floats:
    sigma = linear.sigma or 1.0
    free = [i for i, unknown in enumerate(linear.unknowns) if not unknown.known]
    white = linear.reduced.design[:, free] * scales(linear.unknowns)[free] / sigma
    return np.asarray(linalg.svdvals(white)) if white.size else np.zeros(0)


def _parameters(linear: LinearModel, estimate: LeastSquares) -> tuple[Determined, ...]:
    scale, sigma = scales(linear.unknowns), linear.sigma or 1.0
    white = linear.reduced.design * scale / sigma
    prior = certified(linear.unknowns) + np.diag([float(u.key[0] != ARTEFACT) for u in linear.unknowns])
    posterior = np.sqrt(np.maximum(np.diag(linalg.pinvh(white.T @ white + prior)), 0.0)) * scale
    found = []
    for i, unknown in enumerate(linear.unknowns):
        if unknown.known:
            continue
        u = float(np.sqrt(estimate.covariance[i, i])) if estimate.determined[i] else None
        weak = unknown.key[0] != ARTEFACT and posterior[i] ** 2 > WEAK * scale[i] ** 2
        found.append(
            Determined(unknown, u, float(posterior[i]), "free" if u is None else "weak" if weak else "determined")
        )
    return tuple(found)


def _free(estimate: LeastSquares) -> tuple[Mapping[tuple[str, str], float], ...]:
    return tuple(
        {u.key: float(part) for u, part in zip(estimate.unknowns, column, strict=True) if part}
        for column in estimate.null_space.T
    )


def _pairs(
    model: MeasurementModel, rivals: Sequence[Effect], values: Floats
) -> tuple[tuple[tuple[str, str, float], ...], tuple[str, ...]]:
    """Pairs not told apart: of named effects with all others fitted, of rivals with everything named fitted."""
    named = [unknown.key[0] for unknown in model.unknowns]
    effects = [i for i, name in enumerate(named) if name != ARTEFACT]
    information = gram(model, values) + certified(model.unknowns)
    found = list(_named_pairs(information, effects, named))
    if not rivals:
        return tuple(found), ()
    wider = replace(model, effects=(*model.effects, *rivals))
    information = gram(wider, np.array([u.prior_mean for u in wider.unknowns])) + certified(wider.unknowns)
    names = [unknown.key[0] for unknown in wider.unknowns]
    fitted = [i for i, name in enumerate(names) if name in named]
    others = [i for i in range(len(names)) if i not in fitted]
    left = left_of(information, others, fitted)
    alone = np.diag(information)[others]
    seen, cosine = visible(left, alone), cosines(left, alone)
    unseen = {names[i] for i in others} - {names[i] for i, there in zip(others, seen, strict=True) if there}
    alike = (cosine > NOT_TOLD_APART) & seen[:, None] & seen[None, :]
    found += [
        (names[others[a]], names[others[b]], float(cosine[a, b]))
        for a, b in zip(*np.nonzero(np.triu(alike, 1)), strict=True)
        if names[others[a]] != names[others[b]]
    ]
    return tuple(sorted(found, key=lambda pair: -pair[2])), tuple(n for n in dict.fromkeys(names) if n in unseen)


def _named_pairs(information: Floats, effects: list[int], names: list[str]) -> list[tuple[str, str, float]]:
    """Pairs of named effects, each with everything else fitted."""
    found = []
    for a, i in enumerate(effects):
        for j in effects[a + 1 :]:
            rest = [k for k in range(len(information)) if k not in (i, j)]
            left = left_of(information, [i, j], rest)
            alone = np.diag(information)[[i, j]]
            if names[i] != names[j] and np.all(visible(left, alone)):
                cosine = float(cosines(left, alone)[0, 1])
                if cosine > NOT_TOLD_APART:
                    found.append((names[i], names[j], cosine))
    return found
