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
from dataclasses import dataclass, replace

import numpy as np

from cmm_uq.inference.linear_model import Whiten
from cmm_uq.inference.marginal import Marginal
from cmm_uq.inference.noise import Components, Sizes
from cmm_uq.inference.sampling import sample_with_noise
from cmm_uq.model.measurement import MeasurementModel
from cmm_uq.model.noise import noise_of
from cmm_uq.parts.drawn_periods import DrawnPeriod, drawable
from cmm_uq.parts.machine import MachineState, StatedNoise, Unmodelled
from cmm_uq.parts.periods import GivenPeriod
from cmm_uq.parts.recorded_noise import stated_noise
from cmm_uq.parts.together import Together, open_size
from cmm_uq.parts.with_periods import Conditioned, Noises
from cmm_uq.points import Floats, Ints
from cmm_uq.units import MICROMETRE

DRAWS = 10_000

_EFFECTIVE = 0.2
"""Part of the draws that weights must leave for periods to be drawn; else errors with a period are normal sums."""

NOISES = 20
"""Sizes of the noise, of which a draw with periods has one."""

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
    state: MachineState, model: MeasurementModel, sigma_mm: float | None = None, draws: int = DRAWS, seed: int = 0,
    *, one_period: bool = False,
) -> MachineState:  # fmt: skip
    """The state of a machine with all of its errors drawn together, given the recording of its calibration.

    Parameters
    ----------
    state : as its certificate states it, its effects in the model's order; the model may have others, as of its artefact. How
        much the calibration bounds an error that it did not model is of no matter here: its recording says that again.
    model : of the calibration, without the observations that its certificate set aside.
    sigma_mm : standard deviation of one recorded coordinate, where the noise is known and white; else it is sampled.
    one_period : whether an error with an unknown period has one in each draw, where weights leave enough of the draws; else,
        and without it, it is the normal sum of all.

    Raises
    ------
    CmmUqError : the recording leaves even the sizes of the artefact open.
    """
    whole, random = Together.of(model, state.unmodelled), np.random.default_rng(seed)
    if sigma_mm is not None:
        noise = replace(state.noise, coordinate_mm=state.noise.usual_mm)
        if one_period:
            apart = _Apart.of(state, model)
            found = apart.drawn([(sigma_mm, None)], None, draws, seed)
            if found is not None:
                return _with(apart.state, model, apart.whole, found[1], noise, found[2])
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
    if one_period:
        apart, some = _Apart.of(state, model), sizes.at(_evenly(len(sizes.slow), NOISES))
        every_one = (sizes.typical, *(some.at(slice(i, i + 1)) for i in range(len(some.slow))))
        noises = [(float(one.coordinate[0]), components.white(one)) for one in every_one]
        found = apart.drawn(noises, _likelier(components, some, apart.whole, whole) if told else None, draws, seed)
        if found is not None:
            which, together, periods = found
            return _with(
                apart.state, model, apart.whole, together, stated_noise(model, components, some.at(which)), periods
            )
    return _with(state, model, whole, drawn, stated_noise(model, components, sizes))


@dataclass(frozen=True, eq=False)
class _Apart:
    """Errors with a period apart from all others.

    Attributes
    ----------
    state : without them.
    model : of the calibration.
    periodic : those.
    whole : all others together.
    """

    state: MachineState
    model: MeasurementModel
    periodic: tuple[Unmodelled, ...]
    whole: Together

    @classmethod
    def of(cls, state: MachineState, model: MeasurementModel) -> _Apart:
        periodic = tuple(one for one in state.unmodelled if drawable(one.effect))
        others = tuple(one for one in state.unmodelled if one not in periodic)
        return cls(replace(state, unmodelled=others), model, periodic, Together.of(model, others))

    def drawn(
        self, noises: Sequence[tuple[float, Whiten | None]], likelier: Floats | None, draws: int, seed: int
    ) -> tuple[Ints, Floats, tuple[DrawnPeriod, ...]] | None:
        """Which noise each draw has, coefficients (N, k + f) of the others, and draws with one period each.

        Parameters
        ----------
        noises : standard deviation of a reading, and what makes observations uncorrelated; of several the first is a usual one
            by which the others are only judged.
        likelier : (s,) see :class:`Noises`.

        Returns
        -------
        Nothing where no error has a period, or weights leave too few of the draws.
        """
        if not self.periodic:
            return None
        linear, random = self.whole.linear, np.random.default_rng(seed)
        usual = Conditioned(self.model, linear, noises[0][0], self.periodic, noises[0][1])
        if usual.open:
            raise open_size()
        stood = usual.without_noise()
        usual = Conditioned(self.model, linear, noises[0][0], self.periodic, noises[0][1], stood)
        found = usual.combinations(draws, random)
        if found.effective < _EFFECTIVE:
            return None
        each = [Conditioned(self.model, linear, *one[:1], self.periodic, one[1], stood) for one in noises[1:]] or [
            usual
        ]
        which, frequency, effective = Noises(usual, each, likelier).drawn(found, random)
        if effective < _EFFECTIVE:
            return None
        own, parameters = np.empty((draws, 2 * len(self.periodic))), np.empty((draws, len(linear.unknowns)))
        for i in np.unique(which):
            rows = which == i
            own[rows], parameters[rows] = each[i].drawn(frequency[rows], random)
        periods = tuple(
            DrawnPeriod(one.effect, frequency[:, i], own[:, 2 * i : 2 * i + 2]) for i, one in enumerate(self.periodic)
        )
        return which, self.whole.coefficients(parameters, random), periods


def _likelier(components: Components, sizes: Sizes, apart: Together, whole: Together) -> Floats:
    """(s,) log likelihood of sizes of the noise without errors that have a period, over that with them as normal sums."""
    (log, squares), (log_all, squares_all) = (
        Marginal(one.linear, components, one.estimate).log_likelihood(sizes) for one in (apart, whole)
    )
    return log - log_all - 0.5 * (squares - squares_all)


def _with(
    state: MachineState, model: MeasurementModel, whole: Together, drawn: Floats, noise: StatedNoise,
    periodic: tuple[DrawnPeriod, ...] = (),
) -> MachineState:  # fmt: skip
    """The state with draws (N, k + f) of all errors together."""
    if not np.isfinite(drawn).all():
        raise open_size()
    acting = {one.name for one in state.effects}
    own = [effect.name in acting for effect in model.effects for _ in effect.coefficients]
    kept = np.flatnonzero(np.append(own, np.ones(len(whole.sd), dtype=bool)))
    none = np.zeros(len(whole.sd))
    together = replace(
        state, effects=(*state.effects, *whole.effects), draws=drawn[:, kept], noise=noise, corrected=True, periodic=periodic,
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
    for one in state.periodic:
        prior_mm = MICROMETRE * one.effect.coefficients[0].prior_sd
        found[one.effect.name] = float(np.sqrt(np.mean(one.coefficients**2)) / prior_mm)
    return found


def _evenly(count: int, wanted: int) -> Ints:
    return np.linspace(0, count - 1, min(wanted, count)).astype(np.int64)
