"""Units of the outside world: in the units used inside (mm, rad, °C), as printed, and as machines read them.

Inside, lengths are mm, angles rad, temperatures °C. Micrometres, arc seconds and ppm appear only in parameter names and
where text is read or written; each factor stands here once. Every unit that a document or a file of results prints is a
:class:`Unit` of the table here, which says what D-SI and QIF call it and how large it is.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from math import pi
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, Verbatim

if TYPE_CHECKING:
    import pint

MICROMETRE = 1e-3  # 1 µm in mm
METRE = 1e3  # 1 m in mm
ARCSECOND = pi / (180 * 3600)  # 1″ in rad
PPM = 1e-6  # 1 ppm as a ratio
HOUR = 3600.0  # 1 h in s
REFERENCE_TEMPERATURE = 20.0  # standard reference temperature for dimensional specification, °C (ISO 1)


class Unit(Text):
    r"""A unit as printed, ``µm``, with what machines call it.

    symbol : as printed.
    dsi : in the notation of D-SI (SmartCom, D-SI 2.1): ``\micro\metre``.
    qif : name for the ``UnitName`` of QIF 3.0 (ANSI/DMSC, ``FileUnits``), which gives the factor beside it.
    si : factor to the coherent SI unit; of a difference, where the unit has an offset (°C).
    """

    __slots__ = ("dsi", "qif", "si")

    dsi: str
    qif: str
    si: float

    def __new__(cls, symbol: str, dsi: str, qif: str, si: float) -> Self:
        unit = super().__new__(cls, symbol)
        unit.dsi, unit.qif, unit.si = dsi, qif, si
        return unit

    def __reduce__(self) -> tuple[type[Unit], tuple[str, str, str, float]]:
        return Unit, (str.__str__(self), self.dsi, self.qif, self.si)


UNITS: Mapping[str, Unit] = MappingProxyType({row[0]: Unit(*row) for row in (
    ("1", r"\one", "ratio", 1.0),
    ("%", r"\percent", "percent", 1e-2),
    ("ppm", r"\ppm", "ppm", PPM),
    ("10⁻⁶/K", r"\ppm\kelvin\tothe{-1}", "ppm per kelvin", PPM),
    ("1/K", r"\kelvin\tothe{-1}", "per kelvin", 1.0),
    ("ppm/h", r"\ppm\hour\tothe{-1}", "ppm per hour", PPM / HOUR),
    ("m", r"\metre", "meter", 1.0),
    ("mm", r"\milli\metre", "millimeter", 1e-3),
    ("µm", r"\micro\metre", "micrometer", 1e-6),
    ("nm", r"\nano\metre", "nanometer", 1e-9),
    ("mm²", r"\milli\metre\tothe{2}", "square millimeter", 1e-6),
    ("µm/m", r"\micro\metre\metre\tothe{-1}", "micrometer per meter", 1e-6),
    ("µm/m²", r"\micro\metre\metre\tothe{-2}", "micrometer per square meter", 1e-6),
    ("µm/K", r"\micro\metre\kelvin\tothe{-1}", "micrometer per kelvin", 1e-6),
    ("µm/(m·K)", r"\micro\metre\metre\tothe{-1}\kelvin\tothe{-1}", "micrometer per meter and kelvin", 1e-6),
    ("µm/mm", r"\micro\metre\milli\metre\tothe{-1}", "micrometer per millimeter", 1e-3),
    ("µm/°", r"\micro\metre\degree\tothe{-1}", "micrometer per degree", 1e-6 * 180 / pi),
    ("µm/kg", r"\micro\metre\kilogram\tothe{-1}", "micrometer per kilogram", 1e-6),
    ("µm·s²/m", r"\micro\metre\second\tothe{2}\metre\tothe{-1}", "micrometer per meter per second squared", 1e-6),
    ("µm/h", r"\micro\metre\hour\tothe{-1}", "micrometer per hour", 1e-6 / HOUR),
    ("rad", r"\radian", "radian", 1.0),
    ("°", r"\degree", "degree", pi / 180),
    ("″", r"\arcsecond", "arcsecond", ARCSECOND),
    ("″/m", r"\arcsecond\metre\tothe{-1}", "arcsecond per meter", ARCSECOND),
    ("″/K", r"\arcsecond\kelvin\tothe{-1}", "arcsecond per kelvin", ARCSECOND),
    ("″/(m·K)", r"\arcsecond\metre\tothe{-1}\kelvin\tothe{-1}", "arcsecond per meter and kelvin", ARCSECOND),
    ("″/(m·kg)", r"\arcsecond\metre\tothe{-1}\kilogram\tothe{-1}", "arcsecond per meter and kilogram", ARCSECOND),
    ("″/(m K)", r"\arcsecond\metre\tothe{-1}\kelvin\tothe{-1}", "arcsecond per meter and kelvin", ARCSECOND),
    ("K", r"\kelvin", "kelvin", 1.0),
    ("°C", r"\degreecelsius", "degree Celsius", 1.0),
    ("s", r"\second", "second", 1.0),
    ("ms", r"\milli\second", "millisecond", 1e-3),
    ("min", r"\minute", "minute", 60.0),
    ("h", r"\hour", "hour", HOUR),
    ("Pa", r"\pascal", "pascal", 1.0),
)})  # fmt: skip
"""By the symbol that is printed."""


def unit(symbol: str) -> Unit:
    """The unit of a symbol; a unit itself, such as one of another package, as it is."""
    if isinstance(symbol, Unit):
        return symbol
    if symbol not in UNITS:
        raise CmmUqError(f"{symbol!r} is no unit of the table", fix=f"Known: {', '.join(UNITS)}")
    return UNITS[symbol]


def unit_as_typed(text: str) -> Unit:
    """The unit of a symbol, also as a keyboard has it: ``um/m2``, ``arcsec/m``, ``um/(m*K)``."""
    plain = "".join(text.split())
    for typed, symbol in _TYPED.items():
        plain = plain.replace(typed, symbol)
    return unit(f"µ{plain[1:]}" if plain.startswith("um") else plain)


_TYPED = {"μ": "µ", "arcsec": "″", "deg": "°", "*": "·", "^2": "²", "m2": "m²", "ppm/K": "10⁻⁶/K"}
_SPELLED: Mapping[str, str] = MappingProxyType({"degC": "°C", "percent": "%"})
"""Units of the table as files spell them that are read by pint."""


def unit_as_written(text: str) -> Text:
    """A unit of the user's choice: that of the table where it is there, else as it was written."""
    return UNITS.get(_SPELLED.get(text, text)) or (Verbatim(text) if text else NOTHING)


PRINTED: Mapping[str, Unit] = MappingProxyType({ending: UNITS[symbol] for ending, symbol in {
    "mm": "mm", "um": "µm", "arcsec": "″", "rad": "rad", "ppm": "ppm", "c": "°C", "k": "K", "h": "h", "s": "s",
    "per_k": "1/K", "um_per_h": "µm/h", "arcsec_per_m": "″/m", "arcsec_per_m_k": "″/(m K)", "arcsec_per_k": "″/K", "ms": "ms",
    "um_per_m": "µm/m", "um_per_mm": "µm/mm", "um_per_m2": "µm/m²", "um_per_deg": "µm/°", "um_per_k": "µm/K",
    "um_per_m_k": "µm/(m·K)", "ppm_per_h": "ppm/h", "ppm_per_k": "10⁻⁶/K", "um_per_kg": "µm/kg", "um_s2_per_m": "µm·s²/m",
    "arcsec_per_m_kg": "″/(m·kg)",
}.items()})  # fmt: skip
"""Units as printed, by the ending of a quantity's name."""


def printed_unit(name: str) -> Text:
    """The unit in which a quantity's name ends, as printed: ``µm`` of ``b89_range_um``; empty where it names none."""
    word = name.rpartition(".")[2]
    fitting = [ending for ending in PRINTED if word == ending or word.endswith(f"_{ending}")]
    return PRINTED[max(fitting, key=len)] if fitting else NOTHING


@cache
def pint_units() -> pint.UnitRegistry[Any]:
    """The units of pint, which take half a second to read: once, and only where somebody names a unit."""
    import pint

    return pint.UnitRegistry(cache_folder=None)
