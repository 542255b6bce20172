"""The measurement model: outputs as a function of inputs, what is known of them, and its exact derivatives.

A :class:`Jet` carries first and second derivatives through whatever is written with NumPy's elementary functions: it behaves
as its value does (a float or an array of points), and applies the chain rule beside it, exact to rounding (truncated Taylor
arithmetic: Griewank and Walther, Evaluating Derivatives, 2008, ch. 13). Derivatives are kept only for the inputs that a
quantity depends on, each as wide as it must be, so that the cost follows the structure of the model. The rules hold for
complex arguments too (a step along the imaginary axis differentiates once more), where NumPy itself would be in the way for
the absolute value, the arc tangent of two arguments and the hypotenuse, which :data:`COMPLEX` therefore defines.

A model that jets cannot follow (linear algebra, a foreign library) but that is analytic is differentiated by complex steps
(Squire and Trapp, SIAM Review 40, 1998), checked against a coarse real step, since a model that is not analytic would go wrong
there without a word.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from math import log
from typing import Any, Literal

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, field
from cmm_uq.maths.uncertainty.distributions import Distribution
from cmm_uq.maths.uncertainty.type_a import Correlations, correlation_matrix

Operand = Any  # a float or an array, real or complex
Partial = Callable[..., Operand]
# functions of the arguments and of the function's value f there, so that nothing is computed twice; None where zero
Rule = Partial | None


def _power_term(coefficient: Operand, x: Operand, exponent: Operand) -> Operand:
    """``coefficient * x**exponent``, zero where the coefficient is, whatever the power would give."""
    if np.ndim(coefficient) == 0:
        return coefficient * x**exponent if coefficient else 0.0
    return np.where(coefficient == 0, 0.0, coefficient * x**exponent)


def sign(x: Operand) -> Operand:
    """-1, 0 or 1 by the real part."""
    return np.sign(np.real(x))


LN2, LN10 = log(2.0), log(10.0)

# f'(x) and f"(x)
ONE: Mapping[np.ufunc, tuple[Partial, Rule]] = {
    np.negative: (lambda _x, _f: -1.0, None), np.positive: (lambda _x, _f: 1.0, None),
    np.absolute: (lambda x, _f: sign(x), None), np.square: (lambda x, _f: 2.0 * x, lambda _x, _f: 2.0),
    np.reciprocal: (lambda _x, f: -f * f, lambda _x, f: 2.0 * f * f * f),
    np.sqrt: (lambda _x, f: 0.5 / f, lambda x, f: -0.25 / (f * x)),
    np.cbrt: (lambda _x, f: 1.0 / (3.0 * f * f), lambda x, f: -2.0 / (9.0 * f * f * x)),
    np.exp: (lambda _x, f: f, lambda _x, f: f), np.exp2: (lambda _x, f: LN2 * f, lambda _x, f: LN2 * LN2 * f),
    np.expm1: (lambda _x, f: f + 1.0, lambda _x, f: f + 1.0),
    np.log: (lambda x, _f: 1.0 / x, lambda x, _f: -1.0 / (x * x)),
    np.log2: (lambda x, _f: 1.0 / (LN2 * x), lambda x, _f: -1.0 / (LN2 * x * x)),
    np.log10: (lambda x, _f: 1.0 / (LN10 * x), lambda x, _f: -1.0 / (LN10 * x * x)),
    np.log1p: (lambda x, _f: 1.0 / (1.0 + x), lambda x, _f: -1.0 / ((1.0 + x) * (1.0 + x))),
    np.sin: (lambda x, _f: np.cos(x), lambda _x, f: -f), np.cos: (lambda x, _f: -np.sin(x), lambda _x, f: -f),
    np.tan: (lambda _x, f: 1.0 + f * f, lambda _x, f: 2.0 * f * (1.0 + f * f)),
    np.arcsin: (lambda x, _f: 1.0 / np.sqrt(1.0 - x * x), lambda x, _f: x / (1.0 - x * x) ** 1.5),
    np.arccos: (lambda x, _f: -1.0 / np.sqrt(1.0 - x * x), lambda x, _f: -x / (1.0 - x * x) ** 1.5),
    np.arctan: (lambda x, _f: 1.0 / (1.0 + x * x), lambda x, _f: -2.0 * x / (1.0 + x * x) ** 2),
    np.sinh: (lambda x, _f: np.cosh(x), lambda _x, f: f), np.cosh: (lambda x, _f: np.sinh(x), lambda _x, f: f),
    np.tanh: (lambda _x, f: 1.0 - f * f, lambda _x, f: -2.0 * f * (1.0 - f * f)),
    np.arcsinh: (lambda x, _f: 1.0 / np.sqrt(1.0 + x * x), lambda x, _f: -x / (1.0 + x * x) ** 1.5),
    np.arccosh: (lambda x, _f: 1.0 / np.sqrt(x * x - 1.0), lambda x, _f: -x / (x * x - 1.0) ** 1.5),
    np.arctanh: (lambda x, _f: 1.0 / (1.0 - x * x), lambda x, _f: 2.0 * x / (1.0 - x * x) ** 2),
    **dict.fromkeys((np.deg2rad, np.radians), (lambda _x, _f: np.pi / 180.0, None)),
    **dict.fromkeys((np.rad2deg, np.degrees), (lambda _x, _f: 180.0 / np.pi, None)),
}  # fmt: skip

# by x, y, xx, xy, yy
TWO: Mapping[np.ufunc, tuple[Partial, Partial, Rule, Rule, Rule]] = {
    np.add: (lambda _x, _y, _f: 1.0, lambda _x, _y, _f: 1.0, None, None, None),
    np.subtract: (lambda _x, _y, _f: 1.0, lambda _x, _y, _f: -1.0, None, None, None),
    np.multiply: (lambda _x, y, _f: y, lambda x, _y, _f: x, None, lambda _x, _y, _f: 1.0, None),
    np.divide: (
        lambda _x, y, _f: 1.0 / y,
        lambda _x, y, f: -f / y,
        None,
        lambda _x, y, _f: -1.0 / (y * y),
        lambda _x, y, f: 2.0 * f / (y * y),
    ),
    np.power: (
        lambda x, y, _f: _power_term(y, x, y - 1.0),
        lambda x, _y, f: f * np.log(x),
        lambda x, y, _f: _power_term(y * (y - 1.0), x, y - 2.0),
        lambda x, y, _f: x ** (y - 1.0) * (1.0 + y * np.log(x)),
        lambda x, _y, f: f * np.log(x) ** 2,
    ),
    np.arctan2: (
        lambda x, y, _f: y / (x * x + y * y),
        lambda x, y, _f: -x / (x * x + y * y),
        lambda x, y, _f: -2.0 * x * y / (x * x + y * y) ** 2,
        lambda x, y, _f: (x * x - y * y) / (x * x + y * y) ** 2,
        lambda x, y, _f: 2.0 * x * y / (x * x + y * y) ** 2,
    ),
    np.hypot: (
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
    **dict.fromkeys((np.deg2rad, np.radians), lambda x: x * (np.pi / 180.0)),
    **dict.fromkeys((np.rad2deg, np.degrees), lambda x: x * (180.0 / np.pi)),
}
"""Analytic continuations, exact to first order in an imaginary part that is negligible beside the real part."""


def value_of(ufunc: np.ufunc, *arguments: Operand) -> Operand:
    """The function's value, for complex arguments by its analytic continuation."""
    if ufunc in COMPLEX and any(np.iscomplexobj(argument) for argument in arguments):
        return COMPLEX[ufunc](*arguments)
    if ufunc is np.power:  # the operator knows squares and square roots, the function does not
        return arguments[0] ** arguments[1]
    return ufunc(*arguments)


First = dict[int, Operand]  # derivative by input k, for the inputs that a quantity depends on
Second = dict[tuple[int, int], Operand]  # by inputs (k, l), k ≤ l


class Jet(NDArrayOperatorsMixin):
    """A quantity, float or array (n,), with its derivatives; ``second`` is None when only first ones are carried."""

    __slots__ = ("first", "second", "value")

    def __init__(self, value: Operand, first: First, second: Second | None) -> None:
        self.value, self.first, self.second = value, first, second

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *operands: Operand, **options: Any) -> Any:
        if method != "__call__" or options:
            raise _unknown(f"numpy.{ufunc.__name__}.{method}" if method != "__call__" else f"numpy.{ufunc.__name__}")
        if ufunc in ONE:
            slope, bent = ONE[ufunc]
            f = value_of(ufunc, self.value)
            curvature = bent and bent(self.value, f) if self.second is not None else None
            return _compose(self, f, slope(self.value, f), curvature)
        if ufunc in TWO:
            return _two_arguments(ufunc, *operands)
        if ufunc in COMPARISONS:
            return ufunc(*(np.real(_value(operand)) for operand in operands))
        if ufunc in (np.maximum, np.minimum):
            x, y = operands
            return _where((x > y) if ufunc is np.maximum else (x < y), x, y)
        raise _unknown(f"numpy.{ufunc.__name__}")

    def __array_function__(self, func: Callable[..., Any], types: Any, args: Any, kwargs: Any) -> Any:
        if func is np.where and len(args) == 3 and not kwargs:
            return _where(*args)
        raise _unknown(f"numpy.{func.__name__}")


def _unknown(name: str) -> CmmUqError:
    return CmmUqError(
        f"the model uses {name}, of which no exact derivative is known here",
        fix="Write it with elementary functions, or differentiate the model by complex steps",
    )


def _value(operand: Operand) -> Operand:
    return operand.value if isinstance(operand, Jet) else operand


def _sum(a: Mapping[Any, Operand], b: Mapping[Any, Operand]) -> dict[Any, Operand]:
    total = dict(a)
    for key, term in b.items():
        total[key] = total[key] + term if key in total else term
    return total


def _scaled(terms: Mapping[Any, Operand], factor: Operand) -> dict[Any, Operand]:
    if isinstance(factor, float) and factor == 1.0:
        return dict(terms)
    return {key: factor * term for key, term in terms.items()}


def _compose(x: Jet, value: Operand, slope: Operand, curvature: Operand | None) -> Jet:
    """f(x) by the chain rule, f' = slope and f'' = curvature."""
    first = _scaled(x.first, slope)
    if x.second is None:
        return Jet(value, first, None)
    second = _scaled(x.second, slope)
    if curvature is not None:
        second = _sum(second, _scaled(_products(x.first, x.first), curvature))
    return Jet(value, first, second)


def _products(a: First, b: First) -> Second:
    """Entries (i, j), i ≤ j, of abᵀ + baᵀ, or of aaᵀ when b is a itself."""
    products: Second = {}
    for i, a_i in a.items():
        for j, b_j in b.items():
            if a is b and i > j:
                continue
            key = (i, j) if i <= j else (j, i)
            term = a_i * b_j
            if i == j and a is not b:
                term = 2.0 * term
            products[key] = products[key] + term if key in products else term
    return products


def _two_arguments(ufunc: np.ufunc, x: Operand, y: Operand) -> Jet:
    by_x, by_y, by_xx, by_xy, by_yy = TWO[ufunc]
    xv, yv = _value(x), _value(y)
    f = value_of(ufunc, xv, yv)
    if not isinstance(y, Jet):
        return _compose(x, f, by_x(xv, yv, f), by_xx(xv, yv, f) if by_xx and x.second is not None else None)
    if not isinstance(x, Jet):
        return _compose(y, f, by_y(xv, yv, f), by_yy(xv, yv, f) if by_yy and y.second is not None else None)
    slope_x, slope_y = by_x(xv, yv, f), by_y(xv, yv, f)
    first = _sum(_scaled(x.first, slope_x), _scaled(y.first, slope_y))
    if x.second is None or y.second is None:
        return Jet(f, first, None)
    second = _sum(_scaled(x.second, slope_x), _scaled(y.second, slope_y))
    for rule, a, b in ((by_xx, x.first, x.first), (by_xy, x.first, dict(y.first)), (by_yy, y.first, y.first)):
        if rule is not None:
            second = _sum(second, _scaled(_products(a, b), rule(xv, yv, f)))
    return Jet(f, first, second)


def _where(condition: Operand, x: Operand, y: Operand) -> Jet:
    def chosen(a: Mapping[Any, Operand], b: Mapping[Any, Operand]) -> dict[Any, Operand]:
        return {key: np.where(condition, a.get(key, 0.0), b.get(key, 0.0)) for key in {**a, **b}}

    xs, ys = (operand if isinstance(operand, Jet) else Jet(operand, {}, {}) for operand in (x, y))
    second = None if xs.second is None or ys.second is None else chosen(xs.second, ys.second)
    return Jet(np.where(condition, xs.value, ys.value), chosen(xs.first, ys.first), second)


Function = Callable[..., Sequence[Any]]  # m quantities in, p out; each a float, an array (n,) or a jet
_IMAGINARY_STEP = 1e-40
_COARSE_STEP = 1e-2


@dataclass(frozen=True, eq=False)
class Derivatives:
    """What a model does near its estimates; ``...`` is the shape of the points, empty for a single one."""

    value: Floats  # (p, ...)
    jacobian: Floats  # (p, m, ...)
    hessian: Floats | None = None  # (p, m, m, ...) second derivatives, where they were asked for


def derivatives(function: Function, at: Sequence[Any], order: Literal[1, 2] = 1) -> Derivatives:
    """Derivatives by jets at m estimates, floats or arrays that broadcast, up to an order.

    Raises :class:`CmmUqError` where the model uses a function of which no exact derivative is known here.
    """
    outputs, shape = _jets(function, at, order), _shape(at)
    jacobian = np.zeros((len(outputs), len(at), *shape))
    for row, output in enumerate(outputs):
        for k, slope in output.first.items() if isinstance(output, Jet) else ():
            jacobian[row, k] = slope
    value = _stack([output.value if isinstance(output, Jet) else output for output in outputs], shape)
    return Derivatives(value, jacobian, _hessian(outputs, len(at), shape) if order > 1 else None)


def hessian_along(function: Function, at: Sequence[Any], direction: Sequence[Any]) -> Floats:
    """Rate of change (p, m, m, ...) of the second derivatives when the m inputs move along a direction."""
    moved = [x + _IMAGINARY_STEP * 1j * np.asarray(d) for x, d in zip(at, direction, strict=True)]
    hessian = _hessian(_jets(function, moved, 2), len(at), _shape(moved), np.complex128)
    return np.asarray(hessian.imag / _IMAGINARY_STEP)


def complex_step(function: Function, at: Sequence[Any], scale: Sequence[Any]) -> Derivatives:
    """First derivatives of an analytic model, which takes complex numbers, by complex steps.

    ``at``: m estimates, floats or arrays that broadcast. ``scale``: m positive lengths over which the model changes smoothly,
    such as the standard uncertainties. Raises :class:`CmmUqError` where the model is not analytic.
    """
    shape = _shape(at)
    value = _stack(function(*at), shape)
    jacobian = np.empty((len(value), len(at), *shape))
    for k, x in enumerate(at):
        moved = list(at)
        moved[k] = np.asarray(x) + 1j * _IMAGINARY_STEP
        outputs = np.stack([np.broadcast_to(np.asarray(y, np.complex128), shape) for y in function(*moved)])
        jacobian[:, k] = outputs.imag / _IMAGINARY_STEP
        step = _COARSE_STEP * np.asarray(scale[k])
        moved[k] = x + step
        above = _stack(function(*moved), shape)
        moved[k] = x - step
        exact, coarse = jacobian[:, k] * step, (above - _stack(function(*moved), shape)) / 2
        allowed = 1e-2 * np.maximum(np.abs(exact), np.abs(coarse)) + 1e-12 * np.abs(value)
        if np.any(np.abs(exact - coarse) > allowed):
            raise CmmUqError(
                "complex steps and real steps give different derivatives: the model is not analytic near the estimate",
                fix="Write it with NumPy's elementary functions and differentiate it by jets",
            )
    return Derivatives(value, jacobian)


def _jets(function: Function, at: Sequence[Any], order: int) -> Sequence[Any]:
    with np.errstate(all="ignore"):
        return function(*(Jet(np.asarray(x)[()], {k: 1.0}, {} if order > 1 else None) for k, x in enumerate(at)))


def _shape(at: Sequence[Any]) -> tuple[int, ...]:
    return np.broadcast_shapes(*(np.shape(x) for x in at))


def _stack(outputs: Sequence[Any], shape: tuple[int, ...]) -> Floats:
    return np.stack([np.broadcast_to(np.asarray(y, dtype=np.float64), shape) for y in outputs])


def _hessian(outputs: Sequence[Any], m: int, shape: tuple[int, ...], kind: type[np.generic] = np.float64) -> Any:
    hessian: NDArray[Any] = np.zeros((len(outputs), m, m, *shape), dtype=kind)
    for row, output in enumerate(outputs):
        for (j, k), bend in (output.second or {}).items() if isinstance(output, Jet) else ():
            hessian[row, j, k] = hessian[row, k, j] = bend
    return hessian


@dataclass(frozen=True, eq=False)
class MeasurementModel:
    """Outputs from inputs.

    ``function`` is called with the inputs by name and gives a mapping from output name to value, or, where there is one
    output, its value; it must take arrays and be written with NumPy's functions. With arrays for parameters of ``inputs`` the
    law of propagation works at all points at once. ``correlation``: coefficients of correlated pairs of inputs.
    ``differentiation``: ``"jets"`` for models of elementary functions, ``"complex_step"`` for other analytic models.
    """

    function: Callable[..., Any]
    inputs: Mapping[str, Distribution]
    outputs: Sequence[str] = ("y",)
    correlation: Correlations = field(default_factory=dict)
    differentiation: Literal["jets", "complex_step"] = "jets"

    @property
    def names(self) -> list[str]:
        return list(self.inputs)

    @property
    def means(self) -> list[Any]:
        """Of the m inputs, floats or (n,)."""
        return [given.mean for given in self.inputs.values()]

    @cached_property
    def correlation_matrix(self) -> Floats:
        """(m, m) correlation matrix of the inputs, columns of one earlier sample included."""
        within = {
            (a, b): float(np.corrcoef(np.asarray(first.draws), np.asarray(second.draws))[0, 1])
            for a, first in self.inputs.items()
            for b, second in self.inputs.items()
            if a < b and first.together and first.together == second.together
        }
        return correlation_matrix(self.names, {**within, **self.correlation})

    def must_be_at_one_point(self) -> None:
        """Refuse inputs of several values."""
        for name, given in self.inputs.items():
            if np.ndim(given.mean) or np.ndim(given.u) or np.ndim(given.dof):
                raise CmmUqError(f"{name} has several values", fix="Evaluate one point at a time, or use first_order")

    def __call__(self, *values: Any) -> tuple[Any, ...]:
        """The p outputs at the m inputs, both in order."""
        result = self.function(**dict(zip(self.inputs, values, strict=True)))
        if not isinstance(result, Mapping):
            result = {self.outputs[0]: result}
        missing = [name for name in self.outputs if name not in result]
        if missing:
            raise CmmUqError(f"the model gives no output {missing[0]!r}", fix=f"It gives {', '.join(result)}")
        return tuple(result[name] for name in self.outputs)
