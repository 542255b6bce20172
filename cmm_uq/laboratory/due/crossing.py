"""When an error will first be beyond its limit: the whole distribution of the day, perhaps never.

Paths are drawn from the state after the last certificate on a grid of days. Between two days a path without a step is a
Brownian bridge, whose probability of touching a limit is known (Karatzas and Shreve 1991, section 4.3), so that nothing is
lost between them; where the season has its crest between them, the bridge is one beside the limit less that crest. The
probabilities are averaged. The random numbers are fixed: the same history gives the same days.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import date
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass
from cmm_uq.laboratory.due import drift
from cmm_uq.laboratory.due.drift_filter import DriftState
from cmm_uq.laboratory.due.steps import FollowedHistory, followed
from cmm_uq.laboratory.records.facts import Series

_HORIZON = drift.HORIZON * drift.YEAR


# Days after the last certificate up to the horizon: for many machines whose dates are wide, a week, and a sixth more each;
DAYS = np.concatenate([[0.0], np.geomspace(7.0, _HORIZON, 48)])
# for one, a fortnight each for three years, then a twentieth more
FINE = np.concatenate([np.arange(0.0, 1120.0, 14.0), np.geomspace(1120.0, _HORIZON, 54)])
PATHS = 2048
_AT_ONCE = 2_000_000
_GAPS = 15_000  # levels of paths that are moved together: they stay in the cache of a core
_SEED = 20


@dataclass(frozen=True, eq=False)
class Crossings:
    """Of N machines."""

    last: Floats  # (N,) ordinal of each machine's last certificate, or of an adjustment after it
    days: Floats
    probability: Floats
    level: Floats
    u_level: Floats
    rate: Floats  # and u_rate: (N,) per year
    u_rate: Floats

    @staticmethod
    def joined(parts: Sequence[Crossings]) -> Crossings:
        names = ("last", "probability", "level", "u_level", "rate", "u_rate")
        last, *rest = (np.concatenate([getattr(part, name) for part in parts]) for name in names)
        return Crossings(last, parts[0].days, *rest)

    def one(self, i: int) -> Crossing:
        return Crossing(
            date.fromordinal(int(self.last[i])), self.days, self.probability[i], float(self.level[i]), float(self.u_level[i]),
            float(self.rate[i]), float(self.u_rate[i]),
        )  # fmt: skip

    def by(self, days: Floats) -> Floats:
        """Probability of having crossed by so many days after the last certificate, (N,)."""
        logs = _log_survival(self.probability)
        each = zip(np.broadcast_to(days, len(logs)), logs, strict=True)
        found = [np.interp(day, self.days, row) for day, row in each]
        return np.asarray(-np.expm1(found), dtype=np.float64)

    def quantile(self, part: float) -> Floats:
        """Days after the last certificate by which the probability is ``part``, (N,); infinite beyond the horizon."""
        return np.array([_quantile(self.days, row, np.log1p(-part)) for row in _log_survival(self.probability)])


@dataclass(frozen=True, eq=False)
class Crossing:
    last: date  # day of the last certificate, or of an adjustment after it: from here on is looked ahead
    days: Floats  # and probability: (G,) of having crossed until so many days after it
    probability: Floats
    level: float  # and u_level, rate, u_rate: the error then and its rate per year, with standard uncertainties
    u_level: float
    rate: float
    u_rate: float

    @property
    def already(self) -> float:
        """Probability that the error was beyond the limit at the last certificate."""
        return float(self.probability[0])

    def by(self, day: date) -> float:
        """Probability that the error has been beyond the limit by a day."""
        return self.after(max(float(day.toordinal() - self.last.toordinal()), 0.0))

    def after(self, days: float) -> float:
        return float(-np.expm1(np.interp(days, self.days, _log_survival(self.probability))))

    def quantile(self, part: float) -> date | None:
        """Day by which the limit is crossed with a probability; None where that is beyond the horizon."""
        days = _quantile(self.days, _log_survival(self.probability), np.log1p(-part))
        return date.fromordinal(self.last.toordinal() + int(days)) if np.isfinite(days) else None

    def interval(self, coverage: float = 0.9) -> tuple[date | None, date | None]:
        """Days between which the limit is crossed with a probability, as much before as after them."""
        return self.quantile((1 - coverage) / 2), self.quantile((1 + coverage) / 2)

    def data(self) -> dict[str, Any]:
        """For other programs: days, ``None`` beyond the horizon, and probabilities."""
        dates = {f"day_{round(100 * part)}": self.quantile(part) for part in drift.PARTS}
        return {
            "last": self.last.isoformat(), **{name: day.isoformat() if day else None for name, day in dates.items()},
            "already": self.already, "within_a_year": self.after(drift.YEAR),
        }  # fmt: skip


def crossing(series: Series | drift.DriftHistory, limit: float, prior: drift.DriftPrior | None = None) -> Crossing:
    """When one machine's error will first be beyond its limit.

    Parameters
    ----------
    series : of the records, or a history.
    limit : the error conforms while |error| ≤ limit.
    prior : of the machine's fleet (:meth:`cmm_uq.laboratory.due.fleet_model.FleetPrior.prior`), or none.

    Raises
    ------
    CmmUqError : a limit that is not positive, or a history that cannot be used.
    """
    if not (np.isfinite(limit) and limit > 0):
        raise CmmUqError(f"a limit of {limit:g} cannot be crossed", fix="State a limit above zero")
    known = series if isinstance(series, drift.DriftHistory) else drift.history(series)
    return crossing_of(followed(known, limit, prior), limit)


def crossing_of(known: FollowedHistory, limit: float) -> Crossing:
    """The same of a history that was followed already."""
    return crossings(known.machines, known.prior, known.state, limit, days=FINE).one(0)


class _States(NamedTuple):
    """Level, rate and components of N machines in each of C nodes and tales; c are as many as move."""

    mean: Floats  # (c, N, C)
    covariance: Floats  # (c, c, N, C)
    weight: Floats  # (N, C)
    node: Ints  # (C,)
    prior: drift.DriftPrior
    machines: drift.Histories


def crossings(
    machines: drift.Histories, prior: drift.DriftPrior, state: DriftState, limit: Floats | float, *,
    paths: int = PATHS, until: float = _HORIZON, days: Floats = DAYS, enough: float = 1.0,
) -> Crossings:  # fmt: skip
    """When many errors will be; later than ``until`` days, or than the first has ``enough``, they stay as they are."""
    N, M = len(machines), state.log_weight.shape[2]
    c = 2 + len(prior.components)
    flat = _States(
        state.mean[:c].reshape(c, N, -1), state.covariance[:c, :c].reshape(c, c, N, -1),
        state.weights(prior).reshape(N, -1), np.repeat(np.arange(len(prior)), M), prior, machines,
    )  # fmt: skip
    limits = np.broadcast_to(np.asarray(limit, dtype=np.float64), N)
    chunk = max(1, _AT_ONCE // (paths * 8))
    numbers, ahead = _numbers(paths, len(days) - 1), days[: 1 + int(np.searchsorted(days, until))]
    each = (np.arange(i, min(i + chunk, N)) for i in range(0, N, chunk))
    found = [_probabilities(flat, which, limits, numbers, ahead, enough) for which in each]
    mean = (flat.weight * flat.mean[:2]).sum(axis=-1)
    variance = flat.covariance[[0, 1], [0, 1]]
    u = np.sqrt((flat.weight * (variance + (flat.mean[:2] - mean[..., None]) ** 2)).sum(axis=-1))
    probability = np.concatenate(found)
    probability = np.pad(probability, [(0, 0), (0, len(days) - probability.shape[1])], mode="edge")
    return Crossings(machines.last, days, probability, mean[0], u[0], mean[1], u[1])


@lru_cache(maxsize=3)
def _numbers(paths: int, gaps: int) -> tuple[Floats, Floats, Floats, Floats]:
    """Of each path: where it stands in the weights, numbers for its state, and for each gap of the grid for walk and steps.

    The first two are a lattice in six dimensions (Roberts 2018); a normal number of the walk has its mirror image in
    another path; steps take an exponential number and a normal one.
    """
    n = np.arange(paths)
    random = np.random.default_rng(_SEED)
    half = random.standard_normal((gaps, paths // 2 + 1))
    walk = np.concatenate([half, -half], axis=1)[:, :paths][:, random.permutation(paths)]
    steps = np.stack([random.standard_exponential((gaps, paths)), random.standard_normal((gaps, paths))])
    return (n + 0.5) / paths, drift.normal_lattice(paths, 5).T.copy(), walk, steps


def _drawn(states: _States, which: Ints, chosen: Ints, normal: Floats) -> Floats:
    """Of each path (c, n, paths): its mean and, by Cholesky's factor column by column, what is uncertain about it."""
    at = which[:, None], chosen
    drawn = states.mean[:, *at]
    left = states.covariance[:, :, *at]
    for i, number in enumerate(normal[: len(drawn)]):
        root = np.sqrt(np.maximum(left[i, i], 0.0))
        column = left[i, i:] / np.where(root > 0, root, 1.0)
        drawn[i:] += column * number
        for j in range(1, len(column)):
            left[i + j, i + j :] -= column[j] * column[j:]
    return drawn


def _probabilities(
    states: _States, which: Ints, limits: Floats, numbers: tuple[Floats, ...], days: Floats, enough: float
) -> Floats:
    place, normal, walk, stepping = numbers
    cumulated = np.cumsum(states.weight[which], axis=1)
    chosen = np.stack([np.searchsorted(row / row[-1], place) for row in cumulated])
    chosen = np.minimum(chosen, cumulated.shape[1] - 1)
    node, prior, years = states.node[chosen], states.prior, np.diff(days) / drift.YEAR
    walking, often = prior.walk[node], prior.steps_per_year[node]
    level, *theta = _drawn(states, which, chosen, normal) / walking  # all in units of what a year's wandering adds
    size, high = prior.step_sd[node] / walking, limits[which][:, None] / walking
    inside = (np.abs(level) <= high).astype(np.float64)
    part = np.full(len(place), 1 / len(place))
    survival = np.repeat((inside @ part)[:, None], len(days), axis=1)
    moves, at_once = _moves(states, which, node, theta, days), max(1, _GAPS // level.size)
    for start in range(0, len(years), at_once):
        gaps = slice(start, min(start + at_once, len(years)))
        gap, (move, up, up_then, down, down_then) = years[gaps, None, None], moves(gaps)
        stepped = stepping[0, gaps, None] < often * gap
        steps = np.where(stepped, size * stepping[1, gaps, None], 0.0)
        wandering = (walk[gaps] * np.sqrt(years[gaps])[:, None])[:, None]
        before, after = (np.empty((len(gap), *level.shape)) for _ in range(2))
        for g in range(len(gap)):
            before[g] = level
            after[g] = level + move[g] + wandering[g]
            level = after[g] + steps[g]
        # probability that a bridge from one level to the other stays within the limits, given that its ends do
        crosses = np.expm1(-2 / gap * np.maximum(high - before - up, 0.0) * np.maximum(high - after - up_then, 0.0))
        crosses *= -np.expm1(
            -2 / gap * np.maximum(high + before - down, 0.0) * np.maximum(high + after - down_then, 0.0)
        )
        crosses *= -(~stepped | (np.abs(after + steps) <= high)).astype(np.float64)
        crosses[0] *= inside
        for g in range(1, len(gap)):
            crosses[g] *= crosses[g - 1]
        inside = crosses[-1]
        survival[:, start + 1 :] = (inside @ part)[:, None]
        survival[:, 1 + start : 1 + start + len(gap)] = (crosses @ part).T
        if survival[:, -1].min() < 1 - enough:
            break
    return 1.0 - survival


def _moves(
    states: _States, which: Ints, node: Ints, theta: Sequence[Floats], days: Floats
) -> Callable[[slice], tuple[Floats, Floats | float, Floats | float, Floats | float, Floats | float]]:
    """Of some gaps (g, n, paths) each: what the level moves by, how far the season rises above both ends, and falls below."""
    of, prior = states.machines, states.prior
    since, first, settling = (each[which][:, None] for each in (of.last, of.first, of.settles))
    until = since + days

    def along(growth: Floats | float, settle_years: Floats) -> tuple[Floats, Floats]:
        return drift.moved(since, until, first, settling, growth, settle_years)[:2]

    by_rate, settled = along(0.0, prior.settle_years[:, None, None])
    by_growth = along(1.0, prior.settle_years[:1])[0] - by_rate
    by_settling = np.ascontiguousarray(np.diff(settled, axis=-1).transpose(2, 0, 1)).reshape(len(days) - 1, -1)
    place, growing = node * len(which) + np.arange(len(which))[:, None], theta[0] * prior.growth[node]
    rate, growth = (np.diff(each, axis=-1).T[..., None] for each in (by_rate, by_growth))
    if len(theta) == 1:
        return lambda gaps: (rate[gaps] * theta[0] + growth[gaps] * growing, 0.0, 0.0, 0.0, 0.0)
    phase, cosine, sine = drift.phase(until).T[..., None], theta[2], theta[3]
    most, crest = np.hypot(cosine, sine), np.arctan2(sine, cosine) / (2 * np.pi)

    def at(day: Floats) -> list[Floats]:
        """The season, and how many crests and troughs there were."""
        turned = day / (2 * np.pi) - crest
        return [np.cos(day) * cosine + np.sin(day) * sine, np.floor(turned), np.floor(turned + 0.5)]

    last = at(phase[:1])

    def moves(gaps: slice) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        nonlocal last
        each = zip(last, at(phase[gaps.start + 1 : gaps.stop + 1]), strict=True)
        season, *turns = (np.concatenate(pair) for pair in each)
        last = [season[-1:], *(turn[-1:] for turn in turns)]
        rise, fall = most - season, most + season
        move = rate[gaps] * theta[0] + growth[gaps] * growing + season[1:] - season[:-1]
        move += by_settling[gaps].take(place, axis=1) * theta[1]
        up, down = (turn[1:] > turn[:-1] for turn in turns)
        return move, up * rise[:-1], up * rise[1:], down * fall[:-1], down * fall[1:]

    return moves


def _log_survival(probability: Floats) -> Floats:
    return np.log1p(-np.minimum(probability, 1 - 1e-12))


def _quantile(days: Floats, log_survival: Floats, wanted: float) -> float:
    """Where the survival falls to a value, between the days of the grid as a constant hazard goes."""
    if log_survival[0] <= wanted:
        return 0.0
    after = int(np.argmax(log_survival <= wanted))
    if not after:
        return float("inf")
    high, low = log_survival[after - 1], log_survival[after]
    return float(days[after - 1] + (days[after] - days[after - 1]) * (high - wanted) / (high - low))
