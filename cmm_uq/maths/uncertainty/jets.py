"""Numbers that carry their derivatives: exact first and second derivatives of any function made of NumPy's functions.

A :class:`Jet` behaves in arithmetic and in NumPy's elementary functions as its value does (a float or an array of
points), and applies the chain rule beside it (truncated Taylor arithmetic: Griewank and Walther, Evaluating
Derivatives, 2008, ch. 13). Derivatives are kept only for the inputs that a quantity depends on, each as wide as it must
be, so that the cost follows the structure of the model. They are exact to rounding: there is no step to choose.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.uncertainty.elementary_functions import COMPARISONS, ONE, TWO, Operand, Partial, value_of

First = dict[int, Operand]
Second = dict[tuple[int, int], Operand]


class Jet(NDArrayOperatorsMixin):
    """A quantity with its derivatives by numbered inputs.

    Parameters
    ----------
    value : float or array (n,).
    first : derivative by input k, for the inputs that the quantity depends on.
    second : second derivative by inputs (k, l), k ≤ l; ``None`` when only first derivatives are carried.
    """

    __slots__ = ("first", "second", "value")

    def __init__(self, value: Operand, first: First, second: Second | None) -> None:
        self.value, self.first, self.second = value, first, second

    @classmethod
    def variable(cls, value: Operand, index: int, order: int) -> Jet:
        """Input number ``index`` itself; ``order`` 1 or 2 says which derivatives are carried."""
        return cls(value, {index: 1.0}, {} if order > 1 else None)

    def __repr__(self) -> str:
        return f"Jet({self.value!r}, {self.first!r}, {self.second!r})"

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *operands: Operand, **options: Any) -> Any:
        if method != "__call__" or options:
            raise _unknown(f"numpy.{ufunc.__name__}.{method}" if method != "__call__" else f"numpy.{ufunc.__name__}")
        if ufunc in ONE:
            rule = ONE[ufunc]
            f = value_of(ufunc, self.value)
            bent = rule.second if self.second is not None else None
            return _compose(self, f, rule.first(self.value, f), bent and bent(self.value, f))
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
    rule, xv, yv = TWO[ufunc], _value(x), _value(y)
    f = value_of(ufunc, xv, yv)

    def at(partial: Partial | None) -> Operand | None:
        return partial and partial(xv, yv, f)

    if not isinstance(y, Jet):
        return _compose(x, f, at(rule.x), at(rule.xx) if x.second is not None else None)
    if not isinstance(x, Jet):
        return _compose(y, f, at(rule.y), at(rule.yy) if y.second is not None else None)
    first = _sum(_scaled(x.first, at(rule.x)), _scaled(y.first, at(rule.y)))
    if x.second is None or y.second is None:
        return Jet(f, first, None)
    second = _sum(_scaled(x.second, at(rule.x)), _scaled(y.second, at(rule.y)))
    for partial, a, b in ((rule.xx, x.first, x.first), (rule.xy, x.first, dict(y.first)), (rule.yy, y.first, y.first)):
        if partial is not None:
            second = _sum(second, _scaled(_products(a, b), at(partial)))
    return Jet(f, first, second)


def _where(condition: Operand, x: Operand, y: Operand) -> Jet:
    def chosen(a: Mapping[Any, Operand], b: Mapping[Any, Operand]) -> dict[Any, Operand]:
        return {key: np.where(condition, a.get(key, 0.0), b.get(key, 0.0)) for key in {**a, **b}}

    xs, ys = (operand if isinstance(operand, Jet) else Jet(operand, {}, {}) for operand in (x, y))
    second = None if xs.second is None or ys.second is None else chosen(xs.second, ys.second)
    return Jet(np.where(condition, xs.value, ys.value), chosen(xs.first, ys.first), second)
