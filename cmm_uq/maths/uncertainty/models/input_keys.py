"""Inputs of a model file: distributions from their keys; units checked, converted, carried through an expression by pint.

Inside a model, numbers are in the units stated for them. The unit of an output follows where the expression says it; a
number written in an expression takes whatever unit makes a sum consistent, so a unit is derived only where it is certain.
"""

from __future__ import annotations

import re
import tokenize
from collections.abc import Callable, Mapping
from math import sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.units import pint_units
from cmm_uq.maths.uncertainty import distributions as make
from cmm_uq.maths.uncertainty.distributions import Distribution
from cmm_uq.maths.uncertainty.models.expression import Expression
from cmm_uq.maths.uncertainty.type_a import repeated_readings

if TYPE_CHECKING:
    import pint

Keys = Mapping[str, Any]

ABSOLUTE = frozenset({"value", "low", "high", "samples"})
DIFFERENCES = frozenset({"u", "half_width", "limit", "expanded"})
PLAIN = frozenset({"dof", "beta", "coverage_factor"})
NUMERIC = ABSOLUTE | DIFFERENCES | PLAIN

_AGREEMENT = 1e-9


def distribution_from(kind: str, keys: Keys) -> Distribution:
    """Distribution by its name in JCGM 101:2008 table 1, ``sampled`` or ``constant``, from any of :data:`NUMERIC`."""
    allowed, build = KINDS[kind]
    for key in keys:
        if key not in allowed:
            raise CmmUqError(f"{key!r} does not belong to a {kind} distribution", fix=f"It takes {', '.join(allowed)}")
    return build(keys)


def _need(keys: Keys, *names: str) -> list[Any]:
    for name in names:
        if name not in keys:
            raise CmmUqError(f"{name!r} is missing", fix=f"Give {' and '.join(names)}")
    return [keys[name] for name in names]


def _exclude(keys: Keys, given: str, *others: str) -> None:
    for other in others:
        if other in keys:
            raise CmmUqError(f"{given!r} and {other!r} contradict each other", fix=f"Leave out {other}")


def _must_agree(what: str, a: float, b: float, scale: float) -> None:
    if abs(a - b) > _AGREEMENT * abs(scale):
        raise CmmUqError(f"{what}: {a} and {b}", fix="Leave one of the contradicting keys out")


def _standard_uncertainty(keys: Keys) -> float:
    """Standard uncertainty as given, or from a certificate's expanded uncertainty."""
    if "expanded" not in keys:
        return float(_need(keys, "u")[0])
    _exclude(keys, "expanded", "u")
    expanded, factor = _need(keys, "expanded", "coverage_factor")
    if not factor > 0:
        raise CmmUqError(f"a coverage factor of {factor}", fix="It is positive, often 2")
    return float(expanded / factor)


def _normal(keys: Keys) -> Distribution:
    if "samples" in keys:
        mean = _readings(keys)
        return make.normal(mean.mean, mean.u, mean.dof)
    (value,) = _need(keys, "value")
    return make.normal(value, _standard_uncertainty(keys), keys.get("dof", np.inf))


def _student_t(keys: Keys) -> Distribution:
    if "samples" in keys:
        return _readings(keys)
    value, dof = _need(keys, "value", "dof")
    return make.student_t(value, _standard_uncertainty(keys), dof)


def _readings(keys: Keys) -> Distribution:
    _exclude(keys, "samples", "value", "u", "expanded", "coverage_factor")
    found = repeated_readings(keys["samples"])
    if "dof" in keys:
        _must_agree("dof and the number of readings", keys["dof"], float(found.dof), 1.0)
    return found


def _limits(keys: Keys, ratio: float) -> tuple[float, float]:
    """Limits from ``low, high``, ``value, half_width`` or ``value, u``; ``ratio`` = half-width over u."""
    if "low" in keys or "high" in keys:
        low, high = _need(keys, "low", "high")
        middle, half_width = (low + high) / 2, (high - low) / 2
    elif "half_width" in keys:
        middle, half_width = _need(keys, "value", "half_width")
    else:
        middle, half_width = _need(keys, "value", "u")
        half_width = half_width * ratio
    _must_agree("value and the middle of the limits", keys.get("value", middle), middle, half_width)
    _must_agree("half_width and the limits", keys.get("half_width", half_width), half_width, half_width)
    _must_agree("u and the limits", keys.get("u", half_width / ratio), half_width / ratio, half_width)
    return (keys["low"], keys["high"]) if "low" in keys else (middle - half_width, middle + half_width)


def _bounded(build: Callable[..., Distribution], variance: float) -> Callable[[Keys], Distribution]:
    return lambda keys: build(*_limits(keys, 1 / sqrt(variance)), dof=keys.get("dof", np.inf))


def _trapezoidal(keys: Keys) -> Distribution:
    (beta,) = _need(keys, "beta")
    if not 0 <= beta <= 1:
        raise CmmUqError(f"beta is {beta}", fix="The ratio of top to base lies between 0 and 1")
    low, high = _limits(keys, sqrt(6 / (1 + beta**2)))
    return make.trapezoidal(low, high, beta, keys.get("dof", np.inf))


def _rectangular_uncertain(keys: Keys) -> Distribution:
    """The doubt of the limits as ``limit``, as ``beta`` (of the half-width), or as ``dof`` (JCGM 100 G.4.2).

    Beside ``low`` and ``high``, a ``half_width`` smaller than half their distance is that of the limits' own interval.
    """
    given = dict(keys)
    if {"low", "high", "half_width"} <= set(given) and given["half_width"] < (given["high"] - given["low"]) / 2:
        _exclude(given, "half_width", "limit")
        given["limit"] = given.pop("half_width")
    low, high = _limits(given, sqrt(3))
    half_width = (high - low) / 2
    if "limit" in given:
        _exclude(given, "limit", "beta")
        return make.rectangular_uncertain(low, high, given["limit"], given.get("dof"))
    if "beta" in given:
        return make.rectangular_uncertain(low, high, given["beta"] * half_width, given.get("dof"))
    (dof,) = _need(given, "dof")
    if not dof >= 1:
        raise CmmUqError(f"{dof} degrees of freedom", fix="One is the least that an uncertainty can have")
    return make.rectangular_uncertain(low, high, half_width / sqrt(2 * dof), dof)


def _exponential(keys: Keys) -> Distribution:
    (value,) = _need(keys, "value")
    _must_agree("an exponential distribution has u = value", keys.get("u", value), value, value)
    return make.exponential(value)


def _gamma(keys: Keys) -> Distribution:
    if "samples" in keys:
        _exclude(keys, "samples", "value")
        counts = np.asarray(keys["samples"], dtype=np.float64)
        if np.any(counts < 0):
            raise CmmUqError("a count is negative", fix="Give the numbers of events seen")
        return make.gamma(float(counts.sum()), len(counts))
    (count,) = _need(keys, "value")
    return make.gamma(count)


_LIMITS = ("value", "low", "high", "half_width", "u")

KINDS: Mapping[str, tuple[tuple[str, ...], Callable[[Keys], Distribution]]] = {
    "normal": (("value", "u", "dof", "expanded", "coverage_factor", "samples"), _normal),
    "t": (("value", "u", "dof", "expanded", "coverage_factor", "samples"), _student_t),
    "rectangular": ((*_LIMITS, "dof"), _bounded(make.rectangular, 1 / 3)),
    "rectangular_uncertain": ((*_LIMITS, "limit", "beta", "dof"), _rectangular_uncertain),
    "trapezoidal": ((*_LIMITS, "beta", "dof"), _trapezoidal),
    "triangular": ((*_LIMITS, "dof"), _bounded(make.triangular, 1 / 6)),
    "arcsine": ((*_LIMITS, "dof"), _bounded(make.arcsine, 1 / 2)),
    "exponential": (("value", "u"), _exponential),
    "gamma": (("value", "samples"), _gamma),
    "sampled": (("samples",), lambda keys: make.sampled(_need(keys, "samples")[0])),
    "constant": (("value",), lambda keys: make.constant(_need(keys, "value")[0])),
}


_LONGEST = 60
_SPELLED = re.compile(r"[\w\s.*/^()·%°′″µμΩ−+\-⁰¹²³⁴⁵⁶⁷⁸⁹⁻]*")
_POWER = re.compile(r"(?:\*\*|\^)\s*\(?\s*[-−+]?\d{1,2}(?:[./]\d{1,2})?\s*\)?(?!\s*(?:\*\*|\^|\d))")
# what is left of a unit without its powers must hold no further power, and no number but 1: pint would compute it
_NOT_PLAIN = re.compile(r"\*\*|\^|(?<!\w)(?!1\b)\d|[⁰¹²³⁴⁵⁶⁷⁸⁹⁻]{4,}")
_QUANTITY = re.compile(r"\s*([-+−]?[0-9]+(?:\.[0-9]*)?(?:[eE][-+]?[0-9]+)?)\s*(.*)", re.DOTALL)
_OF_PINT = AttributeError, ValueError, TypeError, AssertionError, SyntaxError, KeyError, ZeroDivisionError
_CELSIUS = re.compile(r"\b(?:degC|celsius|degree_Celsius)\b|°C")


def unit_of(text: str, where: str | None = None) -> pint.Unit:
    import pint

    problem = f"{text[:_LONGEST]!r} is no known unit"
    fix = "Write it as in mm, µm/m, 1/K, degC, kg/m^3, percent"
    if len(text) > _LONGEST or not _SPELLED.fullmatch(text) or _NOT_PLAIN.search(_POWER.sub("", text)):
        raise CmmUqError(problem, where=where, fix=fix)
    try:
        return pint_units().Unit(text.strip().replace("−", "-"))
    except (pint.PintError, tokenize.TokenError, *_OF_PINT) as error:
        raise CmmUqError(problem, where=where, fix=fix) from error


def number_in(text: str, unit: str, *, difference: bool, where: str | None = None) -> float:
    """Number of a quantity such as ``"25 nm"`` in another unit; of a difference (width, uncertainty) °C and K are the same."""
    import pint

    quantity = _QUANTITY.fullmatch(text)
    if not quantity or not unit:
        fix = "Write a number, or a number with a unit beside `unit`"
        raise CmmUqError(f"{text[:_LONGEST]!r} is no number", where=where, fix=fix)
    spelled = (_CELSIUS.sub("kelvin", each) if difference else each for each in (quantity[2], unit))
    number = float(quantity[1].replace("−", "-"))
    try:
        written, other = (unit_of(each, where) for each in spelled)
        converted = pint_units().Quantity(number, written).to(other)
    except pint.PintError as error:
        raise CmmUqError(f"{text!r} cannot be expressed in {unit}", where=where, fix="Mend one of the units") from error
    return float(converted.magnitude)


_ROUNDING = 1e-9  # of a factor between two units


class _UndeterminedError(Exception):
    """The expression does not say its unit."""


class _Number(float):
    """A number written in the expression: without unit as a factor, of any unit as a term."""


def derived_unit(expression: Expression, units: Mapping[str, str]) -> str | None:
    """Unit of an expression from those of its quantities, as text; None where it is not certain.

    Terms of different units, a dimensional argument of a function, or a quantity without a stated unit leave it open.
    """
    try:
        unit = _unit_of(expression, units)
    except _UndeterminedError:
        return None
    return "1" if isinstance(unit, _Number) else f"{unit:~P}" or "1"


def contradiction(expression: Expression, units: Mapping[str, str], stated: str) -> str | None:
    """What is wrong with units of an expression whose numbers convert none: a sum of µm and mm, another unit than stated.

    Where a number other than 1 and 2 stands in it, that may be a conversion; where a unit is not stated, nothing is said.
    """
    if not expression.names or any(step.kind == "number" and step.item not in (1, 2) for step in expression.steps):
        return None
    try:
        unit = _unit_of(expression, units)
    except _UndeterminedError as error:
        return str(error) or None
    other = unit_of(_CELSIUS.sub("kelvin", stated)) if stated else unit
    return None if _alike(unit, other) else f"gives {f'{unit:~P}' or 1}, and its unit is stated as {stated}"


def _alike(a: Any, b: Any) -> bool:
    """Whether numbers in two units mean the same."""
    one = pint_units().Quantity(1.0, a)
    return bool(one.is_compatible_with(b) and abs(one.to(b).magnitude - 1.0) < _ROUNDING)


def _unit_of(expression: Expression, units: Mapping[str, str]) -> Any:
    stack: list[Any] = []
    for step in expression.steps:
        operands = stack[len(stack) - step.operands :]
        del stack[len(stack) - step.operands :]
        if step.kind == "number":
            stack.append(_Number(step.item))
        elif step.kind == "operation":
            rule: Callable[..., Any] = _RULES.get(str(step.item), _dimensionless)
            stack.append(rule(*operands))
        elif units.get(str(step.item)):
            stack.append(unit_of(_CELSIUS.sub("kelvin", units[str(step.item)])))
        else:
            raise _UndeterminedError
    return stack[0]


def _dimensionless(*operands: Any) -> Any:
    """Exponentials, logarithms and circular functions: of numbers and angles in radians only."""
    one, radian = pint_units().Unit(""), pint_units().Unit("rad")
    if not all(isinstance(operand, _Number) or operand in (one, radian) for operand in operands):
        raise _UndeterminedError
    return one


def _sum(a: Any, b: Any) -> Any:
    if isinstance(a, _Number):
        return b
    if isinstance(b, _Number) or a == b:
        return a
    if a.is_compatible_with(b) and not _alike(a, b):
        raise _UndeterminedError(f"adds {a:~P} and {b:~P} as they stand")
    raise _UndeterminedError


def _plain(unit: Any) -> Any:
    return pint_units().Unit("") if isinstance(unit, _Number) else unit


def _power(base: Any, exponent: Any) -> Any:
    if isinstance(base, _Number) and not isinstance(exponent, _Number):
        return _dimensionless(exponent)
    if isinstance(exponent, _Number):
        return _plain(base) ** float(exponent)
    return _dimensionless(base, exponent)


def _angle(a: Any, b: Any) -> Any:
    _sum(a, b)
    return pint_units().Unit("rad")


_RULES: Mapping[str, Callable[..., Any]] = {
    **dict.fromkeys(("+", "-"), _sum),
    "*": lambda a, b: _plain(a) * _plain(b),
    "/": lambda a, b: _plain(a) / _plain(b),
    "**": _power,
    **dict.fromkeys(("negative", "positive", "abs"), lambda a: a),
    "sqrt": lambda a: _plain(a) ** 0.5,
    "atan2": _angle,
}
