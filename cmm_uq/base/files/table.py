"""What the tables of job.toml, its plan and truth.toml are made of: keys that are known, and numbers within their range.

A range holds everything that a machine, an artefact or a laboratory can have, and keeps squares, sums and quotients of what
it holds within a double's range.

The sentence of a key stands beside what it is where it is left out, or below it: in schemas, reference pages, comments of a
new job and messages.
"""

from __future__ import annotations

import ast
import inspect
import re
import sys
from collections.abc import Iterable, Mapping
from functools import cache
from itertools import pairwise
from typing import Annotated, Any, Self, TypeVar, cast

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from cmm_uq.base.files.csv_table import column_problem
from cmm_uq.base.files.limits import EFFECTS, LISTED


class JobTable(BaseModel):
    """A table: no key beyond the known ones, no text where a number belongs, no NaN."""

    # most tables are never read: what checks them is made when it is first needed
    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)

    @model_validator(mode="after")
    def _without_problems(self) -> Self:
        for problem in self.problems():
            raise ValueError(problem)
        return self

    @classmethod
    def left_out(cls, sentence: str | None = None) -> Self:
        """The key of a table that need not be there, with its sentence; what checks it is not made for that."""
        return cast("Self", Field(cls.model_construct(), description=sentence))

    def problems(self) -> Iterable[str]:
        """What keys say that do not go together; the first is told."""
        return ()


Default = TypeVar("Default")


def key(default: Default, sentence: str) -> Default:
    """A key with what it is where it is left out, and its sentence."""
    field: Default = Field(default, description=sentence)
    return field


def required(sentence: str) -> Any:
    """A key that must be there, with its sentence."""
    return Field(description=sentence)


# largest coordinate or length, mm: ten metres written in micrometres, so that a mistaken unit is still told as one
LONGEST_MM = 1e7
SMALLEST_UM = 1e-6  # least standard uncertainty or limit other than 0, µm: a picometre, a hundredth of an atom
LARGEST_UM = 1e6  # largest standard uncertainty, limit or error, µm: a metre


def at_least(least: float) -> AfterValidator:
    """Refuses a positive number that is none in its unit."""

    def checked(value: float) -> float:
        if value < least:
            raise ValueError(f"must be at least {least:g}")
        return value

    return AfterValidator(checked)


def _zero_or_more_than_nothing(value: float) -> float:
    if 0 < abs(value) < SMALLEST_UM:
        raise ValueError(f"must be 0, or at least {SMALLEST_UM:g}")
    return value


def _rising(pair: list[float]) -> list[float]:
    if not pair[0] < pair[1]:
        raise ValueError("the first number must be the lower one")
    return pair


def _of_a_solid(cte: float) -> float:
    if abs(cte) > 1e-3:
        raise ValueError(f"{cte:g} is no expansion coefficient: steel has 11.5e-6 per kelvin")
    return cte


RISING = AfterValidator(_rising)  # of the ends of a range


def _plain_column(name: str) -> str:
    if problem := column_problem(name):
        raise ValueError(problem)
    return name


Position = Annotated[float, Field(ge=-LONGEST_MM, le=LONGEST_MM)]  # A coordinate, or a shift, mm
Length = Annotated[float, Field(gt=0, le=LONGEST_MM), at_least(1e-6)]  # A length, mm

Positive = Annotated[float, Field(gt=0, le=1e6), at_least(1e-3)]  # a time or a ratio that cannot be 0
Divisor = Annotated[float, Field(gt=0, le=1e12), at_least(1e-3)]  # K of A + L/K
# a limit, or a standard uncertainty that cannot be 0, µm
Limit = Annotated[float, Field(gt=0, le=LARGEST_UM), at_least(SMALLEST_UM)]
# a standard uncertainty, µm, or 0 where it does not count
Uncertainty = Annotated[float, Field(ge=0, le=LARGEST_UM), AfterValidator(_zero_or_more_than_nothing)]
Temperature = Annotated[float, Field(ge=-273.15, le=1000)]  # °C
Number = Annotated[int, Field(ge=-1_000_000_000, le=1_000_000_000)]  # of a measurement or point

# a number in a unit that only its name knows: as large as in a recording
AnyFloat = Annotated[float, Field(ge=-1e15, le=1e15)]
Expansion = Annotated[AnyFloat, AfterValidator(_of_a_solid)]  # coefficient of thermal expansion, 1/K
Column = Annotated[str, AfterValidator(_plain_column)]  # name of a recorded column
Unit = Annotated[str, Field(pattern=r"^[A-Za-z_°µ%/ ]*$", max_length=40)]  # as pint spells it
Pair = Annotated[list[Position], Field(min_length=2, max_length=2)]
Range = Annotated[Pair, RISING]
Triple = Annotated[list[Position], Field(min_length=3, max_length=3)]
Names = Annotated[list[str], Field(max_length=EFFECTS.most)]
Numbers = Annotated[list[Number], Field(max_length=LISTED.most)]


_UNITS: Mapping[str, str] = {
    "k_per_h": "K/h", "per_k": "1/K", "um_per_m": "µm/m", "mm_s": "mm/s", "arcsec": "″", "um": "µm", "mm": "mm", "min": "min",
    "deg": "°", "ppm": "ppm", "hpa": "hPa", "pct": "%", "c": "°C", "k": "K", "h": "h", "s": "s",
}  # fmt: skip
"""By the ending of a key's or a column's name, longer endings first."""


def sentences(table: type[BaseModel]) -> Mapping[str, str]:
    """Sentence of each key of a table, by the key as job.toml has it: its own, or that of the table that it stems from."""
    own: dict[str, str] = {}
    for base in reversed(table.__mro__):
        for name, field in getattr(base, "model_fields", {}).items():
            below = _below(base.__module__).get((base.__qualname__, name))
            own[name] = re.sub(r"\s+", " ", field.description or below or own.get(name, ""))
    return {field.alias or name: own[name] for name, field in table.model_fields.items()}


@cache
def _below(module: str) -> Mapping[tuple[str, str], str]:
    """Sentences below the keys of a module's tables, by table and key: from its source, so that only who tells them pays."""
    try:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
    except (OSError, TypeError, KeyError):
        return {}
    tables = [table for table in tree.body if isinstance(table, ast.ClassDef)]
    below = ((table.name, key, said) for table in tables for key, said in pairwise(table.body))
    return {
        (name, ast.unparse(key.target)): inspect.cleandoc(str(said.value.value))
        for name, key, said in below
        if isinstance(key, ast.AnnAssign) and isinstance(said, ast.Expr) and isinstance(said.value, ast.Constant)
    }


def unit_of(name: str) -> str:
    """Unit that the name of a key or a column ends with; empty where it has none."""
    return next((shown for ending, shown in _UNITS.items() if name.endswith(f"_{ending}")), "")
