"""Partial derivatives of NumPy's elementary functions, first and second.

One table for functions of one argument, one for functions of two. ``f`` is the function's value at the argument, passed
on so that nothing is computed twice; ``None`` stands for a derivative that is zero everywhere. The rules hold for
complex arguments too (a step along the imaginary axis differentiates once more), where NumPy itself would be in the way
for the absolute value, the arc tangent of two arguments and the hypotenuse, which :data:`COMPLEX` therefore defines.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import log
from typing import Any

import numpy as np

Operand = Any
"""A float or an array, real or complex."""

Partial = Callable[..., Operand]


@dataclass(frozen=True)
class OneArgument:
    """Derivatives of f(x): ``first(x, f)`` and ``second(x, f)``."""

    first: Partial
    second: Partial | None


@dataclass(frozen=True)
class TwoArguments:
    """Partial derivatives of f(x, y), each a function of (x, y, f)."""

    x: Partial
    y: Partial
    xx: Partial | None
    xy: Partial | None
    yy: Partial | None


def _power_term(coefficient: Operand, x: Operand, exponent: Operand) -> Operand:
    """``coefficient * x**exponent``, zero where the coefficient is, whatever the power would give."""
    if np.ndim(coefficient) == 0:
        return coefficient * x**exponent if coefficient else 0.0
    return np.where(coefficient == 0, 0.0, coefficient * x**exponent)


def sign(x: Operand) -> Operand:
    """-1, 0 or 1 by the real part."""
    return np.sign(np.real(x))


LN2, LN10 = log(2.0), log(10.0)

ONE: Mapping[np.ufunc, OneArgument] = {
    np.negative: OneArgument(lambda _x, _f: -1.0, None),
    np.positive: OneArgument(lambda _x, _f: 1.0, None),
    np.absolute: OneArgument(lambda x, _f: sign(x), None),
    np.square: OneArgument(lambda x, _f: 2.0 * x, lambda _x, _f: 2.0),
    np.reciprocal: OneArgument(lambda _x, f: -f * f, lambda _x, f: 2.0 * f * f * f),
    np.sqrt: OneArgument(lambda _x, f: 0.5 / f, lambda x, f: -0.25 / (f * x)),
    np.cbrt: OneArgument(lambda _x, f: 1.0 / (3.0 * f * f), lambda x, f: -2.0 / (9.0 * f * f * x)),
    np.exp: OneArgument(lambda _x, f: f, lambda _x, f: f),
    np.exp2: OneArgument(lambda _x, f: LN2 * f, lambda _x, f: LN2 * LN2 * f),
    np.expm1: OneArgument(lambda _x, f: f + 1.0, lambda _x, f: f + 1.0),
    np.log: OneArgument(lambda x, _f: 1.0 / x, lambda x, _f: -1.0 / (x * x)),
    np.log2: OneArgument(lambda x, _f: 1.0 / (LN2 * x), lambda x, _f: -1.0 / (LN2 * x * x)),
    np.log10: OneArgument(lambda x, _f: 1.0 / (LN10 * x), lambda x, _f: -1.0 / (LN10 * x * x)),
    np.log1p: OneArgument(lambda x, _f: 1.0 / (1.0 + x), lambda x, _f: -1.0 / ((1.0 + x) * (1.0 + x))),
    np.sin: OneArgument(lambda x, _f: np.cos(x), lambda _x, f: -f),
    np.cos: OneArgument(lambda x, _f: -np.sin(x), lambda _x, f: -f),
    np.tan: OneArgument(lambda _x, f: 1.0 + f * f, lambda _x, f: 2.0 * f * (1.0 + f * f)),
    np.arcsin: OneArgument(lambda x, _f: 1.0 / np.sqrt(1.0 - x * x), lambda x, _f: x / (1.0 - x * x) ** 1.5),
    np.arccos: OneArgument(lambda x, _f: -1.0 / np.sqrt(1.0 - x * x), lambda x, _f: -x / (1.0 - x * x) ** 1.5),
    np.arctan: OneArgument(lambda x, _f: 1.0 / (1.0 + x * x), lambda x, _f: -2.0 * x / (1.0 + x * x) ** 2),
    np.sinh: OneArgument(lambda x, _f: np.cosh(x), lambda _x, f: f),
    np.cosh: OneArgument(lambda x, _f: np.sinh(x), lambda _x, f: f),
    np.tanh: OneArgument(lambda _x, f: 1.0 - f * f, lambda _x, f: -2.0 * f * (1.0 - f * f)),
    np.arcsinh: OneArgument(lambda x, _f: 1.0 / np.sqrt(1.0 + x * x), lambda x, _f: -x / (1.0 + x * x) ** 1.5),
    np.arccosh: OneArgument(lambda x, _f: 1.0 / np.sqrt(x * x - 1.0), lambda x, _f: -x / (x * x - 1.0) ** 1.5),
    np.arctanh: OneArgument(lambda x, _f: 1.0 / (1.0 - x * x), lambda x, _f: 2.0 * x / (1.0 - x * x) ** 2),
    np.deg2rad: OneArgument(lambda _x, _f: np.pi / 180.0, None),
    np.radians: OneArgument(lambda _x, _f: np.pi / 180.0, None),
    np.rad2deg: OneArgument(lambda _x, _f: 180.0 / np.pi, None),
    np.degrees: OneArgument(lambda _x, _f: 180.0 / np.pi, None),
}

TWO: Mapping[np.ufunc, TwoArguments] = {
    np.add: TwoArguments(lambda _x, _y, _f: 1.0, lambda _x, _y, _f: 1.0, None, None, None),
    np.subtract: TwoArguments(lambda _x, _y, _f: 1.0, lambda _x, _y, _f: -1.0, None, None, None),
    np.multiply: TwoArguments(lambda _x, y, _f: y, lambda x, _y, _f: x, None, lambda _x, _y, _f: 1.0, None),
    np.divide: TwoArguments(
        lambda _x, y, _f: 1.0 / y,
        lambda _x, y, f: -f / y,
        None,
        lambda _x, y, _f: -1.0 / (y * y),
        lambda _x, y, f: 2.0 * f / (y * y),
    ),
    np.power: TwoArguments(
        lambda x, y, _f: _power_term(y, x, y - 1.0),
        lambda x, _y, f: f * np.log(x),
        lambda x, y, _f: _power_term(y * (y - 1.0), x, y - 2.0),
        lambda x, y, _f: x ** (y - 1.0) * (1.0 + y * np.log(x)),
        lambda x, _y, f: f * np.log(x) ** 2,
    ),
    np.arctan2: TwoArguments(
        lambda x, y, _f: y / (x * x + y * y),
        lambda x, y, _f: -x / (x * x + y * y),
        lambda x, y, _f: -2.0 * x * y / (x * x + y * y) ** 2,
        lambda x, y, _f: (x * x - y * y) / (x * x + y * y) ** 2,
        lambda x, y, _f: 2.0 * x * y / (x * x + y * y) ** 2,
    ),
    np.hypot: TwoArguments(
        lambda x, _y, f: x / f,
        lambda _x, y, f: y / f,
        lambda _x, y, f: y * y / (f * f * f),
        lambda x, y, f: -x * y / (f * f * f),
        lambda x, _y, f: x * x / (f * f * f),
    ),
}

COMPARISONS = frozenset({
    np.less, np.less_equal, np.greater, np.greater_equal, np.equal, np.not_equal,
    np.isfinite, np.isnan, np.isinf, np.sign, np.signbit,
})  # fmt: skip
"""Functions that see only the value and are flat wherever they have a derivative."""


def _complex_arctan2(x: Operand, y: Operand) -> Operand:
    a, b = np.real(x), np.real(y)
    return np.arctan2(a, b) + 1j * (b * np.imag(x) - a * np.imag(y)) / (a * a + b * b)


COMPLEX: Mapping[np.ufunc, Callable[..., Operand]] = {
    np.absolute: lambda x: np.where(np.real(x) < 0, -x, x),
    np.cbrt: lambda x: sign(x) * np.power(sign(x) * x, 1.0 / 3.0),
    np.arctan2: _complex_arctan2,
    np.hypot: lambda x, y: np.sqrt(x * x + y * y),
    np.deg2rad: lambda x: x * (np.pi / 180.0),
    np.radians: lambda x: x * (np.pi / 180.0),
    np.rad2deg: lambda x: x * (180.0 / np.pi),
    np.degrees: lambda x: x * (180.0 / np.pi),
}
"""Analytic continuations, exact to first order in an imaginary part that is negligible beside the real part."""


def value_of(ufunc: np.ufunc, *arguments: Operand) -> Operand:
    """The function's value, for complex arguments by its analytic continuation."""
    if ufunc in COMPLEX and any(np.iscomplexobj(argument) for argument in arguments):
        return COMPLEX[ufunc](*arguments)
    if ufunc is np.power:  # the operator knows squares and square roots, the function does not
        return arguments[0] ** arguments[1]
    return ufunc(*arguments)
