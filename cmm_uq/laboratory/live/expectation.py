"""What the recording so far says that the newest observation should be, and whether the scatter of repeats asks for more.

Every observation is predicted from all others, with the effects that the job names and what physics allows of them before
anything is measured: the deleted residual of least squares and its standard deviation σ/√(1 − h) (Cook & Weisberg 1982,
2.2.1), the priors being observations like others. The noise is what the job states of a coordinate, else what repeats and
residuals show; a set-up offset is not in it, so the interval is that of white noise.

A repeat more is asked for where the repeats of one set-up scatter by more than one set-up in a hundred would: their variance
against that of the stated noise (χ²), or against that of all other set-ups' repeats (F).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE
from cmm_uq.machine.model import RecordingModel
from cmm_uq.maths.inference.linear_model import LinearModel

LEVEL = 0.95  # of the interval that is shown
RARE = 0.01  # part of sound set-ups whose repeats are asked for once more
FEWEST = 3  # degrees of freedom that the noise is estimated from
_DETERMINED = 1e-9  # 1 − h below which nothing but the observation itself says what it should be


@dataclass(frozen=True, eq=False)
class Predicted:
    """Each observation (m,) as measured, and as all others predict it, µm against the artefact's nominal sizes."""

    measured: Floats  # deviation from what the artefact's nominal sizes would give, the set-up's own freedoms fitted
    expected: Floats  # the same as predicted; ``nan`` where nothing else says anything
    u: Floats  # standard deviation of measured less expected
    factor: float  # of the interval at :data:`LEVEL`
    sigma: float  # standard deviation of a coordinate, µm


def predicted(model: RecordingModel) -> Predicted | None:
    """Every observation as all others predict it; ``None`` where neither the job nor the recording says what the noise is."""
    linear = model.linearised(np.array([unknown.prior_mean for unknown in model.unknowns]))
    sigma, degrees = _sigma(linear)
    if sigma is None:
        return None
    rows, known = linear.priors
    values = linear.prior_mean
    whitened = linear.reduce(linear.observed[:, None] - (linear.design @ values)[:, None])[:, 0]
    place = linear.freedoms.over(linear.noise_scale).dense()
    design = np.hstack([linear.design / linear.noise_scale[:, None], place])
    prior = np.hstack([sigma * rows, np.zeros((len(rows), place.shape[1]))])
    observed = (linear.observed - linear.design @ values) / linear.noise_scale
    fitted, leverage = _fitted(np.vstack([design, prior]), np.concatenate([observed, sigma * (known - rows @ values)]))
    m = len(observed)
    free = 1 - leverage[:m]
    seen = free > _DETERMINED
    left = np.where(seen, (observed - fitted[:m]) / np.where(seen, free, 1.0), np.nan)
    scale = linear.noise_scale / MICROMETRE
    upper = 0.5 + LEVEL / 2
    factor = float(special.stdtrit(degrees, upper) if np.isfinite(degrees) else special.ndtri(upper))
    measured = whitened * scale
    u = np.where(seen, sigma / np.sqrt(np.where(seen, free, 1.0)), np.inf) * scale
    return Predicted(measured, measured - left * scale, u, factor, sigma / MICROMETRE)


def _fitted(rows: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Fitted values and leverages of least squares, whatever the rank."""
    size = np.linalg.norm(rows, axis=0)
    U, s, _ = np.linalg.svd(rows / np.where(size > 0, size, 1.0), full_matrices=False)
    U = U[:, s > 1e-10 * s.max(initial=0.0)]
    return U @ (U.T @ values), np.einsum("ij,ij->i", U, U)


def _sigma(linear: LinearModel) -> tuple[float | None, float]:
    """Standard deviation of a coordinate, mm, as stated or as the residuals show it, and its degrees of freedom."""
    if linear.sigma is not None:
        return linear.sigma, np.inf
    reduced = linear.reduced
    fitted, leverage = _fitted(reduced.design, reduced.observed)
    degrees = reduced.count - round(float(leverage.sum()))
    if degrees < FEWEST:
        return None, 0.0
    return max(float(np.linalg.norm(reduced.observed - fitted)) / float(np.sqrt(degrees)), 1e-3 * MICROMETRE), degrees


@dataclass(frozen=True)
class RepeatScatter:
    """How the repeats of one measurement scatter."""

    measurement: int
    s: float  # standard deviation of a coordinate by its repeats, µm
    usual: float  # the same as stated, or of all others, µm
    limit: float  # what one set-up in a hundred exceeds, µm

    @property
    def words(self) -> Text:
        """Why a repeat is asked for."""
        return say(
            "the repeats of measurement {m} scatter by {s:.2g} µm a coordinate; {usual:.2g} µm is usual, and one set-up in a "
            "hundred goes beyond {limit:.2g} µm: measure it once more",
            m=self.measurement, s=self.s, usual=self.usual, limit=self.limit,
        )  # fmt: skip


def scatter(model: RecordingModel, measurement: int) -> RepeatScatter | None:
    """The scatter of the repeats of a measurement where it asks for another; else, or where it is unknown, ``None``."""
    values = np.array([unknown.prior_mean for unknown in model.unknowns])
    try:
        residuals = model.residuals(values) / model.artefact.noise_scale / MICROMETRE
    except CmmUqError:
        return None
    own, own_dof = _within(model, residuals, model.artefact.measurement == measurement)
    others, dof = _within(model, residuals, model.artefact.measurement != measurement)
    if not own_dof:
        return None
    if model.sigma is not None:
        usual, factor = model.sigma / MICROMETRE, float(special.chdtri(own_dof, RARE)) / own_dof
    elif dof >= FEWEST and others > 0:
        usual, factor = float(np.sqrt(others / dof)), float(special.fdtri(own_dof, dof, 1 - RARE))
    else:
        return None
    s, limit = float(np.sqrt(own / own_dof)), usual * float(np.sqrt(factor))
    return RepeatScatter(measurement, s, usual, limit) if s > limit else None


def _within(model: RecordingModel, residuals: Floats, chosen: Floats) -> tuple[float, int]:
    """Sum of squares about the means of the same observation repeated, and its degrees of freedom."""
    artefact = model.artefact
    point = artefact.points.point[artefact.rows]
    keys = np.column_stack([artefact.measurement[:, None], point])[chosen]
    if not len(keys):
        return 0.0, 0
    _, index, counts = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    index = index.ravel()
    means = np.bincount(index, residuals[chosen]) / counts
    return float(np.sum((residuals[chosen] - means[index]) ** 2)), int(np.sum(counts - 1))
