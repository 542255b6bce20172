"""What each key of a table is, in a sentence: the string that stands below the field in the table's class.

It is read from the source where it is asked for, so that reading a job costs nothing. A table of another package may say it
so too, or as ``Field(description=…)``.
"""

from __future__ import annotations

import ast
import inspect
import re
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel

_UNITS: Mapping[str, str] = {
    "k_per_h": "K/h", "per_k": "1/K", "um_per_m": "µm/m", "mm_s": "mm/s", "arcsec": "″", "um": "µm", "mm": "mm", "min": "min",
    "deg": "°", "ppm": "ppm", "hpa": "hPa", "pct": "%", "c": "°C", "k": "K", "h": "h", "s": "s",
}  # fmt: skip
"""By the ending of a key's or a column's name, longer endings first."""


@cache
def sentences(table: type[BaseModel]) -> Mapping[str, str]:
    """Sentence of each key of a table, by the key as job.toml has it; empty where there is none."""
    told: dict[str, str] = {}
    for base in reversed(table.__mro__):
        if issubclass(base, BaseModel):
            told |= _written_below(base)
    return {field.alias or name: field.description or told.get(name, "") for name, field in table.model_fields.items()}


def unit_of(name: str) -> str:
    """Unit that the name of a key or a column ends with; empty where it has none."""
    for ending, shown in _UNITS.items():
        if name.endswith(f"_{ending}"):
            return shown
    return ""


def tables_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """Tables that a value of this annotation may be, or may hold."""
    if get_origin(annotation) is Annotated:
        annotation = get_args(annotation)[0]
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    elif get_origin(annotation) in (Union, UnionType, list, dict):
        for part in get_args(annotation):
            yield from tables_in(part)


def _written_below(table: type[BaseModel]) -> dict[str, str]:
    node = _classes(table.__module__).get(table.__qualname__)
    if node is None:  # made while the program runs
        return {}
    found = {}
    for field, below in zip(node.body, node.body[1:], strict=False):
        if (
            isinstance(field, ast.AnnAssign)
            and isinstance(field.target, ast.Name)
            and isinstance(below, ast.Expr)
            and isinstance(below.value, ast.Constant)
            and isinstance(below.value.value, str)
        ):
            found[field.target.id] = re.sub(r"\s+", " ", below.value.value)
    return found


@cache
def _classes(module: str) -> Mapping[str, ast.ClassDef]:
    """Classes at the top of a module, by name; none where its source is not there."""
    try:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
    except (OSError, TypeError, KeyError, SyntaxError):
        return {}
    return {node.name: node for node in tree.body if isinstance(node, ast.ClassDef)}
