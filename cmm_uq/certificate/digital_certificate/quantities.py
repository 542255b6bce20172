"""Plain figures of results.json as quantities of a digital certificate: shape, unit, uncertainty."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from decimal import Decimal
from types import MappingProxyType
from typing import Any

from cmm_uq.base.units import PRINTED, UNITS, Unit
from cmm_uq.jobs.dcc.quantities import Expanded, ExpandedList, Interval, IntervalList

ONE = UNITS["1"]
_ENDINGS: Mapping[str, Unit] = MappingProxyType({**PRINTED, "deg": UNITS["°"], "mm2": UNITS["mm²"]})
_PLAIN = ("k", "probability", "p_value", "share", "dof", "draws", "repeat", "measurement", "point", "points")
"""Keys of what has no unit, also where the key above them has one."""

_FACTOR = re.compile(r"((?:\\(?:nano|micro|milli|centi|kilo))?\\[a-z]+)(?:\\tothe\{(-?\d+)\})?")
"""A unit with its prefix, and the power of both; those of the table."""

_SHORT = 4  # numbers of a list that stand in columns of their own: a point, a direction
_ILLEGAL = re.compile(r"[^A-Za-z0-9_.\-]")
_BUDGET = {"value", "u", "U", "k", "dof", "unit", "budget"}
_LINE = {"input", "value", "u", "unit", "distribution", "dof", "sensitivity", "contribution", "share", "source"}
P95 = Decimal("0.95")
P_STANDARD = Decimal("0.6827")  # probability of a normal distribution within one standard deviation
POSTERIOR = "posterior"  # in place of a named distribution: that of the draws in posterior.npz.


def unit_of(key: str, above: Unit | None) -> Unit:
    if key in _PLAIN or key.endswith("_probability"):
        return ONE
    return named_unit(key) or above or ONE


def named_unit(key: str) -> Unit | None:
    """The unit that a key ends in: µm of ``b89_range_um``."""
    fitting = [ending for ending in _ENDINGS if key == ending or key.endswith(f"_{ending}")]
    return _ENDINGS[max(fitting, key=len)] if fitting else None


def without_unit(key: str) -> str:
    """A key in words: ``b89 range``."""
    longest = max((f"_{ending}" for ending in _ENDINGS if key.endswith(f"_{ending}")), key=len, default="")
    return key.removesuffix(longest).replace("_", " ")


def dsi_of(symbol: str) -> str:
    """A unit of results.json in D-SI; of another package, which D-SI does not know, after the bar that marks such units."""
    return UNITS[symbol].dsi if symbol in UNITS else _foreign(symbol)


def _foreign(text: str) -> str:
    """Without spaces, which would part it where it stands in a list."""
    return "|" + "_".join(text.replace("|", "").split())


def product(a: str, b: str) -> str:
    if "|" in a + b:
        return _foreign(f"{a}·{b}")
    return b if a == ONE.dsi else a if b == ONE.dsi else a + b


def ratio(a: str, b: str) -> str:
    if "|" in a + b:
        return _foreign(f"{a}/({b})")
    if a == b:
        return ONE.dsi
    powers = [] if b == ONE.dsi else [(name, -int(power or 1)) for name, power in _FACTOR.findall(b)]
    inverse = "".join(name if power == 1 else rf"{name}\tothe{{{power}}}" for name, power in powers)
    return product(a, inverse or ONE.dsi)


def decimal(value: float) -> Decimal:
    return Decimal(repr(value)) if isinstance(value, float) else Decimal(value)


def decimals(values: Sequence[float]) -> tuple[Decimal, ...]:
    return tuple(map(decimal, values))


def plain_name(text: str) -> str:
    return _ILLEGAL.sub("_", text)


def is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def are_numbers(values: object, count: int | None = None) -> bool:
    """Whether it is a list of numbers, of so many where that is said."""
    return isinstance(values, list) and all(map(is_number, values)) and (count is None or len(values) == count)


def is_quantity(value: object) -> bool:
    """Whether it has a value with its uncertainty, and is no budget."""
    if not isinstance(value, Mapping) or not {"value", "u"} <= value.keys() or "budget" in value:
        return False
    sizes, interval = [value["u"], value.get("U"), value.get("k")], value.get("interval95")
    return (
        (value["value"] is None or is_number(value["value"]))
        and all(size is None or (is_number(size) and size >= 0) for size in sizes)
        and (interval is None or (are_numbers(interval, 2) and interval[0] <= interval[1]))
    )


def is_budget(data: Mapping[str, Any]) -> bool:
    """Whether it is a budget of uncertainty, with its lines."""
    lines = data.get("budget")
    return (
        data.keys() >= _BUDGET and isinstance(lines, list) and bool(lines)
        and all(isinstance(line, Mapping) and line.keys() >= _LINE for line in lines)
    )  # fmt: skip


def is_matrix(data: Mapping[str, Any]) -> bool:
    """Whether it is a covariance matrix with names and units of its rows."""
    if data.keys() != {"parameters", "units", "matrix"} or not all(isinstance(rows, list) for rows in data.values()):
        return False
    count = len(data["units"])
    return len(data["matrix"]) == count and all(are_numbers(row, count) for row in data["matrix"])


def is_curve(value: Any, u: Any, interval: Any) -> bool:
    """Whether these are the points of a curve with u and interval of each."""
    if not are_numbers(value) or not value or not isinstance(interval, list) or len(interval) != 2:
        return False
    low, high = interval
    return (
        all(are_numbers(series, len(value)) for series in (u, low, high))
        and min(u) >= 0 and all(a <= b for a, b in zip(low, high, strict=True))
    )  # fmt: skip


def plain_cell(value: Any) -> bool:
    """Whether a table can have it in one column, or in one for each number of a point."""
    if isinstance(value, list):
        return 0 < len(value) <= _SHORT and are_numbers(value)
    return not isinstance(value, Mapping) or (is_quantity(value) and value["value"] is not None)


def expanded_of(data: Mapping[str, Any]) -> Expanded | None:
    """U with k and 95 %; where only u is known, that with k = 1; None where there is none that D-SI takes."""
    u, U, k = data["u"], data.get("U"), data.get("k")
    if not u:
        return None
    if U is None:
        return Expanded(uncertainty=decimal(u), factor=Decimal(1), probability=P_STANDARD, distribution="normal")
    if k is None or k < 1:
        return None
    distribution = POSTERIOR if "interval95" in data else None
    return Expanded(uncertainty=decimal(U), factor=decimal(k), probability=P95, distribution=distribution)


def interval_of(data: Mapping[str, Any]) -> Interval | None:
    """The 95 % coverage interval."""
    if not data.get("interval95") or data["u"] is None:
        return None
    u, low, high = decimals((data["u"], *data["interval95"]))
    return Interval(standard=u, low=low, high=high, probability=P95, distribution=POSTERIOR)


def symmetric(data: Mapping[str, Any]) -> bool:
    """Whether both sides of the interval are the same to the two digits that are printed of U."""
    value, (low, high), U = data["value"], data["interval95"], data.get("U")
    if not U:
        return bool(U == 0)
    step = 10.0 ** (math.floor(math.log10(U)) - 1)
    return bool(round((high - value) / step) == round((value - low) / step))


def spread_of(values: Sequence[Mapping[str, Any]]) -> ExpandedList | IntervalList | None:
    """Uncertainties of a column: U with k of each, or the interval of each; None where neither is known of all."""
    none = Expanded(uncertainty=Decimal(0), factor=Decimal(1), probability=P95)  # of what is known without one
    stated = [expanded_of(value) or (none if not value["u"] else None) for value in values]
    known = [spread for spread in stated if spread is not None]
    if len(known) < len(stated):
        return intervals_of(values)
    uncertainties, factors, chances = zip(
        *((each.uncertainty, each.factor, each.probability) for each in known), strict=True
    )
    return ExpandedList(uncertainties=uncertainties, factors=factors, probabilities=chances)


def intervals_of(values: Sequence[Mapping[str, Any]]) -> IntervalList | None:
    """The interval of each; None where it is not known of all. What has no uncertainty is an interval of no width."""
    known = [interval for interval in map(interval_of, values) if interval is not None]
    if len(known) < len(values):
        return None
    standards, lows, highs = zip(*((each.standard, each.low, each.high) for each in known), strict=True)
    return IntervalList(standards=standards, lows=lows, highs=highs, probabilities=(P95,))
