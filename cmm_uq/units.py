"""Units of the outside world, in the units used inside (mm, rad, °C).

Inside, lengths are mm, angles rad, temperatures °C. Micrometres, arc seconds and ppm appear only in parameter names and
where text is read or written; each factor stands here once.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from types import MappingProxyType

MICROMETRE = 1e-3
"""1 µm in mm."""

METRE = 1e3
"""1 m in mm."""

ARCSECOND = pi / (180 * 3600)
"""1″ in rad."""

PPM = 1e-6
"""1 ppm as a ratio."""

HOUR = 3600.0
"""1 h in s."""

REFERENCE_TEMPERATURE = 20.0
"""Standard reference temperature for dimensional specification, °C (ISO 1)."""

PRINTED: Mapping[str, str] = MappingProxyType({
    "mm": "mm", "um": "µm", "arcsec": "″", "rad": "rad", "ppm": "ppm", "c": "°C", "k": "K", "h": "h", "s": "s",
    "per_k": "1/K", "um_per_h": "µm/h", "arcsec_per_m": "″/m", "arcsec_per_m_k": "″/(m K)",
})  # fmt: skip
"""Units as printed, by the ending of a quantity's name."""


def printed_unit(name: str) -> str:
    """The unit in which a quantity's name ends, as printed: ``µm`` of ``b89_range_um``; empty where it names none."""
    word = name.rpartition(".")[2]
    fitting = [ending for ending in PRINTED if word == ending or word.endswith(f"_{ending}")]
    return PRINTED[max(fitting, key=len)] if fitting else ""
