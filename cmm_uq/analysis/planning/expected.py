"""Expected standard uncertainties of a plan under its noise, and what repeats are worth beside set-ups.

The weights of least squares are those of the noise, as in the posterior of a recording that shows it. Sums over observations
are made of columns that are orthonormal under white noise, so that no noise makes them worse than itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from cmm_uq.analysis.planning.information import certified, scales
from cmm_uq.analysis.planning.noise import PlannedNoise
from cmm_uq.analysis.planning.set_up import SetUp, join
from cmm_uq.analysis.planning.setting import Setting
from cmm_uq.base.points import Floats, Points
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.maths.inference.least_squares import RANK_TOLERANCE
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown, reached
from cmm_uq.maths.inference.noise import Components, Sizes

_ROUNDING, _ZERO = 1e-9, 1e-8
COMPARED = 10  # repeats that are compared, or one more than the plan has


@dataclass(frozen=True, eq=False)
class ExpectedUncertainty:
    """Standard uncertainties (k,) of each parameter, in its unit."""

    u: Floats  # of the least-squares estimate, infinite where the set-ups leave it free; as spread averages
    with_prior: Floats  # the same when what physics allows is used too


def expected_uncertainty(model: RecordingModel, noise: PlannedNoise) -> ExpectedUncertainty:
    values = np.array([unknown.prior_mean for unknown in model.unknowns])
    linear, components = model.linearised(values), noise.components(model, values)
    sizes, weight = noise.spread(components)
    u, with_prior = uncertainties(linear, components, sizes)
    return ExpectedUncertainty(_averaged(u, weight), _averaged(with_prior, weight))


def uncertainties(linear: LinearModel, components: Components, sizes: Sizes) -> tuple[Floats, Floats]:
    """Standard uncertainties (w, k) for each of w sizes of the noise: of least squares, and with the prior of the effects."""
    unknowns, scale = linear.unknowns, scales(linear.unknowns)
    held = np.array([unknown.known for unknown in unknowns], dtype=bool)
    # 0 for columns of which the set-up leaves nothing but rounding, lest they determine each other; else 1
    whole = np.linalg.norm(linear.design / linear.noise_scale[:, None], axis=0)
    there = np.asarray(np.linalg.norm(linear.reduced.design, axis=0) > _ROUNDING * whole, dtype=np.float64)
    design = linear.design * scale * there
    basis, free = _determined(linear.reduced.design * scale * there, held)
    place = reached(linear.freedoms.dense())
    columns = np.asarray(components.turn @ np.hstack([place, design @ basis, design]))
    q, r = place.shape[1], basis.shape[1]
    prior = certified(unknowns) + np.diag([float(unknown.key[0] != ARTEFACT) for unknown in unknowns])
    variances = components.variances(sizes)[0] @ components.shares.T
    u, with_prior = np.full((len(variances), len(unknowns)), np.inf), np.empty((len(variances), len(unknowns)))
    for i, variance in enumerate(variances):
        information = columns.T @ (columns / variance[:, None])
        left = information[q:, q:] - information[q:, :q] @ np.linalg.solve(information[:q, :q], information[:q, q:])
        covariance = np.linalg.inv(left[:r, :r])
        passed = -basis @ covariance @ left[:r, r:][:, held]
        passed[held] += np.eye(int(held.sum()))
        squares = np.einsum("kr,rs,ks->k", basis, covariance, basis)
        squares += passed**2 @ (linear.prior_sd[held] / scale[held]) ** 2
        u[i, ~free] = np.sqrt(squares[~free])
        with_prior[i] = np.sqrt(np.maximum(np.diag(linalg.pinvh(left[r:, r:] + prior)), 0.0))
    return u * scale, with_prior * scale


def _determined(reduced: Floats, held: NDArray[np.bool_]) -> tuple[Floats, NDArray[np.bool_]]:
    """Combinations (k, r) that observations determine, orthonormal under white noise; and which parameters (k,) stay free."""
    k = len(held)
    _, s, Vt = linalg.svd(np.vstack([reduced[:, ~held], np.zeros((k, k))[:, ~held]]), full_matrices=False)
    rank = int(np.sum(s > RANK_TOLERANCE * s[0])) if s.size and s[0] > 0 else 0
    basis, free = np.zeros((k, rank)), np.zeros(k, dtype=bool)
    basis[~held] = Vt[:rank].T / s[:rank]
    free[~held] = np.linalg.norm(Vt[rank:], axis=0) > _ZERO
    return basis, free


def _averaged(values: Floats, weight: Floats) -> Floats:
    """Geometric mean (k,) of values (w, k), infinite where one is."""
    with np.errstate(divide="ignore"):
        return np.asarray(np.exp(weight @ np.log(values)) if len(weight) > 1 else values[0])


@dataclass(frozen=True, eq=False)
class RepeatsRow:
    """What set-ups tell with a number of repeats."""

    repeats: int  # repeats, readings, minutes: of every point; of all set-ups together
    readings: int
    minutes: float
    u: Floats  # (p,) expected of each parameter, in its unit, infinite where it stays free
    # readings_more, minutes_more, u_more: with one more set-up, which tells as much as they do on average
    readings_more: float
    minutes_more: float
    u_more: Floats


@dataclass(frozen=True, eq=False)
class RepeatsComparison:
    """Repeats against set-ups."""

    unknowns: tuple[Unknown, ...]  # p parameters, those without a certificate
    placings: int
    rows: tuple[RepeatsRow, ...]  # for 1, 2, … repeats

    @property
    def enough(self) -> int | None:
        """Repeats from which on a minute of one more set-up lowers every uncertainty more than one of a repeat."""
        better = [_placing_is_better(one, following) for one, following in pairwise(self.rows)]
        first = len(better) + 1 - [*reversed(better), False].index(False)
        return first if first <= len(better) else None


def _placing_is_better(row: RepeatsRow, following: RepeatsRow) -> bool:
    there = np.isfinite(row.u)
    by_placing = np.log(row.u[there] / row.u_more[there]) * (following.minutes - row.minutes)
    by_repeat = np.log(row.u[there] / following.u[there]) * (row.minutes_more - row.minutes)
    return bool(np.all(by_placing > by_repeat))


def compare_repeats(setting: Setting, placings: Sequence[SetUp]) -> RepeatsComparison | None:
    """Repeats against set-ups; ``None`` where no parameter is determined or the noise is taken as white."""
    noise, n = setting.noise, len(placings)
    if noise is None or not setting.named:
        return None
    rows = []
    for repeats in range(1, max(COMPARED, setting.plan.repeats + 1) + 1):
        points = join(
            [replace(placing, points=repeat_points(placing.points, repeats)) for placing in placings],
            seconds_per_point=setting.plan.seconds_per_point, minutes_per_placing=setting.plan.minutes_per_placing,
            columns=setting.plan.columns,
        )  # fmt: skip
        model, minutes = setting.model(points), _minutes(setting, n, len(points))
        sought = [i for i, unknown in enumerate(model.unknowns) if not unknown.known]
        # information of n + 1 set-ups is to that of n as if variances were n / (n + 1) of what they are
        now, more = (
            expected_uncertainty(model, each).u[sought] for each in (noise, noise.times(float(np.sqrt(n / (n + 1)))))
        )
        with_one_more = len(points) * (1 + 1 / n)
        rows.append(
            RepeatsRow(repeats, len(points), minutes, now, with_one_more, _minutes(setting, n + 1, with_one_more), more)
        )
    unknowns = tuple(unknown for unknown in model.unknowns if not unknown.known)
    return RepeatsComparison(unknowns, n, tuple(rows)) if np.any(np.isfinite(rows[0].u)) else None


def repeat_points(points: Points, times: int) -> Points:
    """What was read first, that many times over."""
    once = points.select(points.repeat == points.repeat.min())
    n = len(once)
    return replace(
        once, xyz=np.tile(once.xyz, (times, 1)), measurement=np.tile(once.measurement, times),
        point=np.tile(once.point, times), repeat=np.repeat(np.arange(1, times + 1), n), lines=np.zeros(0, dtype=np.int64),
        columns={name: np.tile(values, times) for name, values in once.columns.items()},
    )  # fmt: skip


def _minutes(setting: Setting, placings: int, readings: float) -> float:
    return setting.plan.minutes_per_placing * placings + setting.plan.seconds_per_point * readings / 60
