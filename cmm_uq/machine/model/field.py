"""The machine as a random field: errors that it has besides those that are named, in families of one size each.

Each of the guideway errors of VDI/VDE 2617-3 is a smooth function of the reading of its axis: position (beyond its scale), the
straightnesses and the rotations of a carriage. A function is a sum of cosines over the travel T,

    f(a) = A·Σ_k w_k·c_k·√2·cos(πk(a − a₀)/T),   c_k ~ N(0, s²),   Σ w_k² = 1,   w_k ~ 1/k

with A what physics allows of its root mean square. Long waves (k up to 2) and short ones have sizes s of their own, so that
no correlation length is taken for known. An error with a period, and play, are families too.

An error with a period of which only bounds are known is any within them, evenly in its logarithm. A sum over many trial
periods, each with its share of the variance, has the same mean and nearly the same covariance between any two points; it is
linear, so that it can be drawn together with everything else. Few trials would pretend to know the period: two points far
apart would err alike. What a recording says of such an error follows from its covariance itself, a difference of cosine
integrals: from the sum, amplitudes of trial periods would answer for periods between them, and a recording of some hundred
readings would seem to determine them all. So a draw of the sum is a draw beforehand, and what the recording says is added.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cache
from itertools import pairwise, product

import numpy as np
import scipy
from numpy.polynomial.chebyshev import chebvander

from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import ARCSECOND, MICROMETRE, unit
from cmm_uq.machine.physics.catalogue import EVERY
from cmm_uq.machine.physics.effect import Effect, Family, Parameter, along
from cmm_uq.machine.physics.effects.drives import HYSTERESIS, SCALE_CURVATURE, PeriodicScale
from cmm_uq.machine.physics.effects.rigid_body import ROTATIONS, STRAIGHTNESSES, turned

PERIODIC, PLAY, POSITION, STRAIGHTNESS, ROTATION = "periodic", "play", "position", "straightness", "rotation"
_LONG, _SHORT, STATED = " long", " short", " as stated"
WAVES, LONG, _BEYOND = 10, 2, 0.125  # of a function; those that count as long; part of the travel beyond its ends
FAMILIES: Mapping[str, Text] = {
    PERIODIC: say("Periodic errors of the scales"), PLAY: say("Play of the drives"),
    POSITION + _LONG: say("Position errors along the axes, long waves"),
    POSITION + _SHORT: say("Position errors along the axes, short waves"),
    STRAIGHTNESS + _LONG: say("Straightnesses, long waves"), STRAIGHTNESS + _SHORT: say("Straightnesses, short waves"),
    ROTATION + _LONG: say("Rotations, long waves"), ROTATION + _SHORT: say("Rotations, short waves"),
}  # fmt: skip
READ: Mapping[str, Text] = {  # of axes of which it is stated how they are read
    PERIODIC + STATED: say("Periodic errors of scales that are stated, over what is stated"),
    PLAY + STATED: say("Play of axes that are stated, over what is stated"),
}
# root mean square that physics allows: µm along an axis beyond its scale, µm across it, ″
ALLOWED = {POSITION: 20.0, STRAIGHTNESS: 50.0, ROTATION: 30.0}
_SAME = 1e-6  # of the shortest period: a distance over which nothing changes
_AT_ONCE, _PAIRS = 1_000_000, 50_000  # displacements, and covariances of readings, that are held at once
_MANY, _FEW = 20_000, 1000  # readings up to which the covariance is taken of each; up to which, where cells are known
_PERIODS, _DEGREE = 8, 60  # shortest periods in a cell of an axis, and polynomials: off by 10⁻¹³ of the largest
_TURN = MICROMETRE * 1j * np.exp(-2j * np.pi * np.arange(4096) / 4096)  # sine and i·cosine in as many parts of a turn
_LOOKED_AT = 61  # readings
TRIED = 64  # periods: correlations of errors at two places are then off by less than a tenth in the root mean square
_EACH = 4  # of these in each band, where the size of an error goes by its period


def family_of(effect: Effect) -> str | None:
    """Family whose size its errors share; ``None`` of an effect with a size of its own."""
    if isinstance(effect, AxisFunction):
        return effect.family
    if effect.of_family or effect.stated:
        return effect.of_family
    if isinstance(effect, PeriodicScale | GivenPeriod):
        return PERIODIC
    rows = {PLAY: HYSTERESIS, POSITION: SCALE_CURVATURE, STRAIGHTNESS: STRAIGHTNESSES, ROTATION: ROTATIONS}
    return next((name for name, row in rows.items() if row.has(effect)), None)


class AxisFunction(Effect):
    """One of the smooth functions, its long or its short waves; it has the name of the effect that is its simplest form."""

    def __init__(self, of: Family, *, long: bool) -> None:
        self.of, kind = of, family_of(of)
        self.kind = str(kind)
        self.name, self.title, self.formula = of.name, of.title, of.formula
        self.mechanism, self.points_to, self.along_motion = of.mechanism, of.points_to, of.along_motion
        every = np.arange(1, WAVES + 1)
        turns = 2 * np.pi * every / (1 + 2 * _BEYOND)
        squares = (1 - 2 * np.sin(turns * _BEYOND) / turns) / every**2  # of each wave, over the travel
        forms = 1 + (kind == ROTATION)  # bow, and slope
        part, chosen = ALLOWED[self.kind] / np.sqrt(forms + squares.sum()), slice(LONG) if long else slice(LONG, None)
        self.orders, self.forms = every[chosen], forms if long else 0
        self.family = self.kind + (_LONG if long else _SHORT)
        self.rms = float(part * np.sqrt(self.forms + squares[chosen].sum()))
        named = [("bow", part), ("slope", part)][: self.forms] + [(f"wave {k}", part / k) for k in self.orders]
        of_unit = unit("″" if kind == ROTATION else "µm")
        self.coefficients = tuple(Parameter(name, of_unit, float(sd)) for name, sd in named)

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        axis = self.of.axis
        low, high = points.machine.travel(axis)
        place = (points.readings[axis] - low) / (high - low)
        angle, t = np.pi * (place + _BEYOND) / (1 + 2 * _BEYOND), 2 * place[:, None] - 1
        simple = np.hstack([np.sqrt(1.25) * (3 * t**2 - 1), np.sqrt(3.0) * t])[:, : self.forms]
        each = np.hstack([simple, np.sqrt(2.0) * np.cos(angle[:, None] * self.orders)])
        if self.kind == ROTATION:
            lever = turned(points, axis, self.of.other, np.ones(len(points)))
            return np.asarray(lever * (ARCSECOND * each)[:, None, :])
        return along(self.of.other, MICROMETRE * each)


def bounded(effect: Effect, largest_um: float) -> Effect:
    """Play whose gap, or a periodic error whose amplitude, 95 of 100 do not exceed: normal, or with normal sine and cosine."""
    quantile = np.sqrt(-2 * np.log(0.05)) if isinstance(effect, PeriodicScale) else scipy.special.ndtri(0.975)
    found = copy(effect)
    found.stated = True
    found.coefficients = tuple(replace(one, prior_sd=float(largest_um / quantile)) for one in effect.coefficients)
    return found


def as_read(effect: Effect, largest_um: float, errors: Sequence[Sequence[tuple[float, float, float]]] = ()) -> Effect:
    """An error of an axis as it is stated, with those of other such axes a family of its own.

    ``largest_um``: as of :func:`bounded`. ``errors``: of a periodic error, those that it is the sum of, each in bands of
    periods with the amplitude that 95 of 100 do not exceed, µm.
    """
    found = bounded(effect, largest_um)
    found.of_family = (PERIODIC if isinstance(effect, PeriodicScale) else PLAY) + STATED
    if isinstance(found, PeriodicScale):
        sd = found.coefficients[0].prior_sd / largest_um
        found.errors = tuple(tuple((low, high, sd * most) for low, high, most in bands) for bands in errors)
    return found


@cache
def curves() -> tuple[AxisFunction, ...]:
    """Of a machine of three axes."""
    each = [one for one in EVERY.values() if isinstance(one, Family) and family_of(one) in ALLOWED]
    return tuple(AxisFunction(one, long=long) for one in each for long in (True, False))


@cache
def allowed(family: str) -> tuple[float, str]:
    """Root mean square of an error of a family that physics allows, and its unit; of play the gap; one of what is stated."""
    if family.endswith(STATED):
        return 1.0, "1"
    one = next(effect for effect in (*EVERY.values(), *curves()) if family_of(effect) == family)
    most = one.rms if isinstance(one, AxisFunction) else float(np.sqrt(sum(c.prior_sd**2 for c in one.coefficients)))
    return most, str(one.coefficients[0].unit)


class AtPoints(Effect):
    """Displacements (n, j), mm, of points by themselves along the axis of another effect."""

    def __init__(self, of: Effect, component: Floats) -> None:
        self.name, self.mechanism, self.along_motion, self.component = of.name, of.mechanism, of.along_motion, component

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return along(str(self.along_motion), self.component)

    def travelled(self, points: Points) -> Floats:
        return self.component


class EveryPeriod(Effect):
    """All trial periods of an effect at once; without a shape of its own."""

    def __init__(self, effect: Effect) -> None:
        self.of, sd = effect, effect.coefficients[0].prior_sd
        several = effect.errors if isinstance(effect, PeriodicScale) else ()
        # of each error its trials, with the part of the effect's prior that each has
        errors: list[list[tuple[tuple[float, ...], float]]] = [
            [((at,), own / sd) for low, high, own in bands for at in _evenly(low, high, _EACH)] for bands in several
        ] or [[(at, 1.0) for at in product(*(_evenly(one.low, one.high, TRIED) for one in effect.shape))]]
        self.at, self.counts = tuple(at for each in errors for at, _ in each), tuple(map(len, errors))
        share = [part / np.sqrt(len(each)) for each in errors for _, part in each]
        self.name, self.title, self.formula = effect.name, effect.title, effect.formula
        self.mechanism, self.points_to = effect.mechanism, effect.points_to
        self.columns, self.tier, self.along_motion = effect.columns, effect.tier, effect.along_motion
        self.coefficients = tuple(
            replace(one, name=f"{one.name} {i}", prior_sd=float(one.prior_sd * part))
            for i, part in enumerate(share, 1)
            for one in effect.coefficients
        )

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return np.concatenate([self.of.basis(points, each) for each in self.at], axis=2)


class GivenPeriod(Effect):
    """A periodic error with all its trial periods, and what a recording says of it, for each combination it sees.

    A draw f of the sum beforehand is conditioned at any reading x by f(x) + k(x, X)·B·w, w what combinations were found to be
    less what they are by that draw and all others (conditioning by kriging: Chilès, Delfiner 2012, 7.3).

    ``effect``: periodic. ``readings``: (p,) X, where the scale stood at the points of the recording, mm. ``into``: (p, r) B,
    1/mm.
    """

    def __init__(self, effect: PeriodicScale, readings: Floats, into: Floats) -> None:
        self.of, self.sum, self.readings, self.into = effect, EveryPeriod(effect), readings, into
        self.of_family, self.stated = effect.of_family, bool(effect.of_family)
        self.name, self.title, self.formula = effect.name, effect.title, effect.formula
        self.mechanism, self.points_to = effect.mechanism, effect.points_to
        self.axis = self.along_motion = effect.axis
        said = (Parameter(f"said {j}", unit("1"), 0.0) for j in range(1, into.shape[1] + 1))
        self.coefficients = (*self.sum.coefficients, *said)
        self._cells: dict[float, Floats] = {}  # polynomials (q, r), by cell of the axis

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return along(self.axis, self.travelled(points))

    def travelled(self, points: Points) -> Floats:
        return self.at(points.readings[self.axis])

    def parts(self, points: Points) -> Iterator[Effect]:
        """Some of its coefficients each, at these points alone: all together at a hundred thousand fill half a gigabyte."""
        reading, periods = points.readings[self.axis], np.ravel(self.sum.at)
        for some in np.array_split(periods, 1 + 2 * len(reading) * len(periods) // _AT_ONCE):
            yield AtPoints(self, _waves(reading, some))
        for some in np.array_split(self._said(reading), 1 + len(reading) * self.into.shape[1] // _AT_ONCE, axis=1):
            yield AtPoints(self, some)

    def at(self, reading: Floats) -> Floats:
        """(n, j) mm of error at readings (n,): of the trials, then of the combinations."""
        return np.hstack([_waves(reading, np.ravel(self.sum.at)), self._said(reading)])

    def _said(self, reading: Floats) -> Floats:
        """At many readings by polynomials in cells of the axis, for no wave is shorter than the shortest period."""
        if len(reading) <= (_FEW if self._cells else _MANY):
            parts = np.array_split(reading, 1 + len(reading) * len(self.readings) // _PAIRS)
            return np.concatenate([covariance(self.of, part, self.readings) @ self.into for part in parts])
        length = _PERIODS * float(np.min(self.sum.at))
        place, found = reading / length, np.empty((len(reading), self.into.shape[1]))
        nodes = np.cos(np.pi * (np.arange(_DEGREE) + 0.5) / _DEGREE)
        inverse = np.linalg.inv(chebvander(nodes, _DEGREE - 1))
        for some in np.array_split(np.argsort(place), 1 + len(place) * _DEGREE // _AT_ONCE):
            cells = np.floor(place[some])
            polynomials = chebvander(2 * (place[some] - cells) - 1, _DEGREE - 1)
            ends = np.flatnonzero(np.diff(cells, prepend=np.nan, append=np.nan)).tolist()
            for first, last in pairwise(ends):
                if (cell := float(cells[first])) not in self._cells:
                    values = self._said((cell + 0.5 + 0.5 * nodes) * length)
                    self._cells[cell] = np.asarray(inverse @ values)
                found[some[first:last]] = polynomials[first:last] @ self._cells[cell]
        return found

    def beforehand(self, random: np.random.Generator, count: int) -> Floats:
        """Draws (N, j) of the coefficients over their standard deviations, without the recording.

        Of one trial period each, of every error of which it is the sum.

        Mean and covariance are those of all at once; errors of a linear estimate are then distributed as those of machines
        with one period.
        """
        waves, start = len(self.of.coefficients), 0
        found = np.zeros((count, len(self.sum.at), waves))
        for trials in self.sum.counts:
            drawn = np.sqrt(trials) * random.standard_normal((count, waves))
            found[np.arange(count), start + random.integers(trials, size=count)] = drawn
            start += trials
        return np.hstack([found.reshape(count, -1), np.zeros((count, self.into.shape[1]))])

    def share(self, draws: Floats) -> float:
        """Standard deviation of errors by draws (N, j), between the readings of the recording, over that beforehand."""
        between = np.linspace(self.readings.min(), self.readings.max(), _LOOKED_AT)
        left = (draws @ self.at(between).T).var(axis=0).mean()
        return float(np.sqrt(left) / (MICROMETRE * self.of.coefficients[0].prior_sd))


def _waves(reading: Floats, periods: Floats) -> Floats:
    """(n, 2p) mm, sine and cosine of each period; of many readings by those of parts of a turn, and of what is left."""
    if len(reading) <= _FEW:
        angle = 2 * np.pi * reading[:, None] / periods
        return MICROMETRE * np.stack([np.sin(angle), np.cos(angle)], axis=2).reshape(len(reading), -1)
    found, parts = np.empty((len(reading), len(periods)), dtype=np.complex128), 1 + len(reading) // _FEW
    for some, each in zip(np.array_split(reading, parts), np.array_split(found, parts), strict=True):
        turn = some[:, None] * (len(_TURN) / periods)
        left = 2 * np.pi / len(_TURN) * (turn - np.rint(turn))
        each.real, each.imag = 1 - left**2 * (0.5 - left**2 / 24), left * (left**2 / 6 - 1)
        each *= _TURN[np.rint(turn).astype(np.intp) & len(_TURN) - 1]
    return found.view(np.float64)


def covariance(effect: PeriodicScale, one: Floats, other: Floats) -> Floats:
    """(n, p) mm², of an error whose period nobody knows, at readings (n,) and (p,), mm.

    The mean of σ²·cos(2πd/λ) over ln λ: σ²·(Ci(2πd/λ₀) − Ci(2πd/λ₁))/ln(λ₁/λ₀); where σ goes by λ, of each band by its part.
    """
    (shape,), own = effect.shape, effect.coefficients[0].prior_sd
    one, place = np.unique(one, return_inverse=True)  # points that fill a region stand at few
    distance, whole = 2 * np.pi * np.abs(np.subtract.outer(one, other)), np.zeros(())
    for bands in effect.errors or (((shape.low, shape.high, own),),):
        same, every = distance < _SAME * bands[0][0], np.log(bands[-1][1] / bands[0][0])
        apart = np.where(same, 1.0, distance)
        for low, high, sd in bands:
            found = scipy.special.sici(apart / low)[1] - scipy.special.sici(apart / high)[1]
            found[same] = np.log(high / low)
            whole = whole + (MICROMETRE * sd) ** 2 * (found / every)
    return np.asarray(whole)[place]


def _evenly(low: float, high: float, count: int) -> list[float]:
    """The middle of each of ``count`` equal parts of the logarithm, which have the same share of the prior each."""
    return [*map(float, np.exp(np.log(low) + np.log(high / low) * (np.arange(count) + 0.5) / count))]


def linear(effect: Effect) -> Effect:
    """The effect itself where it has no shape, else all of its trials at once."""
    return EveryPeriod(effect) if effect.shape else effect
