"""Results as text: the uncertainty to at most two significant digits, the value to the same decimal place.

The rule is that of ILAC-P14:09/2020 5.4 with JCGM 100:2008 7.2.6: rounding comes last, to the nearest, ties away from
zero (ISO 80000-1:2022 annex B, rule B); an uncertainty that this would lower by more than 5 % is rounded up instead
(EA-4/02 M:2022 6.3), which can happen with one digit only. Numbers are read as the decimal they print as, so that 0.15
is a tie and the noise of binary arithmetic behind the 13th digit decides nothing.
"""

from __future__ import annotations

from decimal import ROUND_HALF_UP, ROUND_UP, Decimal
from math import ceil, floor, isfinite, isinf, isnan, log10

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Number

MINUS = "−"
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_PLAIN_DECIMALS = 12
_PLAIN_INTEGER_DIGITS = 15
_LARGEST_LOSS = Decimal("0.05")


def significant(u: float, digits: int = 2) -> Number:
    """An uncertainty to some significant digits.

    Parameters
    ----------
    u : standard or expanded uncertainty, not negative; infinite gives ``∞``.
    digits : significant digits, 1 or 2 for what a certificate states.

    Raises
    ------
    CmmUqError : ``u`` is negative or not a number.
    """
    return rounded(0.0, u, digits)[1]


def rounded(value: float, u: float, digits: int = 2) -> tuple[Number, Number]:
    """A value and its uncertainty, both to the decimal place that the uncertainty supports.

    Parameters
    ----------
    value : the estimate.
    u : its standard or expanded uncertainty, same unit, not negative. Zero leaves the value as it is; infinite leaves
        it with ``digits`` significant digits.
    digits : significant digits of ``u``.

    Returns
    -------
    value and uncertainty with the Unicode minus sign; a common power of ten is split off only where the decimals would
    run past twelve places or fifteen integer digits.

    Raises
    ------
    CmmUqError : ``u`` is negative or not a number, or ``value`` is not finite.

    Examples
    --------
    >>> rounded(838.03, 71.62)
    ('838', '72')
    >>> rounded(12345.6, 123)
    ('12350', '120')
    """
    _check(value, u, digits)
    exact = _decimal(value)
    if u == 0:
        return (_plain(exact.normalize()), Number("0"))
    if isinf(u):
        return _plain(_to_place(exact, exact.adjusted() - digits + 1)) if value else Number("0"), Number("∞")
    shown = _rounded_uncertainty(_decimal(u), digits)
    place = shown.adjusted() - digits + 1
    return _as_text(_to_place(exact, place), shown, place)


def alike(*values: float, decimals: int = 1) -> tuple[Number, ...]:
    """Numbers without uncertainties of their own, side by side: with so many decimals, or more where the largest is small.

    A step of the last decimal is never more than a third of the largest modulus, unless that is zero.

    Examples
    --------
    >>> alike(78.6, 18.04)
    ('78.6', '18.0')
    >>> alike(0.0474, 0.0208)
    ('0.05', '0.02')
    """
    largest = max(abs(value) for value in values)
    _check(largest, 0.0, 1)
    more = ceil(-log10(largest / 3)) if largest else 0
    return tuple(Number(f"{value:.{max(decimals, more)}f}") for value in values)


def nominal(length: float) -> Number:
    """A length that is given, not measured, in full: no digit of it is left out, and none is made up.

    Examples
    --------
    >>> nominal(1080.0012)
    '1080.0012'
    """
    _check(length, 0.0, 1)
    return _plain(Decimal(f"{length:.6f}").normalize())


def limit_in_full(limit: float) -> Number:
    """A limit that is stated, in full; what a formula makes of a length, to four digits and at least two decimals.

    Examples
    --------
    >>> limit_in_full(1080.0012), limit_in_full(2.5 + 800 / 300)
    ('1080.0012', '5.167')
    """
    if not limit or abs(limit - round(limit, 6)) <= 1e-12 * abs(limit):
        return nominal(limit)
    return nominal(round(limit, max(2, 3 - floor(log10(abs(limit))))))


def figure(number: float, digits: int = 4) -> Number:
    """A number that has no uncertainty of its own, such as a sensitivity, to some significant digits.

    Trailing zeros say nothing here and are left out; a power of ten is split off below 0.001 and from a million on.
    """
    _check(number, 0.0, digits)
    mantissa, exponent = f"{number:.{digits - 1}e}".split("e")
    if -3 <= int(exponent) < 6:
        return _plain(Decimal(f"{number:.{digits}g}").normalize())
    return Number(_plain(Decimal(mantissa).normalize()) + _power(int(exponent)))


def _check(value: float, u: float, digits: int) -> None:
    if isnan(u) or u < 0:
        raise CmmUqError(f"an uncertainty of {u} cannot be stated", fix="It must be a number that is not negative")
    if not isfinite(value):
        raise CmmUqError(f"a value of {value} cannot be stated", fix="Find out why the result is not finite")
    if digits < 1:
        raise CmmUqError(f"{digits} significant digits cannot be shown", fix="Use 1 or 2")


def _decimal(number: float) -> Decimal:
    return Decimal(f"{number:.12e}")


def _to_place(number: Decimal, place: int, rounding: str = ROUND_HALF_UP) -> Decimal:
    """Rounded to a multiple of 10**place."""
    return number.scaleb(-place).to_integral_value(rounding).scaleb(place)


def _rounded_uncertainty(u: Decimal, digits: int) -> Decimal:
    place = u.adjusted() - digits + 1
    nearest = _to_place(u, place)
    return _to_place(u, place, ROUND_UP) if u - nearest > _LARGEST_LOSS * u else nearest


def _as_text(value: Decimal, u: Decimal, place: int) -> tuple[Number, Number]:
    exponent = max(value.adjusted() if value else u.adjusted(), u.adjusted())
    if -place <= _PLAIN_DECIMALS and exponent < _PLAIN_INTEGER_DIGITS:
        return _plain(value, place), _plain(u, place)
    power = _power(exponent)
    scaled_place = place - exponent
    shown = (_plain(number.scaleb(-exponent), scaled_place) + power for number in (value, u))
    return Number(next(shown)), Number(next(shown))


def _power(exponent: int) -> str:
    return "×10" + str(exponent).translate(_SUPERSCRIPT)


def _plain(number: Decimal, place: int | None = None) -> Number:
    """Without exponent; with as many decimals as the place asks."""
    text = f"{number:f}" if place is None else f"{number:.{max(0, -place)}f}"
    return Number(text.replace("-", MINUS if number else ""))
