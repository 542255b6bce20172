"""Level and rate of many machines given their certificates: Kalman filters over every likely tale of steps.

State of a machine: level, rate at its first certificate, coefficients of settling and of the seasons (three, or none), and
the errors of the artefacts that it was measured with, in their standard uncertainties. All but the level stay as they are (an
adjustment begins a new settling) and move the level by :func:`cmm_uq.laboratory.due.drift.moved`.
Given when steps came and which certificates were wrong, all is Gaussian and the filter is exact (Kalman 1960; Durbin and
Koopman 2012, section 4.3). Those tales are summed over: each certificate makes four of one, and the likeliest are kept (a
Gaussian sum, Alspach and Sorenson 1972).
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, replace
from cmm_uq.laboratory.due import drift

KEPT = 12  # tales kept of a machine at a node
_ODDS = np.log([1 - drift.WRONG, drift.WRONG])
_TIMES = drift.WRONG_TIMES**2 - 1


@dataclass(frozen=True, eq=False)
class DriftStart:
    """Rate and artefacts' errors of each machine at each node, before its own certificates."""

    mean: Floats  # (1 + q, N, K)
    covariance: Floats  # (1 + q, 1 + q, N, K)


@dataclass(frozen=True, eq=False)
class DriftState:
    """After the last certificate, or an adjustment after it, for N machines, K nodes and M tales."""

    mean: Floats  # (d, N, K, M) level, rate, components, errors of the artefacts
    covariance: Floats  # (d, d, N, K, M)
    log_weight: Floats  # (N, K, M) joint density of certificates and tale
    steps: Floats  # (n, N, K, M) 1 where the tale has a step before a certificate, else 0; (0, …) where nobody asked

    def between(self, first: int, last: int | None) -> DriftState:
        mean, covariance, steps = self.mean[:, first:last], self.covariance[:, :, first:last], self.steps[:, first:last]
        return DriftState(mean, covariance, self.log_weight[first:last], steps)

    @property
    def log_evidence(self) -> Floats:
        """Density of a machine's certificates at each node, (N, K)."""
        return log_sum(self.log_weight)

    def weights(self, prior: drift.DriftPrior) -> Floats:
        """Of nodes and tales given the certificates, (N, K, M), one in all for each machine."""
        own = self.log_evidence
        evidence = own + np.log(prior.weight)
        of_group = np.stack([log_sum(np.where(row, evidence, -np.inf)) for row in prior.members], axis=-1)
        each = np.array([prior.weight[row].sum() for row in prior.members])
        node = np.exp(evidence - of_group[:, prior.group]) * each[prior.group]
        return np.asarray(node[..., None] * np.exp(self.log_weight - own[..., None]), dtype=np.float64)


def log_sum(values: Floats) -> Floats:
    """Logarithm of the sum of exponentials over the last axis."""
    top = values.max(axis=-1, keepdims=True)
    top = np.where(np.isfinite(top), top, 0.0)
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(np.exp(values - top).sum(axis=-1)) + top[..., 0], dtype=np.float64)


def usual_start(machines: drift.Histories, prior: drift.DriftPrior) -> DriftStart:
    """Rates of the prior, artefacts as their certificates say."""
    q, N, K = machines.shared.shape[1], len(machines), len(prior)
    mean, covariance = np.zeros((1 + q, N, K)), np.zeros((1 + q, 1 + q, N, K))
    mean[0], covariance[0, 0] = prior.rate, prior.rate_sd**2
    covariance[np.arange(1, 1 + q), np.arange(1, 1 + q)] = 1.0
    return DriftStart(mean, covariance)


def filtered(
    machines: drift.Histories, prior: drift.DriftPrior, start: DriftStart | None = None, kept: int = KEPT, *,
    dated: bool = False, sized: Collection[int] = (),
) -> DriftState:  # fmt: skip
    """Filter all certificates of all machines at all nodes, from :func:`usual_start` or another start.

    ``dated``: keep when tales have steps, of machines with as many certificates. ``sized``: certificates before which the sum
    of steps is the state's last component.
    """
    start = start or usual_start(machines, prior)
    if sized:  # as of an artefact that no certificate was made with
        machines = replace(machines, shared=np.pad(machines.shared, [(0, 0), (0, 1), (0, 0)]))
        more = [(0, 1), (0, 0), (0, 0)]
        start = DriftStart(np.pad(start.mean, more), np.pad(start.covariance, [(0, 1), *more]))
    order = np.argsort(-machines.given.sum(axis=0), kind="stable")  # whoever has no further certificate is done
    machines, start = machines.some(order), DriftStart(start.mean[:, order], start.covariance[:, :, order])
    components, N, K = prior.components, len(machines), len(prior)
    c = np.arange(2, 2 + len(components))
    own = np.delete(np.arange(1 + len(start.mean) + len(c)), c)[1:]
    d = 1 + len(own) + len(c)
    mean, covariance = np.zeros((d, N, K, 1)), np.zeros((d, d, N, K, 1))
    mean[own, ..., 0], covariance[own[:, None], own, ..., 0] = start.mean, start.covariance
    covariance[0, 0] = (prior.first_sd**2)[:, None]
    covariance[c, c] = (components**2)[:, None, :, None]
    no_steps = np.zeros((len(machines.given) * dated, N, K, 1))
    state, done = DriftState(mean, covariance, np.zeros((N, K, 1)), no_steps), []
    for k, left in enumerate(machines.given.sum(axis=1)):
        done.append(state.between(left, None))
        state = _moved(state.between(0, left), machines, prior, k)
        state = _measured(state, machines, prior, k, kept, counted=k in sized)
    back = np.argsort(order)
    state, after = _side_by_side([state, *reversed(done)], back), machines.adjusted_after[back][:, None, None]
    if after.any():
        _set_back(state, after, prior)
    return state


_SETTLE = 2  # where the state has the coefficient of settling, if any


def _set_back(state: DriftState, adjusted: NDArray[np.bool_], prior: drift.DriftPrior) -> None:
    """To what adjustments leave; what settles after one is as much less than after the installation as what it leaves is."""
    left = prior.as_left_sd**2
    again = [(0, left), (_SETTLE, prior.settle_sd**2 * left / prior.first_sd**2)][: 1 + (len(prior.components) > 0)]
    for i, variance in again:
        state.mean[i] *= ~adjusted
        state.covariance[i] *= ~adjusted
        state.covariance[:, i] *= ~adjusted
        state.covariance[i, i] += adjusted * variance[:, None]


def _side_by_side(parts: list[DriftState], order: NDArray[np.intp]) -> DriftState:
    """Machines with few certificates have few tales; the others' further ones have no weight."""
    parts = [part for part in parts if len(part.log_weight)]
    if len(parts) == 1 and (np.diff(order) > 0).all():
        return parts[0]
    most = max(part.log_weight.shape[-1] for part in parts)

    def joined(arrays: list[Floats], value: float) -> Floats:
        wide = [array if array.shape[-1] == most else np.pad(
            array, [(0, 0)] * (array.ndim - 1) + [(0, most - array.shape[-1])], constant_values=value)
                for array in arrays]  # fmt: skip
        return np.concatenate(wide, axis=-3).take(order, axis=-3)

    return DriftState(
        joined([part.mean for part in parts], 0.0), joined([part.covariance for part in parts], 0.0),
        joined([part.log_weight for part in parts], -np.inf), joined([part.steps for part in parts], 0.0),
    )  # fmt: skip


def _moved(state: DriftState, machines: drift.Histories, prior: drift.DriftPrior, k: int) -> DriftState:
    """To the day of certificate k: set back by an adjustment, moved by rate and components, wandering; in place."""
    mean, covariance, N = state.mean, state.covariance, len(state.log_weight)
    adjusted = machines.adjusted[k, :N, None, None]
    if adjusted.any():
        _set_back(state, adjusted, prior)
    begun, day, settling = (each[k, :N, None, None] for each in (machines.begun, machines.day, machines.settling))
    first, nodes = machines.first[:N, None, None], (prior.growth[:, None], prior.settle_years[:, None])
    moves = drift.moved(begun, day, first, settling, *nodes)[: 1 + len(prior.components)]
    for i, move in enumerate(moves, 1):
        mean[0] += move * mean[i]
    along = sum(move * covariance[i] for i, move in enumerate(moves, 1))
    along[0] += 0.5 * sum(move * along[i] for i, move in enumerate(moves, 1))
    covariance[0] += along
    covariance[:, 0] += along
    covariance[0, 0] += machines.years[k, :N, None, None] * (prior.walk**2)[:, None]
    return state


def _measured(
    state: DriftState, machines: drift.Histories, prior: drift.DriftPrior, k: int, kept: int, *, counted: bool
) -> DriftState:
    """With certificate k: each tale becomes four (no step or one before it; right or wrong), the likeliest have an update."""
    N, K, M = state.log_weight.shape
    shared, variance = machines.shared[k, :, :N, None, None], machines.u[k, :N, None, None] ** 2
    first = len(state.mean) - len(shared)  # of the artefacts
    seen = state.covariance[:, 0] + (shared * state.covariance[:, first:]).sum(axis=1)
    expected = seen[0] + (shared * (seen[first:] - shared)).sum(axis=0) + variance
    missed = machines.value[k, :N, None, None] - state.mean[0] - (shared * state.mean[first:]).sum(axis=0)
    size = (prior.step_sd**2)[:, None]
    steps = _log_steps(machines.years[k, :N], prior)
    spread, log_weight = np.empty((N, K, 4, M)), np.empty((N, K, 4, M))
    for tale in range(4):
        stepped, wrong = divmod(tale, 2)
        spread[:, :, tale] = expected + stepped * size + wrong * _TIMES * variance
        log_weight[:, :, tale] = state.log_weight + (steps[stepped] + _ODDS[wrong])[..., None]
    log_weight -= 0.5 * (np.log(2 * np.pi * spread) + missed[:, :, None] ** 2 / spread)
    few, rows = min(kept, 4 * M), np.arange(N * K)[:, None]
    flat = log_weight.reshape(N * K, 4 * M)
    if few < 4 * M:
        chosen = np.argpartition(-flat, few - 1, axis=-1)[:, :few]
    else:
        chosen = np.broadcast_to(np.arange(4 * M), flat.shape)
    of, tales = (rows * M + chosen % M).ravel(), (rows * 4 * M + chosen).ravel()

    def taken(values: Floats, which: NDArray[np.intp], own: int = 3) -> Floats:
        """Of the last ``own`` axes: machine, node, and what tales are made of."""
        lead, last = values.shape[: values.ndim - own], values.shape[values.ndim - own :]
        return values.reshape(*lead, int(np.prod(last))).take(which, axis=-1).reshape(*lead, N, K, few)

    mean, covariance, seen, with_step = (taken(each, of) for each in (state.mean, state.covariance, seen, state.steps))
    with_step[k : k + 1] = step = (chosen // M >= 2).reshape(N, K, few)
    stepping = np.arange(len(mean))[[0, -1]] if counted else np.arange(1)  # what of the state a step changes
    seen[stepping] += step * size
    covariance[stepping[:, None], stepping] += step * size
    gain = seen / taken(spread, tales, 4)
    mean += gain * taken(missed, of)
    covariance -= gain[:, None] * seen
    return DriftState(mean, covariance, taken(log_weight, tales, 4), with_step)


def _log_steps(years: Floats, prior: drift.DriftPrior) -> tuple[Floats, Floats]:
    """Logarithms of the probabilities of no step and of one in the years since the certificate before, (N, K) each."""
    expected = years[:, None] * prior.steps_per_year
    with np.errstate(divide="ignore"):
        return -expected, np.log(-np.expm1(-expected))


FEWEST = 2  # certificates from which on a history says anything of a machine's own drift


def change_since(
    of: drift.DriftHistory, days: float, *, prior: drift.DriftPrior | None = None, limit: float | None = None
) -> float | None:
    """Root mean square change of an error by so many days after its last certificate, in its unit; ``None`` if unknown.

    A rate that may grow, a settling and a season, known less and less well the farther they are carried on, a wandering and
    now and then a step: √((m·θ)² + m·U·m + w²·t + n·s²·t) of coefficients θ with covariance U that move the level by m,
    averaged over the model's parameters given the certificates.
    """
    if len(of.day) < FEWEST or np.isfinite(of.adjusted_after):
        return None
    known = drift.default_prior(drift.limit_for(limit, of.u)) if prior is None else prior
    machines, years = drift.side_by_side([of]), abs(days) / drift.YEAR
    state = filtered(machines, known)
    weight = state.weights(known)[0]
    ends = machines.last, machines.last + abs(days)
    moves = drift.moved(*ends, machines.first, machines.settles, known.growth, known.settle_years)
    m = np.stack([np.broadcast_to(move, len(known)) for move in moves])[: 1 + len(known.components)]
    theta = slice(1, 1 + len(m))
    moved = np.einsum("ik,ikm->km", m, state.mean[theta, 0]) ** 2
    moved += np.einsum("ik,jk,ijkm->km", m, m, state.covariance[theta, theta, 0])
    wandering = (known.walk**2 + known.steps_per_year * known.step_sd**2)[:, None]
    square = moved + wandering * years
    return float(np.sqrt(np.sum(weight * square) / np.sum(weight)))
