"""What set-ups determine, from singular values of the whitened design; expected uncertainties, and what repeats are worth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from cmm_uq.analysis.planning.candidates import (
    FAINT,
    certified,
    cosines,
    gram,
    imitators,
    left_of,
    scales,
    shared,
    visible,
)
from cmm_uq.analysis.planning.set_up import SetUp, repeat_points
from cmm_uq.analysis.planning.setting import PlannedNoise, Setting, uncorrelated, white_noise
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, replace
from cmm_uq.jobs.tables.conformity import Circumstances
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.artefact_doubt import causes_of
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.maths.inference.linear_model import RANK_TOLERANCE, LeastSquares, LinearModel, Unknown, reached, solve
from cmm_uq.maths.inference.noise import Components, Sizes
from cmm_uq.maths.inference.posterior import Doubt, gain

_ROUNDING, _ZERO = 1e-9, 1e-8
COMPARED = 10  # repeats that are compared, or one more than the plan has


@dataclass(frozen=True, eq=False)
class ExpectedUncertainty:
    """Standard uncertainties (k,) of each parameter, in its unit."""

    u: Floats  # of the least-squares estimate, infinite where the set-ups leave it free; as spread averages
    with_prior: Floats  # the same when what physics allows is used too


def expected_uncertainty(
    model: RecordingModel, noise: PlannedNoise, stated: Circumstances | None = None
) -> ExpectedUncertainty:
    """``stated``: what will be in doubt of the artefact, which no scatter shows; ``None``: nothing."""
    values = np.array([unknown.prior_mean for unknown in model.unknowns])
    linear, components = model.linearised(values), noise.components(model, values)
    sizes, weight = noise.spread(components)
    causes = () if stated is None else causes_of(model.artefact, stated)
    doubt = Doubt.of(causes, gain(linear, noise.white.coordinate)) if causes else Doubt(())
    doubted = np.sqrt([doubt.variance(one) for one in np.eye(len(values))])
    with np.errstate(divide="ignore"):  # geometric means (k,) of values (w, k), infinite where one is
        return ExpectedUncertainty(*(
            np.hypot(np.exp(weight @ np.log(each)) if len(weight) > 1 else each[0], doubted)
            for each in uncertainties(linear, components, sizes)
        ))  # fmt: skip


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
        better = []
        for row, following in pairwise(self.rows):
            there = np.isfinite(row.u)
            by_placing = np.log(row.u[there] / row.u_more[there]) * (following.minutes - row.minutes)
            by_repeat = np.log(row.u[there] / following.u[there]) * (row.minutes_more - row.minutes)
            better.append(bool(np.all(by_placing > by_repeat)))
        first = len(better) + 1 - [*reversed(better), False].index(False)
        return first if first <= len(better) else None


def compare_repeats(setting: Setting, placings: Sequence[SetUp]) -> RepeatsComparison | None:
    """Repeats against set-ups; ``None`` where no parameter is determined or the noise is taken as white."""
    noise, plan, n, rows = setting.noise, setting.plan, len(placings), []
    if noise is None or not setting.named:
        return None

    def minutes(set_ups: int, readings: float) -> float:
        return plan.minutes_per_placing * set_ups + plan.seconds_per_point * readings / 60

    for repeats in range(1, max(COMPARED, plan.repeats + 1) + 1):
        each = [replace(placing, points=repeat_points(placing.points, repeats)) for placing in placings]
        points = setting.joined(each)
        model, readings = setting.model(points), len(points)
        sought = [i for i, unknown in enumerate(model.unknowns) if not unknown.known]
        # information of n + 1 set-ups is to that of n as if variances were n / (n + 1) of what they are
        lesser = noise.times(float(np.sqrt(n / (n + 1))))
        now, later = (expected_uncertainty(model, each, setting.circumstances).u[sought] for each in (noise, lesser))
        more = readings * (1 + 1 / n)
        rows.append(RepeatsRow(repeats, readings, minutes(n, readings), now, more, minutes(n + 1, more), later))
    unknowns = tuple(unknown for unknown in model.unknowns if not unknown.known)
    return RepeatsComparison(unknowns, n, tuple(rows)) if np.any(np.isfinite(rows[0].u)) else None


def predicted(setting: Setting, placings: Sequence[SetUp]) -> Floats | None:
    """(t, 3) u of where the machine is at further set-ups, by what set-ups tell and physics allows, mm; beside their noise.

    ``None`` for a kind that names no further set-ups.
    """
    if setting.planning.held_out is None:
        return None
    points = setting.joined([*placings, *setting.planning.held_out(setting)])
    model = setting.model(points)
    known, at = shared(model, setting.noise), model.artefact.points
    effects = [float(i < len(known.unknowns) and known.unknowns[i].key[0] != ARTEFACT) for i in range(len(known.prior))]
    covariance = linalg.pinvh(known.each[: len(placings)].sum(axis=0) + known.prior + np.diag(effects))
    linear = model.linearised(np.array([unknown.prior_mean for unknown in model.unknowns]))
    rows = np.hstack([linear.design * scales(linear.unknowns), linear.freedoms.dense()])
    further = rows[(model.artefact.measurement > len(placings)) & (model.artefact.repeat == at.repeat.min())]
    return np.asarray(np.sqrt(np.einsum("mi,ij,mj->m", further, covariance, further)).reshape(-1, 3))


Pair = tuple[str, str, float]  # two effects and the absolute cosine between them
NOT_TOLD_APART = 0.98  # cosine from which on a fifth of one effect is all that the other cannot imitate
WEAK = 0.1  # part of the prior variance from which on a parameter counts as weakly determined


@dataclass(frozen=True)
class Determination:
    """What to expect of one parameter."""

    unknown: Unknown
    # standard uncertainty of its least-squares estimate, in its unit; None where the set-ups leave it free
    u: float | None
    u_with_prior: float  # the same when what physics allows is used too
    u_white: float | None  # like u, if the noise were white
    status: str  # determined, weak (the prior says almost as much) or free


@dataclass(frozen=True, eq=False)
class Identifiability:
    """What set-ups determine."""

    # of the effects named, and the sizes of the artefact that no certificate gives
    parameters: tuple[Determination, ...]
    # combinations, each by the keys of its parameters and their parts, that leave every observation as it is
    free: tuple[Mapping[tuple[str, str], float], ...]
    # of the design whitened by the noise and scaled by the prior standard deviations, largest first
    singular_values: Floats
    alike: tuple[Pair, ...]  # pairs of effects, and their cosine, that could not be told apart
    # effects, not named by the job, that would be taken for some that it names; with the names of these
    absorbed: tuple[tuple[str, tuple[str, ...]], ...]
    unseen: tuple[str, ...]  # effects, not named by the job, of which nothing would show at all

    @property
    def complete(self) -> bool:
        return all(parameter.status != "free" for parameter in self.parameters)


def identifiability(
    model: RecordingModel,
    rivals: Sequence[Effect] = (),
    noise: PlannedNoise | None = None,
    stated: Circumstances | None = None,
) -> Identifiability:
    """What the set-ups determine of effects, and how rivals would show; ``noise`` ``None``: the model's white noise.

    ``stated``: as of :func:`expected_uncertainty`.
    """
    values = np.array([unknown.prior_mean for unknown in model.unknowns])
    linear = model.linearised(values)
    k, free = len(linear.unknowns), linear.freedoms.dense()
    whole = np.linalg.norm(linear.design / linear.noise_scale[:, None], axis=0)
    there = np.linalg.norm(linear.reduced.design, axis=0) > _ROUNDING * whole
    estimate = solve(replace(
        linear, observed=np.append(linear.observed, np.zeros(k + 1)),
        noise_scale=np.append(linear.noise_scale, np.ones(k + 1)),
        design=np.vstack([linear.design * there, np.zeros((k + 1, k))]),
        placing=np.vstack([free, np.zeros((k + 1, free.shape[1]))]),
    ))  # fmt: skip
    white = white_noise(model) if noise is None else noise.white
    under_white = expected_uncertainty(model, white, stated)
    under_noise = under_white if noise is None else expected_uncertainty(model, noise, stated)
    information = gram(model, values, noise) + certified(model.unknowns)
    names = [unknown.key[0] for unknown in model.unknowns]
    alike: list[Pair] = []
    for i, j in combinations([i for i, name in enumerate(names) if name != ARTEFACT], 2):
        rest = [k for k in range(len(information)) if k not in (i, j)]
        left, alone = left_of(information, [i, j], rest), np.diag(information)[[i, j]]
        cosine = float(cosines(left, alone)[0, 1])
        if names[i] != names[j] and np.all(visible(left, alone)) and cosine > NOT_TOLD_APART:
            alike.append((names[i], names[j], cosine))
    others, absorbed, unseen = _among_rivals(model, rivals, noise) if rivals else ([], (), ())
    combined = tuple(
        {u.key: float(part) for u, part in zip(estimate.unknowns, column, strict=True) if part}
        for column in estimate.null_space.T
    )
    one_by_one = uncorrelated(model, values, noise)
    uncertified = [i for i, unknown in enumerate(one_by_one.unknowns) if not unknown.known]
    design = one_by_one.reduced.design[:, uncertified] * scales(one_by_one.unknowns)[uncertified] / white.coordinate
    return Identifiability(
        _parameters(linear, estimate, under_noise, under_white), combined,
        np.asarray(linalg.svdvals(design)) if design.size else np.zeros(0),
        tuple(sorted([*alike, *others], key=lambda pair: -pair[2])), absorbed, unseen,
    )  # fmt: skip


def _parameters(
    linear: LinearModel, estimate: LeastSquares, noisy: ExpectedUncertainty, white: ExpectedUncertainty
) -> tuple[Determination, ...]:
    scale, found = scales(linear.unknowns), []
    for i, unknown in enumerate(linear.unknowns):
        if unknown.known:
            continue
        u, u_white = (float(each.u[i]) if estimate.determined[i] else None for each in (noisy, white))
        weak = unknown.key[0] != ARTEFACT and noisy.with_prior[i] ** 2 > WEAK * scale[i] ** 2
        status = "free" if u is None else "weak" if weak else "determined"
        found.append(Determination(unknown, u, float(noisy.with_prior[i]), u_white, status))
    return tuple(found)


def _among_rivals(
    model: RecordingModel, rivals: Sequence[Effect], noise: PlannedNoise | None
) -> tuple[list[Pair], tuple[tuple[str, tuple[str, ...]], ...], tuple[str, ...]]:
    """Pairs of rivals not told apart, everything named fitted; rivals taken for named effects; rivals that do not show."""
    wider = replace(model, effects=(*model.effects, *rivals))
    values = np.array([unknown.prior_mean for unknown in wider.unknowns])
    information = gram(wider, values, noise) + certified(wider.unknowns)
    names, own = [unknown.key[0] for unknown in wider.unknowns], {ARTEFACT, *(effect.name for effect in model.effects)}
    fitted = [i for i, name in enumerate(names) if name in own]
    others = [i for i, name in enumerate(names) if name not in own]
    left, alone = left_of(information, others, fitted), np.diag(information)[others]
    seen, cosine = visible(left, alone), cosines(left, alone)
    alike = np.triu((cosine > NOT_TOLD_APART) & seen[:, None] & seen[None, :], 1)
    found = [(names[others[a]], names[others[b]], float(cosine[a, b])) for a, b in zip(*np.nonzero(alike), strict=True)]
    shown = {names[i] for i, there in zip(others, seen, strict=True) if there}
    hidden = [i for i, there in zip(others, seen, strict=True) if not there and names[i] not in shown]
    absorbed = {
        names[i]: tuple(dict.fromkeys(names[j] for j in imitators(information, i, fitted)))
        for i in hidden if information[i, i] > FAINT
    }  # fmt: skip
    unseen = dict.fromkeys(names[i] for i in hidden if names[i] not in absorbed)
    return [pair for pair in found if pair[0] != pair[1]], tuple(absorbed.items()), tuple(unseen)
