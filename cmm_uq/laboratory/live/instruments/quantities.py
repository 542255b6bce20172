"""Numbers of a message in the unit that the quantity's name ends with, within what is plausible."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from math import isfinite
from types import MappingProxyType

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.sentences import unit_of
from cmm_uq.base.messages import Text, Verbatim, number, say
from cmm_uq.base.units import pint_units
from cmm_uq.laboratory.live.instruments.profile import Quantity

_PINT: Mapping[str, str] = MappingProxyType({
    "K/h": "kelvin/hour", "1/K": "1/kelvin", "µm/m": "micrometer/meter", "mm/s": "millimeter/second", "″": "arcsecond",
    "µm": "micrometer", "°": "degree", "°C": "degC", "K": "kelvin", "h": "hour", "%": "percent",
})  # fmt: skip
"""Units of the ends of names as pint spells them, where it does otherwise."""


class NoValueError(Exception):
    """A number that is none; what is wrong with it, in words."""

    def __init__(self, why: Text) -> None:
        self.why = why
        super().__init__(why)


def number_of(text: str, decimal: str) -> float:
    """A number in a message; blanks between sign and digits are passed over.

    Raises
    ------
    NoValueError : it is none.
    """
    plain = "".join(text.split())
    if decimal == ",":
        plain = plain.replace(".", "?").replace(",", ".")  # a point would be one of thousands, or of another setting
    try:
        return float(plain.replace("_", "?"))  # which Python allows between digits
    except ValueError:
        raise NoValueError(say("{text} is no number", text=Verbatim(repr(text)))) from None


def value_of(name: str, raw: float, quantity: Quantity, said: str = "") -> float:
    """The value of a quantity.

    Parameters
    ----------
    name : with its unit at its end.
    raw : the number as sent.
    quantity : what the profile says of it.
    said : the unit as the message says it.

    Raises
    ------
    NoValueError : the unit is none of the quantity's, or the value is not plausible.
    """
    unit = quantity.units.get(said) if quantity.unit_group else quantity.unit
    if unit is None:
        raise NoValueError(say("{name} comes in {unit}, which the profile does not know", name=Verbatim(name),
                               unit=Verbatim(repr(said))))  # fmt: skip
    found = conversion(unit, unit_of(name))(raw * quantity.factor)
    if not isfinite(found):
        raise NoValueError(say("{name} is {found}", name=Verbatim(name), found=number(found, "g")))
    if quantity.range is not None and not quantity.range[0] <= found <= quantity.range[1]:
        raise NoValueError(
            say("{name} is {found}, outside {low} to {high}", name=Verbatim(name), found=number(found, "g"),
                low=number(quantity.range[0], "g"), high=number(quantity.range[1], "g"))
        )  # fmt: skip
    return found


@cache
def conversion(given: str, wanted: str) -> Callable[[float], float]:
    """From one unit into another.

    Parameters
    ----------
    given : as pint spells it; empty where it is the wanted one.
    wanted : as printed; empty for a quantity whose name has none.

    Raises
    ------
    CmmUqError : there is no such unit, or it is one of something else.
    """
    target = _PINT.get(wanted, wanted)
    if given in ("", target):
        return float
    import pint

    registry = pint_units()
    try:
        registry.Quantity(1.0, given).to(target)
    except (pint.PintError, ValueError, TypeError, AttributeError, SyntaxError) as error:
        fix = f"Give a unit that can be {wanted}" if wanted else "End the quantity's name with its unit: temp_c, x_mm"
        raise CmmUqError(f"the unit {given!r} cannot be used: {error}", fix=fix) from None
    return lambda value: float(registry.Quantity(value, given).to(target).magnitude)
