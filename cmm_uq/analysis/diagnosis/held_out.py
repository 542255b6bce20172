"""Whether what was found predicts set-ups, or points, that the fit has not seen."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.diagnosis.observations import numbered_by_place
from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE
from cmm_uq.machine.model import RecordingModel
from cmm_uq.maths.inference.linear_model import Freedoms
from cmm_uq.maths.inference.posterior import Density

FOLDS = 10
_SINGULAR = 1e-9  # part of the largest singular value below which another counts as zero


@dataclass(frozen=True)
class Improvement:
    """Before and after, on the recording itself and on held-out set-ups."""

    rms_before_um: float  # rms_before_um, rms_after_um: residual rms of the observations
    rms_after_um: float
    # heldout_rms_before_um, heldout_rms_after_um: of predictions of what was left out of the fit
    heldout_rms_before_um: float
    heldout_rms_after_um: float
    # elpd_gain, elpd_gain_se: gain in expected log predictive density, and its standard error over what was held out
    elpd_gain: float
    elpd_gain_se: float
    unseen: Text = say("set-ups")


def improvement(before: RecordingModel, after: RecordingModel) -> Improvement:
    """Compare two models of one recording by cross-validation over its set-ups, or the points of few set-ups."""
    groups, unseen = _groups(before)
    rms = [_rms(model.estimate().least_squares.residuals) for model in (before, after)]
    if before.effects == after.effects:
        held = _held_out(before, groups)[0]
        return Improvement(rms[0], rms[1], held, held, 0.0, 0.0, unseen)
    first, second = _held_out(before, groups), _held_out(after, groups)
    gain = second[1] - first[1]
    se = float(np.sqrt(len(gain)) * gain.std(ddof=1)) if len(gain) > 1 else 0.0
    return Improvement(rms[0], rms[1], first[0], second[0], float(gain.sum()), se, unseen)


def _held_out(model: RecordingModel, groups: NDArray[np.int64]) -> tuple[float, Floats]:
    """Rms of predictions, µm, and log predictive density of each fold; what a set-up leaves open is no part of it."""
    estimate = model.estimate()
    linear = estimate.linear
    sigma = max(estimate.least_squares.sigma_of_residuals, model.least_noise, 1e-7)
    errors, counts, densities = [], [], []
    scale = linear.noise_scale[:, None]
    every = np.hstack([linear.observed[:, None], linear.design]) / scale
    placing = linear.freedoms.over(linear.noise_scale)
    for out in _folds(groups):
        mean, covariance, _ = Density(replace(linear.at(~out), sigma=sigma)).conditional(float(np.log(sigma)))
        left, known, open_ = _predicted(placing, every, out)
        error = left[:, 0] - left[:, 1:] @ mean
        told = [known, left[:, 1:] @ (_root(covariance) / sigma)]
        errors.append(float(error @ error) * linear.noise_scale[out].mean() ** 2)
        counts.append(len(error) - open_)
        densities.append(_log_density(error / sigma, np.hstack(told)) - counts[-1] * np.log(sigma * np.sqrt(2 * np.pi)))
    return float(np.sqrt(sum(errors) / max(sum(counts), 1)) / MICROMETRE), np.array(densities)


def _log_density(error: Floats, spread: Floats) -> float:
    """Of errors (m,) with the covariance 1 + L·Lᵀ for L = ``spread`` (m, r), but for the constant."""
    U, s, _ = np.linalg.svd(spread, full_matrices=False)
    seen = U.T @ error
    rest = error - U @ seen
    return float(-0.5 * (rest @ rest + np.sum(seen**2 / (1 + s**2)) + np.sum(np.log1p(s**2))))


def _root(covariance: Floats) -> Floats:
    """A matrix whose product with its own transpose is a covariance (k, k)."""
    scale = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


def _groups(model: RecordingModel) -> tuple[NDArray[np.int64], Text]:
    """What is left out together, by its place: set-ups, or of few set-ups, which might leave too much open, their points."""
    artefact, used = model.artefact, model.used
    placing = artefact.measurement[used]
    if len(np.unique(placing)) >= FOLDS:
        return (numbered_by_place(model, placing), say("set-ups"))
    key = np.column_stack([placing, artefact.points.point[artefact.rows[:, 0]][used]])
    return (numbered_by_place(model, key), say("points"))


def _folds(group: NDArray[np.int64]) -> Iterator[NDArray[np.bool_]]:
    groups = np.unique(group)
    count = FOLDS if len(groups) > 40 else len(groups)
    for k in range(count):
        yield np.isin(group, groups[k::count])


def _predicted(placing: Freedoms, every: Floats, out: NDArray[np.bool_]) -> tuple[Floats, Floats, int]:
    """Columns (o, b) held out less what other observations tell; (o, r) factor of its covariance; dimensions lost."""
    left, known, open_ = every.copy(), np.zeros((len(every), 0)), 0
    for rows in placing.rows:
        own = out[rows]
        inside, rest = rows[own], rows[~own]
        if not len(inside):
            continue
        reached, told, free = _told(placing.columns[rest])
        basis = _reached(placing.columns[inside] @ free)
        each = _without(basis, placing.columns[inside] @ told)
        left[inside] = _without(basis, every[inside]) - each @ (reached.T @ every[rest])
        widened = np.zeros((len(every), each.shape[1]))
        widened[inside] = each
        known, open_ = np.hstack([known, widened]), open_ + basis.shape[1]
    return left[out], known[out], open_


def _told(columns: Floats) -> tuple[Floats, Floats, Floats]:
    """Basis (m, r) that columns (m, q) reach, (q, r) coefficients of it, and basis (q, q − r) of what they leave open."""
    if not columns.size:
        return np.zeros((len(columns), 0)), np.zeros((columns.shape[1], 0)), np.eye(columns.shape[1])
    U, s, V = np.linalg.svd(columns, full_matrices=len(columns) < columns.shape[1])
    rank = _rank(s)
    return U[:, :rank], V[:rank].T / s[:rank], V[rank:].T


def _reached(columns: Floats) -> Floats:
    """Orthonormal basis (m, rank) of what columns (m, q) reach."""
    if not columns.shape[1]:
        return np.zeros((len(columns), 0))
    U, s, _ = np.linalg.svd(columns, full_matrices=False)
    return U[:, : _rank(s)]


def _without(basis: Floats, columns: Floats) -> Floats:
    """Columns (m, b) without their part in an orthonormal basis (m, r)."""
    return columns - basis @ (basis.T @ columns)


def _rank(s: Floats) -> int:
    return int(np.sum(s > _SINGULAR * max(float(s[0]), 1e-300)))


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)) / MICROMETRE) if len(values) else 0.0
