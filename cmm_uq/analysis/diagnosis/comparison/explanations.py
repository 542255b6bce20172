"""Candidate explanations of what a model leaves: known effects, and nonparametric terms, smooth or with one jump."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import cache

import numpy as np
import scipy

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.plugins import BrokenPluginError
from cmm_uq.base.points import AXES, Floats, Points, reading_name
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.jobs.columns import in_words
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.machine.physics.effect import Effect, Nonparametric, along

EFFECT, SEVERAL, UNKNOWN = "effect", "several", "unknown"
UNKNOWN_SD = 0.05  # mm, largest standard deviation of a nonparametric displacement
_SHORTEST_PERIOD, _FINEST_PERIOD = 6.0, 2.0  # mm, searched, and told of besides where a longer one is found
STEP = 0.35  # between frequencies that are tried, over one in the range of the readings
_TILTED, _BENT = (-0.9, -0.45, 0.0, 0.45, 0.9), (-0.5, 0.0, 0.5)
_ROUGH = 0.25  # probability that an idealised effect (:attr:`Effect.idealised_over`) has another form than the simplest
# Of the largest extent of a recording, over which such a form differs; a plate that lies level has next to none along Z
_SHORTEST_OVER = 0.1
# mm that an artefact must reach to show that a machine is out of adjustment: 20 ppm are 2 µm then, and 0.5 µm over a ball
_ADJUSTED = 100.0
_BEYOND = 0.5  # how readily an effect is thought of beyond the size that it mostly keeps to (:attr:`Effect.mostly`)
_MOST_PERIODS, _MOST_SHORTER = 240, 800
_DIVIDED = (-0.4, -0.2, 0.0, 0.2, 0.4)


@dataclass(frozen=True, eq=False)
class Member:
    columns: Floats  # (m, r) mm
    shape: tuple[float, ...] = ()  # nonlinear parameter that they belong to
    weight: float = 1.0  # how probable, among the versions
    # (p, r) mm, a nonparametric function where its covariate is given, for one unit of each coefficient
    values: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    rough: bool = False  # whether an effect has another form here than its own, though the same mechanism


@dataclass(frozen=True, eq=False)
class Explanation:
    name: Text  # the effect's name; for a nonparametric term what it depends on
    kind: str  # effect, several (known effects at once) or unknown (a nonparametric term)
    members: tuple[Member, ...]  # versions, as probable as their weights say
    covariate: Floats | None = None  # (p,) what a nonparametric term depends on, of the points or of the observations
    covariate_name: str | None = None
    term: Nonparametric | None = None  # of a nonparametric one that effects may be imitated by
    imitated_by: tuple[Nonparametric, ...] = ()
    weight: float = 1.0  # how readily it is thought of, beside others of its kind
    effect: Effect | None = None
    # whether it is one of what a machine out of adjustment has, and long enough an artefact shows it
    together: bool = False

    @property
    def shaped(self) -> bool:
        return bool(self.members[0].shape)

    def could_be(self, effect: Explanation) -> bool:
        """Whether this nonparametric term could have the form of an effect."""
        return self.term is not None and self.term in effect.imitated_by


def effect_of(explanation: Explanation) -> Effect:
    """The effect that an explanation is; a fault of the artefact as made for this one."""
    return every()[explanation.name] if explanation.effect is None else explanation.effect


def known_effects(model: RecordingModel, values: Floats, named: tuple[str, ...]) -> list[Explanation]:
    """Every effect of the catalogue that could act here and is not in the model, linear about ``values`` (k,)."""
    points, found = model.artefact.points.at(model.where(values)), []
    # mm, the longest extent along an axis in any of its set-ups: with the artefact placed freely it shows no more
    own = (points.xyz[points.measurement == m] for m in np.unique(points.measurement))
    reach = max(float(np.ptp(xyz, axis=0).max()) for xyz in own)
    for effect in possible_effects(model.artefact):
        if effect.name in named or not effect.shown_in(points) or not points.columns.keys() >= set(effect.columns):
            continue
        try:
            tried = ((shape, _seen(model, effect, points, shape, values)) for shape in shapes(effect, points))
            members = tuple(Member(columns, shape) for shape, columns in tried)
        except BrokenPluginError:
            raise
        except CmmUqError:  # the job does not give the travel that this effect needs
            continue
        if any(np.any(member.columns) for member in members):
            if effect.mostly < 1:
                usual = [replace(m, columns=effect.mostly * m.columns) for m in members]
                members = (*usual, *(replace(m, weight=_BEYOND) for m in members))
            members = (*members, *_roughly(model, effect, points, values))
            together = effect.everywhere and reach >= _ADJUSTED
            found.append(Explanation(
                Verbatim(effect.name), EFFECT, members, imitated_by=effect.imitated_by, weight=effect.prior_weight,
                effect=effect, together=together,
            ))  # fmt: skip
    return found


def possible_effects(artefact: Artefact) -> Iterator[Effect]:
    """Every effect of the catalogue, and those faults of artefacts that this one can have."""
    for effect in every().values():
        if not effect.of_artefact:
            yield effect
        elif effect.name in artefact.faults:
            yield artefact.faults[effect.name]


def _roughly(model: RecordingModel, effect: Effect, points: Points, values: Floats) -> Iterator[Member]:
    """An idealised effect, larger or smaller towards the ends or one end of its axis, or of the time."""
    course = effect.course(points)
    if course is None or (span := float(np.ptp(course))) == 0:
        return
    over = span
    if effect.idealised_over in tuple(AXES):  # a guideway has no other form within a fraction of what was measured
        over = max(span, _SHORTEST_OVER * float(np.ptp(points.machine_xyz, axis=0).max()))
    u = (2 * (course - course.min()) / over - span / over)[:, None, None]
    forms = [(s, t) for s in _TILTED for t in _BENT if s or t]
    basis = effect.mostly * model.columns(effect, (), values) * np.array([c.prior_sd for c in effect.coefficients])
    every = np.concatenate([basis * (1 + s * u + t * (1.5 * u**2 - 0.5)) for s, t in forms], axis=2)
    for columns in np.split(model.seen(every, values), len(forms), axis=1):
        yield Member(columns, weight=_ROUGH / (1 - _ROUGH) / len(forms), rough=True)


def refine(model: RecordingModel, values: Floats, explanation: Explanation, members: Iterable[int]) -> Explanation:
    """An explanation with some of its shapes divided: each gives way to five about it that share its weight."""
    effect = explanation.effect
    if effect is None:
        return explanation
    points = model.artefact.points.at(model.where(values))
    shaped = [i for i, member in enumerate(explanation.members) if member.shape]
    scaled = even_scale(effect, np.array([explanation.members[i].shape[0] for i in shaped]))
    even, kept = dict(zip(shaped, scaled, strict=True)), list(explanation.members)
    for i in members:
        kept[i] = replace(kept[i], weight=kept[i].weight / len(_DIVIDED))
        step = float(np.partition(np.abs(scaled - even[i]), 1)[1])  # to the nearest
        for part in (part for part in _DIVIDED if part):
            shape = (float(from_even_scale(effect, np.array(even[i] + part * step))),)
            kept.append(Member(_seen(model, effect, points, shape, values), shape, kept[i].weight))
    return replace(explanation, members=tuple(kept))


def with_shorter_periods(model: RecordingModel, values: Floats, explanation: Explanation) -> Explanation:
    """A periodic effect with periods below those searched, which equal distances fit as well; octaves equally probable."""
    effect = effect_of(explanation)
    axis = effect.shape[0].period_along
    if axis is None:
        return explanation
    points = model.artefact.points.at(model.where(values))
    step = STEP / float(np.ptp(points.readings[axis]))
    first = max(1 / member.shape[0] for member in explanation.members if member.shape) + step
    frequencies = np.arange(first, 1 / _FINEST_PERIOD, step)[:_MOST_SHORTER]
    shorter = (((float(1 / f),), float(first / f)) for f in frequencies)
    more = (Member(_seen(model, effect, points, shape, values), shape, weight) for shape, weight in shorter)
    return replace(explanation, members=(*explanation.members, *more))


def even_scale(effect: Effect, shape: Floats) -> Floats:
    """An effect's nonlinear parameter as it is tried evenly: frequency for a period, a place itself, else its logarithm."""
    (one, *_) = effect.shape
    return shape if one.even else 1 / shape if one.period_along else np.log(shape)


def from_even_scale(effect: Effect, value: Floats) -> Floats:
    (one, *_) = effect.shape
    return value if one.even else 1 / value if one.period_along else np.exp(value)


def effects_together(singles: Sequence[Explanation]) -> list[Explanation]:
    """All known effects of the machine at once, each as large as the others in the observations."""
    columns = [e.members[0].columns for e in singles if not e.shaped and (e.effect is None or not e.effect.of_artefact)]
    if len(columns) < 2:
        return []
    together = np.hstack(columns)
    rms = np.sqrt(np.mean(together**2, axis=0))
    member = Member(UNKNOWN_SD * together / np.where(rms > 0, rms, 1.0))
    return [Explanation(say("several effects together"), SEVERAL, (member,))]


def shapes(effect: Effect, points: Points) -> Iterator[tuple[float, ...]]:
    """Values of an effect's nonlinear parameter to try: of a period, those that the readings can tell apart."""
    axis = effect.shape[0].period_along if effect.shape else None
    if axis is None:
        yield from effect.trials()
    elif (span := float(np.ptp(points.readings[axis]))) > 2 * _SHORTEST_PERIOD:
        step = STEP / span
        for frequency in np.arange(0.7 / span, min(1 / _SHORTEST_PERIOD, _MOST_PERIODS * step), step):
            yield (float(1 / frequency),)


def _seen(model: RecordingModel, effect: Effect, points: Points, shape: tuple[float, ...], values: Floats) -> Floats:
    scale = np.array([c.prior_sd for c in effect.coefficients])
    return model.seen(model.columns(effect, shape, values) * scale, values)


LENGTH_SCALES = (0.6, 0.25, 0.1)  # of smooth functions, in parts of the covariate's range
_SPACE_LENGTHS = (0.5, 0.25)
# In parts of the diameter of a sphere of directions; the shortest lets neighbouring directions differ at will
_DIRECTION_LENGTHS = (0.5, 0.25, 0.08)
_LOBES = (5, 7, 8, 9, 10)  # undulations in a turn; the others are effects of the catalogue
_SPACE_PLACES, _SPACE_RANK = 120, 40
# Jumps that are tried. A reading on the wrong side of one is off by all of it: few between many readings find none
_MOST_STEPS = 200
_MANY_DIRECTIONS, _SEEN = 12, 1e-6
# Beginnings of columns that belong to a point's place, or have functions of their own
_PLACED = ("approach_", "nx", "ny", "nz", "tip_", "reference_", "time_s")
# mm: no jump is sought between readings nearer than this, which are one place read again; what parts these is their noise
SAME_PLACE = 0.1
_SUDDEN = ("time_s", "order")  # covariates of an observation at which an error may jump
_KEPT = 1e-3
_GRID = 60


def unknown_functions(model: RecordingModel, values: Floats) -> list[Explanation]:
    """Nonparametric terms, smooth or with one jump."""
    points = model.artefact.points.at(model.where(values))
    found = [*_of_readings(model, points, values), *_of_place(model, points, values), *_of_time(model, points, values)]
    found += [*_of_direction(model), *_of_all_scales(model, points, values)]
    for key, covariate in covariates(model).items():
        functions = _functions(covariate) if key in _SUDDEN else ((f, 1.0) for f in smooth_functions(covariate))
        members = tuple(Member(f, weight=weight, values=f) for f, weight in functions)
        name = say("error as a function of {name}", name=in_words(key))
        found.append(Explanation(name, UNKNOWN, members, covariate, key, Nonparametric(key)))
    return found


def _of_readings(model: RecordingModel, points: Points, values: Floats) -> Iterator[Explanation]:
    for axis, readings in points.readings.items():
        if np.ptp(readings) < 1.0:
            continue
        functions = list(_functions(readings, SAME_PLACE))
        for direction in AXES:
            members = tuple(Member(model.seen(along(direction, f), values), weight=w, values=f) for f, w in functions)
            way, of = Verbatim(direction.upper()), Verbatim(axis.upper())
            name = say("error along {direction} as a function of {axis}", direction=way, axis=of)
            term = Nonparametric(reading_name(axis), direction)
            yield Explanation(name, UNKNOWN, members, readings, term.of, term)


def _of_place(model: RecordingModel, points: Points, values: Floats) -> Iterator[Explanation]:
    if np.sum(np.ptp(points.machine_xyz, axis=0) > 1.0) < 2:
        return
    factors = list(smooth_in_space(points.machine_xyz))
    for direction in AXES:
        members = tuple(Member(model.seen(along(direction, factor), values)) for factor in factors)
        name = say("error along {direction} as a function of the place", direction=Verbatim(direction.upper()))
        yield Explanation(name, UNKNOWN, members)


def _of_time(model: RecordingModel, points: Points, values: Floats) -> Iterator[Explanation]:
    time = points.columns.get("time_s")
    if time is None or len(np.unique(time)) < 3:
        return
    for axis in AXES:
        readings = points.readings[axis]
        if (half := 0.5 * float(np.ptp(readings))) < 1.0:
            continue
        lever = (readings / half)[:, None]
        constant = any(_in_proportion(effect, points, axis) for effect in model.effects)
        functions = _functions(time) if constant else _one_sided(_functions(time))
        members = tuple(Member(model.seen(along(axis, lever * f), values), weight=w, values=f) for f, w in functions)
        name = say("scale of {axis} as a function of time", axis=Verbatim(axis.upper()))
        yield Explanation(name, UNKNOWN, members, time, "time_s", Nonparametric("time_s", axis, scale=True))


def _in_proportion(effect: Effect, points: Points, axis: str) -> bool:
    if effect.shape or len(effect.coefficients) > 1:
        return False
    moved = effect.basis(points)[:, :, 0]
    read = np.zeros_like(moved)
    read[:, AXES.index(axis)] = points.readings[axis]
    factor = float(np.sum(moved * read) / np.sum(read**2))
    return bool(factor and np.allclose(moved, factor * read, atol=1e-9 * abs(factor) * np.abs(read).max()))


def _of_direction(model: RecordingModel) -> Iterator[Explanation]:
    """Anything of the direction in which points were probed, where there are many; and lobes about Z."""
    among = directions(model)
    if len(np.unique(np.round(among, 3), axis=0)) < _MANY_DIRECTIONS:
        return
    members = tuple(Member(factor) for factor in smooth_in_space(among, _DIRECTION_LENGTHS))
    yield Explanation(say("error as a function of the probing direction"), UNKNOWN, members)
    azimuth = np.arctan2(among[:, 1], among[:, 0])
    waves = [UNKNOWN_SD * np.column_stack([np.cos(k * azimuth), np.sin(k * azimuth)]) for k in _LOBES]
    members = tuple(Member(wave, values=wave) for wave in waves)
    yield Explanation(say("error in lobes about Z"), UNKNOWN, members, np.degrees(azimuth), "azimuth_deg")


def _of_all_scales(model: RecordingModel, points: Points, values: Floats) -> Iterator[Explanation]:
    """One scale of all axes, about their zero or their middle, as a function of each further column."""
    readings = points.carriages
    middle, span = 0.5 * (readings.min(axis=0) + readings.max(axis=0)), 0.5 * float(np.ptp(readings, axis=0).max())
    if not span:  # no carriage moved
        return
    levers = [((readings - about) / span)[:, :, None] for about in (np.zeros(3), middle)]
    for key, column in points.own_columns.items():
        if key.startswith(_PLACED) or len(np.unique(column)) < 3:
            continue
        factors = [(lever, f) for lever in levers for f in smooth_functions(column)]
        members = tuple(Member(model.seen(lever * f[:, None, :], values), values=f) for lever, f in factors)
        name = say("scale of all axes as a function of {name}", name=in_words(key))
        yield Explanation(name, UNKNOWN, members, column, key)


def directions(model: RecordingModel) -> Floats:
    """Unit vectors (m, 3) along which used observations see a point move; zero where they see differences of points."""
    points = model.artefact.points
    values = model.estimate().about
    seen = model.seen(np.broadcast_to(np.eye(3), (len(points), 3, 3)), values)
    length = np.linalg.norm(seen, axis=1, keepdims=True)
    return np.where(length > _SEEN, seen / np.maximum(length, _SEEN), 0.0)


def covariates(model: RecordingModel) -> dict[str, Floats]:
    """Columns (m,) that an observation is a function of, and its place in the order of time where one is recorded."""
    found = means_of_columns(model)
    if "time_s" in found:
        found["order"] = np.unique(found["time_s"], return_inverse=True)[1].ravel().astype(np.float64)
    kept: dict[str, Floats] = {}
    for name, values in found.items():
        if len(np.unique(values)) >= 3 and not any(abs(np.corrcoef(values, v)[0, 1]) > 0.999 for v in kept.values()):
            kept[name] = values
    return kept


def means_of_columns(model: RecordingModel) -> dict[str, Floats]:
    """Mean (m,) over the points of each used observation of every column but those that it is made of, with their noise."""
    artefact, own = model.artefact, model.artefact.points.own_columns
    known = {name: values for name, values in own.items() if name not in artefact.observed}
    return {name: values[artefact.rows].mean(axis=1, dtype=float)[model.used] for name, values in known.items()}


def _functions(covariate: Floats, same: float = 0.0) -> Iterator[tuple[Floats, float]]:
    """Factors (n, r), mm, of functions of a covariate and their weights: smooth ones, and steps in its widest gaps."""
    yield from ((function, 1.0) for function in smooth_functions(covariate))
    distinct = np.unique(covariate)
    gaps = np.diff(distinct)
    apart = np.flatnonzero(gaps > same)
    parts = np.array_split(apart, min(len(apart), _MOST_STEPS)) if len(apart) else []
    widest = np.array([part[np.argmax(gaps[part])] for part in parts], dtype=np.int64)
    for place in distinct[widest] + 0.5 * gaps[widest]:
        yield UNKNOWN_SD * np.where(covariate > place, 1.0, -1.0)[:, None], 1 / len(widest)


def _one_sided(functions: Iterable[tuple[Floats, float]]) -> Iterator[tuple[Floats, float]]:
    for function, weight in functions:
        if function.shape[1] > 1:
            yield function, weight
            continue
        for constant in (-UNKNOWN_SD, 0.0, UNKNOWN_SD):
            yield (function + constant) / (2 if constant else 1), weight / 3


def smooth_functions(covariate: Floats) -> Iterator[Floats]:
    """Factors (n, r), mm, of squared-exponential covariances over a covariate (Karhunen–Loève on a grid, Nyström beyond)."""
    place = (covariate - covariate.min()) / float(np.ptp(covariate))
    for length, (grid, vectors, root) in zip(LENGTH_SCALES, map(_on_grid, LENGTH_SCALES), strict=True):
        yield UNKNOWN_SD * np.exp(-0.5 * ((place[:, None] - grid) / length) ** 2) @ vectors / root


@cache
def _on_grid(length: float) -> tuple[Floats, Floats, Floats]:
    grid = np.linspace(0, 1, _GRID)
    eigenvalues, vectors = scipy.linalg.eigh(np.exp(-0.5 * ((grid[:, None] - grid) / length) ** 2))
    keep = eigenvalues > _KEPT * eigenvalues[-1]
    return grid, vectors[:, keep], np.sqrt(eigenvalues[keep])


def smooth_in_space(readings: Floats, lengths: tuple[float, ...] = _SPACE_LENGTHS) -> Iterator[Floats]:
    """Factors (n, r), mm, of squared-exponential covariances over readings (n, d) (Nyström on some of their places)."""
    place = (readings - readings.min(axis=0)) / float(np.ptp(readings, axis=0).max())
    distinct = np.unique(np.round(place, 6), axis=0)
    some = distinct[np.unique(np.linspace(0, len(distinct) - 1, _SPACE_PLACES).round().astype(int))]
    among, across = (np.sum((points[:, None] - some) ** 2, axis=2) for points in (some, place))
    for length in lengths:
        eigenvalues, vectors = scipy.linalg.eigh(np.exp(-0.5 * among / length**2))
        keep = np.flatnonzero(eigenvalues > _KEPT * eigenvalues[-1])[-_SPACE_RANK:]
        yield UNKNOWN_SD * (np.exp(-0.5 * across / length**2) @ vectors[:, keep] / np.sqrt(eigenvalues[keep]))
