"""A result: estimate, standard uncertainty, interval; as rounded text; averaged over models.

Rounding is that of ILAC-P14:09/2020 5.4 with JCGM 100:2008 7.2.6: it comes last, to the nearest, ties away from zero (ISO
80000-1:2022 annex B, rule B); an uncertainty that this would lower by more than 5 % is rounded up instead (EA-4/02 M:2022
6.3), which can happen with one digit only. Numbers are read as the decimal they print as, so that 0.15 is a tie and the
noise of binary arithmetic behind the 13th digit decides nothing.

Over several models the distribution is the mixture of theirs (Bayesian model averaging: Hoeting et al. 1999, *Statistical
Science* 14, 382), each taken as normal on either side of its value, as wide as its own interval there.
"""

from __future__ import annotations

from collections.abc import Sequence
from decimal import ROUND_HALF_UP, ROUND_UP, Decimal
from math import ceil, floor, isfinite, isinf, isnan, log10

import numpy as np
import scipy

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Number
from cmm_uq.base.points import Floats
from cmm_uq.base.units import Unit
from cmm_uq.base.values import dataclass

_ALIKE = 0.1  # of the longer side of an interval, by which the other may be shorter: what U says of two digits, 10 ± 1


def uneven(value: float, low: float, high: float) -> bool:
    """Whether the sides of an interval about a value differ by more than a tenth of the longer one."""
    sides = high - value, value - low
    return min(sides) < (1 - _ALIKE) * max(sides)


def expanded_of(draws: Floats, value: Floats) -> Floats:
    """U (...) of draws (N, ...) about a value: the larger distance to an end of the 95 % interval."""
    low, high = np.quantile(draws, [0.025, 0.975], axis=0)
    return np.asarray(np.maximum(high - value, value - low))


@dataclass(frozen=True)
class Quantity:
    value: float  # estimate, in ``unit``
    u: float  # standard uncertainty, in ``unit``
    interval95: tuple[float, float]  # probabilistically symmetric 95 % coverage interval
    unit: Unit  # as printed

    @classmethod
    def of_draws(cls, draws: Floats, unit: Unit, value: float | None = None) -> Quantity:
        """From draws (N,) of a distribution; its mean is the estimate unless one is given."""
        low, high = np.quantile(draws, [0.025, 0.975])
        estimate = float(draws.mean()) if value is None else value
        return cls(estimate, float(draws.std(ddof=1)), (float(low), float(high)), unit)

    @property
    def expanded(self) -> float:
        """Expanded uncertainty U: the larger distance from the value to an end of the 95 % interval."""
        low, high = self.interval95
        return max(high - self.value, self.value - low)

    @property
    def coverage_factor(self) -> float | None:
        """K = U/u; ``None`` where nothing is uncertain."""
        return self.expanded / self.u if self.u > 0 else None

    @property
    def one_sided(self) -> bool:
        """Whether ± U would reach beyond zero where the interval does not: such a quantity is stated by its interval."""
        low, high = self.interval95
        return (low >= 0 > self.value - self.expanded) or (high <= 0 < self.value + self.expanded)

    @property
    def skewed(self) -> bool:
        """Whether no value ± U says the interval, which is then stated itself (JCGM 101:2008, 5.3.4)."""
        return self.u > 0 and uneven(self.value, *self.interval95)

    @property
    def degrees_of_freedom(self) -> float:
        """Of a standard deviation that is known this well: ½·(value/u)² (JCGM 100:2008, E.4.3), at least one."""
        return max(0.5 * (self.value / self.u) ** 2, 1.0) if self.u > 0 else float("inf")

    def at_least(self, expanded: float) -> Quantity:
        """The quantity with this expanded uncertainty (95 %, k = 2) where its own is smaller, else as it is."""
        if self.expanded >= expanded:
            return self
        return Quantity(self.value, expanded / 2, (self.value - expanded, self.value + expanded), self.unit)

    def times(self, factor: float, unit: Unit) -> Quantity:
        """The quantity multiplied by an exact factor, of either sign, in the unit of the product."""
        low, high = sorted(factor * end for end in self.interval95)
        return Quantity(self.value * factor, self.u * abs(factor), (low, high), unit)


MINUS = "−"
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_PLAIN_DECIMALS, _PLAIN_INTEGER_DIGITS = 12, 15
_LARGEST_LOSS = Decimal("0.05")  # of an uncertainty by rounding (EA-4/02)
_TAIL = 0.025
_HALVINGS = 80
_NO_WIDTH = 1e-200


def significant(u: float, digits: int = 2) -> Number:
    """A standard or expanded uncertainty, not negative, to some significant digits; infinite gives ``∞``."""
    return rounded(0.0, u, digits)[1]


def rounded(value: float, u: float, digits: int = 2) -> tuple[Number, Number]:
    """A value and its standard or expanded uncertainty, both to the decimal place that ``digits`` digits of it support.

    Zero uncertainty leaves the value as it is; an infinite one leaves it with ``digits`` significant digits. A common power
    of ten is split off only where the decimals would run past twelve places or fifteen integer digits.
    """
    _check(value, u, digits)
    exact = Decimal(f"{value:.12e}")
    if u == 0:
        return _plain(exact.normalize()), Number("0")
    if isinf(u):
        return _plain(_to_place(exact, exact.adjusted() - digits + 1)) if value else Number("0"), Number("∞")
    exact_u = Decimal(f"{u:.12e}")
    place = exact_u.adjusted() - digits + 1
    shown = _to_place(exact_u, place)
    if exact_u - shown > _LARGEST_LOSS * exact_u:
        shown = _to_place(exact_u, place, ROUND_UP)
    place = shown.adjusted() - digits + 1
    both = _to_place(exact, place), shown
    exponent = max(number.adjusted() for number in both if number)
    if -place <= _PLAIN_DECIMALS and exponent < _PLAIN_INTEGER_DIGITS:
        return _plain(both[0], place), _plain(shown, place)
    value_text, u_text = (_plain(number.scaleb(-exponent), place - exponent) + _power(exponent) for number in both)
    return Number(value_text), Number(u_text)


def alike(*values: float, decimals: int = 1) -> tuple[Number, ...]:
    """Numbers without uncertainties of their own, side by side: with so many decimals, or more where the largest is small.

    A step of the last decimal is never more than a third of the largest modulus, unless that is zero.
    """
    largest = max(abs(value) for value in values)
    _check(largest)
    more = ceil(-log10(largest / 3)) if largest else 0
    return tuple(Number(f"{value:.{max(decimals, more)}f}") for value in values)


def nominal(length: float) -> Number:
    """A length that is given, not measured, in full: no digit of it is left out, and none is made up."""
    _check(length)
    return _plain(Decimal(f"{length:.6f}").normalize())


def limit_in_full(limit: float) -> Number:
    """A limit that is stated, in full; what a formula makes of a length, to four digits and at least two decimals."""
    if not limit or abs(limit - round(limit, 6)) <= 1e-12 * abs(limit):
        return nominal(limit)
    return nominal(round(limit, max(2, 3 - floor(log10(abs(limit))))))


def figure(number: float, digits: int = 4) -> Number:
    """A number that has no uncertainty of its own, such as a sensitivity, to some significant digits.

    Trailing zeros say nothing here and are left out; a power of ten is split off below 0.001 and from a million on.
    """
    _check(number, digits=digits)
    mantissa, exponent = f"{number:.{digits - 1}e}".split("e")
    if -3 <= int(exponent) < 6:
        return _plain(Decimal(f"{number:.{digits}g}").normalize())
    return Number(_plain(Decimal(mantissa).normalize()) + _power(int(exponent)))


def _check(value: float, u: float = 0.0, digits: int = 1) -> None:
    if isnan(u) or u < 0:
        raise CmmUqError(f"an uncertainty of {u} cannot be stated", fix="It must be a number that is not negative")
    if not isfinite(value):
        raise CmmUqError(f"a value of {value} cannot be stated", fix="Find out why the result is not finite")
    if digits < 1:
        raise CmmUqError(f"{digits} significant digits cannot be shown", fix="Use 1 or 2")


def _to_place(number: Decimal, place: int, rounding: str = ROUND_HALF_UP) -> Decimal:
    """Rounded to a multiple of 10**place."""
    return number.scaleb(-place).to_integral_value(rounding).scaleb(place)


def _power(exponent: int) -> str:
    return "×10" + str(exponent).translate(_SUPERSCRIPT)


def _plain(number: Decimal, place: int | None = None) -> Number:
    """Without exponent; with as many decimals as the place asks."""
    text = f"{number:f}" if place is None else f"{number:.{max(0, -place)}f}"
    return Number(text.replace("-", MINUS if number else ""))


def averaged(quantities: Sequence[Quantity], weights: Sequence[float]) -> Quantity:
    """The quantity over all models: the mean of their values, the mean of their variances and the variance of the means."""
    p = np.array(weights) / np.sum(weights)
    columns = zip(*((q.value, q.u, *q.interval95) for q in quantities), strict=True)
    value, u, low, high = (np.array(column) for column in columns)
    mean = float(p @ value)
    spread = float(np.sqrt(p @ (u**2 + (value - mean) ** 2)))
    ends = (_quantile(_TAIL, p, value, low, high), _quantile(1 - _TAIL, p, value, low, high))
    return Quantity(mean, spread, ends, quantities[0].unit)


def mixed(draws: Sequence[Floats], weights: Sequence[float], random: np.random.Generator) -> Floats:
    """Draws (N, k) of the mixture: row i is row i of one of the models, each as often as its probability has it.

    ``draws``: (N, k) under each model, of the same quantities in the same order; row after row independent.
    """
    count = len(draws[0])
    wanted = count * np.array(weights) / np.sum(weights)
    times = np.floor(wanted).astype(np.int64)
    times[np.argsort(times - wanted, kind="stable")[: count - times.sum()]] += 1
    model = random.permutation(np.repeat(np.arange(len(draws)), times))
    return np.asarray(np.stack(draws)[model, np.arange(count)])


def _quantile(tail: float, p: Floats, value: Floats, low: Floats, high: Floats) -> float:
    """Where the mixture's distribution function reaches a probability, by halving between the outermost ends."""
    own = low if tail < 0.5 else high
    below, above = float(own.min()), float(own.max())
    factor = -float(scipy.special.ndtri(_TAIL))
    for _ in range(_HALVINGS):
        middle = 0.5 * (below + above)
        width = np.where(middle < value, value - low, high - value) / factor
        reached = float(p @ scipy.special.ndtr((middle - value) / np.maximum(width, _NO_WIDTH)))
        below, above = (middle, above) if reached < tail else (below, middle)
    return 0.5 * (below + above)
