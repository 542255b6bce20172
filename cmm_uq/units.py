"""Units of the outside world, in the units used inside (mm, rad, °C).

Inside, lengths are mm, angles rad, temperatures °C. Micrometres, arc seconds and ppm appear only in parameter names and
where text is read or written; each factor stands here once.
"""

from __future__ import annotations

from math import pi

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
