"""What planning needs of a job: artefact, wishes, room (reversal: Evans, Hocken & Estler 1996), the noise."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from cmm_uq.analysis.planning.set_up import Pattern, SetUp, join
from cmm_uq.base.arm import Arm
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import AXES, Floats, Machine, Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.reports import noise_found, results_named
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.conformity import Circumstances
from cmm_uq.jobs.tables.plan import PlanFacts
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.kind import Kind, Observe
from cmm_uq.machine.model.noise import growing_lengths, noise_of
from cmm_uq.machine.physics.catalogue import effects, every
from cmm_uq.machine.physics.effect import CONTRACT, Effect
from cmm_uq.maths.inference.linear_model import LinearModel
from cmm_uq.maths.inference.noise import ABSENT, GROWTH, LARGEST_RATIO, PLACING, RATIO, SLOW, Components, Sizes

_ALONG = np.cos(np.radians(3.0))  # cosine from which on a direction is one that a fixture allows
_ROUNDING = 1e-6
_FLAT = 1e-3  # extent across an artefact, over its length, below which it has none


@dataclass(frozen=True, eq=False)
class Volume:
    """Room for set-ups."""

    machine: Machine
    box: Floats  # (3, 2) lowest and highest reading of each axis that points may have, mm
    heights: tuple[float, float] = (-np.inf, np.inf)  # of the artefact's middle, z readings, mm
    # (d, 3) unit vectors that fixtures allow; none means any
    directions: Floats = field(default_factory=lambda: np.zeros((0, 3)))

    @classmethod
    def of(cls, machine: Machine, plan: PlanFacts, recorded: Floats | None = None) -> Volume:
        """What a job says: ``[plan] volume_mm``, else the machine's travel, else where points were recorded (n, 3)."""
        box, margin = np.empty((3, 2)), plan.margin_mm
        for i, axis in enumerate(AXES):
            low, high = machine.travel_mm[i]
            box[i] = -np.inf, np.inf
            if axis in plan.volume_mm:
                box[i] = plan.volume_mm[axis]
                if box[i, 0] < low - _ROUNDING or box[i, 1] > high + _ROUNDING:  # false where the travel is not known
                    raise CmmUqError(
                        f"{axis} = [{box[i, 0]:g}, {box[i, 1]:g}] mm goes beyond the travel of {low:g} to {high:g} mm",
                        where="job.toml [plan] volume_mm",
                        fix="Keep inside the travel, or mend [machine] travel_mm",
                    )
            elif isinstance(machine, Arm):  # whose joints have travels
                continue
            elif recorded is not None and not np.all(np.isfinite(machine.travel_mm[i])):
                box[i] = recorded[:, i].min() - margin, recorded[:, i].max() + margin
            else:
                box[i] = machine.travel(axis)
        box = box + margin * np.array([1.0, -1.0])
        if np.any(nothing := box[:, 0] > box[:, 1]):
            axis = AXES[int(np.argmax(nothing))]
            raise CmmUqError(f"a margin of {margin:g} mm leaves nothing of the volume along {axis.upper()}",
                             where="job.toml [plan] margin_mm", fix="Make it smaller, or the volume larger")  # fmt: skip
        ways = np.array(plan.fixtures.directions, dtype=np.float64).reshape(-1, 3)
        low, high = plan.fixtures.heights_mm or (-np.inf, np.inf)
        return cls(machine, box, (low, high), ways / np.linalg.norm(ways, axis=1, keepdims=True))

    @property
    def size(self) -> Floats:
        """(3,) mm."""
        return self.box[:, 1] - self.box[:, 0]

    def chord(self, direction: Floats) -> float:
        """Longest length along a direction through the middle of the box, mm."""
        u = np.abs(direction) / np.linalg.norm(direction)
        moving = u > _ROUNDING
        return float((self.size[moving] / u[moving]).min())

    def allows(self, direction: Floats) -> bool:
        """Whether a fixture holds an artefact along this direction, either way."""
        u = direction / np.linalg.norm(direction)
        return not len(self.directions) or bool(np.any(np.abs(self.directions @ u) > _ALONG))

    def room(self, turned: Floats) -> Floats | None:
        """Range (3, 2) of the middle of a body (n, 3) that keeps it inside; ``None`` where it does not fit."""
        low, high = self.box[:, 0] - turned.min(axis=0), self.box[:, 1] - turned.max(axis=0)
        if np.any(high - low < -_ROUNDING):
            return None
        room = np.column_stack([low, np.maximum(low, high)])
        room[2] = max(room[2, 0], self.heights[0]), min(room[2, 1], self.heights[1])
        return room if room[2, 0] <= room[2, 1] + _ROUNDING else None

    def set_up(self, pattern: Pattern, attitude: Floats, place: Sequence[float], title: Text) -> SetUp:
        """A pattern at a place (3,) of its room, 0 … 1 along each axis."""
        turned = pattern.turned(attitude)
        if (room := self.room(turned)) is None:
            raise self.too_small(turned, title)
        middle = room[:, 0] + (room[:, 1] - room[:, 0]) * np.asarray(place, dtype=np.float64)
        return pattern.placed(self.machine, attitude, middle, title)

    def too_small(self, turned: Floats, title: Text) -> CmmUqError:
        """Why a body (n, 3) has no room."""
        extent = np.ptp(turned, axis=0)
        axis = int(np.argmax(extent - self.size))
        if extent[axis] - self.size[axis] <= _ROUNDING:
            return CmmUqError(
                f"no height of {self.heights[0]:g} to {self.heights[1]:g} mm leaves room for it ({title})",
                where="job.toml [plan.fixtures] heights_mm",
                fix="Allow other heights, or name another plan",
            )
        return CmmUqError(
            f"the artefact is {extent[axis]:.4g} mm long along {AXES[axis].upper()} ({title}), of which the volume has "
            f"{self.size[axis]:.4g} mm",
            where="job.toml [plan] volume_mm or [machine] travel_mm",
            fix="Use a smaller artefact, another plan, or a smaller margin_mm",
        )


def turned_set_ups(placings: Sequence[SetUp], volume: Volume) -> Iterator[SetUp]:
    """Each set-up with the artefact turned about its own axes, where it then fits."""
    for placing in placings:
        pattern, attitude, _ = Pattern.of_recording(placing.points)
        extent = np.ptp(pattern.body, axis=0)
        for words, turn in _turns(extent):
            wanted = attitude @ turn
            room = volume.room(pattern.turned(wanted))
            if room is None or not volume.allows(wanted[:, 0] if extent[1] < _FLAT * extent[0] else wanted[:, 2]):
                continue
            middle = np.clip(placing.points.machine_xyz.mean(axis=0), room[:, 0], room[:, 1])
            title = say("{title}, {turned}", title=placing.title, turned=words)
            yield pattern.placed(volume.machine, wanted, middle, title)


def _turns(extent: Floats) -> list[tuple[Text, Floats]]:
    """Turns (3, 3) about an artefact's own axes that its extent along them allows, in words."""
    if extent[0] == 0:
        return []
    if extent[1] < _FLAT * extent[0]:
        return [(say("ends exchanged"), _about(2, 2))]
    # quarters about the normal
    angles = [(say("turned by {angle:.0f}°", angle=90.0 * quarter), _about(2, quarter)) for quarter in (1, 2, 3)]
    return [*angles, (say("turned over"), _about(0, 2))]


def _about(axis: int, quarters: int) -> Floats:
    """Turn (3, 3) about an own axis by quarters."""
    u, v, turn = (axis + 1) % 3, (axis + 2) % 3, np.eye(3)
    cosine, sine = ((1, 0), (0, 1), (-1, 0), (0, -1))[quarters % 4]
    turn[u, u] = turn[v, v] = cosine
    turn[v, u], turn[u, v] = sine, -sine
    return turn


_NODES = 10  # sizes of a component that stand for its prior, beside none at all
_LEAST_RATIO = 0.02  # ratio to the reading noise below which a component does not count


@dataclass(frozen=True, eq=False)
class PlannedNoise:
    """What is known of the noise before anything is measured."""

    reading: tuple[float, float, float]  # standard deviation of a reading along each axis, mm
    # placing, growth: of a set-up offset, and of what grows, at the longest length, mm; None where nothing is known
    placing: float | None = 0.0
    growth: float | None = 0.0
    longest: float | None = None  # that length, mm; None where it is the longest of whatever is planned

    @property
    def coordinate(self) -> float:
        """Root mean square of the axes' reading noise, mm."""
        return float(np.sqrt(np.mean(np.square(self.reading))))

    @property
    def white(self) -> PlannedNoise:
        """Of nothing but readings, alike along all axes."""
        return PlannedNoise((self.coordinate,) * 3, longest=self.longest)

    def times(self, factor: float) -> PlannedNoise:
        x, y, z = (factor * each for each in self.reading)
        placing, growth = (None if size is None else factor * size for size in (self.placing, self.growth))
        return replace(self, reading=(x, y, z), placing=placing, growth=growth)

    @property
    def typical(self) -> Sizes:
        """One set of sizes; an offset of which nothing is known is as large as the reading noise, growth is then absent."""
        return _sizes(self, [self.coordinate if self.placing is None else self.placing], [self.growth or 0.0])

    @property
    def drawn(self) -> Noise:
        typical = self.typical
        return Noise(self.reading, placing=float(typical.placing[0]), growth=float(typical.growth[0]))

    def spread(self, components: Components) -> tuple[Sizes, Floats]:
        """All sizes (w,) that are reckoned with, and their weights (w,), which sum up to one."""
        one = np.ones(1)
        (placing, p), (growth, g) = (np.array([self.placing]), one), (np.array([self.growth or 0.0]), one)
        if self.placing is None:
            ratio, p = _half_cauchy(ABSENT[PLACING], RATIO[PLACING])
            placing = self.coordinate * ratio
        if self.growth is None and GROWTH in components.possible:
            ratio, g = _half_cauchy(ABSENT[GROWTH], RATIO[GROWTH])
            growth = self.coordinate * ratio
        sizes = _sizes(self, np.repeat(placing, len(growth)), np.tile(growth, len(placing)))
        return sizes, np.outer(p, g).ravel()

    def components(self, model: RecordingModel, values: Floats) -> Components:
        """The noise of a model's observations about parameters (k,), without what depends on the time of a reading."""
        found = noise_of(model, values=values)
        possible = tuple(name for name in found.possible if name != SLOW)
        shares = found.shares.copy()
        if self.longest is not None:
            own = float(growing_lengths(model, model.placed(values)).max(initial=0.0))
            shares[:, 4] *= (own / max(self.longest, 1e-9)) ** 2
        none = np.zeros((len(shares), 0))
        return replace(found, shares=shares, slow=none, frequency=np.zeros(0), possible=possible)

    def over(self, model: RecordingModel, values: Floats) -> PlannedNoise:
        """The same, growing up to the longest length of this model."""
        return replace(self, longest=float(growing_lengths(model, model.placed(values)).max(initial=0.0)))


def white_noise(model: RecordingModel) -> PlannedNoise:
    """That which a model states; of one µm where it states none."""
    each = model.sigma or MICROMETRE
    return PlannedNoise((each, each, each))


def uncorrelated(model: RecordingModel, values: Floats, noise: PlannedNoise | None) -> LinearModel:
    """The model about parameters (k,) in uncorrelated observations with the noise of one reading each."""
    linear = model.linearised(values)
    return linear if noise is None else linear.uncorrelated(noise.components(model, values).white(noise.typical))


def _sizes(noise: PlannedNoise, placing: Floats | list[float], growth: Floats | list[float]) -> Sizes:
    reading, nothing = np.tile(noise.reading, (len(placing), 1)), np.zeros(len(placing))
    return Sizes(reading, np.asarray(placing), np.asarray(growth), nothing, nothing + 1)


@cache
def _half_cauchy(absent: float, scale: float) -> tuple[Floats, Floats]:
    """Sizes of a component over the reading noise, and their weights."""
    low, high = np.log(_LEAST_RATIO), np.log(LARGEST_RATIO)
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    ratio = np.exp(low + 0.5 * (high - low) * (nodes + 1))
    density = 2 / np.pi * (ratio / scale) / (1 + (ratio / scale) ** 2)
    middle = 0.5 * (high - low) * weights * density
    below, beyond = (2 / np.pi * np.arctan(np.array([_LEAST_RATIO, LARGEST_RATIO]) / scale)).tolist()
    inside = (beyond - below) / middle.sum() * middle
    weight = (1 - absent) * np.concatenate([[below], inside, [1 - beyond]]) + absent * (np.arange(_NODES + 2) == 0)
    return np.concatenate([[0.0], ratio, [LARGEST_RATIO]]), weight


ASSUMED_NOISE_UM = 1.0  # standard uncertainty of a coordinate where the job states none


@dataclass(frozen=True, eq=False)
class Start:
    """What there is before better set-ups are searched for."""

    artefact: Artefact  # at the set-ups of a recording or of a ready plan
    again: SetUp | None  # the first set-up of the recording, to be set up elsewhere; None without a recording


@dataclass(frozen=True)
class Planning:
    """What a kind of measurement offers to planning."""

    ready: Mapping[str, Callable[[Setting], tuple[SetUp, ...]]]  # plans by name, the usual one first
    # set-ups that volume and fixtures allow, at most as many as the plan says
    candidates: Callable[[Setting, Start | None], tuple[SetUp, ...]]
    # a recorded artefact in other places and attitudes, once in each, at most so many
    elsewhere: Callable[[Artefact, Volume, int], tuple[SetUp, ...]] | None = None
    # whether the freedoms of its set-up are common to all measurements, so that their information does not add
    shared: bool = False
    sought: bool = False  # whether it is sizes of the artefact that are sought, so that no effect need be named
    # (setting, points, where): what set-ups leave open, in words, of a kind that names no effects
    free: Callable[[Setting, Points, str], tuple[Text, ...]] | None = None
    observe: Observe | None = None  # in place of the kind's, where a set-up is a part of a measurement of the kind
    # (recorded, planned): planned points as the kind numbers them
    numbered: Callable[[Points, Points], Points] | None = None
    # further set-ups, at which a plan says how well it predicts
    held_out: Callable[[Setting], tuple[SetUp, ...]] | None = None
    notes: Callable[[Setting], tuple[Text, ...]] | None = None  # what of set-ups is not looked at
    pictures: Callable[[Setting, Sequence[SetUp]], Sequence[Any]] | None = None  # of them, in place of the usual


@dataclass(frozen=True, eq=False)
class Setting:
    """An artefact, a plan's wishes, and the room for it."""

    artefact: ArtefactFacts  # as the job describes it
    observe: Observe | None  # makes an artefact of that and of points
    planning: Planning  # what its kind offers here
    plan: PlanFacts
    volume: Volume
    named: tuple[Effect, ...]  # that the job's model names
    sigma: float  # standard uncertainty of one coordinate, mm
    stated: float | None = None  # the same as the job states it; None where it does not
    noise: PlannedNoise | None = None  # with its set-up offsets; None where it is taken as white
    circumstances: Circumstances | None = None  # what is stated to be in doubt of the artefact
    recorded: Points | None = None  # what there is already

    @classmethod
    def of(cls, job: Job, kind: Kind) -> Setting:
        facts, plan = job.facts, job.facts.plan
        planning = kind.needs("plan", Planning, "planned")
        observe = None if planning.free is not None else planning.observe or kind.observing("planned")
        if not (facts.model.effects or planning.sought) and planning.free is None:
            raise CmmUqError("no effect is named, so there is nothing to determine", where="job.toml [model] effects",
                             fix="Name the error factors that the measurement shall determine")  # fmt: skip
        recorded = job.points.carriages if len(job.points) else None
        stated, noise = facts.recording.u_coordinate_um, _noise(job)
        return cls(
            facts.artefact, observe, planning, plan, Volume.of(job.points.machine, plan, recorded),
            effects(facts.model.effects, where="job.toml [model] effects"), noise.coordinate,
            None if stated is None else stated * MICROMETRE, noise, job.circumstances,
            job.points if len(job.points) else None,
        )  # fmt: skip

    @property
    def machine(self) -> Machine:
        return self.volume.machine

    def joined(self, placings: Sequence[SetUp]) -> Points:
        """Set-ups as one recording, in the order and at the times at which they are measured."""
        of_point, of_placing = self.plan.seconds_per_point, self.plan.minutes_per_placing
        return join(placings, seconds_per_point=of_point, minutes_per_placing=of_placing, columns=self.plan.columns)

    def completed(self, placings: Sequence[SetUp]) -> tuple[SetUp, ...]:
        """Set-ups that were not made from the recording, with its other columns at their means."""
        means = {} if self.recorded is None else {k: float(v.mean()) for k, v in self.recorded.own_columns.items()}
        return tuple(
            replace(one, points=replace(one.points, columns={
                **{name: np.full(len(one.points), mean) for name, mean in means.items()}, **one.points.columns,
            }))
            for one in placings
        )  # fmt: skip

    def sized(self, points: Points) -> Setting:
        """The same with the artefact's length as these points show it, where its certified figures stand in the recording."""
        if not self.artefact.with_references or self.artefact.length_mm is not None:
            return self
        longest = self.observed(points).sizes[0].nominal
        return replace(self, artefact=self.artefact.model_copy(update={"length_mm": longest}))

    def model(self, points: Points, also: tuple[Effect, ...] = ()) -> RecordingModel:
        """The model that the job names, with further effects, of the artefact at these points."""
        return RecordingModel(self.observed(points), (*self.named, *also), self.sigma)

    def observed(self, points: Points) -> Artefact:
        if self.observe is None:
            raise ValueError("a kind that names no effects has no artefact")
        return self.observe(self.artefact, points)

    def rivals(self, points: Points) -> tuple[Effect, ...]:
        """Effects that the job does not name: those that the plan lists, else all of the first tier that could act here."""
        named, where, columns = {effect.name for effect in self.named}, "job.toml [plan] rivals", points.columns
        if self.plan.rivals is None:
            free = [e for e in every().values() if e.tier == CONTRACT and e.name not in named and not e.shape]
            return tuple(e for e in free if all(c in columns for c in e.columns) and e.unfit(points) is None)
        artefact = self.observed(points)
        chosen = tuple(artefact.acting(effect) for effect in effects(self.plan.rivals, where=where))
        for effect in chosen:
            if missing := [column for column in effect.columns if column not in columns]:
                raise CmmUqError(f"{effect.name} needs the column {missing[0]}, which this plan does not record",
                                 where=where, fix="Leave it out, or give its value in [plan] columns")  # fmt: skip
        return tuple(effect for effect in chosen if effect.name not in named and not effect.shape)


def _noise(job: Job) -> PlannedNoise:
    plan, stated = job.facts.plan, job.facts.recording.u_coordinate_um
    reading: tuple[float, float, float] = (stated or ASSUMED_NOISE_UM,) * 3
    placing, growth = plan.placing_um, plan.growth_um
    if (name := results_named(plan.noise_from)) is not None:
        found = noise_found(job.inputs[name], str(job.folder / name))
        reading, placing, growth = found.reading_um, found.placing_um, found.growth_um
    x, y, z = (size * MICROMETRE for size in reading)
    offset, growing = (None if size is None else size * MICROMETRE for size in (placing, growth))
    return PlannedNoise((x, y, z), offset, growing)
