"""The machine's errors given the recording of its calibration, those included that the calibration did not model.

The linear model of a calibration's recording with what the calibration left out of its model.

However many errors were left out, a recording sees no more combinations of them than it has observations: those are its
unknowns beside the calibration's own. Each error takes up what is said of them by its covariance with them, and keeps its
prior in what is not seen.

The machine's errors given the recording of its calibration, those included that the calibration did not model.

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

from cmm_uq.analysis.parts.machine.state import GivenPeriod, MachineState, StatedNoise, Unmodelled, covariance, linear
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.base.units import unit
from cmm_uq.machine.model.measurement import ARTEFACT, RecordingModel
from cmm_uq.machine.model.noise import growing_lengths, noise_of
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.effects.drives import PeriodicScale
from cmm_uq.maths.inference.linear_model import LeastSquares, LinearModel, Unknown
from cmm_uq.maths.inference.marginal import Marginal
from cmm_uq.maths.inference.noise import Components, Sizes
from cmm_uq.maths.inference.posterior import sample_with_noise


class PointwiseEffect(Effect):
    """One millimetre of an error along the motion of an axis at each point by itself."""

    def __init__(self, effect: Effect) -> None:
        self.name, self.along_motion = effect.name, effect.along_motion

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        found = np.zeros((len(points), 3, len(points)))
        each = np.arange(len(points))
        found[each, "xyz".index(str(self.along_motion)), each] = 1.0
        return found


def shown(model: RecordingModel, effect: Effect) -> Floats:
    """(m, n) of the model's used observations, of a millimetre of error at each of its points."""
    about = model.estimate().about
    return model.seen(model.columns(PointwiseEffect(effect), (), about), about)


# of the scatter of the residuals: what a combination of errors adds to the observations below which they do not show it
_UNSEEN = 0.01
_MOST = 400  # combinations, those that the recording sees best; what others say is left to their prior
_SMALLEST = 1e-6  # mm: the smallest noise that is sampled
_ROWS = 1000  # draws at once


@dataclass(frozen=True, eq=False)
class _Given:
    """An error that was left out, with what a recording says of it: its part of :class:`JointModel`."""

    effect: Effect
    sd: Floats
    seen: Floats
    gain: Floats


@dataclass(frozen=True, eq=False)
class _Shown:
    """What the recording shows of an error that was left out."""

    effect: Effect  # linear; of a periodic one the sum of its trials
    # (j,) of its coefficients beforehand: what physics allows, since the recording itself says how large it may be
    sd: Floats
    columns: Floats  # (m, j) mm of the observations for these, without what a placing reaches, which shows nothing
    covariance: Floats  # (m, m) mm² beforehand
    periodic: PeriodicScale | None  # the effect itself where it is periodic, else ``None``
    # readings, impulse: (p,) mm where its scale stood; (m, p) of the observations for a millimetre of error at each
    readings: Floats
    impulse: Floats

    @classmethod
    def of(cls, effect: Effect, model: RecordingModel, own: LinearModel, about: Floats) -> _Shown:
        whole, nothing = linear(effect), np.zeros(0)
        sd = np.array([coefficient.prior_sd for coefficient in whole.coefficients])
        if not isinstance(effect, PeriodicScale):
            columns = sd * _left(own, model.seen(model.columns(whole, (), about), about))
            return cls(whole, sd, columns, columns @ columns.T, None, nothing, nothing)
        points, impulse = model.artefact.points, _left(own, shown(model, effect))
        readings = points.readings[effect.axis]
        columns = sd * (impulse @ whole.basis(points)[:, "xyz".index(effect.axis)])
        beforehand = impulse @ covariance(effect, readings, readings) @ impulse.T
        return cls(whole, sd, columns, beforehand, effect, readings, impulse)

    def given(self, into: Floats) -> _Given:
        """The effect with the recording.

        ``into``: (m, r) whose transpose takes observations, mm, to combinations.
        """
        seen = into.T @ self.columns
        if self.periodic is None:
            return _Given(self.effect, self.sd, seen, seen * self.sd)
        none = np.zeros((len(seen), len(seen)))
        return _Given(
            GivenPeriod(self.periodic, self.readings, self.impulse.T @ into), np.append(self.sd, np.zeros(len(seen))),
            np.hstack([seen, none]), np.hstack([np.zeros_like(seen), np.eye(len(seen))]),
        )  # fmt: skip


def _left(own: LinearModel, columns: Floats) -> Floats:
    """Columns (m, j), mm, without what a placing reaches."""
    return np.asarray(own.reduce(columns) * own.noise_scale[:, None])


@dataclass(frozen=True, eq=False)
class JointModel:
    """The linear model of a calibration with what it left out."""

    # of the calibration's unknowns, then of combinations of what it left out, standard normal beforehand
    linear: LinearModel
    estimate: LeastSquares  # least squares of the calibration, where these are zero
    which: tuple[int, ...]  # places of what takes part in what was left out
    effects: tuple[Effect, ...]  # those, linear
    sd: Floats  # (f,) of their coefficients beforehand, zero of what a recording says of an error with a period
    seen: Floats  # (r, f) combinations that the recording sees, of the coefficients over their standard deviations
    gain: Floats  # (r, f) what a combination that is larger by one says of each coefficient

    @classmethod
    def of(cls, model: RecordingModel, further: Sequence[Unmodelled]) -> JointModel:
        """Of a calibration and of what it left out; what needs columns that were not recorded takes no part."""
        recorded = model.artefact.points.columns
        which = tuple(i for i, one in enumerate(further) if all(name in recorded for name in one.effect.columns))
        estimate = model.estimate()
        own = estimate.linear
        each = [_Shown.of(further[i].effect, model, own, estimate.about) for i in which]
        beforehand = sum((one.covariance for one in each), np.zeros((len(own.observed), len(own.observed))))
        squares, axes = np.linalg.eigh(beforehand)
        least = max(_SMALLEST, _UNSEEN * estimate.least_squares.sigma_of_residuals)
        kept = np.flatnonzero(squares > least**2)[::-1][:_MOST]
        sizes, axes = np.sqrt(squares[kept]), axes[:, kept]
        one = unit("1")
        combined = tuple(Unknown(("left out", str(j)), one, 0.0, 1.0, 1.0) for j in range(len(kept)))
        whole = replace(own, design=np.hstack([own.design, axes * sizes]), unknowns=(*own.unknowns, *combined))
        value = np.append(estimate.least_squares.value, np.zeros(len(combined)))
        given = [one.given(axes / sizes) for one in each]
        none = np.zeros((len(kept), 0))
        return cls(
            whole, replace(estimate.least_squares, value=value), which, tuple(one.effect for one in given),
            np.concatenate([np.zeros(0), *(one.sd for one in given)]), np.hstack([none, *(one.seen for one in given)]),
            np.hstack([none, *(one.gain for one in given)]),
        )  # fmt: skip

    def white(self, sigma_mm: float) -> tuple[Floats, Floats]:
        """Mean (u,) of the linear model's unknowns, and R (u, u) of their covariance RᵀR, for a white noise that is known."""
        rows, given = self.linear.priors
        scale = np.array([unknown.scale for unknown in self.linear.unknowns])
        whitened = np.vstack([self.linear.reduced.design / sigma_mm, rows]) * scale
        if np.linalg.matrix_rank(whitened) < whitened.shape[1]:
            raise open_size()
        inverse = scale[:, None] * np.linalg.pinv(whitened)
        mean = inverse @ np.append(self.linear.reduced.observed / sigma_mm, given)
        return mean, np.asarray(np.linalg.qr(inverse.T, mode="r"))

    def coefficients(self, draws: Floats, random: np.random.Generator) -> Floats:
        """(N, k + f) of the calibration's effects, then of what it left out, of draws (N, …) of the linear model."""
        k = len(draws[0]) - len(self.seen) - self._sizes
        found = np.empty((len(draws), k + len(self.sd)))
        found[:, :k] = draws[:, :k]
        for start in range(0, len(draws), _ROWS):
            rows = slice(start, start + _ROWS)
            free = self._beforehand(random, len(draws[rows]))
            more = draws[rows, len(draws[0]) - len(self.seen) :] - free @ self.seen.T
            free *= self.sd
            free += more @ self.gain
            found[rows, k:] = free
        return found

    def _beforehand(self, random: np.random.Generator, count: int) -> Floats:
        """Draws (N, f) of the coefficients over their standard deviations, without the recording."""
        each = [
            effect.beforehand(random, count) if isinstance(effect, GivenPeriod)
            else random.standard_normal((count, len(effect.coefficients)))
            for effect in self.effects
        ]  # fmt: skip
        return np.hstack([np.zeros((count, 0)), *each])

    @property
    def _sizes(self) -> int:
        """How many of the calibration's unknowns are sizes of its artefact."""
        return sum(unknown.key[0] == ARTEFACT for unknown in self.linear.unknowns)


def open_size() -> CmmUqError:
    """What is raised where nothing says how large the artefact is."""
    return CmmUqError("the recording leaves a size of its artefact open, of which nothing is known beforehand",
                      where="the calibration", fix="Give the artefact's length")  # fmt: skip


def stated_noise(model: RecordingModel, components: Components, sizes: Sizes) -> StatedNoise:
    """Noise of a coordinate for each of N sizes; what the display rounds off is part of a reading."""
    lengths = growing_lengths(model, model.placed(model.estimate().about))[model.used]
    duration = _duration(model)
    with np.errstate(divide="ignore"):
        time = duration / sizes.rate
    # of a length both ends are noisy, of a point of a part the distance from the first is, and that has none itself
    ends = np.sqrt(model.artefact.rows.shape[1])
    return StatedNoise(
        np.hypot(sizes.reading, components.display / np.sqrt(12)), sizes.placing, sizes.slow, time,
        growth_mm=ends * sizes.growth, longest_mm=float(lengths.max(initial=0.0)), walked_s=duration,
    )  # fmt: skip


def _duration(model: RecordingModel) -> float:
    """Of the recording, s; one second where it has no times."""
    time = model.artefact.points.columns.get("time_s")
    if time is None:
        return 1.0
    seconds: Floats = time[model.artefact.rows].mean(axis=1)[model.used]
    return max(float(np.ptp(seconds)), 1e-9)


DRAWS = 10_000
# ratio of the 95 % to the 5 % quantile of the noise from which on the recording does not tell it from errors left out
_UNTOLD = 100.0


def joint_posterior(
    model: RecordingModel, further: Sequence[Unmodelled], sigma_mm: float
) -> tuple[tuple[int, ...], Floats, Floats]:
    """Normal posterior of a calibration's errors and of errors that it did not model, for a white noise that is known.

    ``further``: what it did not model; what needs columns that were not recorded is left out.

    Returns ``which``: places in ``further`` of those that take part. ``mean, covariance``: (k,) and (k, k) of the
    coefficients of the model's effects, then of those.
    """
    whole = JointModel.of(model, further)
    mean, root = whole.white(sigma_mm)
    covariance = root.T @ root
    k = sum(len(effect.coefficients) for effect in model.effects)
    at = np.r_[:k, len(mean) - len(whole.seen) : len(mean)]
    into = np.zeros((k + len(whole.sd), len(at)))
    into[:k, :k] = np.eye(k)
    into[k:, k:] = whole.gain.T
    free = np.vstack([np.zeros((k, len(whole.sd))), np.diag(whole.sd) - whole.gain.T @ whole.seen])
    return whole.which, into @ mean[at], into @ covariance[np.ix_(at, at)] @ into.T + free @ free.T


def draws_given(whole: JointModel, components: Components, sizes: Sizes, random: np.random.Generator) -> Floats:
    """Exact draws (N, k + f) of all errors, one for each of N sizes of the noise; no finite ones where a size is open."""
    return whole.coefficients(Marginal(whole.linear, components, whole.estimate).draw(sizes, random), random)


def given_recording(
    state: MachineState, model: RecordingModel, sigma_mm: float | None = None, draws: int = DRAWS, seed: int = 0
) -> MachineState:
    """The state of a machine with all of its errors drawn together, given the recording of its calibration.

    ``state``: as its certificate states it, its effects in the model's order; the model may have others, as of its artefact.
    How much the calibration bounds an error that it did not model is of no matter here: its recording says that again.
    ``model``: of the calibration, without the observations that its certificate set aside. ``sigma_mm``: standard deviation
    of one recorded coordinate, where the noise is known and white; else it is sampled.
    """
    whole, random = JointModel.of(model, state.unmodelled), np.random.default_rng(seed)
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
    state: MachineState, model: RecordingModel, whole: JointModel, drawn: Floats, noise: StatedNoise
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
