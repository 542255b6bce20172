"""Rival explanations of what a model leaves: effects of the catalogue, and smooth functions that nobody knows.

Each is a set of columns that the observations would show, scaled so that coefficients of one are as large as physics (or,
for the unknown, plausibility) allows; how much smaller they may be is left to the comparison.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import linalg

from cmm_uq.errors import CmmUqError
from cmm_uq.measurement import MeasurementModel
from cmm_uq.physics.catalogue import EVERY
from cmm_uq.physics.effect import FURTHER, Effect
from cmm_uq.points import AXES, Floats, Points

EFFECT, SEVERAL, UNKNOWN = "effect", "several", "unknown"

LENGTH_SCALES = (0.6, 0.25, 0.1)
"""Of unknown smooth functions, in parts of the covariate's range."""

_UNKNOWN_SD = 0.05
"""mm, largest standard deviation of an unknown displacement."""

_SHORTEST_PERIOD = 6.0
"""mm."""

_IDEALISED = ("straightness", "hysteresis", "rotation", "drift")
"""Effects whose form along their axis, or in time, is the simplest of many that their mechanism can have."""

_TILTED, _BENT = (-0.9, -0.45, 0.0, 0.45, 0.9), (-0.5, 0.0, 0.5)
_ROUGH = 0.25
"""Probability that such an effect has another form than the simplest."""

_FURTHER = 0.1
"""Weight of an effect that only some machines show, beside one that most do."""

_SPACE_LENGTHS = (0.5, 0.25)
_SPACE_PLACES, _SPACE_RANK = 120, 40
_MOST_STEPS = 40
_MANY_DIRECTIONS, _SEEN = 12, 1e-6

_PLACED = ("approach_", "nx", "ny", "nz", "tip_", "reference_", "time_s")
"""Beginnings of columns that belong to a point's place, or have functions of their own."""

_SUDDEN = ("time_s", "row")
"""Covariates of an observation at which an error may jump."""

_MOST_PERIODS = 240
_DIVIDED = (-0.4, -0.2, 0.0, 0.2, 0.4)
_KEPT = 1e-3
_GRID = 60


@dataclass(frozen=True, eq=False)
class Member:
    """One version of an explanation.

    Parameters
    ----------
    columns : (m, r) mm.
    shape : nonlinear parameter that they belong to.
    weight : how probable, among the versions.
    values : (p, r) mm, an unknown function where its covariate is given, for one unit of each coefficient.
    rough : whether an effect has another form here than its own, though the same mechanism.
    """

    columns: Floats
    shape: tuple[float, ...] = ()
    weight: float = 1.0
    values: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    rough: bool = False


@dataclass(frozen=True, eq=False)
class Explanation:
    """A rival.

    Parameters
    ----------
    name : the effect's name; for an unknown function what it depends on.
    kind : ``effect``, ``several`` (known effects at once) or ``unknown``.
    members : versions, as probable as their weights say.
    covariate : (p,) what an unknown function depends on, of the points or of the observations.
    covariate_name : its name in the recording.
    mechanism : the effect that an unknown function would be, had it that effect's form.
    weight : how readily it is thought of, beside others of its kind.
    """

    name: str
    kind: str
    members: tuple[Member, ...]
    covariate: Floats | None = None
    covariate_name: str | None = None
    mechanism: str = ""
    weight: float = 1.0

    @property
    def shaped(self) -> bool:
        """Whether its versions differ in a nonlinear parameter."""
        return bool(self.members[0].shape)


def known(model: MeasurementModel, values: Floats, named: tuple[str, ...]) -> list[Explanation]:
    """Every effect of the catalogue that could act here and is not named in the model already.

    Parameters
    ----------
    model : what is named, with its recording.
    values : (k,) parameters about which it is linear.
    named : effects to leave out.
    """
    points = model.artefact.points.at(model.placed(values))
    found = []
    for effect in EVERY.values():
        if effect.name in named or any(column not in points.columns for column in effect.columns):
            continue
        try:
            members = tuple(
                Member(_seen(model, effect, points, shape, values), shape) for shape in shapes(effect, points)
            )
        except CmmUqError:  # the job does not give the travel that this effect needs
            continue
        if any(np.any(member.columns) for member in members):
            members = (*members, *_roughly(model, effect, points, values))
            weight = _FURTHER if effect.tier == FURTHER else 1.0
            found.append(Explanation(effect.name, EFFECT, members, weight=weight))
    return found


def _roughly(model: MeasurementModel, effect: Effect, points: Points, values: Floats) -> Iterator[Member]:
    """An idealised effect, larger or smaller towards the ends or one end of its axis, or of the time."""
    mechanism, _, rest = effect.name.partition("_")
    if mechanism not in _IDEALISED:
        return
    along = points.columns["time_s"] if mechanism == "drift" else points.readings[:, AXES.index(rest[0])]
    span = float(np.ptp(along))
    if span == 0:
        return
    u = (2 * (along - along.min()) / span - 1)[:, None, None]
    forms = [(s, t) for s in _TILTED for t in _BENT if s or t]
    basis = effect.basis(points, ()) * np.array([c.prior_sd for c in effect.coefficients])
    for s, t in forms:
        columns = model.seen(basis * (1 + s * u + t * (1.5 * u**2 - 0.5)), values)
        yield Member(columns, weight=_ROUGH / (1 - _ROUGH) / len(forms), rough=True)


def finer(model: MeasurementModel, values: Floats, explanation: Explanation, members: Iterable[int]) -> Explanation:
    """An explanation with some of its shapes divided: each gives way to five about it that share its weight."""
    effect = EVERY[explanation.name]
    points = model.artefact.points.at(model.placed(values))
    shaped = [i for i, member in enumerate(explanation.members) if member.shape]
    even = dict(zip(shaped, evenly(effect, np.array([explanation.members[i].shape[0] for i in shaped])), strict=True))
    step = float(np.median(np.diff(np.sort(list(even.values())))))
    kept = list(explanation.members)
    for i in members:
        kept[i] = replace(kept[i], weight=kept[i].weight / len(_DIVIDED))
        for part in _DIVIDED:
            if part:
                shape = (float(unevenly(effect, np.array(even[i] + part * step))),)
                kept.append(Member(_seen(model, effect, points, shape, values), shape, kept[i].weight))
    return replace(explanation, members=tuple(kept))


def evenly(effect: Effect, shape: Floats) -> Floats:
    """An effect's nonlinear parameter on the scale on which it is tried evenly: frequency for a period, else its logarithm."""
    return 1 / shape if _periodic(effect) else np.log(shape)


def unevenly(effect: Effect, value: Floats) -> Floats:
    """What :func:`evenly` was given."""
    return 1 / value if _periodic(effect) else np.exp(value)


def _periodic(effect: Effect) -> bool:
    return effect.shape[0].name == "period_mm"


def several(singles: Sequence[Explanation]) -> list[Explanation]:
    """All known effects at once, each as large as the others in the observations.

    It names none of them, but opens the gate to those that are visible together only.
    """
    columns = [e.members[0].columns for e in singles if not e.shaped]
    if len(columns) < 2:
        return []
    together = np.hstack(columns)
    rms = np.sqrt(np.mean(together**2, axis=0))
    return [
        Explanation(
            "several effects together", SEVERAL, (Member(_UNKNOWN_SD * together / np.where(rms > 0, rms, 1.0)),)
        )
    ]


def shapes(effect: Effect, points: Points) -> Iterator[tuple[float, ...]]:
    """Values of an effect's nonlinear parameter to try: of a period, those that the readings can tell apart."""
    if not effect.shape or not _periodic(effect):
        yield from effect.trials()
        return
    readings = points.readings[:, AXES.index(effect.name[-1])]
    span = float(np.ptp(readings))
    if span <= 2 * _SHORTEST_PERIOD:
        return
    step = 0.35 / span
    highest = min(1 / _SHORTEST_PERIOD, _MOST_PERIODS * step)
    for frequency in np.arange(0.7 / span, highest, step):
        yield (float(1 / frequency),)


def _seen(model: MeasurementModel, effect: Effect, points: Points, shape: tuple[float, ...], values: Floats) -> Floats:
    scale = np.array([c.prior_sd for c in effect.coefficients])
    return model.seen(effect.basis(points, shape) * scale, values)


def unknown(model: MeasurementModel, values: Floats) -> list[Explanation]:
    """Functions that nobody knows, smooth or with one jump.

    Errors along each axis of each reading and of the place, scales of time, and anything of each covariate of the
    observations.
    """
    points = model.artefact.points.at(model.placed(values))
    found = [*_of_readings(model, points, values), *_of_place(model, points, values), *_of_time(model, points, values)]
    found += [*_of_direction(model), *_of_all_scales(model, points, values)]
    for name, covariate in covariates(model).items():
        functions = _functions(covariate) if name in _SUDDEN else ((f, 1.0) for f in _smooth_functions(covariate))
        members = tuple(Member(f, weight=weight, values=f) for f, weight in functions)
        found.append(Explanation(f"error as a function of {name}", UNKNOWN, members, covariate, name))
    return found


def _of_readings(model: MeasurementModel, points: Points, values: Floats) -> Iterator[Explanation]:
    """Errors along each axis as functions of each reading."""
    for i, axis in enumerate(AXES):
        readings = points.readings[:, i]
        if np.ptp(readings) < 1.0:
            continue
        functions = list(_functions(readings))
        for j, direction in enumerate(AXES):
            members = tuple(Member(model.seen(_along(j, f), values), weight=w, values=f) for f, w in functions)
            name = f"error along {direction.upper()} as a function of {axis.upper()}"
            mechanism = "" if i == j else f"straightness_{axis}_{direction}"
            yield Explanation(name, UNKNOWN, members, readings, f"{axis}_mm", mechanism)


def _of_place(model: MeasurementModel, points: Points, values: Floats) -> Iterator[Explanation]:
    """Errors along each axis as functions of the place in the volume."""
    if np.sum(np.ptp(points.readings, axis=0) > 1.0) < 2:
        return
    factors = list(_smooth_in_space(points.readings))
    for j, direction in enumerate(AXES):
        members = tuple(Member(model.seen(_along(j, factor), values)) for factor in factors)
        yield Explanation(f"error along {direction.upper()} as a function of the place", UNKNOWN, members)


def _of_time(model: MeasurementModel, points: Points, values: Floats) -> Iterator[Explanation]:
    """Scales of each axis as functions of time."""
    time = points.columns.get("time_s")
    if time is None or len(np.unique(time)) < 3:
        return
    for i, axis in enumerate(AXES):
        readings = points.readings[:, i]
        half = 0.5 * float(np.ptp(readings))
        if half < 1.0:
            continue
        lever = (readings / half)[:, None]
        members = tuple(
            Member(model.seen(_along(i, lever * f), values), weight=w, values=f) for f, w in _functions(time)
        )
        yield Explanation(f"scale of {axis.upper()} as a function of time", UNKNOWN, members, time, "time_s")


def _of_direction(model: MeasurementModel) -> Iterator[Explanation]:
    """Anything of the direction in which points were probed, where there are many."""
    among = directions(model)
    if len(np.unique(np.round(among, 3), axis=0)) >= _MANY_DIRECTIONS:
        members = tuple(Member(factor) for factor in _smooth_in_space(among))
        yield Explanation("error as a function of the probing direction", UNKNOWN, members)


def _of_all_scales(model: MeasurementModel, points: Points, values: Floats) -> Iterator[Explanation]:
    """One scale of all axes as a function of each further column."""
    lever = points.readings / (0.5 * float(np.ptp(points.readings, axis=0).max()))
    for name, column in points.columns.items():
        if name.startswith(_PLACED) or len(np.unique(column)) < 3:
            continue
        members = tuple(
            Member(model.seen(lever[:, :, None] * f[:, None, :], values), values=f) for f in _smooth_functions(column)
        )
        yield Explanation(f"scale of all axes as a function of {name}", UNKNOWN, members, column, name)


def directions(model: MeasurementModel) -> Floats:
    """Unit vectors (m, 3) along which used observations see a point move; zero where they see differences of points."""
    points = model.artefact.points
    values = model.estimate().least_squares.value
    seen = model.seen(np.broadcast_to(np.eye(3), (len(points), 3, 3)), values)
    length = np.linalg.norm(seen, axis=1, keepdims=True)
    return np.where(length > _SEEN, seen / np.maximum(length, _SEEN), 0.0)


def _along(axis: int, factor: Floats) -> Floats:
    displacement = np.zeros((len(factor), 3, factor.shape[1]))
    displacement[:, axis] = factor
    return displacement


def covariates(model: MeasurementModel) -> dict[str, Floats]:
    """What each used observation may depend on, (m,): direction, order, and the mean of every recorded column."""
    points, artefact = model.artefact.points, model.artefact
    found = {}
    for name, values in points.columns.items():
        found[name] = mean_of(model, values)
    found["row"] = np.arange(len(artefact.measurement), dtype=np.float64)[model.used]
    kept: dict[str, Floats] = {}
    for name, values in found.items():
        if len(np.unique(values)) < 3 or any(abs(np.corrcoef(values, other)[0, 1]) > 0.999 for other in kept.values()):
            continue
        kept[name] = values
    return kept


def mean_of(model: MeasurementModel, values: Floats) -> Floats:
    """Mean of a column (n,) over the points of each used observation, (m,)."""
    return np.asarray(values[model.artefact.rows].mean(axis=1)[model.used], dtype=np.float64)


def _functions(covariate: Floats) -> Iterator[tuple[Floats, float]]:
    """Factors (n, r), mm, of functions of a covariate and their weights: smooth ones, and steps in its widest gaps."""
    for function in _smooth_functions(covariate):
        yield function, 1.0
    distinct = np.unique(covariate)
    gaps = np.diff(distinct)
    parts = np.array_split(np.arange(len(gaps)), min(len(gaps), _MOST_STEPS))
    widest = np.array([part[np.argmax(gaps[part])] for part in parts])
    chosen = distinct[widest] + 0.5 * gaps[widest]
    for place in chosen:
        yield _UNKNOWN_SD * np.where(covariate > place, 1.0, -1.0)[:, None], 1 / len(chosen)


def _smooth_functions(covariate: Floats) -> Iterator[Floats]:
    """Factors (n, r), mm, of squared-exponential covariances over a covariate (Karhunen–Loève on a grid, Nyström beyond)."""
    low, span = float(covariate.min()), float(np.ptp(covariate))
    place = (covariate - low) / span
    grid = np.linspace(0, 1, _GRID)
    for length in LENGTH_SCALES:
        kernel = np.exp(-0.5 * ((grid[:, None] - grid[None, :]) / length) ** 2)
        eigenvalues, vectors = linalg.eigh(kernel)
        keep = eigenvalues > _KEPT * eigenvalues[-1]
        cross = np.exp(-0.5 * ((place[:, None] - grid[None, :]) / length) ** 2)
        yield _UNKNOWN_SD * cross @ vectors[:, keep] / np.sqrt(eigenvalues[keep])


def _smooth_in_space(readings: Floats) -> Iterator[Floats]:
    """Factors (n, r), mm, of squared-exponential covariances over readings (n, 3) (Nyström on some of their places)."""
    place = (readings - readings.min(axis=0)) / float(np.ptp(readings, axis=0).max())
    distinct = np.unique(np.round(place, 6), axis=0)
    some = distinct[np.unique(np.linspace(0, len(distinct) - 1, _SPACE_PLACES).round().astype(int))]
    among, across = (np.sum((points[:, None] - some) ** 2, axis=2) for points in (some, place))
    for length in _SPACE_LENGTHS:
        eigenvalues, vectors = linalg.eigh(np.exp(-0.5 * among / length**2))
        keep = np.flatnonzero(eigenvalues > _KEPT * eigenvalues[-1])[-_SPACE_RANK:]
        factor = np.exp(-0.5 * across / length**2) @ vectors[:, keep] / np.sqrt(eigenvalues[keep])
        yield _UNKNOWN_SD * factor
