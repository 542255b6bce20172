"""What a job says beside the name of a file that is imported, and units as laboratories write them.

Factors are quotients of whole numbers, so that 1.5 inch is the double nearest to 38.1 mm.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field, field_validator

from cmm_uq.base.files.limits import COLUMNS
from cmm_uq.base.files.table import Column, JobTable, key
from cmm_uq.base.points import Floats


@dataclass(frozen=True)
class WrittenUnit:
    """A unit: ``value · up / down + offset`` in the unit of its sort of quantity (mm, °C, s, hPa, %)."""

    name: str
    sort: str
    up: int = 1
    down: int = 1
    offset: float = 0.0


LENGTH, TEMPERATURE, TIME, PRESSURE, SHARE = "length", "temperature", "time", "pressure", "share"

_UNITS = (
    (WrittenUnit("mm", LENGTH), "mm millimeter millimeters millimetre millimetres millimetri milimetro milimetros"),
    (WrittenUnit("um", LENGTH, 1, 1000), "µm um μm micrometer micrometre micron microns mikrometer mikron micrometri"),
    (WrittenUnit("nm", LENGTH, 1, 1_000_000), "nm nanometer nanometre"),
    (WrittenUnit("cm", LENGTH, 10), "cm centimeter centimetre zentimeter"),
    (WrittenUnit("m", LENGTH, 1000), "m meter metre metri metros"),
    (WrittenUnit("inch", LENGTH, 127, 5), "in inch inches zoll pouce pouces pollice pollici pulgada pulgadas \" ″ ''"),
    (WrittenUnit("mil", LENGTH, 127, 5000), "mil mils thou"),
    (WrittenUnit("ft", LENGTH, 1524, 5), "ft foot feet"),
    (WrittenUnit("°C", TEMPERATURE), "°c c degc celsius grad ℃"),
    (WrittenUnit("K", TEMPERATURE, offset=-273.15), "k kelvin"),
    (WrittenUnit("°F", TEMPERATURE), "°f f degf fahrenheit ℉"),
    (WrittenUnit("s", TIME), "s sec sek second seconds sekunde sekunden seconde secondi segundos"),
    (WrittenUnit("ms", TIME, 1, 1000), "ms millisecond milliseconds"),
    (WrittenUnit("min", TIME, 60), "min minute minutes minuten minuti minutos"),
    (WrittenUnit("h", TIME, 3600), "h hour hours std stunde stunden heure heures ore horas"),
    (WrittenUnit("hPa", PRESSURE), "hpa mbar"),
    (WrittenUnit("Pa", PRESSURE, 1, 100), "pa"),
    (WrittenUnit("kPa", PRESSURE, 10), "kpa"),
    (WrittenUnit("%", SHARE), "% pct percent prozent %rh %rf"),
)
UNITS: Mapping[str, WrittenUnit] = {alias: unit for unit, aliases in _UNITS for alias in aliases.split(" ")}
LENGTHS = tuple(unit.name for unit, _ in _UNITS if unit.sort == LENGTH)
FAHRENHEIT = UNITS["°f"]

_ENDINGS = (("_mm_s", None), ("_mm", (LENGTH, 1)), ("_um", (LENGTH, 1000)), ("_c", (TEMPERATURE, 1)), ("_s", (TIME, 1)),
            ("_hpa", (PRESSURE, 1)), ("_pct", (SHARE, 1)))  # fmt: skip


def unit_named(text: str) -> WrittenUnit | None:
    """A unit as written, whatever its case where that says nothing; ``None`` where it is none."""
    return UNITS.get(text.strip().strip(".").strip().casefold())


def length_named(text: str) -> WrittenUnit | None:
    unit = unit_named(text)
    return unit if unit is not None and unit.sort == LENGTH else None


def sort_of(column: str) -> tuple[str, int] | None:
    """Sort of quantity of a recording's column, and how many of its units one of the sort's is; ``None`` without unit."""
    return next((sort for ending, sort in _ENDINGS if column.endswith(ending)), None)


def converted(values: Floats, unit: WrittenUnit, column: str) -> Floats:
    """Values (n,) as written in a column, in the unit of its name."""
    sort = sort_of(column)
    up = unit.up * (sort[1] if sort else 1)
    values = values * up if up != 1 else values
    values = values / unit.down if unit.down != 1 else values
    return values + unit.offset if unit.offset else values


_SUFFIX = re.compile(r"^([+-]?[\d.,' \u00a0\u202f]*\d[.,]?(?:[eE][+-]?\d+)?)\s*([^\d\s.,'+-][^\d]*)$")


def apart(cell: str) -> tuple[str, WrittenUnit] | None:
    """A number and the unit written after it in its cell; ``None`` where there is no unit."""
    match = _SUFFIX.match(cell)
    unit = unit_named(match[2]) if match else None
    return (match[1], unit) if match and unit else None


Source = str | Annotated[int, Field(ge=1, le=COLUMNS.most)]  # A column of the file: its heading, or its number from 1

# one, or several where a row holds several points, in their order
Sources = Source | Annotated[list[Source], Field(min_length=1, max_length=COLUMNS.most)]
DELIMITERS: Mapping[str, str] = {",": ",", ";": ";", "tab": "\t", "blank": " ", "|": "|"}


def sources_of(sources: Sources) -> list[Source]:
    return sources if isinstance(sources, list) else [sources]


class FileKeys(JobTable):
    """Of any table that is imported; each is needed only where the file leaves it open."""

    columns: Annotated[dict[Column, Sources], Field(max_length=COLUMNS.most)] = {}
    """The file's columns by the recording's names, as `{ x_mm = "X" }`: a heading, a number from 1, or a list of them where a
    row holds several points."""
    unit: str | None = None
    """Unit of the file's lengths, as `"inch"`, where the file does not say it."""
    sheet: str | None = None
    """Which sheet of a workbook, or which sort of feature of a report (`"spheres"`), where there are several."""
    decimal: Literal[".", ","] | None = key(None, "The file's decimal sign, where its numbers can be read either way.")
    delimiter: Literal[",", ";", "tab", "blank", "|"] | None = None
    """What separates the cells of a text file, where that is not found."""
    encoding: Literal["utf-8", "utf-16", "cp1252", "latin-1"] | None = None
    """Encoding of a text file, where it is mistaken for another."""

    @field_validator("unit")
    @classmethod
    def _a_length(cls, unit: str | None) -> str | None:
        if unit is not None and length_named(unit) is None:
            raise ValueError(f"{unit!r} is no unit of length known here. Known: {', '.join(LENGTHS)}")
        return unit


class ImportKeys(FileKeys):
    """Of a recording in another format than the project's own."""

    points_per_measurement: Annotated[int, Field(ge=1, le=1_000_000)] | Literal["all"] | None = None
    """How many rows in turn are one measurement, where the file does not number them; `"all"` where they are one."""

    @property
    def asked(self) -> bool:
        """Whether anything is said, so that the file is to be imported whatever it looks like."""
        return any(getattr(self, name) not in (None, {}) for name in ImportKeys.model_fields)
