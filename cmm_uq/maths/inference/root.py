"""Where a function of one number crosses zero."""

from __future__ import annotations

from collections.abc import Callable
from math import copysign, isnan

_RELATIVE = 8.881784197001252e-16
"""Part of the root to which it is found at best: four times the spacing of floats at one."""

_ROUNDS = 100


def root(function: Callable[[float], float], low: float, high: float, tolerance: float) -> float:
    """Root between two numbers at which a function has opposite signs, to within ``tolerance``.

    Brent's method (R. P. Brent 1973, Algorithms for Minimization without Derivatives, chapter 4) in the steps of
    ``scipy.optimize.brentq``, whose package takes longer to import than most commands run.

    Raises
    ------
    ValueError : the signs are alike, or the function is not a number somewhere.
    ArithmeticError : a hundred rounds do not find it.
    """
    before, now, far = float(low), float(high), 0.0
    at_before, at_now, at_far = _value(function, before), _value(function, now), 0.0
    if not at_before or not at_now:
        return now if at_before else before
    if not _opposite(at_before, at_now):
        raise ValueError("the function has one sign at both ends")
    last = step = 0.0
    for _ in range(_ROUNDS):
        if at_before and _opposite(at_before, at_now):
            far, at_far = before, at_before
            last = step = now - before
        if abs(at_far) < abs(at_now):
            before, now, far = now, far, now
            at_before, at_now, at_far = at_now, at_far, at_now
        least, half = (tolerance + _RELATIVE * abs(now)) / 2, (far - now) / 2
        if not at_now or abs(half) < least:
            return now
        tried = None
        if abs(last) > least and abs(at_now) < abs(at_before):
            tried = _interpolated(before, now, far, at_before, at_now, at_far)
        if tried is not None and 2 * abs(tried) < min(abs(last), 3 * abs(half) - least):
            last, step = step, tried
        else:
            last = step = half
        before, at_before = now, at_now
        now += step if abs(step) > least else copysign(least, half)
        at_now = _value(function, now)
    raise ArithmeticError(f"no root found within {_ROUNDS} rounds")


def _value(function: Callable[[float], float], place: float) -> float:
    found = float(function(place))
    if isnan(found):
        raise ValueError(f"the function is not a number at {place}")
    return found


def _opposite(a: float, b: float) -> bool:
    return copysign(1.0, a) != copysign(1.0, b)


def _interpolated(before: float, now: float, far: float, at_before: float, at_now: float, at_far: float) -> float:
    """Step to the zero of a line through two of the values, or of the inverse quadratic function through three."""
    if before == far:
        return -at_now * (now - before) / (at_now - at_before)
    to_before = (at_before - at_now) / (before - now)
    to_far = (at_far - at_now) / (far - now)
    return -at_now * (at_far * to_far - at_before * to_before) / (to_far * to_before * (at_far - at_before))
