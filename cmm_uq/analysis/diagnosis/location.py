"""Where a mismatch lives: covariate, region and direction that carry the evidence, and the function that shows it.

What grows along X also grows with the order in which X was gone through: places that fit as well are named together, another
only where it carries evidence beside the first. A length shows half of its residual at either end, along its line.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from cmm_uq.analysis.diagnosis.comparison.conditional import Version
from cmm_uq.analysis.diagnosis.comparison.explanations import UNKNOWN
from cmm_uq.analysis.diagnosis.comparison.lack_of_fit import tail_probability
from cmm_uq.analysis.diagnosis.comparison.search import ModelComparison
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import MICROMETRE
from cmm_uq.base.values import dataclass, field
from cmm_uq.machine.model import RecordingModel
from cmm_uq.maths.uncertainty.quantity import Quantity

_UNSEEN = 0.05  # part of a constant or a line that must show in the observations; with less, nothing is known of it
_AS_WELL = float(np.log(20.0))  # log odds within which another covariate fits as well
_MOST = 4  # places that are told


@dataclass(frozen=True, eq=False)
class Place:
    covariate: str
    # of that covariate, where the function is larger than half its maximum and its band does not hold zero, or between
    # which values it jumps
    region: tuple[float, float]
    p_value: float  # corrected for having looked at every covariate; of a further place, beside those before it
    amplitude_um: float  # largest value of the function in the region
    what: Text
    curve: tuple[Floats, Floats, Floats]  # covariate, function and its standard uncertainty in µm, each (p,)
    k: float = 2.0  # coverage factor of its band for 95 %
    # axis along which it displaces points; None where it is told by the observations themselves
    along: str | None = None
    scale: bool = False  # whether it is a scale of that axis
    also: tuple[Text, ...] = ()  # other functions that fit as well and show the same
    # lowest and highest of the covariate among the points of each observation, and what the job's model leaves of it in
    # µm, each (m,)
    data: tuple[Floats, Floats, Floats] = field(default_factory=lambda: (np.zeros(0), np.zeros(0), np.zeros(0)))


def locate(compared: ModelComparison, alpha: float, effects: Collection[int] = ()) -> tuple[Place, ...]:
    """Where the evidence is that something is missing, significant at ``alpha``, the place with most of it first."""
    if compared.p_value >= alpha:
        return ()
    every = compared.explanations
    functions = {i for i, e in enumerate(every) if e.kind == UNKNOWN and e.covariate_name and e.covariate is not None}
    chosen: list[tuple[Version, float, tuple[Text, ...]]] = []
    while functions and len(chosen) < _MOST:
        gains = _beside(compared, [version for version, *_ in chosen], functions)
        gains = {i: found for i, found in gains.items() if found[2] < alpha}
        if not gains:
            break
        most = max(gain for gain, *_ in gains.values())
        likely = [i for i, (gain, *_) in gains.items() if gain > most - _AS_WELL]
        first = max(likely, key=lambda i: (any(every[i].could_be(every[e]) for e in effects), gains[i][0]))
        _, version, p_value = gains[first]
        besides = _beside(compared, [*(v for v, *_ in chosen), version], set(gains) - {first})
        functions = {i for i, (*_, p) in besides.items() if p < alpha}
        also = sorted((i for i in likely if i != first and i not in functions), key=lambda i: -gains[i][0])
        chosen.append((version, p_value, tuple(dict.fromkeys(every[i].name for i in also))))
    return tuple(_places(compared, chosen))


def _beside(
    compared: ModelComparison, conditions: Sequence[Version], functions: Collection[int]
) -> dict[int, tuple[float, Version, float]]:
    """Of each function its log odds beside others, its best version, and how often noise shows as much."""
    comparison, found = compared.comparison, {}
    alone = float(comparison.log_evidence_of(conditions)[0]) if conditions else 0.0
    for i, (evidence, version) in comparison.beside(conditions, functions).items():
        if i in functions:
            gain = evidence - alone if conditions else float(compared.log_odds[i])
            found[i] = gain, version, tail_probability(compared.null_maximum, gain)
    return found


def _places(compared: ModelComparison, chosen: Sequence[tuple[Version, float, tuple[Text, ...]]]) -> Iterable[Place]:
    fit = _Fit.of(compared, [version for version, *_ in chosen])
    model, comparison = compared.model, compared.comparison
    rows, left = model.artefact.rows[model.used], comparison.left * comparison.noise_scale / MICROMETRE
    for number, (version, p_value, also) in enumerate(chosen):
        explanation = compared.explanations[version.explanation]
        covariate, name, term = explanation.covariate, explanation.covariate_name, explanation.term
        if covariate is None or name is None:
            continue
        x, order = np.unique(covariate, return_index=True)
        values = explanation.members[version.member].values
        y, u = fit.function(number, x, values[order])
        sure = np.abs(y) > fit.k * u
        if not sure.any():
            continue
        region = region_of(x, y, sure) if values.shape[1] > 1 else _jump(compared, version.explanation, x, order)
        each = covariate[rows] if len(covariate) == len(model.artefact.points) else covariate[:, None]
        yield Place(
            name, region, p_value, float(np.abs(y[sure]).max()) / MICROMETRE, explanation.name,
            (x, y / MICROMETRE, u / MICROMETRE), fit.k, None if term is None else term.along,
            term is not None and term.scale, also, (each.min(axis=1), each.max(axis=1), left),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Fit:
    """Unknown functions fitted together to what the baseline leaves."""

    mean: Floats  # mean, covariance: of their coefficients, (r,) and (r, r), for functions in mm
    covariance: Floats
    parts: Sequence[slice]  # coefficients of each function
    left: Floats  # (m, r) what the baseline leaves of their columns
    k: float  # coverage factor for 95 %

    @classmethod
    def of(cls, compared: ModelComparison, versions: Sequence[Version]) -> _Fit:
        """Best linear estimate, with a normal prior of each version's amplitude."""
        comparison = compared.comparison
        members = [compared.explanations[v.explanation].members[v.member] for v in versions]
        each = [comparison.rest(member.columns / comparison.noise_scale[:, None]) for member in members]
        if not each:
            return cls(np.zeros(0), np.zeros((0, 0)), (), np.zeros((len(comparison.left), 0)), 2.0)
        left = np.hstack(each)
        ends = np.cumsum([0, *(columns.shape[1] for columns in each)])
        least = comparison.left - left @ np.linalg.lstsq(left, comparison.left, rcond=None)[0]
        degrees = max(comparison.degrees_of_freedom - left.shape[1], 1)
        variance = max(float(least @ least) / degrees, comparison.least_noise**2)
        amplitude = np.repeat([v.amplitude for v in versions], np.diff(ends))
        precision = left.T @ left / variance + np.diag(1 / (amplitude**2 * variance))
        covariance = np.linalg.inv(precision)
        mean = covariance @ (left.T @ comparison.left) / variance
        parts = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        return cls(mean, covariance, parts, left, float(scipy.special.stdtrit(degrees, 0.975)))

    def function(self, number: int, x: Floats, values: Floats) -> tuple[Floats, Floats]:
        """One function and its standard uncertainty, mm, each (p,), from its values (p, r) for unit coefficients."""
        own = self.parts[number]
        values = without_unseen(x, values, self.left[:, own])
        return values @ self.mean[own], np.sqrt(np.einsum("pi,ij,pj->p", values, self.covariance[own, own], values))


def without_unseen(x: Floats, values: Floats, left: Floats) -> Floats:
    """Functions (p, r) of a covariate less the constant and the line in them that the observations ``left`` (m, r) miss."""
    lines = np.column_stack([np.ones_like(x), (x - x.mean()) / np.ptp(x)])
    among = np.linalg.lstsq(values, lines, rcond=None)[0]
    shown = np.sqrt(np.mean((left @ among) ** 2, axis=0))
    unseen = shown < _UNSEEN * np.sqrt(np.mean((values @ among) ** 2, axis=0))
    lines = lines[:, unseen]
    return np.asarray(values - lines @ np.linalg.lstsq(lines, values, rcond=None)[0])


def _jump(compared: ModelComparison, index: int, x: Floats, order: Ints) -> tuple[float, float]:
    """Range of the sorted covariate that holds a step with 95 % probability."""
    members = compared.explanations[index].members
    member, evidence, _ = compared.comparison.of_versions(index)
    steps = np.array([members[m].columns.shape[1] == 1 for m in member])
    member, evidence = member[steps], evidence[steps]
    probability = np.exp(evidence - scipy.special.logsumexp(evidence))
    likely = np.argsort(-probability)
    likely = likely[: int(np.searchsorted(np.cumsum(probability[likely]), 0.95)) + 1]
    jumps = [int(np.flatnonzero(np.diff(members[m].values[order, 0]))[0]) for m in member[likely]]
    return float(x[min(jumps)]), float(x[max(jumps) + 1])


def region_of(covariate: Floats, curve: Floats, sure: NDArray[np.bool_] | None = None) -> tuple[float, float]:
    """Range of the sorted covariate about the curve's largest value where it exceeds half of it and is ``sure``."""
    size = np.abs(curve) if sure is None else np.where(sure, np.abs(curve), 0.0)
    low = np.flatnonzero(~((np.abs(curve) >= 0.5 * size.max()) & (size > 0)))
    most = int(np.argmax(size))
    first, last = low[low < most].max(initial=-1) + 1, low[low > most].min(initial=len(size)) - 1
    return float(covariate[first]), float(covariate[last])


_SEEN = 1e-6


@dataclass(frozen=True, eq=False)
class ResidualField:
    place: Floats  # (q, 3) readings of the scales, mm
    # before, after: (q, 3) µm, indicated minus modelled, by the job's model and by that with what was left out
    before: Floats
    after: Floats
    scale: Floats  # (q,) standard uncertainty of each vector's length, per unit of that of one coordinate
    dimensions: Ints  # (q,) in how many directions it is seen
    lengths: bool  # whether they are the two ends of lengths, one after the other

    def expanded(self, noise: Quantity) -> Floats:
        """(q,) length that noise of this standard deviation of a coordinate exceeds in 5 % of cases, in its unit."""
        d, nu = np.maximum(self.dimensions, 1).astype(np.float64), max(noise.degrees_of_freedom, 1.0)
        squares = scipy.special.chdtri(d, 0.05) if np.isinf(nu) else d * scipy.special.fdtri(d, nu, 0.95)
        return np.asarray(np.sqrt(squares) * self.scale * noise.value, dtype=np.float64)


def residual_field(before: RecordingModel, after: RecordingModel) -> ResidualField | None:
    """The residuals of two models of one recording as vectors; ``None`` where an observation is of more than two points."""
    artefact, used = before.artefact, before.used
    rows, noise, readings = artefact.rows[used], artefact.noise_scale[used], artefact.points.machine_xyz
    each = [model.residuals(model.estimate().least_squares.value)[used] / MICROMETRE for model in (before, after)]
    left = np.column_stack(each)
    if rows.shape[1] == 1:
        every = np.broadcast_to(np.eye(3), (len(artefact.points), 3, 3))
        # (m, 3) in which each sees its point move
        directions = artefact.project(artefact.points.xyz, artefact.points.on_artefact(every))[used]
        point, order = rows[:, 0], np.argsort(rows[:, 0], kind="stable")
        sets = np.split(order, np.flatnonzero(np.diff(point[order])) + 1)
        field = np.array([np.linalg.pinv(directions[own], rcond=_SEEN) @ left[own] for own in sets])
        scale = np.array([float(noise[own].mean()) for own in sets])
        seen = np.array([np.linalg.matrix_rank(directions[own], tol=_SEEN) for own in sets], dtype=np.int64)
        return ResidualField(readings[np.unique(point)], field[:, :, 0], field[:, :, 1], scale, seen, False)
    if rows.shape[1] == 2:
        ends, count = readings[rows], 2 * len(rows)
        along = ends[:, 1] - ends[:, 0]
        half = 0.5 * left[:, :, None] * (along / np.linalg.norm(along, axis=1, keepdims=True))[:, None, :]
        both = np.stack([-half, half], axis=1)  # (m, end, model, 3)
        first, second = (both[:, :, i].reshape(count, 3) for i in (0, 1))
        scale, one = np.repeat(0.5 * noise, 2), np.ones(count, dtype=np.int64)
        return ResidualField(ends.reshape(count, 3), first, second, scale, one, True)
    return None
