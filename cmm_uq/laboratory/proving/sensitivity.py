"""What the set-ups of a job show of an error: its length over the noise, all that the job names projected out.

The length √λ of a column is that of the least-squares test for it, which somebody would make who knows the noise
exactly: so strengths of different errors, under different noise, on different artefacts can be compared.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.plugins import BrokenPluginError
from cmm_uq.base.points import Floats
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.maths.inference.noise import FASTEST, Sizes

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
        """What every effect that could act here shows, by its name, for some of its shapes."""
        return {
            effect.name: [self.effect(effect, shape) for shape in some_shapes(effect)]
            for effect in possible_effects(self.model)
        }

    def nearest(self, column: Floats) -> tuple[str, float]:
        """The effect that comes nearest to a column (m,), and the length of what it leaves of it."""
        best, least = "", float(np.linalg.norm(column))
        for name, versions in self.candidates.items():
            left = min(remaining_length(column, columns) for columns in versions)
            if left < least:
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


def some_shapes(effect: Effect) -> list[tuple[float, ...]]:
    """A few values of an effect's nonlinear parameter, over all its range; one empty tuple without one."""
    trials = list(effect.trials())
    return trials[:: max(1, len(trials) // _SHAPES)]


def white_of(noise: Noise) -> Noise:
    """Readings alone, of the same size along all axes."""
    sigma = float(np.sqrt(np.mean(np.square(np.broadcast_to(np.asarray(noise.coordinate), 3)))))
    return replace(Noise(), coordinate=(sigma, sigma, sigma))
