"""Errors of a machine with rotary axes, given a recording, with their covariance and what correcting by them is good for.

Named errors keep their priors. Beside them are all errors of the rotary axes that the recording has the columns for: location
and tilt, orders 1 and 2, and play as physics allows them; functions of the higher orders each of a size of its own, which
the recording tells. Errors of carriages that nobody named are no part of it: maps of the carriages correct those.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy

import numpy as np

from cmm_uq.analysis.machine.agreement import Agreement
from cmm_uq.analysis.machine.correction import HeldOutCorrection, tried
from cmm_uq.analysis.machine.regions import DrawnErrors, columns_of
from cmm_uq.analysis.machine.state import Unmodelled
from cmm_uq.base.messages import say
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.rotary import RotaryMachine
from cmm_uq.base.units import MICROMETRE
from cmm_uq.base.values import dataclass, replace
from cmm_uq.machine.model.kind import Observed
from cmm_uq.machine.model.measurement import RecordingModel
from cmm_uq.machine.physics.compensation import RotaryErrors, of_axes
from cmm_uq.machine.physics.effects.rotary import EFFECTS, OfRotary, RotaryFunction
from cmm_uq.machine.physics.superposition import About
from cmm_uq.maths.inference.posterior import Doubt, NoisyPosterior

_DRAWS, _PLACES, _FOLDS = 2000, 400, 5


@dataclass(frozen=True, eq=False)
class RotaryCorrection:
    errors: RotaryErrors
    omitted: tuple[str, ...]  # errors of the axes that it does not hold, by name
    # root mean square error of a coordinate at the recorded places, at any angles in the recorded ranges; corrected
    range_um: tuple[float, float]
    agreement: Agreement  # of named errors and of what was read with all errors together
    held_out: HeldOutCorrection | None  # ``None`` where too little is left without a part of the positions


def rotary_correction(
    model: RecordingModel, posterior: NoisyPosterior, doubt: Doubt, observe: Observed, seed: int
) -> RotaryCorrection:
    """Of a calibration with rotary axes, and its ``posterior`` with no other errors; parameters as of :func:`errors_given`."""
    errors, draws, drawn = errors_given(model, doubt, observe, seed)
    about = About(_anywhere(model.artefact.points, seed))
    at = np.concatenate([about.columns(effect) for effect in errors.effects], axis=2).reshape(-1, draws.shape[1])
    before, after = (float(np.sqrt(np.mean((e @ at.T) ** 2)) / MICROMETRE) for e in (draws, draws - errors.values))
    agreement = drawn.agreement(drawn.of_recording(model, posterior), posterior, doubt, None)
    return RotaryCorrection(errors, tuple(_omitted(model)), (before, after), agreement, _held_out(drawn, seed))


def errors_given(
    model: RecordingModel, doubt: Doubt, observe: Observed, seed: int
) -> tuple[RotaryErrors, Floats, DrawnErrors]:
    """The errors of a machine's axes given a recording, draws (N, k) of their coefficients, and of all that was drawn.

    ``doubt``: what is stated to be in doubt about the unknowns of the model. Raises ``CmmUqError`` where the recording does
    not allow it.
    """
    others = [Unmodelled(one, np.array([c.prior_sd for c in one.coefficients])) for one in _others(model)]
    drawn = DrawnErrors.of(model, doubt, observe, seed, _DRAWS, others=others)
    named = columns_of(model.effects, of_axes)
    draws = np.hstack([drawn.doubted(model, named, drawn.own[:, named]), drawn.further])
    mean = draws.mean(axis=0)
    _, s, V = np.linalg.svd((draws - mean) / np.sqrt(len(draws) - 1), full_matrices=False)
    return RotaryErrors((*filter(of_axes, model.effects), *drawn.field.effects), mean, V.T * s), draws, drawn


def _others(model: RecordingModel) -> Iterator[OfRotary]:
    points, named = model.artefact.points, {effect.name for effect in model.effects}
    for effect in EFFECTS:
        recorded = all(column in points.columns for column in effect.columns)
        if recorded and effect.name not in named and isinstance(effect, OfRotary) and not effect.unfit(points):
            found = copy(effect)
            found.of_family = effect.name if isinstance(effect, RotaryFunction) else None
            yield found


def _omitted(model: RecordingModel) -> Iterator[str]:
    """Those that go by columns which were not recorded."""
    points = model.artefact.points
    for effect in EFFECTS:
        if not effect.unfit(points) and not all(column in points.columns for column in effect.columns):
            yield effect.name


def _anywhere(points: Points, seed: int) -> Points:
    """Recorded places, each at an angle of every axis anywhere in its recorded range, from either side."""
    random, machine = np.random.default_rng([seed, 61]), points.machine
    found = points.select(random.integers(len(points), size=_PLACES))
    columns = dict(found.columns)
    for axis in machine.rotary if isinstance(machine, RotaryMachine) else ():
        if (read := points.columns.get(axis.column)) is not None:
            columns[axis.column] = random.uniform(read.min(), read.max(), len(found))
            columns[f"{axis.letter}_approach"] = random.choice([-1.0, 1.0], len(found))
    own = tuple(f"tip_{a}_mm" for a in AXES) if isinstance(machine, RotaryMachine) and machine.head else ()
    return replace(found, columns={name: values for name, values in columns.items() if name not in own})


def _held_out(drawn: DrawnErrors, seed: int) -> HeldOutCorrection | None:
    points, rows = drawn.model.artefact.points, drawn.model.artefact.rows[drawn.model.used, 0]
    read = [values[rows] for name, values in points.columns.items() if name in ("a_deg", "b_deg", "c_deg")]
    groups = np.unique(np.round(np.column_stack(read), 3), axis=0, return_inverse=True)[1].ravel()
    return tried(drawn, seed, lambda one: True, groups, say("angles"), _FOLDS)
