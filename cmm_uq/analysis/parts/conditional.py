"""The machine's errors given the recording of its calibration, those included that the calibration did not model.

What a calibration leaves out of its model does not stay out of its recording: it goes into the estimates of what is modelled,
and into its noise. A part measured like the artefact then errs by less than both would alone, another part by more. Where the
recording is at hand (a job, or a certificate that carries it) everything is therefore estimated together, each error with the
prior that physics allows, under a noise of components whose sizes are sampled with them; what the machine corrects stays what
its certificate states.

However many errors were left out, a recording sees no more combinations of them than it has observations: those are sampled,
and what it does not see of each keeps its prior.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cmm_uq.analysis.parts.machine import MachineState, StatedNoise, Unmodelled
from cmm_uq.analysis.parts.periods import GivenPeriod
from cmm_uq.analysis.parts.recorded_noise import stated_noise
from cmm_uq.analysis.parts.together import Together, open_size
from cmm_uq.base.points import Floats, Ints
from cmm_uq.machine.model.measurement import MeasurementModel
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.maths.inference.marginal import Marginal
from cmm_uq.maths.inference.noise import Components, Sizes
from cmm_uq.maths.inference.sampling import sample_with_noise

DRAWS = 10_000

_UNTOLD = 100.0
"""Ratio of the 95 % to the 5 % quantile of the noise from which on the recording does not tell it from errors left out."""


def joint_posterior(
    model: MeasurementModel, further: Sequence[Unmodelled], sigma_mm: float
) -> tuple[tuple[int, ...], Floats, Floats]:
    """Normal posterior of a calibration's errors and of errors that it did not model, for a white noise that is known.

    Parameters
    ----------
    model : of the calibration.
    further : what it did not model; what needs columns that were not recorded is left out.
    sigma_mm : standard deviation of one recorded coordinate.

    Returns
    -------
    which : places in ``further`` of those that take part.
    mean, covariance : (k,) and (k, k) of the coefficients of the model's effects, then of those.

    Raises
    ------
    CmmUqError : the recording leaves even the sizes of the artefact open.
    """
    whole = Together.of(model, further)
    mean, root = whole.white(sigma_mm)
    covariance = root.T @ root
    k = sum(len(effect.coefficients) for effect in model.effects)
    at = np.r_[:k, len(mean) - len(whole.seen) : len(mean)]
    into = np.zeros((k + len(whole.sd), len(at)))
    into[:k, :k] = np.eye(k)
    into[k:, k:] = whole.gain.T
    free = np.vstack([np.zeros((k, len(whole.sd))), np.diag(whole.sd) - whole.gain.T @ whole.seen])
    return whole.which, into @ mean[at], into @ covariance[np.ix_(at, at)] @ into.T + free @ free.T


def draws_given(whole: Together, components: Components, sizes: Sizes, random: np.random.Generator) -> Floats:
    """Exact draws (N, k + f) of all errors, one for each of N sizes of the noise; no finite ones where a size is open."""
    return whole.coefficients(Marginal(whole.linear, components, whole.estimate).draw(sizes, random), random)


def given_recording(
    state: MachineState,
    model: MeasurementModel,
    sigma_mm: float | None = None,
    draws: int = DRAWS,
    seed: int = 0,
) -> MachineState:
    """The state of a machine with all of its errors drawn together, given the recording of its calibration.

    Parameters
    ----------
    state : as its certificate states it, its effects in the model's order; the model may have others, as of its artefact. How
        much the calibration bounds an error that it did not model is of no matter here: its recording says that again.
    model : of the calibration, without the observations that its certificate set aside.
    sigma_mm : standard deviation of one recorded coordinate, where the noise is known and white; else it is sampled.

    Raises
    ------
    CmmUqError : the recording leaves even the sizes of the artefact open.
    """
    whole, random = Together.of(model, state.unmodelled), np.random.default_rng(seed)
    if sigma_mm is not None:
        noise = replace(state.noise, coordinate_mm=state.noise.usual_mm)
        mean, root = whole.white(sigma_mm)
        drawn = whole.coefficients(mean + random.standard_normal((draws, len(root))) @ root, random)
        return _with(state, model, whole, drawn, noise)
    components = replace(noise_of(model), known=model.least_noise)
    posterior = sample_with_noise(whole.linear, components, whole.estimate, seed)
    every = _evenly(len(posterior.draws), draws)
    sizes, drawn = posterior.sizes.at(every), whole.coefficients(posterior.draws[every], random)
    low, high = np.quantile(sizes.coordinate, [0.05, 0.95])
    told = bool(high <= _UNTOLD * low)
    if not told:  # any noise would do: it is taken for what the calibration took it for, which is no less
        estimate = model.estimate()
        alone = sample_with_noise(estimate.linear, components, estimate.least_squares, seed)
        sizes = alone.sizes.at(_evenly(len(alone.draws), draws))
        drawn = draws_given(whole, components, sizes, random)
    return _with(state, model, whole, drawn, stated_noise(model, components, sizes))


def _with(
    state: MachineState, model: MeasurementModel, whole: Together, drawn: Floats, noise: StatedNoise
) -> MachineState:
    """The state with draws (N, k + f) of all errors together."""
    if not np.isfinite(drawn).all():
        raise open_size()
    acting = {one.name for one in state.effects}
    own = [effect.name in acting for effect in model.effects for _ in effect.coefficients]
    kept = np.flatnonzero(np.append(own, np.ones(len(whole.sd), dtype=bool)))
    none = np.zeros(len(whole.sd))
    together = replace(
        state, effects=(*state.effects, *whole.effects), draws=drawn[:, kept], noise=noise, corrected=True,
        unmodelled=tuple(one for i, one in enumerate(state.unmodelled) if i not in whole.which),
        corrections=np.append(state.corrects, none), drift=np.append(state.drift, none),
    )  # fmt: skip
    return replace(together, prior_share=_shares(together))


def _shares(state: MachineState) -> dict[str, float]:
    """Posterior standard deviation of each effect over its prior one, of several coefficients in the root mean square."""
    found, start = dict[str, float](), 0
    for effect in state.effects:
        own = state.draws[:, start : start + len(effect.coefficients)]
        start += len(effect.coefficients)
        if isinstance(effect, GivenPeriod):
            found[effect.name] = effect.share(own)
            continue
        prior = sum(coefficient.prior_sd**2 for coefficient in effect.coefficients)
        found[effect.name] = float(np.sqrt(own.var(axis=0).sum() / prior)) if prior else 0.0
    return found


def _evenly(count: int, wanted: int) -> Ints:
    return np.linspace(0, count - 1, min(wanted, count)).astype(np.int64)
