"""The components of noise that a recording could show: what each does to its observations."""

from __future__ import annotations

import numpy as np
import scipy

from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.machine.model.measurement import RecordingModel
from cmm_uq.machine.model.recorded import Display, display_step, distances_in_placing
from cmm_uq.maths.inference.linear_model import Freedoms
from cmm_uq.maths.inference.noise import AXES, FEWER, FREQUENCIES, GROWTH, PLACING, SLOW, Components

# part of the observations' variance that each of two axes must have for their noises to be told apart
_LEAST_SHARE = 0.15
_ALONG = 1e-9  # part of a coordinate below which an observation does not see it
_LEAST_TIMES = 8  # different times from which on slow noise is reckoned with
_WHOLE = 100  # repeats whose mean and contrasts are one matrix without zeros; of more the matrix would fill the memory
# longest over median length from which on noise may be seen to grow with it. Of three by three places, seen from a corner,
# they are 1.41, of four by four 1.5: the last digits of a recording decide of neither.
_LEAST_SPREAD = 1.45
_LEAST_OFFSET = 1e-9  # part of an offset that is no rounding of where the artefact stands
_NO_LENGTH = 1e-3  # part of the longest length that is none


def noise_of(
    model: RecordingModel, used: np.ndarray | None = None, values: Floats | None = None, *, in_turn: bool = False
) -> Components:
    """The noise of a model's observations; ``in_turn``: slow noise by the order of readings too, where their kind has one.

    ``used``: (m,) which observations; by default those that the model uses. ``values``: (k,) of the model's parameters, of a
    recording yet to be made; by default those that it is estimated to have.
    """
    artefact, chosen = model.artefact, model.used if used is None else used
    step = 0.0
    if values is None:
        estimate = model.estimate()
        values, scatter = estimate.about, estimate.least_squares.sigma_of_residuals
        step = display_step(artefact.points.xyz, scatter) or _step_of_lengths(artefact.points, scatter)
    xyz = model.placed(values)
    sensitivity, rows = sensitivities(model, xyz)[chosen], artefact.rows[chosen]
    turn, along = machine_axes(rows, sensitivity)
    block = repeated_quantity(model, chosen)
    helmert, count = _helmert(block)
    turn = scipy.sparse.csr_array(helmert @ turn)
    axes = np.asarray(abs(helmert).power(2) @ axis_variances(along, artefact.noise_scale[chosen]))
    reading = axes.sum(axis=1)
    length = growing_lengths(model, xyz)[chosen]
    growth = np.asarray(
        abs(helmert).power(2) @ (artefact.noise_scale[chosen] ** 2 * (length / max(length.max(), 1e-9)) ** 2)
    )
    shares = np.column_stack([axes, reading * count, growth, reading])
    slow, frequency, gap, part = _slow(model, chosen, sensitivity, along, block)
    if in_turn and not slow.shape[1] and (passes := artefact.passes()) is not None:
        slow, frequency, gap, part = _in_turn(
            passes[chosen], artefact.points.point[rows[:, 0]], artefact.noise_scale[chosen]
        )
    parts, longer = axes / axes.sum(axis=1, keepdims=True), length[length > _NO_LENGTH * length.max(initial=0.0)]
    possible = {
        AXES: bool(np.sum(np.ptp(parts, axis=0) > _LEAST_SHARE) >= 2), PLACING: _shows(model, xyz, chosen, block),
        GROWTH: bool(len(longer)) and bool(longer.max() > _LEAST_SPREAD * np.median(longer)), SLOW: slow.shape[1] > 0,
    }  # fmt: skip
    return Components(
        turn, shares, slow, frequency, tuple(name for name, can in possible.items() if can), model.sigma, gap, step,
        part,
    )  # fmt: skip


def _step_of_lengths(points: Points, scatter: float) -> float:
    """Step in which lengths are recorded, mm, of which their ends were made, as on a diagonal; 0 of other points."""
    pairs = points.rows_of_groups
    if any(len(rows) != 2 for rows in pairs) or any(name.startswith("reading_") for name in points.columns):
        return 0.0
    ends = points.xyz[np.array(pairs)]
    return display_step(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), scatter)


def _shows(model: RecordingModel, xyz: Floats, chosen: np.ndarray, block: Ints) -> bool:
    """Whether an offset that repeats of a quantity share is more than where the artefact stands, which is free."""
    several = np.bincount(block) > 1
    offsets = np.where(several, np.random.default_rng(0).standard_normal(len(several)), 0.0)[block]
    reached, left = Freedoms.of(model.artefact.placing(xyz)).at(chosen).reached, offsets.copy()
    for rows in reached.rows:
        columns = reached.columns[rows]
        left[rows] -= columns @ (columns.T @ offsets[rows])
    return bool(np.linalg.norm(left) > _LEAST_OFFSET * np.linalg.norm(offsets))


def display_of(model: RecordingModel) -> Display | None:
    """The display's steps where the used observations lie, or ``None`` where they are too fine to matter."""
    artefact, estimate = model.artefact, model.estimate()
    step = display_step(artefact.points.xyz, estimate.least_squares.sigma_of_residuals)
    seen = sensitivities(model, model.placed(estimate.about))[model.used] if step else np.zeros(0)
    if not np.any(seen):
        return None
    rows = artefact.rows[model.used]
    return Display.of(step, artefact.points.xyz, rows, seen, estimate.least_squares.residuals)


def sensitivities(model: RecordingModel, xyz: Floats) -> Floats:
    """How far each observation moves when each of its points does, along each axis: (m, points of an observation, 3).

    Zero throughout where observations share points in different parts, so that noise by axis cannot be told.
    """
    artefact = model.artefact
    m, slots = artefact.rows.shape
    owners = [np.unique(artefact.rows[:, s]) for s in range(slots)]
    if sum(map(len, owners)) > len(np.unique(np.concatenate(owners))):
        return np.zeros((m, 1, 3))
    found = np.zeros((m, slots, 3))
    for s, own in enumerate(owners):
        moved = np.zeros((len(xyz), 3, 3))
        moved[own] = np.eye(3)
        found[:, s] = artefact.project(xyz, artefact.points.on_artefact(moved))
    return found


def machine_axes(rows: Ints, sensitivity: Floats) -> tuple[scipy.sparse.csr_array, Floats]:
    """Turns observations of one point among themselves so that each sees the noise of one axis, as nearly as that goes.

    Returns turn (m, m), and the sensitivities (m, slots, 3) afterwards.
    """
    m = len(rows)
    one = rows.shape[1] == 1 and len(np.unique(rows)) < m and np.any(sensitivity)
    if not one:
        return scipy.sparse.eye_array(m, format="csr"), sensitivity
    order = np.argsort(rows[:, 0], kind="stable")
    _, starts, sizes = np.unique(rows[order, 0], return_index=True, return_counts=True)
    along, at, across, values = sensitivity.copy(), [], [], []
    for size in np.unique(sizes):
        groups = order[starts[sizes == size][:, None] + np.arange(size)]  # (g, size)
        seen = sensitivity[groups, 0]  # (g, size, 3)
        turned = np.broadcast_to(np.eye(size), (len(groups), size, size))
        if 1 < size <= 3:
            largest = np.sort(np.argsort(-np.linalg.norm(seen, axis=1), axis=1)[:, :size], axis=1)
            chosen = np.take_along_axis(seen, largest[:, None, :], axis=2)
            U, _, Vt = np.linalg.svd(chosen.swapaxes(1, 2))
            turned = U @ Vt
        along[groups, 0] = turned @ seen
        at.append(np.repeat(groups, size, axis=1).ravel())
        across.append(np.tile(groups, (1, size)).ravel())
        values.append(turned.reshape(len(groups), -1).ravel())
    where = np.concatenate(at), np.concatenate(across)
    return scipy.sparse.csr_array((np.concatenate(values), where), shape=(m, m)), along


def repeated_quantity(model: RecordingModel, chosen: np.ndarray) -> Ints:
    """Numbers (m,) that observations share when they repeat one quantity: the same points of one placing, seen alike.

    At another angle of a rotary table they are seen otherwise.
    """
    artefact, points = model.artefact, np.sort(model.artefact.points.point[model.artefact.rows], axis=1)
    read = artefact.points.readings
    angles = [np.round(read[axis][artefact.rows[:, 0]], 6) for axis in read if axis not in "xyz"]
    whole = np.column_stack([artefact.measurement, points, number_in_reading(model), *angles])
    return np.asarray(np.unique(whole[chosen], axis=0, return_inverse=True)[1].ravel(), dtype=np.int64)


def number_in_reading(model: RecordingModel) -> Ints:
    """Numbers (m,) of the observations of one reading of the same points, as along X, Y and Z: different quantities."""
    artefact, points = model.artefact, np.sort(model.artefact.points.point[model.artefact.rows], axis=1)
    reading = np.column_stack([artefact.measurement, artefact.repeat, points])
    _, index = np.unique(reading, axis=0, return_inverse=True)
    order = np.argsort(index.ravel(), kind="stable")
    number, first = np.empty(len(order), dtype=np.int64), np.unique(index.ravel()[order], return_index=True)[1]
    number[order] = np.arange(len(order)) - first[index.ravel()[order]]
    return number


def _helmert(block: Ints) -> tuple[scipy.sparse.csr_array, Floats]:
    """Turns repeats into their mean, times √n, and contrasts; and n (m,) for the former, 0 for the latter."""
    m, order = len(block), np.argsort(block, kind="stable")
    _, starts, sizes = np.unique(block[order], return_index=True, return_counts=True)
    at, across, values, count = [], [], [], np.zeros(m)
    for n in np.unique(sizes):
        groups = order[starts[sizes == n][:, None] + np.arange(n)]
        basis = mean_and_contrasts(n).tocoo()
        at.append(groups[:, basis.row].ravel())
        across.append(groups[:, basis.col].ravel())
        values.append(np.tile(basis.data, len(groups)))
        count[groups[:, 0]] = n
    where = np.concatenate(at), np.concatenate(across)
    return scipy.sparse.csr_array((np.concatenate(values), where), shape=(m, m)), count


def mean_and_contrasts(n: int) -> scipy.sparse.csr_array:
    """An orthonormal matrix (n, n) whose first row is constant.

    Many repeats are taken in parts, and the means of the parts together, so that most of its values are zero.
    """
    if n <= _WHOLE:
        return scipy.sparse.csr_array(np.vstack([np.full(n, 1 / np.sqrt(n)), _contrasts(n)]))
    sizes = np.array([len(part) for part in np.array_split(np.arange(n), int(np.sqrt(n)))])
    within = scipy.sparse.block_diag(
        [np.vstack([np.full(k, 1 / np.sqrt(k)), _contrasts(k)]) for k in sizes], format="csr"
    )
    # a reflection that turns the first axis into the direction of what all means have in common
    whole = np.sqrt(sizes / n)
    away = np.where(np.arange(len(sizes)) == 0, 1.0, 0.0) - whole
    among = np.eye(len(sizes)) - 2 * np.outer(away, away) / (away @ away)
    first = np.cumsum(sizes) - sizes
    others = np.setdiff1d(np.arange(n), first)
    return scipy.sparse.csr_array(scipy.sparse.vstack([scipy.sparse.csr_array(among) @ within[first], within[others]]))


def _contrasts(n: int) -> Floats:
    """(n − 1, n) orthonormal, each with the sum zero (Helmert)."""
    rows, i = np.tril(np.ones((n - 1, n))), np.arange(1, n)
    rows[i - 1, i] = -i
    return np.asarray(rows / np.sqrt(i * (i + 1))[:, None])


def axis_variances(along: Floats, noise_scale: Floats) -> Floats:
    """Shares (m, 3) of the axes' variances in each observation, which sum up to its noise scale's square."""
    squares = np.sum(along**2, axis=1)
    total = squares.sum(axis=1, keepdims=True)
    equal = np.full_like(squares, 1 / 3)
    parts = np.where(total > 0, squares / np.where(total > 0, total, 1.0), equal)
    return np.asarray(parts * noise_scale[:, None] ** 2)


def growing_lengths(model: RecordingModel, xyz: Floats) -> Floats:
    """What noise may grow with, (m,) mm: the length observed, or the distance from the first point of the placing."""
    artefact, rows = model.artefact, model.artefact.rows
    if rows.shape[1] == 2:
        return np.asarray(np.linalg.norm(xyz[rows[:, 1]] - xyz[rows[:, 0]], axis=1))
    return distances_in_placing(xyz, artefact.points)[rows[:, 0]]


def _slow(
    model: RecordingModel, chosen: np.ndarray, sensitivity: Floats, along: Floats, quantity: Ints
) -> tuple[Floats, Floats, float, Floats]:
    """Columns (m, c) of slow noise as cosines of the time, their frequencies, the typical part between readings, the time.

    Along the observation where its direction is that of the placing; else of each coordinate, with fewer frequencies where
    observations see several of them.
    """
    artefact = model.artefact
    time = artefact.points.columns.get("time_s")
    if time is None or len(np.unique(time)) < _LEAST_TIMES:
        return np.zeros((int(np.sum(chosen)), 0)), np.zeros(0), 0.0, np.zeros(0)
    seconds = time[artefact.rows].mean(axis=1)[chosen]
    part = (seconds - seconds.min()) / max(float(np.ptp(seconds)), 1e-9)
    by_axis = artefact.rows.shape[1] == 1 and _turning(sensitivity[:, 0], artefact.measurement[chosen], quantity)
    several = 3 if by_axis and np.any(np.sum(np.abs(along[:, 0]) > _ALONG, axis=1) > 1) else 1
    most = min(FREQUENCIES // several, len(np.unique(seconds)) - 1)
    gap = float(np.median(np.diff(np.unique(part))))
    frequency = np.arange(most + 1, dtype=np.float64)
    cosines = np.where(frequency > 0, np.sqrt(2.0), 1.0) * np.cos(np.pi * frequency * part[:, None])
    if by_axis:
        seen = sensitivity[:, 0]
        axes = np.flatnonzero(np.abs(seen).max(axis=0) > 1e-6)
        columns = (seen[:, axes, None] * cosines[:, None, :]).reshape(len(part), -1)
        return columns, np.tile(frequency, len(axes)), gap, part
    return artefact.noise_scale[chosen, None] * cosines, frequency, gap, part


def _in_turn(passes: Ints, order: Ints, scale: Floats) -> tuple[Floats, Floats, float, Floats]:
    """As :func:`_slow`, of readings evenly in time in each of the passes (m,), whose slow noise begins anew."""
    each, index = np.unique(passes, return_inverse=True)
    part, count = np.zeros(len(passes)), np.bincount(index.ravel())
    for rows in (np.flatnonzero(passes == one) for one in each):
        part[rows[np.argsort(order[rows], kind="stable")]] = np.linspace(0, 1, len(rows))
    frequency = np.arange(min(FEWER, int(count.max()) - 1) + 1, dtype=np.float64)
    if len(frequency) < _LEAST_TIMES:
        return np.zeros((len(passes), 0)), np.zeros(0), 0.0, np.zeros(0)
    cosines = np.where(frequency > 0, np.sqrt(2.0), 1.0) * np.cos(np.pi * frequency * part[:, None])
    columns = np.hstack([np.where(passes == one, scale, 0.0)[:, None] * cosines for one in each])
    return columns, np.tile(frequency, len(each)), 1 / float(count.max() - 1), part


def _turning(seen: Floats, measurement: Ints, quantity: Ints) -> bool:
    """Whether observations (m, 3) of one placing look along different directions.

    Where each placing is a single quantity, all are one: a bar swept about a ball is seen from the machine, which drifts,
    along ever other directions.
    """
    if len(np.unique(quantity)) == len(np.unique(measurement)):
        measurement = np.zeros_like(measurement)
    _, first, index = np.unique(measurement, return_index=True, return_inverse=True)
    return bool(np.abs(seen - seen[first][index.ravel()]).max() > 1e-3)
