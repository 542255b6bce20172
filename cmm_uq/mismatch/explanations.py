"""Rival explanations of what a model leaves: effects of the catalogue, and smooth functions that nobody knows.

Each is a set of columns that the observations would show, scaled so that coefficients of one are as large as physics (or,
for the unknown, plausibility) allows; how much smaller they may be is left to the comparison.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from cmm_uq.errors import CmmUqError
from cmm_uq.measurement import MeasurementModel
from cmm_uq.physics.catalogue import CATALOGUE
from cmm_uq.physics.effect import Effect
from cmm_uq.points import AXES, Floats, Points

EFFECT, SEVERAL, UNKNOWN = "effect", "several", "unknown"

LENGTH_SCALES = (0.6, 0.25, 0.1)
"""Of unknown smooth functions, in parts of the covariate's range."""

_UNKNOWN_SD = 0.05
"""mm, largest standard deviation of an unknown displacement."""

_SHORTEST_PERIOD = 6.0
"""mm."""

_MOST_PERIODS = 240
_DIVIDED = (-0.4, -0.2, 0.0, 0.2, 0.4)
_KEPT = 1e-3
_GRID = 60


@dataclass(frozen=True, eq=False)
class Member:
    """One version of an explanation: columns (m, r) in mm, the shape parameter that they belong to, and its weight."""

    columns: Floats
    shape: tuple[float, ...] = ()
    weight: float = 1.0


@dataclass(frozen=True, eq=False)
class Explanation:
    """A rival.

    Parameters
    ----------
    name : the effect's name; for an unknown function what it depends on.
    kind : ``effect``, ``several`` (known effects at once) or ``unknown``.
    members : versions, as probable as their weights say.
    covariate : (p,) where an unknown function is evaluated: the points' readings, or the observations' covariate.
    values : (p, r) the function there, mm, for one unit of each coefficient of the first member.
    covariate_name : its name in the recording.
    """

    name: str
    kind: str
    members: tuple[Member, ...]
    covariate: Floats | None = None
    values: Floats | None = None
    covariate_name: str | None = None


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
    for effect in CATALOGUE.values():
        if effect.name in named or any(column not in points.columns for column in effect.columns):
            continue
        try:
            members = tuple(
                Member(_seen(model, effect, points, shape, values), shape) for shape in shapes(effect, points)
            )
        except CmmUqError:  # the job does not give the travel that this effect needs
            continue
        if any(np.any(member.columns) for member in members):
            found.append(Explanation(effect.name, EFFECT, members))
    return found


def finer(model: MeasurementModel, values: Floats, explanation: Explanation, members: Iterable[int]) -> Explanation:
    """An explanation with some of its periods divided: each gives way to five about it that share its weight."""
    effect = CATALOGUE[explanation.name]
    points = model.artefact.points.at(model.placed(values))
    frequency = np.array([1 / member.shape[0] for member in explanation.members])
    step = float(np.median(np.diff(np.sort(frequency))))
    kept = list(explanation.members)
    for i in members:
        kept[i] = replace(kept[i], weight=kept[i].weight / len(_DIVIDED))
        for part in _DIVIDED:
            if part:
                shape = (float(1 / (frequency[i] + part * step)),)
                kept.append(Member(_seen(model, effect, points, shape, values), shape, kept[i].weight))
    return replace(explanation, members=tuple(kept))


def several(singles: Sequence[Explanation]) -> list[Explanation]:
    """All known effects at once, each as large as the others in the observations.

    It names none of them, but opens the gate to those that are visible together only.
    """
    columns = [e.members[0].columns for e in singles if len(e.members) == 1]
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
    """Values of an effect's nonlinear parameter to try: periods that the readings can tell apart."""
    if not effect.shape:
        yield ()
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
    """Smooth functions: errors along each axis of each reading, and of every covariate of the observations."""
    found = []
    points = model.artefact.points.at(model.placed(values))
    for i, axis in enumerate(AXES):
        readings = points.readings[:, i]
        if np.ptp(readings) < 1.0:
            continue
        for j, direction in enumerate(AXES):
            name = f"error along {direction.upper()} as a function of {axis.upper()}"
            factors = [_UNKNOWN_SD * factor for factor in _smooth(readings)]
            members = tuple(Member(model.seen(_along(j, factor), values)) for factor in factors)
            found.append(Explanation(name, UNKNOWN, members, readings, factors[0], f"{axis}_mm"))
    found += list(_changing(model, points, values))
    for name, covariate in covariates(model).items():
        factors = [_UNKNOWN_SD * factor for factor in _smooth(covariate)]
        members = tuple(Member(factor) for factor in factors)
        found.append(Explanation(f"error as a function of {name}", UNKNOWN, members, covariate, factors[0], name))
    return found


def _changing(model: MeasurementModel, points: Points, values: Floats) -> Iterator[Explanation]:
    """Scales that change with time."""
    time = points.columns.get("time_s")
    if time is None or len(np.unique(time)) < 3:
        return
    for i, axis in enumerate(AXES):
        readings = points.readings[:, i]
        half = 0.5 * float(np.ptp(readings))
        if half < 1.0:
            continue
        lever = ((readings - readings.mean()) / half)[:, None]
        factors = [_UNKNOWN_SD * factor for factor in _smooth(time)]
        members = tuple(Member(model.seen(_along(i, lever * factor), values)) for factor in factors)
        name = f"scale of {axis.upper()} as a function of time"
        yield Explanation(name, UNKNOWN, members, time, factors[0], "time_s")


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
    """Mean of a column (n,) over the points of each used observation's (measurement, repeat), (m,)."""
    points, artefact = model.artefact.points, model.artefact
    means = points.group_means(values)
    key = {(m, r): mean for m, r, mean in zip(points.measurement, points.repeat, means, strict=True)}
    return np.array([key[m, r] for m, r in zip(artefact.measurement, artefact.repeat, strict=True)])[model.used]


def _smooth(covariate: Floats) -> Iterator[Floats]:
    """Factors (n, r) of squared-exponential covariances over a covariate (Karhunen–Loève on a grid, Nyström beyond)."""
    low, span = float(covariate.min()), float(np.ptp(covariate))
    place = (covariate - low) / span
    grid = np.linspace(0, 1, _GRID)
    for length in LENGTH_SCALES:
        kernel = np.exp(-0.5 * ((grid[:, None] - grid[None, :]) / length) ** 2)
        eigenvalues, vectors = linalg.eigh(kernel)
        keep = eigenvalues > _KEPT * eigenvalues[-1]
        cross = np.exp(-0.5 * ((place[:, None] - grid[None, :]) / length) ** 2)
        yield cross @ vectors[:, keep] / np.sqrt(eigenvalues[keep])
