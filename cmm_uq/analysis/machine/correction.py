"""An error map of all errors of a machine together, given a recording, with its covariance and what it is good for.

The figures m of a map are linear in the coefficients c of the errors that follow from the place, m = T·c. Given the recording
c is drawn from the machine's random field (:mod:`cmm_uq.machine.model.field`), named errors with the rest: the map is the mean
of what is drawn, and the covariance of its figures theirs. A displacement and a turn of everything are of no consequence for
what is measured, and no recording shows them: least squares over the measuring range takes them out of map and covariance.

What a map is worth shows on set-ups that it was not made from: it is made anew without a part of them, which it then predicts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.diagnosis.held_out import FOLDS, held_out_groups, predicted
from cmm_uq.analysis.machine.agreement import Agreement
from cmm_uq.analysis.machine.recordings import ALONE, FurtherRecordings
from cmm_uq.analysis.machine.regions import DrawnErrors, columns_of, filling
from cmm_uq.analysis.machine.state import StatementEvidence, of_machine
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text
from cmm_uq.base.points import AXES, Floats, Ints, Machine, Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.base.values import dataclass, replace
from cmm_uq.machine.model.field import AxisFunction, GivenPeriod
from cmm_uq.machine.model.kind import Observed
from cmm_uq.machine.model.measurement import RecordingModel
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.error_map import AxisErrors, ErrorMap
from cmm_uq.machine.physics.kinematics import SQUARENESSES, KinematicChain, carried_offset
from cmm_uq.machine.physics.map_interpolation import MapCovariance
from cmm_uq.maths.inference.family_sizes import FOLD, sample_sizes
from cmm_uq.maths.inference.linear_model import LinearModel
from cmm_uq.maths.inference.posterior import Doubt, NoisyPosterior

STEPS = 64  # of the map along each axis: of the shortest wave a straight line between them leaves two hundredths
_DRAWS, _FOLD_DRAWS = 2000, 400
_EXACT = 1e-9  # part of its size within which an error is what a map says


@dataclass(frozen=True)
class HeldOutCorrection:
    """Root mean square, µm, of what observations are off by that a correction was not made from."""

    uncorrected: float
    named: float  # the named errors alone corrected, as the certificate states them
    corrected: float
    predicted: tuple[float, float]  # of the first and the last, by the draws and their noise
    unseen: Text  # what was left out together


@dataclass(frozen=True, eq=False)
class FieldMap:
    error_map: ErrorMap  # with its covariance
    omitted: tuple[str, ...]  # errors of the machine that neither map nor covariance hold, by name
    # root mean square error of a coordinate in the measuring range, as it is and corrected
    range_um: tuple[float, float]
    agreement: Agreement  # as of the certificate: the same draws
    held_out: HeldOutCorrection | None  # ``None`` where too little is left to make a map without a part of it
    statements: tuple[StatementEvidence, ...]  # what the recording says of what is stated of axes


def field_map(
    model: RecordingModel, posterior: NoisyPosterior, doubt: Doubt, observe: Observed, seed: int,
    beside: FurtherRecordings = ALONE,
) -> FieldMap:  # fmt: skip
    """Of the errors of a machine that follow from the place alone.

    ``model``: of a calibration, and its ``posterior`` with no other errors. ``doubt``: what is stated to be in doubt about
    its unknowns. ``beside``: what is taken together with it. Raises ``CmmUqError`` where the machine has other than three
    straight axes or its travel is not stated, or where the recording does not allow it.
    """
    machine = model.artefact.points.machine
    if machine.axes != tuple(AXES):
        raise CmmUqError("the machine has other axes than three straight ones", where="the machine")
    ends = [machine.travel(axis) for axis in AXES]
    drawn = DrawnErrors.of(model, doubt, observe, seed, _DRAWS, beside)
    blank = _blank(ends, _temperature(model))
    tables = {one: _figures(one, machine, blank) for one in (*model.effects, *drawn.field.effects) if _of_place(one)}
    held = {one: table for one, table in tables.items() if table is not None}
    named, smooth = columns_of(model.effects, held.__contains__), columns_of(drawn.field.effects, held.__contains__)
    own = drawn.doubted(model, named, drawn.own[:, named])
    draws = np.hstack([own, drawn.further[:, smooth]])

    grid = filling(machine)
    carried = MapCovariance(np.eye(len(blank_figures(blank))), np.zeros(3)).root(blank, grid, chain=machine.chain)
    carried = carried.reshape(3 * len(grid), -1)
    rigid = _rigid(blank, machine.chain)
    figures = np.hstack([held[one] for one in (*model.effects, *drawn.field.effects) if one in held])
    figures = figures - rigid @ (np.linalg.pinv(carried @ rigid) @ (carried @ figures))

    mean, at = draws.mean(axis=0), carried @ figures
    unresolved = _beside(drawn, machine)
    left = draws - mean
    _, s, V = np.linalg.svd(left / np.sqrt(len(draws) - 1), full_matrices=False)
    covariance = MapCovariance(figures @ (V.T * s), unresolved)
    after = np.mean((left @ at.T) ** 2) + np.mean(unresolved**2)
    before = np.mean((draws @ at.T) ** 2) + np.mean(unresolved**2)
    error_map = replace(_filled(blank, figures @ mean), covariance=covariance)
    rms = float(np.sqrt(before) / MICROMETRE), float(np.sqrt(after) / MICROMETRE)
    found = drawn.of_recording(model, posterior)
    agreement = drawn.agreement(found, posterior, doubt, drawn.performance(model))
    held_out = tried(drawn, seed, lambda one: isinstance(one, AxisFunction), *held_out_groups(drawn.model))
    return FieldMap(error_map, _omitted(model, drawn, held), rms, agreement, held_out, drawn.statements)


def _of_place(effect: Effect) -> bool:
    return of_machine(effect) and not (effect.columns or effect.shape or isinstance(effect, GivenPeriod))


def _omitted(model: RecordingModel, drawn: DrawnErrors, held: dict[Effect, Floats]) -> tuple[str, ...]:
    others = drawn.others
    without = [others[i].effect for i in range(len(others)) if i not in drawn.field.which]
    left = [one for one in drawn.field.effects if one not in held and not isinstance(one, GivenPeriod)]
    own = [one for one in model.effects if of_machine(one) and one not in held]
    return tuple(dict.fromkeys(one.name for one in (*own, *left, *without)))


def _temperature(model: RecordingModel) -> float:
    """Mean of the scales' temperatures over the recording; 20 °C where none was recorded."""
    columns = model.artefact.points.columns
    recorded = [columns[name] for name in (f"temp_{axis}_c" for axis in AXES) if name in columns]
    return round(float(np.mean(recorded)), 3) if recorded else 20.0


def _blank(ends: Sequence[tuple[float, float]], temperature: float) -> ErrorMap:
    x, y, z = (AxisErrors(np.linspace(*each, STEPS + 1), np.zeros((STEPS + 1, 6))) for each in ends)
    return ErrorMap((x, y, z), temperature=temperature)


def blank_figures(error_map: ErrorMap) -> Floats:
    """(m,) figures of a map, the squarenesses last, mm and rad."""
    return np.concatenate([*(each.errors.ravel() for each in error_map.axes), error_map.squareness])


def _filled(blank: ErrorMap, figures: Floats) -> ErrorMap:
    tables = np.split(figures[:-3].reshape(-1, 6), np.cumsum([len(each.positions) for each in blank.axes])[:-1])
    x, y, z = (AxisErrors(each.positions, table) for each, table in zip(blank.axes, tables, strict=True))
    return replace(blank, axes=(x, y, z), squareness=figures[-3:])


def _figures(effect: Effect, machine: Machine, blank: ErrorMap) -> Floats | None:
    """(m, j) figures of a map for one unit of each coefficient of an effect; ``None`` of one that no map can hold."""
    count, found = len(effect.coefficients), np.zeros((len(blank_figures(blank)), len(effect.coefficients)))
    if effect.plane:
        lean = effect.lean(_points(machine, np.zeros((1, 3))))
        found[len(found) - 3 + SQUARENESSES.index(str(effect.plane)), 0] = float(np.ravel(lean)[0])
        return found if np.ndim(lean) == 0 else None
    random, start = np.random.default_rng(0), 0
    places = np.column_stack([random.choice(each.positions, 40) for each in blank.axes])
    # with a tip: without one a turn of what carries nothing moves nothing, and any carriage seems to hold it
    whole, tip = replace(machine, tip_on_every_carriage=True), np.array([60.0, 80.0, -130.0])
    true = effect.basis(_points(whole, places, tip))
    for i, each in enumerate(blank.axes):
        own = slice(start, start := start + 6 * len(each.positions))
        found[own] = _of_carriage(effect, machine, i, each.positions).reshape(-1, count)
        tips = np.broadcast_to(tip, places.shape)
        carried = MapCovariance(found, np.zeros(3)).root(blank, places, tip=tips, chain=machine.chain)
        if np.abs(carried - true).max(initial=0.0) <= _EXACT * np.abs(true).max(initial=0.0):
            return found
        found[:] = 0.0
    return None


def _of_carriage(effect: Effect, machine: Machine, i: int, positions: Floats) -> Floats:
    """(p, 6, j) of what an effect does as carriage ``i`` moves alone: turns by what they do to a tip, then displacements."""
    readings = np.zeros((len(positions), 3))
    readings[:, i] = positions
    whole = replace(machine, tip_on_every_carriage=True)
    none, along_x, along_y = (
        effect.basis(_points(whole, readings, tip)) for tip in (np.zeros(3), np.eye(3)[0], np.eye(3)[1])
    )
    turn = np.stack([(along_y - none)[:, 2], -(along_x - none)[:, 2], (along_x - none)[:, 1]], axis=1)
    arm = carried_offset(AXES[i], readings, chain=machine.chain)[:, :, None]
    return np.concatenate([none - np.cross(turn, arm, axis=1), turn], axis=1)


def _points(machine: Machine, readings: Floats, tip: Floats | None = None) -> Points:
    one = np.ones(len(readings), dtype=np.int64)
    tips = {} if tip is None else {f"tip_{a}_mm": np.full(len(readings), t) for a, t in zip(AXES, tip, strict=True)}
    return Points(machine.coordinates(readings), one, np.arange(len(readings)), one, machine, tips)


def _rigid(blank: ErrorMap, chain: str) -> Floats:
    """(m, 6) figures of a map that displaces everything along x, y, z, or turns it about them."""
    first = KinematicChain.of(chain).order[0]
    bears = carried_offset(AXES[first], np.ones((1, 3)), chain=chain)[0] != 0
    found = []
    for k in range(6):
        tables = [np.zeros((len(each.positions), 6)) for each in blank.axes]
        tables[first][:, k] = 1.0
        for j in np.flatnonzero(~bears) if k >= 3 else ():
            tables[j][:, :3] += np.cross(np.eye(3)[k - 3], np.eye(3)[j]) * blank.axes[j].positions[:, None]
        found.append(np.concatenate([*(each.ravel() for each in tables), np.zeros(3)]))
    return np.column_stack(found)


def _beside(drawn: DrawnErrors, machine: Machine) -> Floats:
    """(3,) root mean square along each axis, mm, of errors with periods shorter than a map's steps show."""
    variance, start = np.zeros(3), 0
    for effect in drawn.field.effects:
        own = drawn.further[:, start : start + len(effect.coefficients)]
        start += len(effect.coefficients)
        if isinstance(effect, GivenPeriod):
            low, high = machine.travel(effect.axis)
            at = np.random.default_rng(0).uniform(low, high, 200)
            variance[AXES.index(effect.axis)] += np.mean((effect.at(at) @ own.T) ** 2)
    return np.sqrt(variance)


def tried(
    drawn: DrawnErrors, seed: int, corrects: Callable[[Effect], bool], groups: Ints, unseen: Text, folds: int = FOLDS
) -> HeldOutCorrection | None:
    """Of observations that are left out in turn; the errors' sizes, too, are found without them.

    ``corrects``: which effects beside the named ones are corrected. ``groups``: (m,) what is left out together.
    """
    model = drawn.model
    estimate = model.estimate()
    linear, whole = estimate.linear, drawn.field_of(model)
    smooth = [one for one in whole.effects if corrects(one)]
    seen = [model.seen(model.columns(one, (), estimate.about), estimate.about) for one in smooth]
    every = np.hstack([linear.observed[:, None], linear.design[:, : whole.modelled], *seen])
    placing = linear.freedoms.over(linear.noise_scale)
    numbers = np.unique(groups)
    squares, expected, count = np.zeros(3), np.zeros(2), 0
    folds = folds if len(numbers) > 4 * folds else min(len(numbers), folds)
    if folds < 3:
        return None
    for fold in range(folds):
        out = np.isin(groups, numbers[fold::folds])
        try:
            rest = _without(model, out)
            field = drawn.field_of(rest)
            sizes = sample_sizes(field.field, _FOLD_DRAWS, seed, effort=FOLD)
            alone = rest.estimate().least_squares
        except (CmmUqError, np.linalg.LinAlgError):
            return None
        draws = field.coefficients(sizes.noise, sizes.families, np.random.default_rng([seed, fold]))
        smooth_columns = field.modelled + columns_of(field.effects, corrects)
        draws = draws[:, np.append(np.arange(field.modelled), smooth_columns)]
        sigma = max(alone.sigma_of_residuals, model.least_noise, 1e-7)
        left, known, open_ = predicted(placing, _of_machine(linear, every, whole.modelled, ~out, sigma), out)
        off, columns = left[:, 0], left[:, 1:]
        mean, size = draws.mean(axis=0), float(np.mean(linear.noise_scale[out] ** 2))
        noise = float(np.mean(sizes.noise.coordinate**2)) * (len(off) - open_ + np.sum(known**2))
        sums = [off, off - columns[:, : whole.modelled] @ alone.value[: whole.modelled], off - columns @ mean]
        squares += [size * float(each @ each) for each in sums]
        spread = [draws @ columns.T, (draws - mean) @ columns.T]
        expected += [size * (float(np.mean(np.sum(each**2, axis=1))) + noise) for each in spread]
        count += len(off) - open_
    each = (np.sqrt(np.append(squares, expected) / max(count, 1)) / MICROMETRE).tolist()
    uncorrected, named, corrected, first, last = each
    return HeldOutCorrection(uncorrected, named, corrected, (first, last), unseen)


def _of_machine(linear: LinearModel, every: Floats, named: int, rest: NDArray[np.bool_], sigma: float) -> Floats:
    """Columns (m, r), mm, in units of the noise scale, less what sizes of the artefact explain that others tell.

    What is no error of the machine is estimated beside any of them by the observations that are left in, and its prior.
    """
    sizes = linear.unknowns[named:]
    if not sizes:
        return every / linear.noise_scale[:, None]
    kept, design = linear.at(rest), linear.design[:, named:]
    every = every.copy()
    every[:, 0] -= design @ np.array([one.prior_mean for one in sizes])
    seen = kept.reduce(design[rest]) / sigma
    precision = np.array([0.0 if np.isinf(one.prior_sd) else one.prior_sd**-2.0 for one in sizes])
    told = np.linalg.pinv(seen.T @ seen + np.diag(precision)) @ (seen.T @ (kept.reduce(every[rest]) / sigma))
    return np.asarray((every - design @ told) / linear.noise_scale[:, None])


def _without(model: RecordingModel, out: NDArray[np.bool_]) -> RecordingModel:
    used = model.used.copy()
    used[np.flatnonzero(used)[out]] = False
    return replace(model, used=used)
