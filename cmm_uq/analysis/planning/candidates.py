"""Candidate set-ups, the artefact in many places and attitudes inside the volume, and ready plans; what each tells.

Information of every unknown: Atkinson, Donev & Tobias 2007, 5.1.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.planning.set_up import PLANES, Pattern, SetUp, attitudes_of_lines, direction_words
from cmm_uq.analysis.planning.setting import PlannedNoise, Setting, Start, Volume, uncorrelated
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.values import dataclass
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.maths.inference.linear_model import Unknown

THIRDS = (0.0, 0.5, 1.0)
_FIFTHS = (0.0, 0.25, 0.5, 0.75, 1.0)
PatternFor = Callable[[Floats], Pattern | None]  # the pattern for an attitude; ``None`` where it does not fit
# Ways of setting up an artefact that the fixtures of a volume allow, by their words
Attitudes = Callable[[Volume], list[tuple[Text, Floats]]]


@dataclass(frozen=True)
class RelocatedCandidates:
    """A recorded artefact, that stands by itself in each set-up, set up in other places."""

    attitudes: Attitudes  # in which it is set up, beside that of the recording

    def __call__(self, artefact: Artefact, volume: Volume, count: int) -> tuple[SetUp, ...]:
        first = artefact.points.select(artefact.points.measurement == artefact.measurement[0])
        pattern, attitude, _ = Pattern.of_recording(first.select(first.repeat == first.repeat.min()))
        return self.like(pattern, attitude, volume, count)

    def like(self, pattern: Pattern, recorded: Floats, volume: Volume, count: int) -> tuple[SetUp, ...]:
        """A pattern in other places; first of all in the recorded attitude (3, 3)."""
        ways = [(say("attitude as recorded"), recorded), *self.attitudes(volume)]
        return thinned(everywhere(volume, ways, pattern), count, volume)


@dataclass(frozen=True)
class VolumeCandidates:
    """Candidates of an artefact that stands by itself in each set-up."""

    attitudes: Attitudes  # in which it is set up
    shape: Callable[[Setting], Pattern | PatternFor]  # what is measured of it in one set-up
    elsewhere: RelocatedCandidates  # of a recorded one

    def candidates(self, setting: Setting, start: Start | None) -> tuple[SetUp, ...]:
        """In many places: as the plan says, or as it was recorded."""
        plan, volume = setting.plan, setting.volume
        if start is not None and start.again is not None:
            pattern, attitude, _ = Pattern.of_recording(start.again.points)
            return self.elsewhere.like(pattern.once().repeated(plan.repeats), attitude, volume, plan.candidates)
        return thinned(everywhere(volume, self.attitudes(volume), self.shape(setting)), plan.candidates, volume)


def candidates(setting: Setting, start: Start | None = None) -> tuple[SetUp, ...]:
    """Set-ups that the volume and the fixtures allow, at most as many as the plan says."""
    return setting.planning.candidates(setting, start)


def along_lines(volume: Volume) -> list[tuple[Text, Floats]]:
    """Attitudes of a bar or gauge, held along its length."""
    return [(title, way) for title, way in attitudes_of_lines(volume.size) if volume.allows(way[:, 0])]


def across_planes(volume: Volume) -> list[tuple[Text, Floats]]:
    """Attitudes of a plate, held by its normal."""
    return [(title, way) for title, way in PLANES if volume.allows(way[:, 2])]


def upright(volume: Volume) -> list[tuple[Text, Floats]]:
    """The one attitude of what looks alike from all sides."""
    return [(say("upright"), np.eye(3))]


def thinned(placings: Iterator[SetUp], count: int, volume: Volume) -> tuple[SetUp, ...]:
    """At most so many of them, spread evenly over the list."""
    found = tuple(placings)
    if not found:
        size = " × ".join(f"{v:.0f}" for v in volume.size)
        raise CmmUqError(
            "no placing is possible: the artefact does not fit the volume in any direction that the fixtures allow",
            where="job.toml [plan]",
            fix=f"The volume is {size} mm; allow other directions or heights, or use a smaller artefact",
        )
    some = np.unique(np.linspace(0, len(found) - 1, min(count, len(found))).round().astype(int))
    return tuple(found[i] for i in some)


def everywhere(volume: Volume, ways: Sequence[tuple[Text, Floats]], shape: Pattern | PatternFor) -> Iterator[SetUp]:
    """Every attitude in the corners, on the edges and in the middle of the room that it has."""
    steps = _FIFTHS if len(ways) < 4 else THIRDS
    for title, attitude in ways:
        pattern = shape if isinstance(shape, Pattern) else shape(attitude)
        room = None if pattern is None else volume.room(pattern.turned(attitude))
        if pattern is None or room is None:
            continue
        middles: dict[tuple[float, ...], Floats] = {}
        for place in product(steps, repeat=3):
            middle = room[:, 0] + (room[:, 1] - room[:, 0]) * place
            middles.setdefault(tuple(middle.round(3).tolist()), middle)
        yield from (pattern.placed(volume.machine, attitude, middle, title) for middle in middles.values())


MIDDLE = (0.5, 0.5, 0.5)  # of the room that a set-up has, along each axis
ACROSS = " (across it)"  # how a plate stands to the direction by which it is held


def ready_plan(setting: Setting) -> tuple[Text, tuple[SetUp, ...]]:
    """Name and set-ups of the ready plan that a job asks for, or of the usual one for its kind."""
    ready, kind = setting.planning.ready, setting.artefact.kind
    usual = next(iter(ready))
    name = Verbatim(setting.plan.ready or usual)
    if name not in ready:
        raise CmmUqError(f"{name!r} is no plan for a job of kind {kind!r}", where="job.toml [plan] ready",
                         fix=f"Leave it out: the usual plan is {usual!r}")  # fmt: skip
    return name, ready[name](setting)


def check_allowed(setting: Setting, direction: Floats, how: str = "") -> None:
    if not setting.volume.allows(direction):
        raise CmmUqError(
            f"no fixture holds the artefact {direction_words(direction)}{how}, which this plan wants",
            where="job.toml [plan.fixtures] directions",
            fix='Allow the direction, or leave out ready and ask for number = 20 placings by criterion = "D"',
        )


_HELD = 1e12  # of a size that its certificate gives without uncertainty, 0.1 nm; more would hide all other by rounding
SEEN = 1e-6  # part of an effect's information, of what it would be by itself, below which rounding hides it
FAINT = 1.0  # below which an effect of its prior standard deviation does not stand out of the noise
_RIDGE = 1e-13
_TOGETHER = 10  # set-ups whose designs are made together
_PART = 0.1  # share from which on a column counts as part of what looks like another


@dataclass(frozen=True, eq=False)
class Information:
    """Information of set-ups, one matrix each."""

    unknowns: tuple[Unknown, ...]
    each: Floats  # (c, k, k) of every set-up; there may be more rows than unknowns, of freedoms that all set-ups share
    prior: Floats  # (k, k) of the certificates, without that of the effects
    sought: tuple[int, ...] = ()  # rows of sizes of the artefact that are to be determined with the effects

    def where(self, effects: Sequence[Effect]) -> list[int]:
        names = {effect.name for effect in effects}
        return [i for i, unknown in enumerate(self.unknowns) if unknown.key[0] in names]

    @property
    def nuisance(self) -> list[int]:
        """Rows of the artefact's sizes that are not sought, and of what all set-ups share."""
        effects = [i for i, unknown in enumerate(self.unknowns) if unknown.key[0] != ARTEFACT or i in self.sought]
        return [i for i in range(len(self.prior)) if i not in effects]


def set_up_information(setting: Setting, placings: Sequence[SetUp], also: tuple[Effect, ...] = ()) -> Information:
    """What each set-up tells of the effects that the job names, and of some others."""
    points = setting.joined(placings)
    if setting.planning.shared:
        return shared(setting.model(points, also), setting.noise)
    numbers = np.unique(points.measurement)
    matrices, parts = list[Floats](), np.split(numbers, range(_TOGETHER, len(numbers), _TOGETHER))
    while parts:
        part = parts.pop(0)
        try:
            model = setting.model(points.select(np.isin(points.measurement, part)), also)
        except CmmUqError:  # of a kind that refuses some together, and none alone
            if len(part) == 1:
                raise
            parts = [*np.split(part, len(part)), *parts]
            continue
        matrices.append(by_measurement(model, np.array([u.prior_mean for u in model.unknowns]), setting.noise))
    unknowns, sizes = model.unknowns, model.artefact.sizes
    names = {(ARTEFACT, size.name) for size in sizes if size.role == "sought"}
    sought = tuple(i for i, unknown in enumerate(unknowns) if unknown.key in names)
    return Information(unknowns, np.concatenate(matrices), certified(unknowns), sought)


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


def by_measurement(model: RecordingModel, values: Floats, noise: PlannedNoise | None = None) -> Floats:
    """The same for each measurement (c, k, k), in ascending order."""
    white = _white(model, values, noise)
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
    cross, within = (information[..., fitted, :][..., :, columns] for columns in (rival, fitted))
    scale = np.sqrt(np.maximum(np.einsum("...ii->...i", within), 1e-300))
    scaled = within / scale[..., :, None] / scale[..., None, :] + _RIDGE * np.eye(len(fitted))
    solved = np.linalg.solve(scaled, cross / scale[..., :, None]) / scale[..., :, None]
    return np.asarray(own - np.swapaxes(cross, -1, -2) @ solved)


def cosines(left: Floats, alone: Floats) -> Floats:
    """Absolute cosines (..., r, r) of effects from what is left, 1 where unseen; ``alone`` (..., r) with nothing else."""
    seen = visible(left, alone)
    root = np.sqrt(np.where(seen, np.einsum("...ii->...i", left), 1.0))
    cosine = np.minimum(np.abs(left) / root[..., :, None] / root[..., None, :], 1.0)
    both = seen[..., :, None] & seen[..., None, :] & ~np.eye(left.shape[-1], dtype=bool)
    return np.asarray(np.where(both, cosine, 1.0))


def visible(left: Floats, alone: Floats) -> NDArray[np.bool_]:
    """(..., r) whether anything of each effect is left."""
    return np.asarray(np.einsum("...ii->...i", left) > np.maximum(SEEN * alone, FAINT))


def imitators(information: Floats, row: int, base: Sequence[int]) -> list[int]:
    """Rows of the base that together look like an effect: least squares of its column on theirs, the smallest solution."""
    fitted, scale = list(base), np.sqrt(np.maximum(np.diag(information), 1e-300))
    scaled = information / scale[:, None] / scale[None, :]
    parts = np.linalg.lstsq(scaled[np.ix_(fitted, fitted)], scaled[fitted, row], rcond=_RIDGE**0.5)[0]
    return [i for i, part in zip(fitted, parts, strict=True) if abs(part) > _PART]
