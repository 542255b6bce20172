"""A fleet of machines and one of their errors: what drift is usual, who does not belong, and each machine's own drift.

Hyper-parameters are drawn by importance sampling, all else is exact given them (:mod:`cmm_uq.laboratory.due.fleet_model`).
Each machine is judged and estimated with what all the *others* say as its prior, so that its certificates count once.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.verdicts import BEYOND
from cmm_uq.laboratory.due import drift, fleet_model
from cmm_uq.laboratory.due.crossing import Crossings, crossings
from cmm_uq.laboratory.due.drift_filter import DriftStart, DriftState, filtered, log_sum
from cmm_uq.maths.inference.proposals import evenly_by, laplace, weighed, weights

LEARNT_FROM = 200
"""Machines at most that the hyper-parameters are sampled from: they know a spread between machines to 5 %."""

DRAWS, LEAST_DRAWS, MANY = 64, 6, 20_000
"""Draws of the hyper-parameters that machines are estimated at: fewer where there are many machines."""

FALSE_DISCOVERIES = 0.05  # part of the machines said not to belong that may well belong (Benjamini and Hochberg 1995)
LEAST_WORTH, _EACH, _MOST = 1000.0, 400, 20_000
"""Independent draws that those of the hyper-parameters are worth at least; drawn at once, and at most."""

_AT_ONCE = 1000  # machines times hyper-parameters: what a processor has at hand
_FILTERED_AT_ONCE = 6000
PATHS = 512  # of each machine until it crosses its limit
_LEAST_SHIFT = 0.02
"""Of the variance of a rate: a machine that tells less of its own rate cannot show that it does not belong."""


@dataclass(frozen=True, eq=False)
class FleetMember:
    """A machine of the fleet: its name or serial, its model, its place, its certificates, and what the last one decides."""

    machine: str
    model: str
    place: str
    history: drift.DriftHistory
    limit: float | None = None
    outcome: str = ""


@dataclass(frozen=True)
class UsualRate:
    """The rate per year that is usual for a group of machines, its standard uncertainty and 95 % interval."""

    kind: str
    name: str
    machines: int
    rate: float
    u: float
    lower: float
    upper: float


@dataclass(frozen=True)
class HyperParameter:
    """A hyper-parameter: its name in the model, posterior median and 95 % interval."""

    name: str
    median: float
    lower: float
    upper: float


@dataclass(frozen=True, eq=False)
class Estimates:
    """Of N machines, rates per year; expected is what all others say of a machine of its model and place."""

    rate: Floats  # and u_rate: (N,) with the fleet as prior
    u_rate: Floats
    expected: Floats
    u_expected: Floats
    p: Floats  # (N,) probability of a rate as far from that or farther, near 1 where its certificates say nothing of it
    crossing: Crossings | None  # where there is a limit


@dataclass(frozen=True, eq=False)
class Fleet(fleet_model.FleetPrior):
    """What was learnt: the prior for a further machine, and all else."""

    usual: tuple[UsualRate, ...]  # and spreads: what is usual, and how much differs
    spreads: tuple[HyperParameter, ...]
    machines: tuple[str, ...]  # names, in the order of the estimates
    estimates: Estimates
    learnt_from: int  # machines that the hyper-parameters were drawn from
    draws: int  # of the hyper-parameters, and how many independent ones they are worth
    worth: float

    @property
    def converged(self) -> bool:
        return self.worth >= LEAST_WORTH


def fit_fleet(members: Sequence[FleetMember], seed: int = 1) -> Fleet:
    """Learn from a fleet: hyper-parameters from machines drawn by lot where there are more than :data:`LEARNT_FROM`."""
    if not members:
        fix = "Record certificates, or choose another --name"
        raise CmmUqError("no machine has a certificate that states this value", fix=fix)
    machines = drift.side_by_side([each.history for each in members])
    limits = [each.limit for each in members if each.limit]
    unit = drift.limit_for(float(np.median(limits)) if limits else None, np.concatenate([m.history.u for m in members]))
    shared = fleet_model.shared_by(machines, [each.model for each in members], [each.place for each in members])
    draws, weight, learnt_from = _drawn(machines, shared, unit, seed)
    theta = draws[evenly_by(weight, int(np.clip(MANY // len(members), LEAST_DRAWS, DRAWS)))]
    said = fleet_model.messages(machines, shared, theta, unit)
    all_together = fleet_model.together(said, shared, theta, unit)
    covariance = np.asarray(np.linalg.inv(all_together.precision), dtype=np.float64)
    mean = (covariance @ all_together.linear[..., None])[..., 0]
    start = fleet_model.others(said, all_together, shared, theta, unit)
    estimates = _estimated(machines, start, theta, unit, [each.limit for each in members])
    effects = 1 + len(shared.models) + len(shared.places)
    spreads = _spreads(draws[evenly_by(weight, len(draws))], unit)
    return Fleet(
        unit, theta, shared.models, shared.places, mean[:, :effects], covariance[:, :effects, :effects],
        _usual(members, shared, mean, covariance), spreads, tuple(each.machine for each in members),
        estimates, learnt_from, len(draws), float(1 / np.sum(weight**2)),
    )  # fmt: skip


def _drawn(
    machines: drift.Histories, shared: fleet_model.SharedEffects, unit: float, seed: int
) -> tuple[Floats, Floats, int]:
    """Draws (N, 8) of the hyper-parameters, their weights (N,), and of how many machines."""
    which = np.arange(len(machines))
    if len(which) > LEARNT_FROM:
        random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(3,)))
        which = np.sort(random.choice(which, LEARNT_FROM, replace=False))
    some, common = machines.some(which), shared.some(which)
    at_once = max(1, _AT_ONCE // len(which))

    def density(theta: Floats) -> Floats:
        parts = [theta[i : i + at_once] for i in range(0, len(theta), at_once)]
        return np.concatenate([fleet_model.log_posterior(some, common, part, unit) for part in parts])

    numbers = np.random.RandomState(np.random.MT19937(np.random.SeedSequence(seed, spawn_key=(5,))))
    draws, log, _ = weighed(density, *laplace(density, np.log(drift.MEDIANS)), numbers, _EACH, LEAST_WORTH, _MOST)
    order = np.argsort(draws[:, 0])  # so that few draws, taken evenly, have the spread of rates that all have
    return draws[order], weights(log)[order], len(which)


def _usual(
    members: Sequence[FleetMember], shared: fleet_model.SharedEffects, mean: Floats, covariance: Floats
) -> tuple[UsualRate, ...]:
    """Of the fleet's average machine, of each model at the average place, and of each place for the average model."""
    average = shared.design[:, 0].mean(axis=0)
    found = [_moments("fleet", "", len(members), average, mean, covariance)]
    for kind, known, first, of in (
        ("model", shared.models, 1, [each.model for each in members]),
        ("place", shared.places, 1 + len(shared.models), [each.place for each in members]),
    ):
        for i, name in enumerate(known):
            row = average.copy()
            row[first : first + len(known)] = 0.0
            row[first + i] = 1.0
            found.append(_moments(kind, name, of.count(name), row, mean, covariance))
    return tuple(found)


def _moments(kind: str, name: str, count: int, row: Floats, mean: Floats, covariance: Floats) -> UsualRate:
    means, variances = mean @ row, np.einsum("i,wij,j->w", row, covariance, row)
    rate, u = float(means.mean()), float(np.sqrt(variances.mean() + means.var()))
    half = float(scipy.special.ndtri(0.975)) * u
    return UsualRate(kind, name, count, rate, u, rate - half, rate + half)


def _spreads(draws: Floats, unit: float) -> tuple[HyperParameter, ...]:
    quantiles = np.exp(np.quantile(draws, [0.5, 0.025, 0.975], axis=0))
    scales = [1.0 if name == "steps_per_year" else unit for name in drift.NAMES]
    each = zip(drift.NAMES, scales, quantiles.T, strict=True)
    return tuple(HyperParameter(name, *(float(scale * q) for q in column)) for name, scale, column in each)


def _estimated(
    machines: drift.Histories, start: DriftStart, theta: Floats, unit: float, limits: Sequence[float | None]
) -> Estimates:
    prior = drift.learnt_prior(theta, np.zeros(len(theta)), np.ones(len(theta)), unit)
    limit = np.array([np.inf if each is None else each for each in limits])
    chunk = max(1, _FILTERED_AT_ONCE // len(prior))
    parts = []
    for i in range(0, len(machines), chunk):
        which = np.arange(i, min(i + chunk, len(machines)))
        some = DriftStart(start.mean[:, which][..., prior.group], start.covariance[:, :, which][..., prior.group])
        few = machines.some(which)
        state = filtered(few, prior, some)
        parts.append((_rates(state, prior, some), crossings(few, prior, state, limit[which], paths=PATHS)))
    rate, u, expected, u_expected, p = np.concatenate([part for part, _ in parts], axis=1)
    crossing = Crossings.joined([part for _, part in parts]) if np.isfinite(limit).any() else None
    return Estimates(rate, u, expected, u_expected, p, crossing)


def _rates(state: DriftState, prior: drift.DriftPrior, start: DriftStart) -> Floats:
    """Rate and u with the certificates, the same before them, and the probability of so great a shift between, (5, N).

    If the machine is one of its fleet, the certificates shift the mean of its rate by a normal deviate whose variance is
    what they take from the variance of the rate.
    """
    weight = state.weights(prior)
    rate, variance = state.mean[1], state.covariance[1, 1]
    mean = (weight * rate).sum(axis=(1, 2))
    total = (weight * (variance + (rate - mean[:, None, None]) ** 2)).sum(axis=(1, 2))
    before, spread = start.mean[0], start.covariance[0, 0]
    of_node = weight / weight.sum(axis=2, keepdims=True)
    at_node = (of_node * rate).sum(axis=2)
    left = (of_node * (variance + (rate - at_node[..., None]) ** 2)).sum(axis=2)
    gained = np.maximum(spread - left, 0.0)
    z = np.abs(at_node - before) / np.sqrt(np.maximum(gained, _LEAST_SHIFT * spread))
    node = weight.sum(axis=2) * _without_it(state, prior)[:, prior.group]
    node /= node.sum(axis=1, keepdims=True)
    p = (node * 2 * scipy.special.ndtr(-z)).sum(axis=1)
    expected = (node * before).sum(axis=1)
    u_expected = np.sqrt((node * (spread + (before - expected[:, None]) ** 2)).sum(axis=1))
    return np.stack([mean, np.sqrt(total), expected, u_expected, p])


def _without_it(state: DriftState, prior: drift.DriftPrior) -> Floats:
    """Weights (N, g) that make draws of a fleet's posterior those of the same fleet without the machine.

    They are the inverse of the density of its certificates given those of the others, truncated (Ionides 2008): a machine far
    from its fleet has widened what it is compared with.
    """
    each = np.array([prior.weight[row].sum() for row in prior.members])
    log = state.log_evidence + np.log(prior.weight)
    of_group = np.stack([log_sum(np.where(row, log, -np.inf)) for row in prior.members], axis=-1) - np.log(each)
    weight = np.exp(of_group.min(axis=1, keepdims=True) - of_group)
    weight /= weight.mean(axis=1, keepdims=True)
    return np.asarray(np.minimum(weight, np.sqrt(len(each))), dtype=np.float64)


def belonging(p: Floats, false_discoveries: float = FALSE_DISCOVERIES) -> NDArray[np.bool_]:
    """Whether machines belong, by Benjamini and Hochberg's step-up procedure over all (N,) probabilities."""
    n = len(p)
    order = np.sort(p)
    passed = np.flatnonzero(order <= false_discoveries * np.arange(1, n + 1) / n)
    threshold = order[passed[-1]] if len(passed) else -1.0
    return np.asarray(p > threshold)


@dataclass(frozen=True, eq=False)
class FleetValue:
    name: str  # and quantity, unit: of the value; the unit as recorded
    quantity: str
    unit: str
    members: tuple[FleetMember, ...]  # machines, in the order of the fleet's estimates
    fleet: Fleet
    belongs: NDArray[np.bool_]  # (N,) whether each machine drifts as its fleet lets expect, all values taken together
    left_out: int  # certificates that state no uncertainty, which cannot be weighed

    @property
    def compared(self) -> bool:
        return comparable(self.members)

    @cached_property
    def median(self) -> Floats:
        """Days (N,) from the last certificate to the median crossing: 0 where it was before, else perhaps infinite."""
        crossing = self.fleet.estimates.crossing
        return np.full(len(self.members), np.inf) if crossing is None else crossing.quantile(0.5)

    @property
    def crosses(self) -> Floats:
        """Ordinals of these days, (N,)."""
        crossing = self.fleet.estimates.crossing
        return self.median if crossing is None else crossing.last + self.median

    @property
    def beyond(self) -> NDArray[np.bool_]:
        """Whether a machine was beyond its limit at its last certificate, (N,): as that says, or where it says nothing."""
        stated = zip(self.members, self.median == 0, strict=True)
        return np.array([one.outcome in BEYOND if one.outcome else bool(probably) for one, probably in stated])

    def crosses_by(self, day: float) -> NDArray[np.bool_]:
        """Whether a machine that was not crosses its limit by an ordinal, (N,)."""
        return np.asarray(~self.beyond & (self.crosses <= day))


@dataclass(frozen=True, eq=False)
class FleetResult:
    values: tuple[FleetValue, ...]
    seed: int

    @property
    def outsiders(self) -> list[tuple[FleetValue, int]]:
        """Machines that do not belong, by value: the value, and the machine's place among its members."""
        return [(value, int(i)) for value in self.values for i in np.flatnonzero(~value.belongs)]

    @property
    def newest(self) -> float:
        return max(float(member.history.day[-1]) for value in self.values for member in value.members)

    @property
    def in_a_year(self) -> float:
        return self.newest + drift.YEAR

    @property
    def compared(self) -> bool:
        return any(value.compared for value in self.values)

    @property
    def converged(self) -> bool:
        return all(value.fleet.converged for value in self.values)


def comparable(members: Iterable[FleetMember]) -> bool:
    """Whether two machines at least have certificates of two days: a machine seen on one shows no drift of its own."""
    return sum(seen_again(member) for member in members) > 1


def seen_again(member: FleetMember) -> bool:
    return bool(np.ptp(member.history.day) > 0)


def judged(learnt: Iterable[tuple[str, str, str, tuple[FleetMember, ...], Fleet, int]], seed: int) -> FleetResult:
    """Values with who belongs: one procedure over all machines and values, so that many values accuse no more machines."""
    all_learnt = list(learnt)
    p = np.concatenate([fleet.estimates.p for *_, fleet, _ in all_learnt])
    weighed = np.concatenate([np.full(len(members), comparable(members)) for *_, members, _, _ in all_learnt])
    belongs = np.ones(len(p), dtype=np.bool_)
    belongs[weighed] = belonging(p[weighed])
    ends = np.cumsum([len(fleet.machines) for *_, fleet, _ in all_learnt])[:-1]
    parts = zip(all_learnt, np.split(belongs, ends), strict=True)
    values = (
        FleetValue(name, quantity, unit, members, fleet, those, left_out)
        for (name, quantity, unit, members, fleet, left_out), those in parts
    )
    return FleetResult(tuple(values), seed)
