"""What is true of a case, causes of no catalogue included, written down and hashed before it is diagnosed; what shows of it.

The length √λ of a column, all that the job names projected out, is that of the least-squares test for it, which somebody
would make who knows the noise exactly: so strengths of different errors, under different noise, on different artefacts can
be compared.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from math import isfinite
from typing import Any

import numpy as np

from cmm_uq.base import messages
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, say
from cmm_uq.base.plugins import BrokenPluginError
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.base.values import asdict, dataclass, replace
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.machine.physics.effect import Effect, Parameter
from cmm_uq.maths.inference.noise import FASTEST, Sizes

FUNCTIONS = ("step", "cubic", "bump", "wave", "jump", "load")
FAULTS = ("length", "nodes", "warm", "warming")
_SAME_MM = 0.05  # up to which nodes of two set-ups are the same node
_FLAT = 1e-4  # second over first extent of a set-up from which on its nodes do not lie along one line
_NO_RATE = 11.5e-6  # 1/K, expansion of steel, for an artefact whose own is not stated


@dataclass(frozen=True)
class FunctionForm:
    """A function that no effect has."""

    what: str
    over: str  # over, along: axis whose reading it is a function of, and along which it displaces points
    along: str
    low: float  # low, high: readings, mm, between which that axis was read; of a jump, times in s
    high: float
    at: float  # at, width: where it is and how wide, on a scale from −1 to 1; of a wave its phase, and its half turns
    width: float
    measurement: int = 0  # the set-up that a load stands on

    def displacement(self, points: Points) -> Floats:
        """(n, 3, 1), mm, for a size of one micrometre."""
        u, along = self._scaled(points.carriages[:, AXES.index(self.over)]), points.carriages[:, AXES.index(self.along)]
        match self.what:
            case "step":
                value = np.asarray(u > self.at, dtype=np.float64)
            case "cubic":
                value = np.asarray(0.5 * (5 * u**3 - 3 * u))
            case "bump":
                value = np.asarray(np.exp(-0.5 * ((u - self.at) / self.width) ** 2))
            case "wave":
                value = np.asarray(np.sin(np.pi * self.width * u + self.at))
            case "jump":
                part = along / max(float(np.abs(along).max()), 1e-9)
                value = (self._scaled(points.column("time_s")) > self.at) * part
            case _:
                value = np.asarray((points.measurement == self.measurement) * u**2)
        found = np.zeros((len(points), 3, 1))
        found[:, AXES.index(self.along), 0] = MICROMETRE * value
        return found

    def _scaled(self, value: Floats) -> Floats:
        return np.asarray((2 * value - self.low - self.high) / max(self.high - self.low, 1e-9))


class ForeignEffect(Effect):
    """An error whose place and form are given: of points, their displacement (n, 3, 1), mm, for a size of one micrometre."""

    mechanism = "outside the catalogue"
    title: Text = say("A cause outside the catalogue")
    formula = "e = size · form"
    points_to: Text = messages.NOTHING
    coefficients = (Parameter("size_um", unit("µm"), 1.0),)

    def __init__(self, name: str, displaced: Callable[[Points], Floats]) -> None:
        self.name, self.displaced = name, displaced

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return self.displaced(points)


def drawn_form(points: Points, what: str, random: np.random.Generator) -> FunctionForm | None:
    """A function at random; ``None`` where the recording has nothing that it could be one of."""
    moved = [axis for axis in AXES if float(np.ptp(points.readings[axis])) > 1.0]
    if not moved or (what == "jump" and float(np.ptp(points.columns.get("time_s", np.zeros(1)))) == 0):
        return None
    over = str(random.choice(moved))
    along = str(random.choice([axis for axis in AXES if what != "wave" or axis != over]))
    values = points.columns["time_s"] if what == "jump" else points.readings[over]
    at, width = float(random.uniform(-0.5, 0.5)), float(random.uniform(0.12, 0.3))
    if what == "wave":
        at, width = float(random.uniform(-np.pi, np.pi)), float(random.uniform(1.5, 4.0))
    number = int(random.choice(np.unique(points.measurement))) if what == "load" else 0
    return FunctionForm(what, over, along, float(values.min()), float(values.max()), at, width, number)


def possible_faults(model: RecordingModel) -> Iterator[str]:
    if any(size.certified and size.role == "dimension" for size in model.artefact.sizes):
        yield "length"
    yield "nodes"
    yield "warm"
    if len(np.unique(model.artefact.points.measurement)) > 1:
        yield "warming"


def artefact_fault(
    model: RecordingModel, values: Floats, what: str, cte_per_k: float, errors: Sequence[Sequence[float]] = ()
) -> ForeignEffect:
    """A fault of the artefact as an error of its points. ``model``, ``values`` with the artefact, and its parameters (k,)."""
    xyz, points = model.placed(values), model.artefact.points
    if what == "length":
        sizes = values[len(values) - len(model.artefact.sizes) :].copy()
        first = next(i for i, s in enumerate(model.artefact.sizes) if s.certified and s.role == "dimension")
        sizes[first] += MICROMETRE
        moved = model.artefact.fit(xyz, sizes) - xyz
    elif what == "nodes":
        number, frames = nodes(xyz, points)
        moved = MICROMETRE * np.einsum("nij,nj->ni", frames, np.asarray(errors, dtype=np.float64)[number])
    else:
        index = np.unique(points.measurement, return_inverse=True)[1].ravel()
        sums = np.zeros((int(index.max()) + 1, 3))
        np.add.at(sums, index, xyz)
        from_middle = xyz - np.asarray((sums / np.bincount(index)[:, None])[index])
        warm = index / max(int(index.max()), 1) if what == "warming" else np.ones(len(xyz))
        moved = (cte_per_k or _NO_RATE) * warm[:, None] * from_middle
        moved = np.asarray(MICROMETRE * moved / max(float(np.linalg.norm(moved, axis=1).max()), 1e-12))
    return ForeignEffect(f"artefact: {what}", lambda _: -moved[:, :, None])


def nodes(xyz: Floats, points: Points) -> tuple[Ints, Floats]:
    """Node of the artefact of each point (n,), and its axes there (n, 3, a); those whose points lie otherwise have others."""
    set_ups = [np.flatnonzero(points.measurement == m) for m in np.unique(points.measurement)]
    lines = all(_is_line(xyz[rows]) for rows in set_ups)
    known, number = list[Floats](), np.zeros(len(xyz), dtype=np.int64)
    frames = np.zeros((len(xyz), 3, 1 if lines else 3))
    first: tuple[Ints, Floats] | None = None
    for rows in set_ups:
        own = xyz[rows]
        if lines:
            away = own - own[points.point[rows].argmin()]
            farthest = away[np.linalg.norm(away, axis=1).argmax()]
            direction = farthest / max(float(np.linalg.norm(farthest)), 1e-12)
            frame, place = direction[:, None], np.column_stack([away @ direction, np.zeros((len(rows), 2))])
        else:
            frame, place = _turned(own, points.point[rows], first)
            first = first or (points.point[rows], place)
        frames[rows] = frame
        for row, here in zip(rows, place, strict=True):
            near = [i for i, there in enumerate(known) if float(np.linalg.norm(here - there)) < _SAME_MM]
            number[row] = near[0] if near else len(known)
            known += [] if near else [here]
    return number, frames


def _is_line(xyz: Floats) -> bool:
    s = np.linalg.svd(xyz - xyz.mean(axis=0), compute_uv=False)
    return bool(len(s) < 2 or s[1] <= _FLAT * max(float(s[0]), 1e-12))


def _turned(xyz: Floats, numbers: Ints, first: tuple[Ints, Floats] | None) -> tuple[Floats, Floats]:
    """Axes (3, 3) of an artefact in one set-up, as those of the first one turned, and where its points lie in them."""
    if first is None:
        return np.eye(3), xyz - xyz.mean(axis=0)
    common = [(i, int(np.flatnonzero(first[0] == n)[0])) for i, n in enumerate(numbers) if n in first[0]]
    if len(common) < 3:
        return np.eye(3), xyz
    here, there = xyz[[i for i, _ in common]], first[1][[j for _, j in common]]
    middle, other = here.mean(axis=0), there.mean(axis=0)
    U, _, Vt = np.linalg.svd((here - middle).T @ (there - other))
    turn = U @ np.diag([1.0, 1.0, float(np.sign(np.linalg.det(U @ Vt)))]) @ Vt  # Kabsch 1976
    return turn, (xyz - middle) @ turn + other


NOTHING, ONE, TWO, OUTSIDE, ARTEFACT = "nothing", "one effect", "two effects", "outside", "artefact"
KINDS = (NOTHING, ONE, TWO, OUTSIDE, ARTEFACT)
CYCLE = (NOTHING, ONE, TWO, NOTHING, OUTSIDE, ONE, NOTHING, ONE, ARTEFACT, TWO)  # what each case of ten hides

OWN, WHITE, SET_UP, AXIS, GROWING, SLOWLY, WALKING, TAILS, RESOLUTION = (
    "own", "white", "set-up", "axis", "growing", "slow", "walk", "tails", "resolution",
)  # fmt: skip

WEAKEST, STRONGEST = 3.0, 15.0  # √λ between which hidden causes are drawn


@dataclass(frozen=True)
class HiddenEffect:
    """An effect of the catalogue that acts and that the job does not name."""

    effect: str  # effect, parameters: its name, and its reported parameters
    parameters: Mapping[str, float]
    strength: float  # √λ, with the other one that is hidden projected out too


@dataclass(frozen=True)
class UnknownCause:
    """A cause that no catalogue has."""

    what: str  # a function, or a fault of the artefact
    size_um: float
    strength: float  # strength, left: √λ of it, and of what the nearest effect of the catalogue leaves of it
    left: float
    like: str  # that effect; empty where none takes anything
    form: FunctionForm | None = None
    errors: tuple[tuple[float, ...], ...] = ()  # of the nodes of the artefact, on the scale of size_um


@dataclass(frozen=True)
class Case:
    """What is true of one case."""

    number: int  # number, kind: which case, and what it hides, one of KINDS
    kind: str
    noise_kind: str  # noise_kind, noise: of its recording
    noise: Noise
    sizes: tuple[float, ...]  # true sizes of the artefact, of its certificate's distribution
    hidden: tuple[HiddenEffect, ...] = ()
    stranger: UnknownCause | None = None  # what else acts

    def as_data(self) -> dict[str, Any]:
        return {**asdict(self), "noise": micrometres(self.noise)}


def micrometres(noise: Noise) -> dict[str, Any]:
    """A noise for results.json."""
    coordinate = np.broadcast_to(np.asarray(noise.coordinate), 3)
    forgets_s = noise.slow_time_s if isfinite(noise.slow_time_s) else "never"
    return {
        **{f"{axis}_um": float(each) / MICROMETRE for axis, each in zip(AXES, coordinate, strict=True)},
        "placing_um": noise.placing / MICROMETRE, "growth_um": noise.growth / MICROMETRE,
        "slow_um": noise.slow / MICROMETRE, "slow_time_s": forgets_s if noise.slow else None,
        "tails_dof": noise.tails or None, "resolution_um": noise.resolution / MICROMETRE,
    }  # fmt: skip


SCHEMA = "cmm-uq/prove-truth/1"


def truth_file(cases: Sequence[Case], common: Mapping[str, Any]) -> bytes:
    return canonical_json({"schema": SCHEMA, **common, "cases": [case.as_data() for case in cases]})


def canonical_json(data: Any) -> bytes:
    """JSON with sorted keys, a line feed at its end and nowhere else, of finite numbers."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return (text + "\n").encode()


def sha256_of(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


ALLOWED = 3.0  # prior standard deviations up to which an effect is reckoned with, as a plan does
_RANK = 1e-9  # part of the largest singular value from which on a direction counts as taken by what the job names
_SHAPES = 6  # nonlinear parameters of an effect by which it is judged whether anything looks like it


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """What observations show under one noise."""

    model: RecordingModel  # model, values: what the job names, and its parameters (k,)
    values: Floats
    white: Callable[[Floats], Floats]  # makes columns (m, b) of the observations white
    sigma: float  # standard deviation of what is white, mm
    taken: Floats  # (m, r) orthonormal, what the job names takes of white columns

    @classmethod
    def of(cls, model: RecordingModel, values: Floats, noise: Noise) -> Sensitivity:
        components, linear = noise_of(model, values=values), model.linearised(values)
        coordinate = np.broadcast_to(np.asarray(noise.coordinate, dtype=np.float64), 3)
        reading = np.hypot(coordinate, noise.resolution / np.sqrt(12))
        time = model.artefact.points.columns.get("time_s")
        slow = noise.slow if components.slow.shape[1] else 0.0
        duration = 0.0 if time is None else float(np.ptp(time))
        rate = min(FASTEST, max(duration / noise.slow_time_s, 1e-3)) if np.isfinite(noise.slow_time_s) else 0.0
        sizes = Sizes(reading[None, :], *(np.array([size]) for size in (noise.placing, noise.growth, slow, rate)))
        white, sigma = components.white(sizes), float(sizes.coordinate[0])
        open_ = ~np.array([unknown.known for unknown in model.unknowns], dtype=bool)
        named = white(np.hstack([linear.design[:, open_], linear.freedoms.dense()]))
        length = np.linalg.norm(named, axis=0)
        U, s, _ = np.linalg.svd(named / np.where(length > 0, length, 1.0), full_matrices=False)
        return cls(model, values, white, sigma, U[:, s > _RANK * s.max(initial=0.0)])

    def seen(self, displacement: Floats) -> Floats:
        """What is left (m, b) of errors e of the points (n, 3, b), mm, over the noise."""
        columns = self.white(self.model.seen(displacement, self.values)) / self.sigma
        return np.asarray(columns - self.taken @ (self.taken.T @ columns))

    def effect(self, effect: Effect, shape: tuple[float, ...] = ()) -> Floats:
        """The same (m, j) for one prior standard deviation of each coefficient of an effect."""
        scale = np.array([c.prior_sd for c in effect.coefficients])
        return self.seen(self.model.columns(effect, shape, self.values) * scale)

    @cached_property
    def candidates(self) -> dict[str, list[Floats]]:
        """What every effect that could act here shows, by its name, for a few values of its nonlinear parameter."""
        trials = {effect: list(effect.trials()) for effect in possible_effects(self.model)}
        return {
            effect.name: [self.effect(effect, shape) for shape in shapes[:: max(1, len(shapes) // _SHAPES)]]
            for effect, shapes in trials.items()
        }

    def nearest(self, column: Floats) -> tuple[str, float]:
        """The effect that comes nearest to a column (m,), and the length of what it leaves of it."""
        best, least = "", float(np.linalg.norm(column))
        for name, versions in self.candidates.items():
            if (left := min(remaining_length(column, columns) for columns in versions)) < least:
                best, least = name, left
        return best, least


def remaining_length(column: Floats, others: Floats) -> float:
    """Length of a column (m,) once others (m, j) have taken what they can."""
    U, s, _ = np.linalg.svd(others, full_matrices=False)
    U = U[:, s > _RANK * s.max(initial=0.0)] if s.max(initial=0.0) > 0 else U[:, :0]
    return float(np.linalg.norm(column - U @ (U.T @ column)))


def possible_effects(model: RecordingModel) -> Iterator[Effect]:
    """Effects of the catalogue that the job does not name and that its columns and its machine allow to act."""
    named = {effect.name for effect in model.effects}
    for effect in every().values():
        if effect.name in named or unrecorded(model, effect):
            continue
        try:
            effect.basis(model.artefact.points, next(iter(effect.trials())))
        except BrokenPluginError:
            raise
        except CmmUqError:  # the job does not give the travel that this effect needs
            continue
        yield effect


def unrecorded(model: RecordingModel, effect: Effect) -> tuple[str, ...]:
    return tuple(column for column in effect.columns if column not in model.artefact.points.columns)


def white_of(noise: Noise) -> Noise:
    """Readings alone, of the same size along all axes."""
    sigma = float(np.sqrt(np.mean(np.square(np.broadcast_to(np.asarray(noise.coordinate), 3)))))
    return replace(Noise(), coordinate=(sigma, sigma, sigma))
