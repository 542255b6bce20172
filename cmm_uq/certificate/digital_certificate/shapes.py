"""What a value of results.json is: a number, a quantity, a budget, a covariance matrix, a curve; whatever a kind reports."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from decimal import Decimal
from typing import Any

_SHORT = 4
"""Numbers of a list that stand in columns of their own: a point, a direction."""

_ILLEGAL = re.compile(r"[^A-Za-z0-9_.\-]")
_BUDGET = {"value", "u", "U", "k", "dof", "unit", "budget"}
_LINE = {"input", "value", "u", "unit", "distribution", "dof", "sensitivity", "contribution", "share", "source"}


def decimal(value: float) -> Decimal:
    """A number as results.json has it."""
    return Decimal(repr(value)) if isinstance(value, float) else Decimal(value)


def plain_name(text: str) -> str:
    """Without what an id cannot have."""
    return _ILLEGAL.sub("_", text)


def is_number(value: object) -> bool:
    """Whether it is one; true and false are not."""
    return isinstance(value, int | float) and not isinstance(value, bool)


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


def are_numbers(values: object, count: int | None = None) -> bool:
    """Whether it is a list of numbers, of so many where that is said."""
    return isinstance(values, list) and all(map(is_number, values)) and (count is None or len(values) == count)


def is_budget(data: Mapping[str, Any]) -> bool:
    """Whether it is a budget of uncertainty, with its lines."""
    lines = data.get("budget")
    return (
        data.keys() >= _BUDGET and isinstance(lines, list) and bool(lines)
        and all(isinstance(line, Mapping) and line.keys() >= _LINE for line in lines)
    )  # fmt: skip


def is_matrix(data: Mapping[str, Any]) -> bool:
    """Whether it is a covariance matrix with names and units of its rows."""
    if data.keys() != {"parameters", "units", "matrix"} or not all(isinstance(one, list) for one in data.values()):
        return False
    count = len(data["units"])
    return len(data["matrix"]) == count and all(are_numbers(row, count) for row in data["matrix"])


def is_curve(value: Any, u: Any, interval: Any) -> bool:
    """Whether these are the points of a curve with u and interval of each."""
    if not are_numbers(value) or not value or not isinstance(interval, list) or len(interval) != 2:
        return False
    low, high = interval
    return (
        all(are_numbers(one, len(value)) for one in (u, low, high))
        and min(u) >= 0 and all(one <= other for one, other in zip(low, high, strict=True))
    )  # fmt: skip


def decimals(values: Sequence[float]) -> tuple[Decimal, ...]:
    """Numbers as results.json has them."""
    return tuple(decimal(value) for value in values)


def plain_cell(value: Any) -> bool:
    """Whether a table can have it in one column, or in one for each number of a point."""
    if isinstance(value, list):
        return 0 < len(value) <= _SHORT and are_numbers(value)
    return not isinstance(value, Mapping) or (is_quantity(value) and value["value"] is not None)
