"""What is stated of a part's characteristics: values where points were measured, and uncertainty with or without them.

The width of a zone is never negative. Its true width follows from its measured one by turning the measurement round, by the
distributions that it would have. A part that deviates λ times as the measured one has a zone θ(λ) and would be measured as
g(λ), with errors that are drawn. Both grow with λ. What was measured, f, then says of the true zone (a confidence
distribution: Schweder and Hjort, Scand. J. Stat. 29 (2002) 309; Cox, Ann. Math. Stat. 29 (1958) 357)

    P(θ ≤ θ(λ)) = P(g(λ) ≥ f),

whose quantiles are limits that hold as often as they say, however large the zone truly is. Draws with which even a perfect
part would have been measured wider, g(0) > f, leave nothing for a zone: they are marked by a negative width. Its value is the
median of all draws, as often too large as too small, and zero where that is negative; probabilities are of possible draws.

Its interval lies between tails such that it holds as often however small the zone is. Equal tails of 2.5 % hold what is zero
in 97.5 %: there is nothing below to fail. The unified interval of Feldman and Cousins (Phys. Rev. D 57 (1998) 3873, section
IV.B) begins at zero up to where the lower tail alone would be 5 %, and then takes so much of both tails that 95 % of a normal
quantity's measurements hold, whatever its mean. For a measurement below zero, better than its errors, it would shrink to
nothing. There the upper end leaves 5 % of what is possible (the ratio of both tails: Read, J. Phys. G 28 (2002) 2693), which
is where the unified one ends for a measurement of zero.

A part may be what was measured less the errors of a draw, as far as these are not form that only errors have. Of orientation,
location and runout the form of a feature is little beside where it is, and what was measured of it is mostly error where
errors have more of it than is seen. Another draw's form taken off would not make it less but more: form that errors have is
not taken off, and what was measured is shrunk by as much as errors explain (the positive part of James and Stein's estimate:
Baranchik, Ann. Math. Stat. 41 (1970) 642). Of form itself all is what the part may be.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from cmm_uq.analysis.conformity.limits import SCARCE
from cmm_uq.analysis.parts.characteristics import never_negative
from cmm_uq.analysis.parts.evaluation import Movement, characteristics_of
from cmm_uq.analysis.parts.plan import PartFeature, Plan
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass, replace
from cmm_uq.jobs.part.feature import FEWEST as FEWEST_POINTS
from cmm_uq.maths.geometry.association import associate
from cmm_uq.maths.inference.slow import root
from cmm_uq.maths.uncertainty.propagation import Simulated

FEWEST = 500  # draws that are possible, from which on a probability is taken from them alone
# true widths at which measurements are drawn, closer together near the least one, where fewest draws are possible; squares of
# their quantiles are nearly quadratic between them
NODES = 11
# of the trial parts, one in so many stands for each width: few enough to be as wide, enough for every direction of errors
_NEAR = 8
_QUANTILES = ndtr(np.linspace(-3.1, 3.1, 249))
_FINE = 600
_FREE = 1e-9  # of the largest, a singular value of motions that points do not tell from others
_ENDS = 24  # quantiles at each end by which the line is laid that goes on beyond it


@dataclass(frozen=True, eq=False)
class Inverse:
    """A decreasing map from what is measured of the part as it was measured, with errors once more, to true widths."""

    # measured, true: (k,) mm or rad, along which it is linear, and beyond
    measured: Floats
    true: Floats

    def __call__(self, measured: Floats) -> Floats:
        """True widths of measured ones, negative where these leave none."""
        found = np.interp(measured, self.measured, self.true)
        below, above = measured < self.measured[0], measured > self.measured[-1]
        for end, inner, beyond in ((0, _ENDS, below), (-1, -1 - _ENDS, above)):
            run = self.measured[end] - self.measured[inner]
            slope = (self.true[end] - self.true[inner]) / run if run else 0.0
            found = np.where(beyond, self.true[end] + slope * (measured - self.measured[end]), found)
        return np.asarray(found)


def nodes_of(found: float, perfect: Floats) -> Floats:
    """(m,) true widths between which everything lies that may have been measured as ``found``.

    A zone is a seminorm of the deviations: errors change it by no more than their own zone.

    ``perfect``: (n,) what a perfect part would be measured as, g(0).
    """
    beyond = float(np.abs(np.quantile(perfect, _QUANTILES[[0, -1]])).max())
    least = max(0.0, found - beyond)
    return least + (found + beyond - least) * np.linspace(0, 1, NODES) ** 2


def alike(widths: Floats, width: float) -> Ints:
    """(n,) which of n trial parts stands for one of this width with each of n draws of errors: the next wider ones, in turn.

    They are made less of, and so stay parts; only the widest are made more of.

    ``widths``: (n,) of trial parts' zones.
    """
    order = np.argsort(widths)
    some = max(1, len(widths) // _NEAR)
    first = min(int(np.searchsorted(widths[order], width)), len(widths) - some)
    return np.resize(order[first : first + some], len(widths))


def inverse(found: float, again: Floats, perfect: Floats, true: Floats, measured: Floats) -> Inverse:
    """The map by which errors of a measurement become draws of what is true.

    ``again``: (n,) what the part as measured would be measured as, with n draws of errors. ``perfect``: (n,) the same of a
    perfect part. ``true``: (m,) θ of :func:`nodes_of`. ``measured``: (m, n) the same of these.
    """
    from scipy.interpolate import CubicSpline  # takes longer to import than parts without a zone have left to do

    curves = CubicSpline(true, _square(np.quantile(measured, _QUANTILES, axis=1).T))
    sizes = np.linspace(true[0], true[-1], _FINE)
    rising = np.maximum.accumulate(curves(sizes), axis=0)
    solved = _reaching(found**2, sizes, rising)
    lacking = _square(np.quantile(perfect, _QUANTILES)) - found**2
    solved = np.where(lacking > 0, -np.sqrt(np.maximum(lacking, 0.0)), solved)
    return Inverse(np.quantile(again, _QUANTILES), np.minimum.accumulate(solved))


def _reaching(value: float, at: Floats, rising: Floats) -> Floats:
    """(k,) where curves (m, k) over ``at`` (m,) reach a value; the first or last place of one that is above or below it."""
    left = np.clip(np.count_nonzero(rising <= value, axis=0) - 1, 0, len(at) - 2)
    low, high = (np.take_along_axis(rising, (left + i)[None], axis=0)[0] for i in (0, 1))
    share = np.clip((value - low) / np.where(high > low, high - low, 1.0), 0.0, 1.0)
    return np.asarray(at[left] + np.where(high <= value, 1.0, share) * (at[left + 1] - at[left]))


def _square(values: Floats) -> Floats:
    return np.asarray(values * np.abs(values))


def tails(negative: float, coverage: float) -> tuple[float, float]:
    """Shares of all draws below the lower end and above the upper end; a lower end among the negative ones is zero.

    ``negative``: share of the draws that are negative: of a normal quantity, measured x standard deviations from zero,
    Φ(−x).
    """
    missed = 1 - coverage
    upper = min(0.5 * missed, missed * (1 - negative))
    if negative >= missed:
        return missed, upper
    return _lower(round(-float(ndtri(max(negative, 1e-12))), 6), missed), upper


@lru_cache(maxsize=4096)
def _lower(at: float, missed: float) -> float:
    """Tail below the mean of which a measurement ``at`` (in standard deviations) is the largest that is accepted."""
    if at >= -2 * float(ndtri(0.5 * missed)):
        return 0.5 * missed

    def refused(mean: float) -> float:
        """Share of measurements that are less likely than this one, beside the best mean of each.

        The smallest that is accepted has the same ratio to the likelihood of the best mean as the largest.
        """
        least = 2 * mean - at
        least = least if least >= 0 else (mean**2 - (at - mean) ** 2) / (2 * mean)
        return float(ndtr(mean - at) + ndtr(least - mean)) - missed

    return float(ndtr(root(refused, 1e-9, at - 1e-9, 2e-12) - at))


def trial_parts(errors: Movement, perfect: Movement, plan: Plan, *, form: bool) -> Movement:
    """(N, …) what the part may be, from what it was measured as.

    ``errors``: (N, …) draws. ``perfect``: (1, …) from the part as measured to the nominal one. ``form``: whether a form is
    asked of it; else form that errors have is not taken off, less that of the measured part as far as errors explain it.
    """
    less = errors.times(-1.0)
    if form:
        return less
    found = {}
    for name, drawn in errors.points.items():
        normals, motions = _motions([plan.feature(member) for member in plan.members(name)])
        of_errors, measured = (_left(moved, normals, motions) for moved in (drawn, perfect.points[name]))
        seen = float(np.sum(measured**2))
        explained = min(1.0, float(np.mean(np.sum(of_errors**2, axis=1))) / seen) if seen else 0.0
        along = of_errors + explained * measured
        found[name] = along if drawn.ndim == 2 else along[:, :, None] * normals
    return less.plus(replace(errors.times(0.0), points=found))


def _left(moved: Floats, normals: Floats, motions: Floats) -> Floats:
    """(N, m) form along the normals of displacements (N, m, 3), or (N, m) along them."""
    along = moved if moved.ndim == 2 else np.einsum("kmi,mi->km", moved, normals)
    return np.asarray(along - (along @ motions) @ motions.T)


def _motions(features: list[PartFeature]) -> tuple[Floats, Floats]:
    """Normals (m, 3) of the points of features, and (m, r) orthonormal motions and sizes of each; of points all is such."""
    normals = np.concatenate([feature.normals for feature in features])
    found, start = list[Floats](), 0
    for feature in features:
        own = slice(start, start := start + len(feature.points))
        motions = np.eye(len(feature.points)) if feature.kind == "point" else _own(feature)
        found.append(np.zeros((len(normals), motions.shape[1])))
        found[-1][own] = motions
    return normals, np.hstack(found)


def _own(feature: PartFeature) -> Floats:
    about = feature.points - feature.points.mean(axis=0)
    about = about / max(float(np.abs(about).max()), 1.0)
    moved = [feature.normals, np.cross(about, feature.normals)]
    if feature.nominal.diameter_mm is not None:
        moved.append(np.ones((len(about), 1)))
    left, sizes, _ = np.linalg.svd(np.hstack(moved), full_matrices=False)
    return np.asarray(left[:, sizes > _FREE * sizes[0]])


@dataclass(frozen=True)
class StatedCharacteristic:
    name: str
    # mm or rad, less the mean error, of a zone the median one, and zero at least; ``None`` where nothing was measured
    value: float | None
    error: float  # mean of the errors: by how much such a measurement is off on average, mm or rad
    u: float  # standard uncertainty, mm or rad
    # shortest coverage interval of the value, of a zone the unified one; where nothing was measured the shortest of the
    # error, with the opposite sign
    interval: tuple[float, float]
    # half of the shortest interval of the errors over u; of a zone half of its own interval where that is more, and so much
    # that U reaches to the end of an interval that begins at zero
    k: float

    @property
    def U(self) -> float:  # noqa: N802
        """Half of the interval, mm or rad; see ``k``. Of a zone near zero it may reach below zero."""
        return self.k * self.u if self.u else 0.5 * (self.interval[1] - self.interval[0])


def stated(
    simulated: Simulated, measured: Floats | None = None, plan: Plan | None = None, errors: Floats | None = None, *,
    widths_alone: bool = False,
) -> tuple[StatedCharacteristic, ...]:  # fmt: skip
    """Every characteristic, of its errors in virtual measurements and its measured values (c,).

    ``plan``, ``errors``: characteristics, and draws (N, c) of their errors, by which values and intervals of zones are those
    of what is possible; without them they are those of the errors alone. ``widths_alone``: whether of zones nothing but their
    widths is known; errors are then as large as they can make them, to either side.
    """
    found = []
    zones = np.zeros(len(simulated.outputs), dtype=bool) if plan is None else never_negative(plan)
    for i, name in enumerate(simulated.outputs):
        error, u = float(simulated.value[i]), float(simulated.u[i])
        low, high = simulated.interval[i].tolist()
        at = 0.0 if measured is None else float(measured[i])
        value = None if measured is None else at - error
        interval = at - high, at - low
        k = 0.5 * (high - low) / u if u else float("nan")
        if value is not None and zones[i] and errors is not None and widths_alone:
            value, error, half = at, 0.0, float(np.quantile(np.abs(errors[:, i]), simulated.coverage))
            interval, k = (max(0.0, at - half), at + half), half / u if u else k
        elif value is not None and zones[i]:
            if errors is not None:
                value = at - middle(errors[:, i])
                interval = possible_interval(at - errors[:, i], simulated.coverage)
            value = max(0.0, value)
            low, high = interval
            k = max(k, 0.5 * (high - low) / u, (high - value) / u if low <= 0 else 0.0) if u else k
        found.append(StatedCharacteristic(name, value, error, u, interval, k))
    return tuple(found)


def middle(errors: Floats) -> float:
    """Of the errors (N,) of a zone: about which it is as often too large as too small."""
    return float(np.median(errors))


def possible_interval(true: Floats, coverage: float) -> tuple[float, float]:
    """Between tails of all draws that hold as often however small the zone is (:func:`.tails`).

    Where few are possible it ends where errors of a perfect part do: draws are negative by as much as these are larger.
    """
    negative = float(np.mean(true < 0))
    below, above = tails(negative, coverage)
    scarce = 1 - negative < SCARCE
    high = np.quantile(np.abs(true), coverage) if scarce else np.quantile(true, 1 - above)
    return max(0.0, float(np.quantile(true, below))), float(high)


def evaluated(plan: Plan, points: Floats) -> Floats:
    """Characteristics (c,) of measured points (n, 3) in the frame of the part, mm, in the order of the plan's."""
    if points.shape != plan.points.shape:
        said = f"{len(points)} points were measured, the plan has {len(plan.points)}"
        raise CmmUqError(said, where="the recording", fix="Measure each point of the plan once")
    return characteristics_of(plan, points)


def conforming(plan: Plan, errors: Floats, measured: Floats) -> tuple[Floats, float]:
    """Probabilities that the true values lie within the limits of the drawing, given that no zone is negative.

    Of errors (N, c) of virtual measurements and values (c,): of every characteristic (c,), ``nan`` where it has no limits;
    and of all that have some at once, ``nan`` where none has.
    """
    true, zones = measured - errors, never_negative(plan)
    scarce = zones & (np.mean(true >= 0, axis=0) < SCARCE)
    true[:, scarce] = np.abs(true[:, scarce])
    low = np.array([-np.inf if one.lower is None else one.lower for one in plan.characteristics])
    high = np.array([np.inf if one.upper is None else one.upper for one in plan.characteristics])
    inside, limited = (low <= true) & (true <= high), np.isfinite(low) | np.isfinite(high)
    possible = ~zones | (true >= 0)
    each = np.array([_share(inside[:, i], possible[:, i]) if limited[i] else np.nan for i in range(len(limited))])
    if not limited.any():
        return each, float("nan")
    together = _share(*(np.asarray(of[:, limited].all(axis=1)) for of in (inside, possible)))
    # what is possible of all at once is not what is possible of each
    return each, within_bounds(together, each[limited])


def within_bounds(together: float, each: Floats) -> float:
    """The probability of all at once, as near as Fréchet's bounds allow: no more than that of one, no less than all leave."""
    return float(np.clip(together, max(0.0, 1 - np.sum(1 - each)), each.min()))


def _share(inside: NDArray[np.bool_], possible: NDArray[np.bool_]) -> float:
    """Of the draws that are possible; of all, where these are few."""
    return float(np.mean(inside[possible] if np.count_nonzero(possible) >= FEWEST else inside))


def deviations_of(plan: Plan, measured: Floats) -> Floats:
    """(n,) signed distances of measured points (n, 3) from their least-squares features, out of the material, mm.

    ``nan`` of features whose number of points alone determines them, which have no form.
    """
    found = np.full(len(measured), np.nan)
    for feature in plan.features:
        if len(feature.points) > FEWEST_POINTS[feature.kind]:
            rows = plan.rows[feature.name]
            found[rows] = _deviations(feature, measured[rows])
    return found


def _deviations(feature: PartFeature, points: Floats) -> Floats:
    if feature.kind == "point":
        return np.asarray(np.einsum("ni,ni->n", points - points.mean(axis=0), feature.normals))
    if feature.kind == "line" and feature.nominal.direction is not None:
        along = np.asarray(feature.nominal.direction)
        out = feature.normals.mean(axis=0)
        out = out - (out @ along) * along
        out /= np.linalg.norm(out)
        flat = np.column_stack([points @ along, points @ out])
        flat -= flat.mean(axis=0)
        across = np.linalg.svd(flat, full_matrices=False)[2][1]
        return np.asarray(np.sign(across[1]) * (flat @ across))
    if feature.kind == "plane":
        return associate("plane", points, outward=feature.normals.mean(axis=0)).deviations
    sign = -1.0 if feature.internal else 1.0
    return np.asarray(sign * associate(feature.kind, points).deviations)
