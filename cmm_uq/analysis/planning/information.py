"""How much each set-up tells of every unknown, and how well effects are told apart by it.

The set-up's own freedoms are projected out, the noise of set-ups is independent, and so their information adds (JCGM 101
has no word for it; Atkinson, Donev & Tobias 2007, *Optimum Experimental Designs*, 5.1). Unknowns are in units of their prior
standard deviation, a size of the artefact in units of a tenth of a millimetre.

Two effects whose columns are parallel after everything else has been projected out cannot be told apart by any method; the
sine of the angle between them is the part of one that the other cannot imitate. (Baarda 1968; Teunissen 2018, *Distributional
theory for the DIA method*: minimal detectable and identifiable bias.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.planning.noise import PlannedNoise, uncorrelated
from cmm_uq.analysis.planning.set_up import SetUp, join
from cmm_uq.analysis.planning.setting import Setting
from cmm_uq.base.points import Floats, Points
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.maths.inference.linear_model import Unknown

_HELD = 1e12  # of a size that its certificate gives without uncertainty, 0.1 nm; more would hide all other by rounding
SEEN = 1e-6  # part of an effect's information, of what it would be by itself, below which rounding hides it
FAINT = 1.0  # below which an effect of its prior standard deviation does not stand out of the noise
_RIDGE = 1e-13
_PART = 0.1  # share from which on a column counts as part of what looks like another


@dataclass(frozen=True, eq=False)
class Information:
    """Information of set-ups, one matrix each."""

    unknowns: tuple[Unknown, ...]
    each: Floats  # (c, k, k) of every set-up; there may be more rows than unknowns, of freedoms that all set-ups share
    prior: Floats  # (k, k) of the certificates, without that of the effects

    def where(self, effects: Sequence[Effect]) -> list[int]:
        names = {effect.name for effect in effects}
        return [i for i, unknown in enumerate(self.unknowns) if unknown.key[0] in names]

    @property
    def nuisance(self) -> list[int]:
        """Rows of the artefact's sizes and of what all set-ups share."""
        effects = [i for i, unknown in enumerate(self.unknowns) if unknown.key[0] != ARTEFACT]
        return [i for i in range(len(self.prior)) if i not in effects]


def set_up_information(setting: Setting, placings: Sequence[SetUp], also: tuple[Effect, ...] = ()) -> Information:
    """What each set-up tells of the effects that the job names, and of some others."""
    plan = setting.plan
    points = join(
        placings, seconds_per_point=plan.seconds_per_point, minutes_per_placing=plan.minutes_per_placing,
        columns=plan.columns,
    )  # fmt: skip
    if setting.planning.shared:
        return shared(setting.model(points, also), setting.noise)
    numbers = np.unique(points.measurement)
    models = [setting.model(points.select(points.measurement == number), also) for number in numbers]
    matrices = [gram(model, np.array([u.prior_mean for u in model.unknowns]), setting.noise) for model in models]
    return Information(models[0].unknowns, np.stack(matrices), certified(models[0].unknowns))


def recording_information(setting: Setting, points: Points, also: tuple[Effect, ...] = ()) -> Floats:
    """Information (k, k) of a whole recording, in the rows of :func:`set_up_information`, without that of certificates."""
    model = setting.model(points, also)
    if setting.planning.shared:
        return np.asarray(shared(model, setting.noise).each.sum(axis=0), dtype=np.float64)
    return gram(model, np.array([u.prior_mean for u in model.unknowns]), setting.noise)


def gram(model: RecordingModel, values: Floats, noise: PlannedNoise | None = None) -> Floats:
    """Information (k, k) of a recording about the parameters, without a prior; ``noise`` ``None``: the model's white noise."""
    white = _white(model, values, noise)
    return np.asarray(white.T @ white, dtype=np.float64)


def by_measurement(model: RecordingModel, values: Floats) -> Floats:
    """The same for each measurement (c, k, k), in ascending order, under the white noise that the model states."""
    white = _white(model, values, None)
    index = np.unique(model.artefact.measurement[model.used], return_inverse=True)[1].ravel()
    return np.stack([rows.T @ rows for rows in (white[index == i] for i in range(int(index.max()) + 1))])


def _white(model: RecordingModel, values: Floats, noise: PlannedNoise | None) -> Floats:
    """Design (m, k) over the noise, the set-up projected out, in the units of :func:`scales`."""
    linear = uncorrelated(model, values, noise)
    return np.asarray(linear.reduced.design * scales(linear.unknowns) / _sigma(model, noise))


def scales(unknowns: Sequence[Unknown]) -> Floats:
    """(k,) unit of each unknown: the prior standard deviation of an effect, a tenth of a millimetre of a size."""
    return np.array([unknown.scale for unknown in unknowns])


def certified(unknowns: Sequence[Unknown], more: int = 0) -> Floats:
    """Information (k + more, k + more) of the certificates."""
    values = np.zeros(len(unknowns) + more)
    for i, unknown in enumerate(unknowns):
        if unknown.known:
            values[i] = min((unknown.scale / unknown.prior_sd) ** 2, _HELD) if unknown.prior_sd > 0 else _HELD
    return np.diag(values)


def shared(model: RecordingModel, noise: PlannedNoise | None = None) -> Information:
    """Information of each measurement of a recording whose set-up's freedoms are common to all of them: a swept bar."""
    values = np.array([u.prior_mean for u in model.unknowns])
    linear = uncorrelated(model, values, noise)
    rows = np.hstack([linear.design * scales(linear.unknowns), linear.freedoms.dense()])
    rows = rows / (linear.noise_scale[:, None] * _sigma(model, noise))
    numbers, index = np.unique(model.artefact.measurement, return_inverse=True)
    each = np.zeros((len(numbers), rows.shape[1], rows.shape[1]))
    np.add.at(each, index.ravel(), rows[:, :, None] * rows[:, None, :])
    return Information(linear.unknowns, each, certified(linear.unknowns, linear.freedoms.count))


def _sigma(model: RecordingModel, noise: PlannedNoise | None) -> float:
    sigma = model.sigma if noise is None else noise.coordinate
    if sigma is None:
        raise ValueError("the information of a measurement needs the noise")
    return sigma


def left_of(information: Floats, rivals: Sequence[int], base: Sequence[int]) -> Floats:
    """Information (..., r, r) on rivals once the base (rows) is fitted: the Schur complement. ``information`` (..., k, k)."""
    rival, fitted = list(rivals), list(base)
    own = information[..., rival, :][..., :, rival]
    if not fitted:
        return np.asarray(own)
    cross = information[..., fitted, :][..., :, rival]
    within = information[..., fitted, :][..., :, fitted]
    scale = np.sqrt(np.maximum(np.einsum("...ii->...i", within), 1e-300))
    scaled = within / scale[..., :, None] / scale[..., None, :]
    scaled = scaled + _RIDGE * np.eye(len(fitted))
    solved = np.linalg.solve(scaled, cross / scale[..., :, None]) / scale[..., :, None]
    return np.asarray(own - np.swapaxes(cross, -1, -2) @ solved)


def cosines(left: Floats, alone: Floats) -> Floats:
    """Absolute cosines (..., r, r) of effects from what is left, 1 where unseen; ``alone`` (..., r) with nothing else."""
    size = np.einsum("...ii->...i", left)
    seen = visible(left, alone)
    root = np.sqrt(np.where(seen, size, 1.0))
    cosine = np.abs(left) / root[..., :, None] / root[..., None, :]
    cosine = np.where(seen[..., :, None] & seen[..., None, :], np.minimum(cosine, 1.0), 1.0)
    return np.asarray(np.where(np.eye(left.shape[-1], dtype=bool), 1.0, cosine))


def visible(left: Floats, alone: Floats) -> NDArray[np.bool_]:
    """(..., r) whether anything of each effect is left."""
    return np.asarray(np.einsum("...ii->...i", left) > np.maximum(SEEN * alone, FAINT))


def imitators(information: Floats, row: int, base: Sequence[int]) -> list[int]:
    """Rows of the base that together look like an effect: least squares of its column on theirs, the smallest solution."""
    fitted = list(base)
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    scaled = information / scale[:, None] / scale[None, :]
    parts = np.linalg.lstsq(scaled[np.ix_(fitted, fitted)], scaled[fitted, row], rcond=_RIDGE**0.5)[0]
    return [i for i, part in zip(fitted, parts, strict=True) if abs(part) > _PART]
