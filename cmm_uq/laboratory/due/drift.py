"""How one error of a machine drifts: its history as the model takes it, and what is known before its own certificates.

The model, per error factor or figure of performance (docs/records/drift.md): between adjustments the error moves at a rate
that may grow (wear), settles, follows the seasons, wanders as a Wiener process and now and then makes a step; an adjustment
puts it back near zero and leaves the rate. Certificates see it with their stated uncertainty, of which those made with one
artefact share a part.

A prior is a set of nodes, each a full set of the model's parameters with a weight; the model is exact Gaussian algebra at
every node (:mod:`cmm_uq.laboratory.due.drift_filter`), and the nodes are summed over. Defaults are in units of the limit,
which is what makes one machine's figures comparable with another's: docs/records/drift.md gives the reasons.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass, replace
from cmm_uq.laboratory.records.facts import Series

YEAR = 365.25  # days: rates and spreads are stated per year
HORIZON = 40.0  # years that are looked ahead; what is later is never

PARTS = (0.05, 0.5, 0.95)
"""Probabilities at which the day of a crossing is stated: the ends of a 90 % interval, and its median."""

MOST_SHARED = 0.999
"""Of u, that certificates by one artefact have in common at most: two of one day never agree to the last digit."""


@dataclass(frozen=True, eq=False)
class DriftHistory:
    """What the certificates of one machine say of one error.

    Raises
    ------
    CmmUqError : arrays that do not fit, no certificate, a figure that is no number, an uncertainty that is not positive.

    ``adjusted_after``: ordinal of an adjustment after the last certificate, NaN for none: nobody has seen what it left.
    """

    day: Floats  # (n,) ordinals, not falling
    value: Floats  # and u: (n,) of the certificates; standard uncertainties
    u: Floats
    u_artefact: Floats  # (n,) the part of u that comes from the artefact, common to all certificates made with it
    artefact: tuple[str, ...]  # n names
    adjusted_since: Floats  # (n,) ordinal of the last adjustment before each certificate, NaN where none is known
    adjusted_after: float = float("nan")

    def __post_init__(self) -> None:
        n = len(self.day)
        if not n:
            raise CmmUqError("a machine without a certificate has no trend", fix="Record one, or leave the machine out")
        if any(len(each) != n for each in (self.value, self.u, self.u_artefact, self.artefact, self.adjusted_since)):
            raise CmmUqError("the columns of a history differ in length", fix="Give one entry a certificate")
        if not all(np.isfinite(each).all() for each in (self.day, self.value, self.u, self.u_artefact)):
            raise CmmUqError("a history has a figure that is not a number", fix="Leave that certificate out")
        if not (self.u > 0).all():
            raise CmmUqError("a certificate states no uncertainty (u = 0), so that nothing says how much it counts",
                             fix="Leave it out, or state u")  # fmt: skip
        if (self.u_artefact < 0).any() or (self.u_artefact > self.u).any():
            raise CmmUqError("the artefact's part of an uncertainty is more than the whole", fix="Correct u_artefact")
        late = (self.adjusted_since > self.day).any() or self.adjusted_after < self.day[-1]
        if (np.diff(self.day) < 0).any() or late:
            raise CmmUqError("the days of a history run backwards, or an adjustment comes after its certificate",
                             fix="Correct the dates")  # fmt: skip

    def in_units(self, unit: float) -> DriftHistory:
        return replace(self, value=self.value / unit, u=self.u / unit, u_artefact=self.u_artefact / unit)


def history(series: Series, adjusted_after: float | None = None) -> DriftHistory:
    """A series of the records as the model takes it.

    Parameters
    ----------
    series : of the records.
    adjusted_after : ordinal of the machine's newest adjustment; it counts where it is after the last certificate.

    Raises
    ------
    CmmUqError : as :class:`DriftHistory`.
    """
    columns = (series.day, series.value, series.u, series.u_artefact, series.adjusted_since)
    day, value, u, shared, adjusted = (np.asarray(column, dtype=np.float64) for column in columns)
    names = tuple(map(str, series.artefact))
    shared = np.where(np.array(names) != "", shared, 0.0)  # by an unknown artefact nothing is known to be common
    known = np.where(adjusted > 0, adjusted, np.nan)
    after = adjusted_after is not None and len(day) > 0 and adjusted_after > day[-1]
    return DriftHistory(day, value, u, shared, names, known, float(adjusted_after or 0) if after else np.nan)


@dataclass(frozen=True, eq=False)
class Histories:
    """Histories of N machines as arrays, the k-th certificates beside each other; n of the longest, q artefacts at most."""

    value: Floats  # and u: (n, N)
    u: Floats
    shared: Floats  # (n, q, N) what one standard uncertainty of each artefact of the machine adds to the certificate
    day: Floats  # and begun: (n, N) ordinal, and that of the certificate before, or of an adjustment between both
    begun: Floats
    adjusted: NDArray[np.bool_]  # (n, N) whether there is one
    settling: Floats  # (n, N) ordinal from which on the machine settles: of an adjustment, or of its first certificate
    given: NDArray[np.bool_]  # (n, N) whether the machine has so many certificates
    artefacts: Ints  # (N, q) numbers into ``names``, −1 where a machine used fewer
    names: tuple[str, ...]
    last: Floats  # (N,) ordinal of the last certificate, or of an adjustment after it
    settles: Floats  # (N,) ordinal from which on the machine settles then
    adjusted_after: NDArray[np.bool_]  # (N,) whether there is one

    @property
    def first(self) -> Floats:
        """Ordinal of each machine's first certificate, (N,)."""
        return np.asarray(self.day[0], dtype=np.float64)

    @property
    def years(self) -> Floats:
        """From where each certificate's time begins to the certificate, (n, N)."""
        return np.asarray((self.day - self.begun) / YEAR, dtype=np.float64)

    def __len__(self) -> int:
        return len(self.last)

    def some(self, which: Ints) -> Histories:
        most = int(self.given[:, which].sum(axis=0).max())
        return Histories(
            self.value[:most, which], self.u[:most, which], self.shared[:most][:, :, which], self.day[:most, which],
            self.begun[:most, which], self.adjusted[:most, which], self.settling[:most, which], self.given[:most, which],
            self.artefacts[which], self.names, self.last[which], self.settles[which], self.adjusted_after[which],
        )  # fmt: skip


def side_by_side(histories: Sequence[DriftHistory]) -> Histories:
    names = sorted({name for each in histories for name in each.artefact})
    number = {name: i for i, name in enumerate(names)}
    own = [list(dict.fromkeys(each.artefact)) for each in histories]
    n, q, N = max(len(each.day) for each in histories), max(map(len, own)), len(histories)
    value, u = np.zeros((n, N)), np.ones((n, N))
    day, begun, settling = np.zeros((3, n, N))
    shared, artefacts = np.zeros((n, q, N)), np.full((N, q), -1)
    adjusted, given = np.zeros((n, N), dtype=bool), np.zeros((n, N), dtype=bool)
    for i, (each, mine) in enumerate(zip(histories, own, strict=True)):
        k = len(each.day)
        value[:k, i], u[:k, i], given[:k, i] = each.value, each.u, True
        day[:k, i] = each.day
        adjusted[:k, i], begun[:k, i], settling[:k, i] = _since(each)
        artefacts[i, : len(mine)] = [number[name] for name in mine]
        shared[np.arange(k), [mine.index(name) for name in each.artefact], i] = np.minimum(
            each.u_artefact, MOST_SHARED * each.u
        )
    after = np.array([each.adjusted_after for each in histories])
    last = np.where(np.isnan(after), [each.day[-1] for each in histories], after)
    settles = np.where(np.isnan(after), settling[given.sum(axis=0) - 1, np.arange(N)], after)
    columns = value, u, shared, day, begun, adjusted, settling, given, artefacts
    return Histories(*columns, tuple(names), last, settles, np.isfinite(after))


def _since(of: DriftHistory) -> tuple[NDArray[np.bool_], Floats, Floats]:
    """Whether an adjustment comes between each certificate and the one before, the later of both, and what it settles from."""
    before = np.concatenate([[np.nan], of.adjusted_since[:-1]])
    adjusted = np.isfinite(of.adjusted_since) & ~(of.adjusted_since <= before)
    previous = np.concatenate([of.day[:1], of.day[:-1]])
    begun = np.where(adjusted, of.adjusted_since, previous)
    begun[1:] = np.maximum(begun[1:], previous[1:])
    settling = np.maximum.accumulate(np.where(adjusted, begun, of.day[0] if not adjusted[0] else begun[0]))
    return adjusted, begun, settling


NAMES = ("rate_sd", "model_sd", "place_sd", "walk", "first_sd", "as_left_sd", "steps_per_year", "step_sd")
"""Of the hyper-parameters that a fleet teaches, all positive; their logarithms are normal before any data."""

MEDIANS = np.array([0.1, 0.05, 0.05, 0.07, 0.35, 0.15, 0.05, 0.4])
"""In units of the limit and of years, but for the steps a year."""

SPREADS = np.array([0.8, 0.8, 0.8, 0.8, 0.5, 0.6, 0.8, 0.6])
"""Standard deviations of the logarithms: a factor of five either way is not surprising, of three for those of a level."""

ALONE = ("rate_sd", "growth", "settle_sd", "settle_years", "season_sd")
"""Of a machine that no fleet tells of: its rate, and, with a fleet too, wear that speeds up, settling and season."""

ALONE_MEDIANS = np.array([0.05, 0.03, 0.2, 0.7, 0.08])
ALONE_SPREADS = np.array([1.0, 1.0, 0.8, 0.8, 0.8])
"""As above; for the rate of one machine, and for what it grows by, factors of five either way are usual."""

USUAL_RATE_SD = 0.15  # of the rate common to a whole fleet, in limits per year: it may drift either way

WALKS_DIFFER = 0.5
"""Standard deviation of the logarithm of one machine's wandering: a sixth of them wander 1.6 times as much, or more."""

WITHOUT_LIMIT = 8.0
"""Standard uncertainties that stand for the limit where none is stated: test uncertainty ratios are from 4 to 10 or so."""

NODES = 128
FAST, _FASTER = np.geomspace(0.5, 50.0, 12), 0.01
"""Rates of one machine in a hundred, beyond what is usual, in limits a year: a steady line, however steep, is a drift."""

_WALK_NODES, _WALK_WEIGHTS = np.polynomial.hermite_e.hermegauss(3)

WRONG, WRONG_TIMES = 0.01, 5.0
"""Part of the certificates that are taken to be wrong, and how many times their uncertainty."""


@dataclass(frozen=True, eq=False)
class DriftPrior:
    """Nodes of the model's parameters, in the unit of the values and in years; a group's are weighed by the machine's data."""

    rate: Floats  # and rate_sd: (K,) of a machine's rate
    rate_sd: Floats
    walk: Floats  # (K,) standard deviation that a year's wandering adds
    first_sd: Floats
    as_left_sd: Floats
    steps_per_year: Floats  # and step_sd: (K,) how often a step comes, and how large
    step_sd: Floats
    growth: Floats  # (K,) of the rate, per year, as a part of what it is at the first certificate
    settle_sd: Floats  # (K,) of how far the machine settles, and years in which all but 1/e of that is over
    settle_years: Floats
    season_sd: Floats  # (K,) of the amplitudes of sine and cosine
    weight: Floats  # (K,) of the nodes before the machine's data; they sum to one in all groups together
    group: Ints

    def __len__(self) -> int:
        return len(self.rate)

    @property
    def components(self) -> Floats:
        """Standard deviations (3, K) of the coefficients of settling, cosine and sine; (0, K) where there are none."""
        each = np.stack([self.settle_sd, self.season_sd, self.season_sd])
        return each if each.any() else each[:0]

    @cached_property
    def members(self) -> NDArray[np.bool_]:
        """(groups, K) whether a node is of a group."""
        return np.asarray(self.group == np.arange(self.group.max() + 1)[:, None])


def limit_for(limit: float | None, u: Floats) -> float:
    """The unit of the defaults: the limit, or where there is none a multiple of the usual uncertainty."""
    return float(limit) if limit else WITHOUT_LIMIT * float(np.median(u))


@lru_cache(maxsize=100)
def default_prior(unit: float, nodes: int = NODES, *, plain: bool = False) -> DriftPrior:
    """Of a machine without a fleet, in units of the limit; ``plain``: without wear that speeds up, settling and season."""
    number = normal_lattice(nodes + len(FAST), len(NAMES) - 3 + len(ALONE))
    values = _in_unit(NAMES[3:], np.log(MEDIANS[3:]) + SPREADS[3:] * number[:, len(ALONE) :], unit)
    values |= _alone(ALONE, number, unit, plain=plain)
    values["rate_sd"][nodes:] = FAST * unit
    weight = np.repeat([(1 - _FASTER) / nodes, _FASTER / len(FAST)], [nodes, len(FAST)])
    return DriftPrior(rate=np.zeros(len(weight)), **values, weight=weight, group=np.zeros(len(weight), dtype=np.int64))


def normal_lattice(count: int, d: int) -> Floats:
    """Normal numbers (count, d) at the points of Roberts' sequence (2018)."""
    root = 2.0
    for _ in range(60):
        root = (1.0 + root) ** (1.0 / (d + 1))
    points = (0.5 + np.outer(np.arange(1, count + 1), root ** -np.arange(1.0, d + 1))) % 1.0
    return np.asarray(scipy.special.ndtri(points), dtype=np.float64)


def learnt_prior(theta: Floats, rate: Floats, rate_sd: Floats, unit: float) -> DriftPrior:
    """Of a machine of a fleet: at (g, 8) draws of its posterior of logarithms, in units of ``unit``, and rates (g,).

    Without components: a fleet's walk, steps and rates were learnt without them, and have taken in what they do.
    """
    g, w = len(theta), len(_WALK_NODES)
    values = _in_unit(NAMES[3:], np.repeat(theta[:, 3:], w, axis=0), unit)
    values["walk"] *= np.tile(np.exp(WALKS_DIFFER * _WALK_NODES), g)
    values |= _alone(ALONE[1:], np.zeros((g * w, len(ALONE) - 1)), unit, plain=True)
    rates = {"rate": np.repeat(rate, w), "rate_sd": np.repeat(rate_sd, w)}
    weight = np.tile(_WALK_WEIGHTS / _WALK_WEIGHTS.sum(), g) / g
    return DriftPrior(**rates, **values, weight=weight, group=np.repeat(np.arange(g), w))


def _alone(names: Sequence[str], number: Floats, unit: float, *, plain: bool) -> dict[str, Floats]:
    """Columns of :data:`ALONE`, its last ones, at normal numbers (K, d); ``plain``: nothing of components."""
    first = len(ALONE) - len(names)
    values = _in_unit(names, np.log(ALONE_MEDIANS[first:]) + ALONE_SPREADS[first:] * number[:, : len(names)], unit)
    return values | {name: 0.0 * values[name] for name in ("growth", "settle_sd", "season_sd") if plain}


def _in_unit(names: Sequence[str], theta: Floats, unit: float) -> dict[str, Floats]:
    """Columns of exp(theta) by name; those of levels, rates and walks are in limits."""
    plain = ("steps_per_year", "growth", "settle_years")
    return {name: np.exp(theta[:, i]) * (1.0 if name in plain else unit) for i, name in enumerate(names)}


def log_density(theta: Floats) -> Floats:
    """Of the logarithms of the hyper-parameters before any data, up to a constant, (…, 8) → (…,)."""
    z = (theta - np.log(MEDIANS)) / SPREADS
    return np.asarray(-0.5 * (z * z).sum(axis=-1), dtype=np.float64)


def phase(day: Floats) -> Floats:
    """Of the year, in radians: nothing depends on where it begins."""
    return np.asarray(2 * np.pi * day / YEAR)


def moved(
    since: Floats, until: Floats, first: Floats, settling: Floats, growth: Floats | float, settle_years: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """What one unit of rate, of settling, of the seasons' cosine and of their sine moves a level by between two days.

    Parameters
    ----------
    since, until, first, settling : ordinals that fit together: from and to, and of :class:`Histories`.
    growth, settle_years : of a prior's nodes, so that they fit with the others.
    """
    begin, end = (since - first) / YEAR, (until - first) / YEAR
    by_rate = (end - begin) * (1.0 + 0.5 * growth * (begin + end))
    decay = np.exp((settling - since) / (YEAR * settle_years)) - np.exp((settling - until) / (YEAR * settle_years))
    year, year_before = phase(until), phase(since)
    return by_rate, decay, np.cos(year) - np.cos(year_before), np.sin(year) - np.sin(year_before)
