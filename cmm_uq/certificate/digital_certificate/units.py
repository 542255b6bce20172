"""Units of the figures of results.json in D-SI: by the ending of their key, or of the key above it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType

from cmm_uq.base.units import PRINTED, UNITS, Unit

ONE = UNITS["1"]

_ENDINGS: Mapping[str, Unit] = MappingProxyType({**PRINTED, "deg": UNITS["°"], "mm2": UNITS["mm²"]})

_PLAIN = ("k", "probability", "p_value", "share", "dof", "draws", "repeat", "measurement", "point", "points")
"""Keys of what has no unit, also where the key above them has one."""


def unit_of(key: str, above: Unit | None) -> Unit:
    """Unit of a figure.

    Parameters
    ----------
    key : the last of its path, the name of no single element of a list.
    above : the unit that the key above it names, if it names one.
    """
    if key in _PLAIN or key.endswith("_probability"):
        return ONE
    return named_unit(key) or above or ONE


def named_unit(key: str) -> Unit | None:
    """The unit that a key ends in: µm of ``b89_range_um``."""
    fitting = [ending for ending in _ENDINGS if key == ending or key.endswith(f"_{ending}")]
    return _ENDINGS[max(fitting, key=len)] if fitting else None


def without_unit(key: str) -> str:
    """A key in words: ``b89 range``."""
    fitting = [ending for ending in _ENDINGS if key.endswith(f"_{ending}")]
    return (key.removesuffix(f"_{max(fitting, key=len)}") if fitting else key).replace("_", " ")


def dsi_of(symbol: str) -> str:
    """A unit of results.json in D-SI; of another package, which D-SI does not know, after the bar that marks such units."""
    return UNITS[symbol].dsi if symbol in UNITS else _foreign(symbol)


def _foreign(text: str) -> str:
    """Without spaces, which would part it where it stands in a list."""
    return "|" + "_".join(text.replace("|", "").split())


def product(one: str, other: str) -> str:
    """Unit of an element of a covariance matrix."""
    if "|" in one + other:
        return _foreign(f"{one}·{other}")
    if one == ONE.dsi:
        return other
    return one if other == ONE.dsi else one + other


def ratio(one: str, other: str) -> str:
    """Unit of a sensitivity."""
    if "|" in one + other:
        return _foreign(f"{one}/({other})")
    return ONE.dsi if one == other else product(one, _inverse(other))


_FACTOR = re.compile(r"((?:\\(?:nano|micro|milli|centi|kilo))?\\[a-z]+)(?:\\tothe\{(-?\d+)\})?")
"""A unit with its prefix, and the power of both; those of the table."""


def _inverse(unit: str) -> str:
    """One over a unit: every power with the other sign."""
    if unit == ONE.dsi:
        return unit
    factors = ((name, -int(power or 1)) for name, power in _FACTOR.findall(unit))
    return "".join(name if power == 1 else rf"{name}\tothe{{{power}}}" for name, power in factors)
