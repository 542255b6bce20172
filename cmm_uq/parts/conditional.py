"""The machine's errors given the recording of its calibration, those included that the calibration did not model.

What a calibration leaves out of its model does not stay out of its recording: it goes into the estimates of what is modelled.
A part measured like the artefact then errs by less than both would alone, another part by more. Where the recording is at hand
(a job, or a certificate that carries it) everything is therefore estimated together, each error with the prior that physics
allows, and drawn from that joint posterior; what the machine corrects stays what its certificate states.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cmm_uq.errors import CmmUqError
from cmm_uq.model.measurement import MeasurementModel
from cmm_uq.parts.machine import MachineState, Unmodelled
from cmm_uq.points import Floats

DRAWS = 10_000


def joint_posterior(
    model: MeasurementModel, further: Sequence[Unmodelled], sigma_mm: float
) -> tuple[tuple[int, ...], Floats, Floats]:
    """Normal posterior of a calibration's errors and of errors that it did not model, for a given noise.

    Parameters
    ----------
    model : of the calibration.
    further : what it did not model; those with a nonlinear parameter, or that need what was not recorded, are left out.
    sigma_mm : standard deviation of one recorded coordinate.

    Returns
    -------
    which : places in ``further`` of those that take part.
    mean, covariance : (k,) and (k, k) of the coefficients of the model's effects, then of those.

    Raises
    ------
    CmmUqError : the recording leaves even the sizes of the artefact open.
    """
    columns = model.artefact.points.columns
    which = tuple(
        i for i, one in enumerate(further)
        if not one.effect.shape and all(name in columns for name in one.effect.columns)
    )  # fmt: skip
    whole = MeasurementModel(
        model.artefact, (*model.effects, *(further[i].effect for i in which)), model.sigma, model.used, model.shapes
    )
    about, k = model.estimate().about, sum(len(effect.coefficients) for effect in model.effects)
    sd = np.concatenate([np.zeros(0), *(further[i].sd for i in which)])
    linear = whole.linearised(np.concatenate([about[:k], np.zeros(len(sd)), about[k:]]))
    unknowns = [
        replace(unknown, prior_sd=float(sd[i - k])) if k <= i < k + len(sd) else unknown
        for i, unknown in enumerate(linear.unknowns)
    ]
    linear = replace(linear, unknowns=tuple(unknowns))
    rows, given = linear.priors
    scale = np.array([unknown.scale for unknown in linear.unknowns])
    root = np.vstack([linear.reduced.design / sigma_mm, rows]) * scale
    target = np.append(linear.reduced.observed / sigma_mm, given)
    if np.linalg.matrix_rank(root) < root.shape[1]:
        raise CmmUqError("the recording leaves a size of its artefact open, of which nothing is known beforehand",
                         where="the calibration", fix="Give the artefact's length")  # fmt: skip
    inverse = np.linalg.pinv(root)
    mean, covariance = scale * (inverse @ target), np.outer(scale, scale) * (inverse @ inverse.T)
    count = k + len(sd)
    return which, np.asarray(mean[:count]), np.asarray(covariance[:count, :count])


def given_recording(
    state: MachineState, model: MeasurementModel, sigma_mm: float, draws: int = DRAWS, seed: int = 0
) -> MachineState:
    """The state of a machine with all of its errors drawn together, given the recording of its calibration.

    Parameters
    ----------
    state : as its certificate states it, of the same effects as the model.
    model : of the calibration.
    sigma_mm : standard deviation of one recorded coordinate.
    """
    which, mean, covariance = joint_posterior(model, state.unmodelled, sigma_mm)
    together = tuple(state.unmodelled[i].effect for i in which)
    rest = tuple(one for i, one in enumerate(state.unmodelled) if i not in which)
    more = len(mean) - state.draws.shape[1]
    corrections = np.append(state.corrects, np.zeros(more))
    drawn = np.random.default_rng(seed).multivariate_normal(mean, covariance, draws, method="svd")
    noise = replace(state.noise, coordinate_mm=state.noise.usual_mm)
    prior = np.concatenate([np.zeros(0), *(state.unmodelled[i].sd for i in which)])
    share = np.sqrt(np.diagonal(covariance))[len(mean) - more :] / prior
    names = [effect.name for effect in together for _ in effect.coefficients]
    shares = {**state.prior_share, **dict(zip(names, share.tolist(), strict=True))}
    return replace(
        state, effects=(*state.effects, *together), draws=drawn, noise=noise, unmodelled=rest, prior_share=shares,
        drift=np.append(state.drift, np.zeros(more)), corrected=True, corrections=corrections,
    )  # fmt: skip
