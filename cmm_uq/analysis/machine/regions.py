"""Where an error factor holds: over the recorded set-ups, over the measuring range, and within parts of it.

A model of named errors states of each the mean over the set-ups that were recorded. A machine has other errors besides, and
elsewhere the same figure would be another: the scale of X above the table is not that below the quill. Here the machine is the
random field of :mod:`cmm_uq.machine.model.field`, drawn given the recording. What a factor is within a region is what least
squares of the named errors, of scales and squarenesses that are not named, and of a displacement as a whole, find of all
errors at points that fill it:

    θ(R) = θ + P_R·B_R·c

with θ and c the coefficients of named and other errors, B_R (3n, j) what one unit of each of c does at the points of R, and
P_R the least-squares operator of the named columns at the same points. Over the recorded set-ups P is the estimator of the
recording itself. Where the recording leaves the difference open, the draws differ, and U says so.

What is stated of a machine's axes: how each is read, in place of what physics allows of its periodic error and play.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import product

import numpy as np

from cmm_uq.analysis.diagnosis.held_out import with_quantities
from cmm_uq.analysis.machine.agreement import Agreement, Key, RecordedDraws, held_together, of_factors, of_lengths
from cmm_uq.analysis.machine.conditional import RecordedField, as_recorded_allows, doubted_draws, stated_noise
from cmm_uq.analysis.machine.performance import (
    MachinePerformance,
    PriorInfluence,
    influence_of,
    performance_of,
    rows_of,
)
from cmm_uq.analysis.machine.recordings import ALONE, FurtherRecordings, components_of, recorded, shown_by
from cmm_uq.analysis.machine.state import StatementEvidence, Unmodelled, of_machine, stated_as, unmodelled_errors
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.base.points import AXES, Floats, Ints, Machine, Points
from cmm_uq.base.values import dataclass, replace
from cmm_uq.machine.model.field import ALLOWED, as_read, curves, family_of
from cmm_uq.machine.model.kind import Observed
from cmm_uq.machine.model.measurement import RecordingModel
from cmm_uq.machine.model.readings import AxisReading
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.effects.drives import HYSTERESIS, PeriodicScale
from cmm_uq.machine.physics.superposition import About
from cmm_uq.maths.inference.family_sizes import BRIEF, FieldSizes, sample_sizes
from cmm_uq.maths.inference.posterior import Doubt, NoisyPosterior
from cmm_uq.maths.uncertainty.quantity import Quantity


def readings_of(machine: Machine) -> dict[str, AxisReading]:
    """By axis, of those of which it is stated how they are read."""
    q = float(np.sqrt(-2 * np.log(0.05)))
    return {
        axis: AxisReading(facts, q * PeriodicScale(axis).coefficients[0].prior_sd)
        for axis, facts in machine.read_by.items()
    }


def with_readings(others: Iterable[Unmodelled], machine: Machine) -> tuple[Unmodelled, ...]:
    """Errors that were not modelled, those of axes as these are stated to be read; a bound stands before that."""
    known, found = readings_of(machine), list[Unmodelled]()
    for one in others:
        effect, reading = one.effect, known.get(getattr(one.effect, "axis", ""))
        if one.unstated is not None:
            one = replace(one, unstated=with_readings((one.unstated,), machine)[0])
        elif reading is not None:
            if isinstance(effect, PeriodicScale):
                one = stated_as(one, as_read(effect, reading.largest_um, reading.errors))
            elif HYSTERESIS.has(effect) and reading.play_um is not None:
                one = stated_as(one, as_read(effect, reading.play_um))
        found.append(one)
    return tuple(found)


DRAWS = 2000
_ABSENT = 1e-4  # size of a family of errors that are not there
_ERRORS, _LEAST = 4_000_000, 200  # errors of lengths that are drawn, and how often each at least
_AT_ONCE = 2000  # lengths, each by every coefficient of the machine, that memory holds
_MOST = 100  # quantities of a recording, with their repeats: time grows with the cube of what they show
_EACH = 5  # points along each axis of a region
_ANYWHERE = ("ppm", "″", "″/m")  # units of what means the same on a part of a travel; a bow is one of the whole travel
_HALVES = ((0.0, 0.5), (0.5, 1.0))
EIGHTHS = tuple(product(_HALVES, repeat=3))  # parts of the measuring range, by shares of the travels
# part of the largest singular value that counts as none; of a named error, that least squares would then take for another
_RANK, _ANOTHER = 1e-9, 1e-6

Ends = Sequence[tuple[float, float]]  # of a region along each axis, shares of the travels


@dataclass(frozen=True, eq=False)
class FactorRegions:
    """Error factors within regions, and how large the recording shows the other errors to be."""

    whole: Mapping[Key, Quantity]  # over the measuring range
    # 95 % interval within which an angle, a ratio or a rate is in all eighths of it
    eighths: Mapping[Key, tuple[float, float]]
    recorded: Mapping[Key, Quantity]  # over the recorded set-ups, all errors together
    agreement: Agreement  # of these with what is stated by the named errors alone, and with what was read
    scales: Mapping[str, Floats]  # (N,) sizes of each family, of what physics allows
    influence: tuple[PriorInfluence, ...]  # of other priors on the factors over the measuring range, in their order
    observations: tuple[int, int]  # reckoned with, and of how many
    statements: tuple[StatementEvidence, ...] = ()  # what the recording says of what is stated of axes
    performance: MachinePerformance | None = None  # without noise; of an artefact that has lengths


@dataclass(frozen=True, eq=False)
class DrawnErrors:
    """All errors of a machine together, drawn given a recording."""

    model: RecordingModel  # of the observations that are reckoned with
    field: RecordedField
    sizes: FieldSizes
    own: Floats  # (N, k) of the coefficients of the named effects
    further: Floats  # (N, f) of those of the field's effects
    others: tuple[Unmodelled, ...]  # errors beside the named ones
    statements: tuple[StatementEvidence, ...]  # what the recording says of what is stated of axes
    beside: FurtherRecordings  # that is taken together with it
    doubt: Doubt  # what is in doubt about the unknowns beside that
    seed: int

    @classmethod
    def of(
        cls, model: RecordingModel, doubt: Doubt, observe: Observed, seed: int, draws: int = DRAWS,
        beside: FurtherRecordings = ALONE, others: Sequence[Unmodelled] | None = None,
    ) -> DrawnErrors:  # fmt: skip
        """``doubt``: what is stated to be in doubt about the unknowns. ``beside``: what is taken together with the recording.

        ``others``: errors beside the named ones; by default those of three straight axes.
        Raises ``CmmUqError`` where the machine's travel is not stated, or the recording does not allow it.
        """
        random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(37,)))
        thinned = with_quantities(model, observe, seed, _MOST)
        known = other_errors(model) if others is None else others
        others, statements = as_recorded_allows(thinned, known, beside=beside.recordings)
        field = RecordedField.of(thinned, others, beside=beside.recordings, in_doubt=beside.doubted(thinned))
        sizes = sample_sizes(field.field, draws, seed, effort=BRIEF)
        drawn = field.coefficients(sizes.noise, sizes.families, random)
        own, further = drawn[:, : field.modelled], drawn[:, field.modelled :]
        return cls(thinned, field, sizes, own, further, others, statements, beside, beside.left_of(doubt), seed)

    def doubted(self, model: RecordingModel, which: Ints, draws: Floats) -> Floats:
        """Draws (N, k) of some of the unknowns, with what is in doubt about them."""
        return doubted_draws(self.doubt, len(model.unknowns), which, self.seed, draws)

    def field_of(self, model: RecordingModel) -> RecordedField:
        """Of some of the observations, with the same errors."""
        return RecordedField.of(model, self.others, beside=self.beside.recordings, in_doubt=self.beside.doubted(model))

    def of_recording(self, model: RecordingModel, posterior: NoisyPosterior) -> RecordedDraws:
        """What they make of all observations, with the estimate of the named errors alone, of ``posterior``."""
        which, sigma = np.arange(self.field.modelled), float(np.median(posterior.sigma))
        return RecordedDraws(model, which, self.own, self.field.effects, self.further, self.sizes.noise, sigma)

    def agreement(
        self, found: RecordedDraws, posterior: NoisyPosterior, doubt: Doubt, performance: MachinePerformance | None
    ) -> Agreement:
        """Of factors with those of the named errors alone, of slopes and lengths with what was read.

        ``doubt``: what is stated to be in doubt about the unknowns: about both alike, unless other recordings bear on one.
        """
        model, every = found.model, [found.slopes(doubt)]
        every.append(of_factors(model, posterior, found.factors, doubt if self.beside.recordings else Doubt(())))
        if performance is not None:
            noise = stated_noise(model, components_of(model), self.sizes.noise)
            every.append(of_lengths(performance, model, noise, doubt))
        return held_together(every)

    def performance(self, model: RecordingModel) -> MachinePerformance | None:
        """Figures of the recorded lengths without noise; ``None`` of an artefact that has no lengths.

        Whether what the named errors leave is noise, or errors of the field, a recording says by how smooth it is, and hardly
        at all where nothing was measured twice. Half of the draws are of a machine with no errors beside the named ones.
        """
        rows = rows_of(model.artefact)
        if rows is None:
            return None
        each = np.linspace(0, len(self.own) - 1, min(len(self.own), max(_LEAST, _ERRORS // len(rows)))).astype(np.int64)
        try:
            none = tuple(one for one in self.field.field.errors if one.family is None)
            noise = sample_sizes(replace(self.field.field, errors=none), len(each), self.seed, effort=BRIEF).noise
        except CmmUqError:  # where the factors hold is stated all the same
            return None
        random = np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(41,)))
        absent = np.full((len(each), len(self.field.field.families)), _ABSENT)
        drawn, k = self.field.coefficients(noise, absent, random), self.field.modelled
        whole = np.where(np.arange(len(each))[:, None] % 2, drawn, np.hstack([self.own, self.further])[each])
        own = self.doubted(model, np.arange(k), whole[:, :k])
        return performance_of(model, self.of_lengths(model, rows, own, whole[:, k:]))

    def of_lengths(self, model: RecordingModel, rows: Ints, own: Floats, further: Floats) -> Floats:
        """Draws (N, m), mm, of how much longer than true the machine shows lengths between points ``rows`` (m, 2).

        Without noise, where the recording found the points; ``own`` (N, k), ``further`` (N, f) draws of all effects.
        """
        artefact, about = model.artefact, model.estimate().about
        steps = np.diff(artefact.points.xyz[rows], axis=1)[:, 0]
        along = artefact.lines_of(rows)[1]
        along = along * (np.sign(np.sum(along * steps, axis=1)) / np.linalg.norm(along, axis=1))[:, None]
        acting, k, own = model.about(about), own.shape[1], own - about[: own.shape[1]]
        if (lengths := artefact.lengths()) is not None and not np.array_equal(artefact.lines_of(rows)[1], steps):
            # between other places than the readings', as of balls that were scanned: by what the artefact makes of errors
            every, sizes = model.using(), [one.nominal for one in artefact.sizes]
            shown = lengths - sizes[0] - artefact.size_change() @ (about[k:] - sizes) - every.residuals(about)
            columns = np.hstack([shown_by(every, one) for one in (*model.effects, *self.field.effects)])
            return np.asarray(shown + own @ columns[:, :k].T + further @ columns[:, k:].T)

        def added(some: Ints) -> Floats:
            which, ends = np.unique(rows[some], return_inverse=True)
            there, (a, b) = acting.select(which), ends.reshape(-1, 2).T
            columns = [np.zeros((len(some), 0))]
            for one in (*model.effects, *self.field.effects):
                if recorded(model, one) and (motion := there.motion(one)) is not None:
                    columns.append((along[some] @ motion[0])[:, None] * (motion[1][a] - motion[1][b]))
                elif recorded(model, one):
                    errors = there.columns(one)
                    columns.append(np.einsum("mi,mik->mk", along[some], errors[a] - errors[b]))
                else:  # as other recordings show it
                    columns.append(np.zeros((len(some), len(one.coefficients))))
            each = np.hstack(columns).T
            return np.asarray(own @ each[:k] + further @ each[k:])

        shown, true = (
            np.linalg.norm(np.diff(xyz[rows], axis=1)[:, 0], axis=1)
            for xyz in (model.predicted(about), model.placed(about))
        )
        found = np.empty((len(own), len(rows)))
        for some in np.array_split(np.arange(len(rows)), 1 + len(rows) // _AT_ONCE):
            found[:, some] = added(some)
        found += shown - true
        return found


def other_errors(model: RecordingModel) -> list[Unmodelled]:
    """What a machine may have beside the named errors, as its axes are read; curves in place of their simplest forms."""
    others = with_readings(unmodelled_errors([one.name for one in model.effects], {}), model.artefact.points.machine)
    return [one for one in others if family_of(one.effect) not in ALLOWED] + [
        Unmodelled(one, np.array([c.prior_sd for c in one.coefficients])) for one in curves()
    ]


def factor_regions(
    model: RecordingModel, posterior: NoisyPosterior, doubt: Doubt, observe: Observed, seed: int,
    beside: FurtherRecordings = ALONE,
) -> FactorRegions:  # fmt: skip
    """Of the named errors that need nothing but a place.

    ``posterior``: of the model with no other errors. ``doubt``: what is stated to be in doubt about its unknowns. ``beside``:
    what is taken together with the recording. Raises ``CmmUqError`` where the machine's travel is not stated, or the
    recording does not allow it.
    """
    if model.artefact.points.machine.axes != tuple(AXES):
        raise CmmUqError(say("the machine has other axes than three straight ones"), where="the machine")
    drawn = DrawnErrors.of(model, doubt, observe, seed, beside=beside)
    field, sizes, own, further = drawn.field, drawn.sizes, drawn.own, drawn.further

    named, placed = columns_of(model.effects, _of_place), columns_of(field.effects, lambda one: not one.columns)
    acting = _chosen(model.effects, named), _chosen(field.effects, placed)
    moved = _moved(model.artefact.points.machine, *acting, (((0.0, 1.0),) * 3, *EIGHTHS))
    same = np.isfinite(moved).all(axis=(0, 2))
    named, moved = named[same], moved[:, same]
    keys = [model.unknowns[i].key for i in named]
    units = [model.unknowns[i].unit for i in named]

    ours, others = own[:, named], further[:, placed]
    of_recording = drawn.of_recording(model, posterior)
    over_all, *parts = (drawn.doubted(model, named, ours + others @ one.T) for one in moved)
    low, high = np.quantile(np.min(parts, axis=0), 0.025, axis=0), np.quantile(np.max(parts, axis=0), 0.975, axis=0)
    recorded, performance = of_recording.factors, drawn.performance(model)  # all readings at once come first
    quantities = [Quantity.of_draws(each, of) for each, of in zip(over_all.T, units, strict=True)]
    of_family = np.array([family_of(one) for one in field.effects for _ in one.coefficients])[placed]
    scales = dict(zip(field.field.families, sizes.families.T, strict=True))
    u, change = np.array([one.u for one in quantities]), moved[0]
    influence = influence_of(over_all, u, scales, lambda name: others @ np.where(of_family == name, change, 0.0).T, {})
    return FactorRegions(
        dict(zip(keys, quantities, strict=True)),
        {key: (float(low[i]), float(high[i])) for i, key in enumerate(keys) if str(units[i]) in _ANYWHERE},
        {key: Quantity.of_draws(recorded[:, i], of) for i, key, of in zip(named, keys, units, strict=True)},
        drawn.agreement(of_recording, posterior, doubt, performance), scales, influence,
        (int(drawn.model.used.sum()), int(model.used.sum())), drawn.statements, performance,
    )  # fmt: skip


def _of_place(effect: Effect) -> bool:
    """Whether an error of the machine follows from the place alone, and is reported as it is."""
    alike = [one.name for one in effect.reported] == [one.name for one in effect.coefficients]
    return of_machine(effect) and alike and not (effect.columns or effect.shape)


def columns_of(effects: Sequence[Effect], which: Callable[[Effect], bool]) -> Ints:
    """Places of the coefficients of some effects among those of all."""
    return np.flatnonzero([which(one) for one in effects for _ in one.coefficients])


def _chosen(effects: Sequence[Effect], columns: Ints) -> list[Effect]:
    of = [one for one in effects for _ in one.coefficients]
    return list(dict.fromkeys(of[i] for i in columns))


def filling(machine: Machine, ends: Ends = ((0.0, 1.0),) * 3) -> Floats:
    """(125, 3) readings that stand for a region, whose ends are shares of the travels: each for a part of the same size.

    Least squares of waves of the field at these are within 3 % (rms) of those over the whole region; at as many points
    with the ends among them 20 % off, for corners and faces count too much.
    """
    parts = (np.arange(_EACH) + 0.5) / _EACH
    shares = [a + (b - a) * parts for a, b in ends]
    travels = [machine.travel(axis) for axis in AXES]
    return np.array(list(product(*(low + (high - low) * s for (low, high), s in zip(travels, shares, strict=True)))))


def _moved(machine: Machine, named: Sequence[Effect], others: Sequence[Effect], regions: Sequence[Ends]) -> Floats:
    """(r, k, j) by which named errors, as told of each region, change with a unit of each coefficient of others.

    Not a number for a named error that cannot be told there. ``regions``: their ends, in shares of the travels.
    """
    readings = np.array([filling(machine, ends) for ends in regions])
    every, r, one = readings.reshape(-1, 3), len(regions), np.ones(readings[..., 0].size, dtype=np.int64)
    about = About(Points(machine.coordinates(every), one, np.arange(len(every)), one, machine))

    def columns(effect: Effect) -> Floats:
        return about.columns(effect).reshape(r, 3 * readings.shape[1], -1)

    # a squareness that nobody named is none of the scales and rotations that were: what every machine has stands for itself
    own, known = {one.name for one in named}, [columns(one) for one in named]
    beside = [columns(one) for one in others if one.everywhere and not one.of_artefact and one.name not in own]
    turned = np.cross(np.eye(3)[:, None, None], readings - readings.mean(axis=1, keepdims=True)).transpose(1, 2, 3, 0)
    rigid = np.concatenate([np.broadcast_to(np.eye(3), turned.shape), turned], axis=3).reshape(r, -1, 6)
    k, design = sum(seen.shape[2] for seen in known), np.concatenate([*known, rigid, *beside], axis=2)
    length = np.linalg.norm(design, axis=1)
    length[length == 0] = 1.0
    inverse = np.linalg.pinv(design / length[:, None], rcond=_RANK)[:, :k] / length[:, :k, None]
    told = np.abs(inverse @ design - np.eye(k, design.shape[2]))
    moving = [columns(one) for one in others]
    found = np.array([np.hstack([m[:, :0], m @ np.hstack([s[i] for s in moving])]) for i, m in enumerate(inverse)])
    return np.where(np.any(told * length[:, :k, None] > _ANOTHER * length[:, None], axis=2)[..., None], np.nan, found)
