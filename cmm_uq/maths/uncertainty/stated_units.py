"""Units where text meets numbers: checked, converted, and carried through an expression (by pint, loaded when needed).

Inside a model, numbers are in the units stated for them. The unit of an output follows where the expression says it; a
number written in an expression takes whatever unit makes a sum consistent, so a unit is derived only where it is certain.
"""

from __future__ import annotations

import re
import tokenize
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.units import pint_units
from cmm_uq.maths.uncertainty.expression import Expression, Step

if TYPE_CHECKING:
    import pint

_LONGEST = 60
_SPELLED = re.compile(r"[\w\s.*/^()·%°′″µμΩ−+\-⁰¹²³⁴⁵⁶⁷⁸⁹⁻]*")
_POWER = re.compile(r"(?:\*\*|\^)\s*\(?\s*[-−+]?\d{1,2}(?:[./]\d{1,2})?\s*\)?(?!\s*(?:\*\*|\^|\d))")
_NOT_PLAIN = re.compile(r"\*\*|\^|(?<!\w)(?!1\b)\d|[⁰¹²³⁴⁵⁶⁷⁸⁹⁻]{4,}")
"""What is left of a unit without its powers must hold no further power, and no number but 1: pint would compute it."""
_QUANTITY = re.compile(r"\s*([-+−]?[0-9]+(?:\.[0-9]*)?(?:[eE][-+]?[0-9]+)?)\s*(.*)", re.DOTALL)
_CELSIUS = re.compile(r"\b(?:degC|celsius|degree_Celsius)\b|°C")


def unit_of(text: str, where: str | None = None) -> pint.Unit:
    """Unit by its name.

    Raises
    ------
    CmmUqError : no such unit.
    """
    import pint

    problem = f"{text[:_LONGEST]!r} is no known unit"
    fix = "Write it as in mm, µm/m, 1/K, degC, kg/m^3, percent"
    if len(text) > _LONGEST or not _SPELLED.fullmatch(text) or _NOT_PLAIN.search(_POWER.sub("", text)):
        raise CmmUqError(problem, where=where, fix=fix)
    try:
        return pint_units().Unit(text.strip().replace("−", "-"))
    except (
        pint.PintError,
        tokenize.TokenError,
        AttributeError,
        ValueError,
        TypeError,
        AssertionError,
        SyntaxError,
        KeyError,
        ZeroDivisionError,
    ) as error:
        raise CmmUqError(problem, where=where, fix=fix) from error


def number_in(text: str, unit: str, *, difference: bool, where: str | None = None) -> float:
    """Number of a quantity written with its unit, in another unit.

    Parameters
    ----------
    text : such as ``"25 nm"``.
    unit : to express it in.
    difference : whether it is a width or an uncertainty, so that °C and K are the same.

    Raises
    ------
    CmmUqError : no number, no unit, or units of different kinds.
    """
    import pint

    found = _QUANTITY.fullmatch(text)
    if not found or not unit:
        raise CmmUqError(
            f"{text[:_LONGEST]!r} is no number",
            where=where,
            fix="Write a number, or a number with a unit beside `unit`",
        )
    written, wanted = found[2], unit
    if difference:
        written, wanted = (_CELSIUS.sub("kelvin", spelled) for spelled in (written, wanted))
    number = float(found[1].replace("−", "-"))
    try:
        converted = pint_units().Quantity(number, unit_of(written, where)).to(unit_of(wanted, where))
    except pint.PintError as error:
        raise CmmUqError(f"{text!r} cannot be expressed in {unit}", where=where, fix="Mend one of the units") from error
    return float(converted.magnitude)


class _UndeterminedError(Exception):
    """The expression does not say its unit."""


class _Number(float):
    """A number written in the expression: without unit as a factor, of any unit as a term."""


def derived_unit(expression: Expression, units: Mapping[str, str]) -> str | None:
    """Unit of an expression from those of its quantities, as text; None where it is not certain.

    Terms of different units, a dimensional argument of a function, or a quantity without a stated unit leave it open.
    """
    stack: list[Any] = []
    try:
        for step in expression.steps:
            operands = stack[len(stack) - step.operands :]
            del stack[len(stack) - step.operands :]
            stack.append(_unit_of_step(step, operands, units))
    except _UndeterminedError:
        return None
    unit = stack[0]
    return "1" if isinstance(unit, _Number) else f"{unit:~P}" or "1"


def _unit_of_step(step: Step, operands: list[Any], units: Mapping[str, str]) -> Any:
    if step.kind == "number":
        return _Number(step.item)
    if step.kind == "name":
        if not units.get(str(step.item)):
            raise _UndeterminedError
        return unit_of(_CELSIUS.sub("kelvin", units[str(step.item)]))
    rule: Callable[..., Any] = _RULES.get(str(step.item), _dimensionless)
    return rule(*operands)


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
    "+": _sum,
    "-": _sum,
    "*": lambda a, b: _plain(a) * _plain(b),
    "/": lambda a, b: _plain(a) / _plain(b),
    "**": _power,
    "negative": lambda a: a,
    "positive": lambda a: a,
    "abs": lambda a: a,
    "sqrt": lambda a: _plain(a) ** 0.5,
    "atan2": _angle,
}
