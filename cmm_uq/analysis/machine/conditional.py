"""The machine's errors given the recording of its calibration, those included that the calibration did not model.

What a calibration leaves out of its model does not stay out of its recording: it goes into the estimates of what is modelled,
and into its noise. A part measured like the artefact then errs by less than both would alone, another part by more. Where the
recording is at hand (a job, or a certificate that carries it) everything is therefore estimated together, the machine as one
random field: each error of a size that its family has, the families' sizes and those of the noise's components as the
recording says; what the machine corrects stays what its certificate states. What the recording does not see of a family keeps
the size that the family is seen to have; of a family that it does not see at all, what physics allows.

How an axis is stated to be read, and a bound of an error, is taken as stated, unless the recording denies it. All sizes
integrated out, the observations have the density p as stated, and pₐ without the statement a; where pₐ/p is beyond 20, it is
not used. Of correct statements one in twenty is denied at most (Markov's inequality: pₐ/p has the mean one). So are all
together. What is denied most goes first, and the others are looked at anew without it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

import numpy as np
import scipy

from cmm_uq.analysis.machine import recordings
from cmm_uq.analysis.machine.state import GivenSizes, MachineState, StatedNoise, StatementEvidence, Unmodelled
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.base.values import dataclass, replace
from cmm_uq.machine.model.field import AtPoints, GivenPeriod, covariance, family_of, linear
from cmm_uq.machine.model.measurement import RecordingModel
from cmm_uq.machine.model.noise import growing_lengths
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.effects.drives import PeriodicScale
from cmm_uq.maths.inference.families import FieldErrors, FieldModel, normal
from cmm_uq.maths.inference.family_sizes import HELD, USUAL, Effort, FieldSizes, log_evidence, sample_sizes
from cmm_uq.maths.inference.noise import Components, Sizes
from cmm_uq.maths.inference.posterior import Cause, Doubt, sample_with_noise


def shown(model: RecordingModel, effect: Effect) -> Floats:
    """(m, n) of the model's used observations, of a millimetre of an axis' error at each of its points by itself."""
    about = model.estimate().about
    return model.seen(model.columns(AtPoints(effect, np.eye(len(model.artefact.points))), (), about), about)


@dataclass(frozen=True, eq=False)
class RecordedField:
    """A calibration's model, and what it left out, as one linear model with families of errors."""

    field: FieldModel
    modelled: int  # coefficients of the calibration's own effects
    which: tuple[int, ...]  # places of what takes part in what was left out
    effects: tuple[Effect, ...]  # those, linear
    sd: Floats  # (f,) of a unit of each of their coefficients, in its own unit

    @classmethod
    def of(
        cls, model: RecordingModel, further: Sequence[Unmodelled], *, learned: bool = True,
        beside: Sequence[recordings.FurtherRecording] = (), in_doubt: Floats | None = None,
    ) -> RecordedField:  # fmt: skip
        """Of a calibration and of what it left out; what needs columns that were not recorded takes no part.

        ``learned``: whether families have sizes to be found; else all are as large as physics allows. ``beside``: further
        recordings of the machine. ``in_doubt``: (m, c) of the calibration's observations for what is stated to be in doubt.
        """
        models = (model, *(one.model for one in beside))
        which = tuple(i for i, one in enumerate(further) if any(recordings.recorded(m, one.effect) for m in models))
        # where the artefact stands, not what was read: noise of readings would explain itself
        points = [each.artefact.points.at(each.where(each.estimate().about)) for each in models]
        errors = [_errors(models, further[i].effect, points, learned) for i in which]
        limit = np.concatenate([np.zeros(0), *(one.limit for one in beside)])
        whole = FieldModel(*recordings.stacked(model, beside), (*errors, *_own(models, beside, in_doubt)), limit)
        effects, sds = list[Effect](), [np.zeros(0)]
        for i, one in zip(which, errors, strict=True):
            effect = further[i].effect
            sds.append(recordings.sd_of(linear(effect)))
            if one.impulse is not None and isinstance(effect, PeriodicScale):
                seen = whole.shown(one.impulse)
                sds.append(np.ones(len(seen)))
                effects.append(GivenPeriod(effect, _readings(points, effect), seen.T))
            else:
                effects.append(effect)
        modelled = sum(len(effect.coefficients) for effect in model.effects)
        return cls(whole, modelled, which, tuple(effects), np.concatenate(sds))

    def coefficients(
        self,
        sizes: Sizes,
        scales: Floats,
        random: np.random.Generator,
        within: Floats | None = None,
        observed: Floats | None = None,
    ) -> Floats:
        """Exact draws (N, k + f) of the calibration's effects, then of what it left out, for N sizes of noise and families."""
        drawn, start = self.field.draw(sizes, scales, random, within, observed), len(self.field.linear.unknowns)
        others = drawn[:, start : start + len(self.sd)]
        others *= self.sd
        return np.hstack([drawn[:, : self.modelled], others])


def _readings(points: Iterable[Points], effect: PeriodicScale) -> Floats:
    return np.concatenate([each.readings[effect.axis] for each in points])


def _errors(models: Sequence[RecordingModel], effect: Effect, points: Sequence[Points], learned: bool) -> FieldErrors:
    whole, family = linear(effect), family_of(effect) if learned else None
    if not isinstance(effect, PeriodicScale):
        columns = np.vstack([recordings.shown_by(each, whole) for each in models]) * recordings.sd_of(whole)
        return FieldErrors(family, columns, normal(columns.shape[1]))
    readings = _readings(points, effect)
    impulse = scipy.linalg.block_diag(*(shown(each, effect) for each in models))
    waves = np.vstack([whole.basis(each)[:, "xyz".index(effect.axis)] for each in points])
    beforehand = GivenPeriod(effect, readings, np.zeros((len(readings), 0))).beforehand
    tied = covariance(effect, readings, readings)
    return FieldErrors(family, impulse @ waves * recordings.sd_of(whole), beforehand, impulse, tied)


def _own(
    models: Sequence[RecordingModel], beside: Sequence[recordings.FurtherRecording], in_doubt: Floats | None
) -> Iterator[FieldErrors]:
    """What one recording has alone: doubt of the first; noise of a further one, and the machine's change between them."""
    ends = np.cumsum([int(each.used.sum()) for each in models])
    if in_doubt is not None and (count := in_doubt.shape[1]):
        yield FieldErrors(None, np.vstack([in_doubt, np.zeros((ends[-1] - ends[0], count))]), normal(count))
    for one, start in zip(beside, ends.tolist(), strict=False):
        columns = np.hstack([one.noise, one.changed[:, np.any(one.changed, axis=0)]])
        whole = np.zeros((ends[-1], columns.shape[1]))
        whole[start : start + len(columns)] = columns
        yield FieldErrors(None, whole, normal(columns.shape[1]))


def own_noise(
    model: RecordingModel, errors: Sequence[Unmodelled], seed: int = 0, known: Sizes | None = None,
    beside: Sequence[recordings.FurtherRecording] = (),
) -> Floats:  # fmt: skip
    """(m, m) factor of the mean covariance, mm, of a recording's noise, all of the machine's errors and others beside it."""
    whole = RecordedField.of(model, errors, beside=beside)
    return recordings.mean_noise(recordings.components_of(model), known or _sizes(whole, model, HELD, seed, None).noise)


def further_recording(
    first: recordings.FurtherRecording, other: RecordingModel, errors: Sequence[Unmodelled], seed: int = 0,
    sigma_mm: float | None = None, causes: Sequence[Cause] = (),
) -> recordings.FurtherRecording:  # fmt: skip
    """Another recording of the machine, its noise as it follows from both of them together, that of the first being known.

    ``other``: without the observations that its certificate set aside. ``errors``: that the calibration did not model.
    ``sigma_mm``: of one recorded coordinate, where the noise is known and white. ``causes``: of doubt about all its
    observations, which act on them together and, as that is not known, on each block by itself besides.
    """
    model, known = recordings.model_of_machine(first.model, other), None if sigma_mm is None else white(sigma_mm)
    noise = own_noise(model, errors, seed, known, (first,))
    return recordings.FurtherRecording(model, np.hstack([noise, recordings.doubted(model, causes)]))


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


DRAWS, _EVIDENCE_SEED = 10_000, 43
_MOST_LOG = 700.0  # of a number that is not infinite
# ratio of the 95 % to the 5 % quantile of the noise from which on the recording does not tell it from errors left out
_UNTOLD = 100.0


def white(sigma_mm: float) -> Sizes:
    """One draw of a noise that is known: the same of each coordinate of each point."""
    none = np.zeros(1)
    return Sizes(np.full((1, 3), sigma_mm), none, none, none, none + 1)


def given_recording(
    state: MachineState, model: RecordingModel, sigma_mm: float | None = None, draws: int = DRAWS, seed: int = 0,
    doubt: Doubt = recordings.NO_DOUBT, beside: recordings.FurtherRecordings = recordings.ALONE, effort: Effort = USUAL,
) -> MachineState:  # fmt: skip
    """The state of a machine with all of its errors drawn together, given the recording of its calibration.

    ``state``: as its certificate states it, its effects in the model's order; the model may have others, as of its artefact.
    How much the calibration bounds an error that it did not model is of no matter here: its recording says that again.
    ``model``: of the calibration, without the observations that its certificate set aside. ``sigma_mm``: standard deviation
    of one recorded coordinate, where the noise is known and white; else it is sampled. ``doubt``: what is stated to be in
    doubt about the model's unknowns by causes that all its observations share, as of its certificate. ``beside``: what is
    taken together with it, with its own part of what is in doubt.
    """
    known = None if sigma_mm is None else white(sigma_mm)
    others, statements = as_recorded_allows(model, state.unmodelled, known, beside.recordings)
    state = replace(state, unmodelled=others, statements=statements)
    whole = RecordedField.of(model, state.unmodelled, beside=beside.recordings, in_doubt=beside.doubted(model))
    doubt, random = beside.left_of(doubt), np.random.default_rng(seed)
    noise = replace(state.noise, coordinate_mm=state.noise.usual_mm)
    sizes = _sizes(whole, model, draws, seed, known, effort)
    if known is None:
        noise = stated_noise(model, whole.field.noise, sizes.noise)
    drawn, k = whole.coefficients(sizes.noise, sizes.families, random, sizes.within), whole.modelled
    drawn[:, :k] = doubted_draws(doubt, len(model.unknowns), np.arange(k), seed, drawn[:, :k])
    together = with_errors(state, model, whole, drawn, noise)
    scales = dict(zip(whole.field.families, sizes.families.T, strict=True))
    shares = _shares(together), _shares(together, scales)
    given = GivenSizes(state, sizes)
    return replace(together, scales=scales, prior_share=shares[0], family_share=shares[1], given=given)


def _sizes(
    whole: RecordedField, model: RecordingModel, draws: int, seed: int, known: Sizes | None, effort: Effort = USUAL
) -> FieldSizes:
    """Of noise and families; where any noise would do, it is taken for what the calibration took it for, which is no less."""
    sizes = sample_sizes(whole.field, draws, seed, known, effort)
    if known is not None:
        return sizes
    low, high = np.quantile(sizes.noise.coordinate, [0.05, 0.95])
    if high <= _UNTOLD * low:
        return sizes
    estimate = model.estimate()
    alone = sample_with_noise(estimate.linear, recordings.components_of(model), estimate.least_squares, seed).sizes
    some = np.linspace(0, len(alone.placing) - 1, HELD).astype(np.int64)[np.arange(draws) % HELD]
    return replace(sample_sizes(whole.field, draws, seed, alone.typical), noise=alone.at(some))


def doubted_draws(doubt: Doubt, count: int, named: Ints, seed: int, draws: Floats) -> Floats:
    """Draws (N, k) of some of ``count`` unknowns with what is in doubt about all observations together."""
    if not doubt.carried:
        return draws
    whole = np.zeros((len(draws), count))
    whole[:, named] = draws
    return doubt.widened(whole, seed)[:, named]


def with_errors(
    state: MachineState, model: RecordingModel, whole: RecordedField, drawn: Floats, noise: StatedNoise
) -> MachineState:
    """The state with draws (N, k + f) of all errors together."""
    if not np.isfinite(drawn).all():
        raise CmmUqError("a draw is no finite number", where="the calibration")
    acting = {one.name for one in state.effects}
    own = [effect.name in acting for effect in model.effects for _ in effect.coefficients]
    kept = np.flatnonzero(np.append(own, np.ones(len(whole.sd), dtype=bool)))
    none = np.zeros(len(whole.sd))
    return replace(
        state, effects=(*state.effects, *whole.effects), draws=drawn[:, kept], noise=noise, corrected=True,
        unmodelled=tuple(one for i, one in enumerate(state.unmodelled) if i not in whole.which),
        corrections=np.append(state.corrects, none), drift=np.append(state.drift, none),
    )  # fmt: skip


def _shares(state: MachineState, scales: Mapping[str, Floats] | None = None) -> dict[str, float]:
    """Posterior standard deviation of each effect over its prior one, of several coefficients in the root mean square.

    ``scales``: of the families, to which prior ones are held then; of effects without a family nothing is said.
    """
    squares, start = dict[str, Floats](), 0
    for effect in state.effects:
        own = state.draws[:, start : start + len(effect.coefficients)]
        start += len(effect.coefficients)
        size, family = 1.0, family_of(effect)
        if scales is not None:
            if family is None or family not in scales:
                continue
            size = float(np.mean(scales[family] ** 2))
        prior = sum(coefficient.prior_sd**2 for coefficient in effect.coefficients)
        each = np.array([own.var(axis=0).sum(), size * prior])
        if isinstance(effect, GivenPeriod):
            each = np.array([effect.share(own) ** 2, size])
        squares[effect.name] = squares.get(effect.name, np.zeros(2)) + each
    return {name: float(np.sqrt(left / prior)) if prior else 0.0 for name, (left, prior) in squares.items()}


def as_recorded_allows(
    model: RecordingModel,
    others: Sequence[Unmodelled],
    known: Sizes | None = None,
    beside: Sequence[recordings.FurtherRecording] = (),
) -> tuple[tuple[Unmodelled, ...], tuple[StatementEvidence, ...]]:
    """Errors that were not modelled, without what the recording denies of what is stated of them; and what it says of each.

    ``known``: sizes of the noise, one draw, where these are not to be found.
    """
    held, found = tuple(others), dict[str, StatementEvidence]()
    models = (model, *(one.model for one in beside))
    chains, every = list(held), set[str]()
    while chains := [one for one in chains if one.unstated]:
        every |= {one.stated_by for one in chains}
        chains = [one.unstated for one in chains if one.unstated]
    while True:
        told = {s.stated_by for s in held if s.unstated and any(recordings.recorded(m, s.effect) for m in models)}
        left = sorted(name for name in told if not (name in found and found[name].denied))
        if not left:
            break
        alone = _evidence(model, held, known, beside)
        sets = [(name,) for name in left] + [tuple(left)] * (len(left) > 1)
        logs = {some: _evidence(model, _without(held, some), known, beside) - alone for some in sets}
        said = {
            some: {name: StatementEvidence(name, float(np.exp(min(log, _MOST_LOG)))) for name in some}
            for some, log in logs.items()
        }
        for name in left:
            found |= said[name,]
        worst = max(sets, key=lambda some: logs[some])
        if not any(one.denied for one in said[worst].values()):
            break
        held, found = _without(held, worst), found | said[worst]
    return held, tuple(found.get(name, StatementEvidence(name, np.nan)) for name in sorted(every))


def _without(others: Iterable[Unmodelled], statements: Collection[str]) -> tuple[Unmodelled, ...]:
    return tuple(one.unstated if one.unstated is not None and one.stated_by in statements else one for one in others)


def _evidence(
    model: RecordingModel,
    others: Sequence[Unmodelled],
    known: Sizes | None,
    beside: Sequence[recordings.FurtherRecording],
) -> float:
    return log_evidence(RecordedField.of(model, others, beside=beside).field, _EVIDENCE_SEED, known)
