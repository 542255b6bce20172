"""Several recordings of one machine as one linear model: its errors in common; artefacts, placings and noise apart.

    y₁ = X₁·β + A₁·a₁ + C₁·c + P₁·(anything) + ε₁,     y₂ = X₂·(β + d − g) + A₂·a₂ + C₂·c + P₂·(anything) + ε₂

β, c: named errors of the machine, and all others. a, P: of each recording's own artefact and placings. d: change of the
machine between the two, as records let expect. g: what it corrected while the second was made. The noise of the second has the
mean covariance of its posterior given both recordings, with all errors beside it, that of the first taken for known; then only
that of the first is sampled together with the errors' sizes.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

import numpy as np
import scipy

from cmm_uq.analysis.machine.state import Change, MachineState, changes, of_machine
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.field import GivenPeriod, linear as trials
from cmm_uq.machine.model.measurement import RecordingModel
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.maths.inference.linear_model import Freedoms, LeastSquares, LinearModel
from cmm_uq.maths.inference.noise import Components, Sizes
from cmm_uq.maths.inference.posterior import Cause, Doubt

# chance of a recording that contradicts a machine as much, below which it is taken to be of another state of the machine
CONTRADICTED = 1e-3
_NO_NOISE = 1e-12  # part of the variance of a reading of the first recording that is none in another


@dataclass(frozen=True, eq=False)
class FurtherRecording:
    model: RecordingModel  # with the calibration's named errors of the machine, and those of its own artefact and probe
    noise: Floats  # (m, c) factor of the covariance, mm, of its noise and of what is in doubt of it
    # by effect and coefficient: root mean square change between the recordings, and what the machine corrected during this one
    change: Mapping[tuple[str, str], float] = field(default_factory=dict)
    corrections: Mapping[tuple[str, str], float] = field(default_factory=dict)
    # (m,) mm, where no more is known of its observations than that each is so near to zero; such stand behind all others
    limit: Floats = field(default_factory=lambda: np.zeros(0))

    @property
    def linear(self) -> LinearModel:
        """Its linear model, of the machine as it is without corrections."""
        found = self.model.estimate().linear
        added = np.array([self.corrections.get(one.key, 0.0) for one in found.unknowns])
        return replace(found, observed=found.observed + found.design @ added)

    @property
    def changed(self) -> Floats:
        """(m, k) of its observations for the root mean square change of each named error since the calibration, or before."""
        found = self.model.estimate().linear
        return np.asarray(found.design * [self.change.get(one.key, 0.0) for one in found.unknowns])

    def on_its_day(
        self, state: MachineState, on: dt.date, change: Change | None, *, corrected: bool
    ) -> tuple[FurtherRecording, bool]:
        """With what the machine changed between that day and its calibration; whether that is known of every error."""
        keys = [(effect.name, one.name) for effect in state.effects for one in effect.coefficients]
        days = abs((on - state.calibrated).days) if state.calibrated else 0
        each = [size for effect in state.effects for size in changes(effect, days, change)]
        changed = {key: size for key, size in zip(keys, each, strict=True) if size}
        corrects = dict(zip(keys, state.corrects.tolist(), strict=True)) if corrected else {}
        return replace(self, change=changed, corrections=corrects), not (days and None in each)

    def contradiction(self, state: MachineState) -> float:
        """Chance, by the machine as it is known without this recording, of one that deviates as much from it.

        As a whole (χ²), or as a change of one of the named errors would make it deviate; no less than the true chance
        (Bonferroni). Errors that no recording has shown yet are as large as they may be.
        """
        linear = self.linear
        foretold, unseen = self._foretold(state)
        named = {(one.name, each.name) for one in state.effects for each in one.coefficients}
        others = np.array([one.key not in named for one in linear.unknowns], dtype=bool)
        known = others & np.isfinite(linear.prior_sd)
        open_ = linear.design[:, others & ~known] * linear.scale[others & ~known]
        free = np.hstack([linear.freedoms.dense(), open_])
        into = scipy.linalg.null_space(free.T) if free.size else np.eye(len(free))
        left = (linear.observed - linear.design[:, known] @ linear.prior_mean[known] - foretold.mean(axis=0)) @ into
        doubt = np.hstack([linear.design[:, known] * linear.prior_sd[known], self.changed, self.noise, unseen])
        covariance = into.T @ (np.cov(foretold.T) + doubt @ doubt.T) @ into
        columns = np.column_stack([left, into.T @ linear.design[:, ~others]])
        gain = scipy.linalg.solve(covariance, columns, assume_a="pos")
        size = np.einsum("ij,ij->j", columns, gain)
        seen = np.flatnonzero(size[1:] > 0) + 1
        whole = float(scipy.special.chdtrc(len(left), size[0]))
        each = scipy.special.chdtrc(1, (left @ gain[:, seen]) ** 2 / size[seen])
        return min(1.0, 2 * min(whole, len(seen) * float(each.min()) if len(seen) else 1.0))

    def passing(self, state: MachineState) -> float:
        """The least chance of an observation to keep its limit, by the machine as it is known without this recording."""
        foretold, unseen = self._foretold(state)
        sd = np.linalg.norm(np.hstack([self.changed, self.noise, unseen]), axis=1)
        ends = ((sign * self.limit - foretold + self.linear.observed) / sd for sign in (1, -1))
        above, below = (scipy.special.ndtr(end).mean(axis=0) for end in ends)
        return float(np.min(above - below))

    def _foretold(self, state: MachineState) -> tuple[Floats, Floats]:
        """Draws (N, m) of the observations by a machine's errors, and (m, j) for what no recording has shown of these."""
        found, start = np.zeros((len(state.draws), int(self.model.used.sum()))), 0
        for effect in state.effects:
            own = state.draws[:, start : start + len(effect.coefficients)]
            start += len(effect.coefficients)
            found += own @ shown_by(self.model, effect).T
        each = (trials(one.effect) for one in state.unmodelled)
        return found, np.hstack([found[:0].T, *(shown_by(self.model, whole) * sd_of(whole) for whole in each)])


def doubted(model: RecordingModel, causes: Iterable[Cause]) -> Floats:
    """(m, c) of the used observations for what is in doubt about them: of all together and, as that is not known, by block."""
    each = [part for one in causes for part in (one.common, None if one.apart is None else one.apart.dense())]
    return np.hstack([np.zeros((int(model.used.sum()), 0)), *(part[model.used] for part in each if part is not None)])


@dataclass(frozen=True, eq=False)
class FurtherRecordings:
    recordings: tuple[FurtherRecording, ...] = ()
    # of doubt about the calibration's own observations
    causes: Callable[[Artefact], Iterable[Cause]] = lambda artefact: ()

    def doubted(self, model: RecordingModel) -> Floats | None:
        """As of :func:`doubted`, where others bear on the same errors: else doubt widens what follows from one recording."""
        return doubted(model, self.causes(model.artefact)) if self.recordings else None

    def left_of(self, doubt: Doubt) -> Doubt:
        """What of a doubt about one recording is still to widen what follows: nothing where others are weighed against it."""
        return NO_DOUBT if self.recordings else doubt


ALONE = FurtherRecordings()
NO_DOUBT = Doubt(())


def recorded(model: RecordingModel, effect: Effect) -> bool:
    """Whether all that an effect depends on was recorded."""
    return all(name in model.artefact.points.columns for name in effect.columns)


def shown_by(model: RecordingModel, effect: Effect) -> Floats:
    """(m, j) of the used observations for one unit of each coefficient; nothing where its columns were not recorded."""
    return np.hstack([*shown_in_parts(model, effect)])


def shown_in_parts(model: RecordingModel, effect: Effect, *, along: bool = False) -> Iterator[Floats]:
    """The same, of some of the coefficients after the others; ``along`` a straight motion in fewer steps."""
    if not recorded(model, effect):
        yield np.zeros((int(model.used.sum()), len(effect.coefficients)))
        return
    about = model.estimate().about
    acting = model.about(about)
    for part in effect.parts(acting.points) if isinstance(effect, GivenPeriod) else (effect,):
        if (motion := acting.motion(part) if along else None) is None:
            yield model.seen(acting.columns(part), about)
        else:
            yield -model.artefact.project_along(model.where(about), *motion)[model.used]


def sd_of(effect: Effect) -> Floats:
    """(j,) of its coefficients beforehand: what physics allows, or what is stated."""
    return np.array([one.prior_sd for one in effect.coefficients])


def model_of_machine(first: RecordingModel, other: RecordingModel) -> RecordingModel:
    """The model of another recording, with the first one's named errors of the machine whose columns it has."""
    shared = [one for one in first.effects if of_machine(one) and recorded(other, one)]
    return replace(other, effects=(*shared, *(one for one in other.effects if not of_machine(one))))


def components_of(model: RecordingModel) -> Components:
    """The noise of a recording's observations."""
    return replace(noise_of(model), known=model.least_noise)


def mean_noise(components: Components, sizes: Sizes) -> Floats:
    """(m, m) factor of the mean covariance, mm², of noise of sizes (N,)."""
    (fast, slow), walks = components.variances(sizes), sizes.rate == 0
    own = np.asarray(components.turn.T @ np.diag(np.sqrt(components.shares @ fast.mean(axis=0))))
    covariance = own @ own.T
    if components.slow.shape[1]:
        for some, columns in ((~walks, components.slow), (walks, components.anchored)):
            covariance += (columns * (some @ slow / len(slow))) @ columns.T
    return np.asarray(np.linalg.cholesky(covariance))


def stacked(model: RecordingModel, beside: Sequence[FurtherRecording]) -> tuple[LinearModel, Components, LeastSquares]:
    """The linear model of all observations, those of the first before others; the noise of the first; what is estimated."""
    first, components = model.estimate(), components_of(model)
    if not beside:
        return first.linear, components, first.least_squares
    each, solved = [first.linear, *(one.linear for one in beside)], [first.least_squares]
    solved += [one.model.estimate().least_squares for one in beside]
    shared = {(one.name, c.name) for one in model.effects if of_machine(one) for c in one.coefficients}
    unknowns, value, places = list(first.linear.unknowns), first.least_squares.value.tolist(), list[list[int]]()
    where = {one.key: i for i, one in enumerate(unknowns) if one.key in shared}
    for number, (linear, found) in enumerate(zip(each, solved, strict=True)):
        places.append(list(range(len(unknowns))) if not number else [])
        for unknown, estimate in zip(linear.unknowns if number else (), found.value, strict=False):
            places[-1].append(where.get(unknown.key, len(unknowns)))
            if unknown.key not in where:
                unknowns.append(unknown)
                value.append(float(estimate))
    sizes = [len(linear.observed) for linear in each]
    design, ends = np.zeros((sum(sizes), len(unknowns))), np.cumsum([0, *sizes])
    for linear, place, start, end in zip(each, places, ends, ends[1:], strict=False):
        design[start:end, place] = linear.design
    placing = scipy.linalg.block_diag(*(linear.freedoms.dense() for linear in each))
    whole = LinearModel(
        np.concatenate([linear.observed for linear in each]), design, tuple(unknowns), Freedoms.of(placing),
        np.concatenate([linear.noise_scale for linear in each]), first.linear.sigma,
    )  # fmt: skip
    return whole, _with_rows(components, sum(sizes[1:])), replace(first.least_squares, value=np.array(value))


def _with_rows(components: Components, more: int) -> Components:
    """The noise of the first recording in observations of others too, where it is none; its proportions are kept."""
    turn = scipy.sparse.block_diag([components.turn, scipy.sparse.eye_array(more)], format="csr")
    part = np.mean(components.shares / components.shares[:, :3].sum(axis=1, keepdims=True), axis=0)
    shares = np.vstack([components.shares, np.tile(_NO_NOISE * part, (more, 1))])
    slow = np.vstack([components.slow, np.zeros((more, components.slow.shape[1]))])
    return replace(components, turn=scipy.sparse.csr_array(turn), shares=shares, slow=slow)
