"""What candidates are compared on, whether what was found predicts readings left out, and what it leaves beside repeats."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy
from numpy.typing import NDArray

from cmm_uq.analysis.diagnosis.comparison.explanations import SAME_PLACE
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import MICROMETRE
from cmm_uq.base.values import dataclass, replace
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.kind import Observed
from cmm_uq.machine.model.noise import number_in_reading, repeated_quantity
from cmm_uq.maths.inference.linear_model import Freedoms, LinearModel, reached
from cmm_uq.maths.inference.posterior import Density


def numbered_by_place(model: RecordingModel, group: Ints) -> Ints:
    """Numbers (m,) of groups of observations, from that nearest to the middle: no order, numbering or frame changes them."""
    xyz, rows = model.artefact.points.xyz, model.artefact.rows[model.used]
    away = np.sum((xyz - xyz.mean(axis=0)) ** 2, axis=1)[rows].mean(axis=1)
    _, index = np.unique(group, axis=0, return_inverse=True)
    index = index.ravel()
    rank = np.empty(index.max() + 1, dtype=np.int64)
    rank[np.argsort(np.bincount(index, away) / np.bincount(index), kind="stable")] = np.arange(len(rank))
    return rank[index]


MOST = 1000  # observations that candidates are compared on
_CURVES = 400  # quantities of which none is left out where each set-up reads a curve of its own
LEAST_OF_SET_UP = 30  # observations that a set-up keeps where it has as many: its freedoms cost six of them at most


def thin_out(model: RecordingModel, observe: Observed, seed: int, most: int = MOST) -> RecordingModel:
    """The model of some ``most`` observations: whole quantities, evenly from every set-up, or from some at random."""
    artefact, used = model.artefact, np.flatnonzero(model.used)
    if len(used) <= most:
        return model
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(11,)))
    points, first = artefact.points, artefact.rows[used, 0]
    placing = artefact.measurement[used]
    # observations of several points stay with all others of their set-up, of which they may be differences
    each = max(most // len(np.unique(placing)), LEAST_OF_SET_UP) if artefact.rows.shape[1] == 1 else len(used)
    # numbered by their places: another numbering of the recording draws the same ones
    owner = numbered_by_place(model, placing)
    part = numbered_by_place(model, np.column_stack([placing, points.point[first]]))
    within = _first_of_each(owner, part, each, random)
    whole = _first_of_each(np.zeros_like(owner[within]), owner[within], most, random)
    chosen = used[within][whole]
    rows = np.zeros(len(points), dtype=bool)
    rows[artefact.rows[chosen]] = True
    # points that are no observations, such as one ahead of a surface, stay with their set-up
    bare = ~np.isin(np.arange(len(points)), artefact.rows)
    rows |= bare & np.isin(points.measurement, artefact.measurement[chosen])
    try:
        found = observe(points.select(rows))
    except CmmUqError:  # a kind whose points cannot do without each other: slower, the others stay and are not used
        return replace(model, used=np.isin(np.arange(len(model.used)), chosen))
    return replace(model, artefact=found, used=~found.unread())


def with_quantities(model: RecordingModel, observe: Observed, seed: int, most: int) -> RecordingModel:
    """The model of no more than some different quantities, each with its repeats.

    Where each set-up reads a curve that no other shows, none can be left out of as many as 400.
    """
    artefact, rows = model.artefact, model.artefact.rows[model.used, 0]
    count = len(np.unique(np.column_stack([artefact.measurement[model.used], artefact.points.point[rows]]), axis=0))
    most = max(most, _CURVES) if artefact.curves else most
    if artefact.moving:  # each repeat is a place more
        return thin_out(model, observe, seed, most)
    return thin_out(model, observe, seed, most * int(model.used.sum()) // max(count, 1))


def _first_of_each(owner: Ints, part: Ints, most: int, random: np.random.Generator) -> NDArray[np.bool_]:
    """(m,) which of every owner's observations: its parts in random order, each of them whole, until ``most`` are reached."""
    _, part = np.unique(np.column_stack([owner, part]), axis=0, return_inverse=True)
    part = part.ravel()
    order = np.lexsort((random.permutation(part.max() + 1)[part], owner))
    starts = np.flatnonzero(np.diff(owner[order], prepend=owner[order][0] - 1))
    rank = np.arange(len(order)) - np.repeat(starts, np.diff(np.append(starts, len(order))))
    chosen = np.zeros(len(order), dtype=bool)
    # a part is taken whole where its first observation is
    parts = np.flatnonzero(np.diff(part[order], prepend=-1))
    chosen[order] = np.repeat(rank[parts] < most, np.diff(np.append(parts, len(order))))
    return chosen


FOLDS = 10
_SINGULAR = 1e-9  # part of the largest singular value below which another counts as zero


@dataclass(frozen=True)
class Improvement:
    """Before and after, on the recording itself and on held-out set-ups."""

    rms_before_um: float  # rms_before_um, rms_after_um: residual rms of the observations
    rms_after_um: float
    # heldout_rms_before_um, heldout_rms_after_um: of predictions of what was left out of the fit
    heldout_rms_before_um: float
    heldout_rms_after_um: float
    # elpd_gain, elpd_gain_se: gain in expected log predictive density, and its standard error over what was held out
    elpd_gain: float
    elpd_gain_se: float
    unseen: Text = say("set-ups")
    worse: bool = False  # whether the squares of the errors grow by more than the standard error of that over the folds


def held_out_groups(model: RecordingModel) -> tuple[Ints, Text]:
    """What is left out together (m,), by its place: set-ups; or points, of few set-ups or of curves that no other shows."""
    artefact, used = model.artefact, model.used
    group, unseen = artefact.measurement[used], say("set-ups")
    if artefact.curves or len(np.unique(group)) < FOLDS:
        group, unseen = np.column_stack([group, artefact.points.point[artefact.rows[:, 0]][used]]), say("points")
    return numbered_by_place(model, group), unseen


def improvement(before: RecordingModel, after: RecordingModel) -> Improvement:
    """Compare two models of one recording by cross-validation over its set-ups, or the points of few set-ups."""
    groups, unseen = held_out_groups(before)
    left = [model.estimate().least_squares.residuals for model in (before, after)]
    rms = [float(np.sqrt(np.mean(each**2)) / MICROMETRE) if len(each) else 0.0 for each in left]
    first = _held_out(before, groups)
    second = first if before.effects == after.effects else _held_out(after, groups)
    gain = second[1] - first[1]
    se = float(np.sqrt(len(gain)) * gain.std(ddof=1)) if len(gain) > 1 else 0.0
    more = second[2] - first[2]
    worse = len(more) > 1 and bool(more.sum() > np.sqrt(len(more)) * more.std(ddof=1))
    return Improvement(rms[0], rms[1], first[0], second[0], float(gain.sum()), se, unseen, worse)


def _held_out(model: RecordingModel, groups: NDArray[np.int64]) -> tuple[float, Floats, Floats]:
    estimate = model.estimate()
    return predictions(estimate.linear, max(estimate.least_squares.sigma_of_residuals, model.least_noise, 1e-7), groups)


def predictions(linear: LinearModel, sigma: float, groups: NDArray[np.int64]) -> tuple[float, Floats, Floats]:
    """Rms of predictions, µm, log predictive density and squares, mm², of each fold, without what a set-up leaves open."""
    errors, counts, densities = [], [], []
    for out, error, root, open_ in predicted_folds(linear, sigma, groups):
        errors.append(float(error @ error) * linear.noise_scale[out].mean() ** 2)
        counts.append(len(error) - open_)
        U, s, _ = np.linalg.svd(root, full_matrices=False)
        seen = U.T @ (error / sigma)
        rest = error / sigma - U @ seen
        density = float(-0.5 * (rest @ rest + np.sum(seen**2 / (1 + s**2)) + np.sum(np.log1p(s**2))))
        densities.append(density - counts[-1] * np.log(sigma * np.sqrt(2 * np.pi)))
    return float(np.sqrt(sum(errors) / max(sum(counts), 1)) / MICROMETRE), np.array(densities), np.array(errors)


def predicted_folds(
    linear: LinearModel, sigma: float, groups: NDArray[np.int64]
) -> Iterator[tuple[NDArray[np.bool_], Floats, Floats, int]]:
    """Of each fold the observations left out (m,), errors (o,) of their prediction, mm, L (o, r), and dimensions lost.

    Errors in units of σ have the covariance 1 + L·Lᵀ, L of what the others told of the set-up and of the estimate.
    """
    every = np.hstack([linear.observed[:, None], linear.design]) / linear.noise_scale[:, None]
    placing, numbers = linear.freedoms.over(linear.noise_scale), np.unique(groups)
    folds = FOLDS if len(numbers) > 40 else len(numbers)
    for k in range(folds):
        out = np.isin(groups, numbers[k::folds])
        mean, covariance, _ = Density(replace(linear.at(~out), sigma=sigma)).conditional(float(np.log(sigma)))
        left, known, open_ = predicted(placing, every, out)
        scale = np.sqrt(np.diag(covariance))
        values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
        root = np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))
        yield out, left[:, 0] - left[:, 1:] @ mean, np.hstack([known, left[:, 1:] @ (root / sigma)]), open_


def predicted(placing: Freedoms, every: Floats, out: NDArray[np.bool_]) -> tuple[Floats, Floats, int]:
    """Columns (o, b) held out less what other observations tell; (o, r) factor of its covariance; dimensions lost."""
    left, known, open_ = every.copy(), [np.zeros((len(every), 0))], 0
    for rows in placing.rows:
        inside, rest = rows[out[rows]], rows[~out[rows]]
        if not len(inside):
            continue
        reached, told, free = _told(placing.columns[rest])
        basis = _told(placing.columns[inside] @ free)[0]
        each, whole = placing.columns[inside] @ told, every[inside]
        each, whole = each - basis @ (basis.T @ each), whole - basis @ (basis.T @ whole)
        left[inside] = whole - each @ (reached.T @ every[rest])
        known.append(np.zeros((len(every), each.shape[1])))
        known[-1][inside] = each
        open_ += basis.shape[1]
    return left[out], np.hstack(known)[out], open_


def _told(columns: Floats) -> tuple[Floats, Floats, Floats]:
    """Basis (m, r) that columns (m, q) reach, (q, r) coefficients of it, and basis (q, q − r) of what they leave open."""
    if not columns.size:
        return np.zeros((len(columns), 0)), np.zeros((columns.shape[1], 0)), np.eye(columns.shape[1])
    U, s, V = np.linalg.svd(columns, full_matrices=len(columns) < columns.shape[1])
    rank = int(np.sum(s > _SINGULAR * max(float(s[0]), 1e-300)))
    return U[:, :rank], V[:rank].T / s[:rank], V[rank:].T


_FEWEST = 4  # degrees of freedom of the repeats, and of what they share, from which on the two are compared


@dataclass(frozen=True)
class RepeatComparison:
    """Analysis of variance of the residuals, within repeats of one quantity and between quantities (lack of fit)."""

    repeatability_um: float  # standard deviation of a repeat, of one coordinate
    shared_um: float  # of what all repeats of a quantity share, beyond what their number leaves of that
    p_value: float  # that independent noise alone leaves as much between quantities


def against_repeats(model: RecordingModel) -> RepeatComparison | None:
    """Compare what a model leaves between quantities with the scatter within; nothing of a recording with few repeats.

    Where nothing is repeated, one place of a set-up that is read again, as on the way back, is: but for what the directions of
    approach have in common. F test of lack of fit (Draper & Smith 1998, Applied Regression Analysis, 2.1): exact for normal
    noise that is independent from reading to reading.
    """
    fitted, none = model.estimate().least_squares, np.zeros((int(model.used.sum()), 0))
    left = fitted.residuals / model.artefact.noise_scale[model.used]
    for block, ways in ((repeated_quantity(model, model.used), none), (_read_again(model), _ways(model))):
        _, block = np.unique(block, return_inverse=True)
        block, count = block.ravel(), np.bincount(block.ravel())
        deviation, among = (each - _means(each, block) for each in (left[:, None], ways))
        among = reached(among)
        within = float(np.sum((deviation - among @ (among.T @ deviation)) ** 2))
        own = len(left) - len(count) - among.shape[1]
        between, other = max(float(left @ left) - within, 0.0), fitted.degrees_of_freedom - own
        if min(own, other) >= _FEWEST and within:
            mean, scatter = between / other, within / own
            each = (len(left) - float(count @ count) / len(left)) / (len(count) - 1)  # repeats of a quantity
            shared = float(np.sqrt(max(mean - scatter, 0.0) / each))
            p_value = float(scipy.special.fdtrc(other, own, mean / scatter))
            return RepeatComparison(float(np.sqrt(scatter)) / MICROMETRE, shared / MICROMETRE, p_value)
    return None


def _means(columns: Floats, block: Ints) -> Floats:
    """Of columns (m, k) the means over each block of observations, (m, k)."""
    sums = np.zeros((block.max() + 1, columns.shape[1]))
    np.add.at(sums, block, columns)
    return np.asarray((sums / np.bincount(block)[:, None])[block])


def _read_again(model: RecordingModel) -> Ints:
    """Numbers (m,) that observations of one set-up, seen alike, share where all of their points are at the same places."""
    artefact, rows = model.artefact, model.artefact.rows[model.used]
    places = artefact.points.machine_xyz[rows].reshape(len(rows), -1)
    others = np.column_stack([artefact.measurement, number_in_reading(model)])[model.used]
    if len(np.unique(others, axis=0)) == len(others):  # as most recordings are: no tree need be looked up
        return np.arange(len(others))
    tree = scipy.spatial.cKDTree(np.column_stack([places, 1e9 * others]))  # further apart than any places
    near = tree.query_pairs(SAME_PLACE, output_type="ndarray")
    graph = scipy.sparse.coo_array((np.ones(len(near)), (near[:, 0], near[:, 1])), shape=(len(rows), len(rows)))
    return np.asarray(scipy.sparse.csgraph.connected_components(graph, directed=False)[1], dtype=np.int64)


def _ways(model: RecordingModel) -> Floats:
    """Directions of approach (m, k) of each used observation, where they were recorded."""
    points, rows = model.artefact.points, model.artefact.rows[model.used]
    found = [points.columns[name][rows].mean(axis=1) for name in points.columns if name.startswith("approach_")]
    return np.column_stack(found) if found else np.zeros((len(rows), 0))
