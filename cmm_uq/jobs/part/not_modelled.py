"""What drawings ask for and programs do that is not modelled: refused by its name, in the words that are said once here.

What is said follows the name of a feature or of a characteristic.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

SCANNED = (
    "is scanned: what scanning adds (dynamic errors, filters, points that lie close together) is not modelled; plan it by "
    "points that are probed one by one"
)
LINE_PROFILE = "is the profile of a line, which is not modelled"
SURFACE_PROFILE = "is the profile of a surface, which is not modelled"
POINT_PROFILE = "is the profile of a surface at a point, which is not modelled"
MAXIMUM_MATERIAL = "holds at maximum material condition, which is not modelled"
LEAST_MATERIAL = "holds at least material condition, which is not modelled"
TWO_POINT = "is a two-point size (LP), which is not modelled: sizes are those of associated features"
PROJECTED = "has a projected tolerance zone, which is not modelled"
SYMMETRY = "is a symmetry: the median plane of two faces is not modelled"
FREE_STATE = "is toleranced in the free state, and how a part bends is not modelled"

_INSTEAD = "leave it out, and name it in [part] not_measured"

_WORDS: Mapping[str, str] = {
    "mmc": MAXIMUM_MATERIAL, "mmr": MAXIMUM_MATERIAL, "maximum_material": MAXIMUM_MATERIAL, "m": MAXIMUM_MATERIAL,
    "lmc": LEAST_MATERIAL, "lmr": LEAST_MATERIAL, "least_material": LEAST_MATERIAL, "l": LEAST_MATERIAL,
    "lp": TWO_POINT, "two_point": TWO_POINT, "local_size": TWO_POINT, "two_point_size": TWO_POINT,
    "free_state": FREE_STATE, "f": FREE_STATE, "projected": PROJECTED, "p": PROJECTED,
    "profile": SURFACE_PROFILE, "surface_profile": SURFACE_PROFILE, "profile_of_a_surface": SURFACE_PROFILE,
    "line_profile": LINE_PROFILE, "profile_of_a_line": LINE_PROFILE, "point_profile": POINT_PROFILE,
    "symmetry": SYMMETRY,
    "scan": SCANNED, "scanning": SCANNED, "scanned": SCANNED, "continuous": SCANNED,
}  # fmt: skip
"""As somebody may write them in job.toml."""

_KEYS: Mapping[str, str | None] = {
    "what": None, "pattern": None, "association": None, "modifier": None, "material_condition": None, "condition": None,
    "free_state": FREE_STATE, "mmc": MAXIMUM_MATERIAL, "lmc": LEAST_MATERIAL, "projected_zone_mm": PROJECTED,
    "projected_mm": PROJECTED, "scan": SCANNED, "scanning": SCANNED, "scan_speed_mm_s": SCANNED, "filter": SCANNED,
}  # fmt: skip
"""Keys that say such a thing, or whose value does."""


def material_condition(datum: str) -> str:
    """What a datum says of its material condition, as ``B(M)`` does; nothing where it says nothing."""
    _, bracket, said = datum.strip().rstrip("Ⓜ Ⓛ").partition("(")
    condition = said.rstrip(") ").casefold() if bracket else ""
    condition = {"Ⓜ": "m", "Ⓛ": "l"}.get(datum.strip()[-1:], condition)
    return _WORDS.get(condition, "") if condition in ("m", "l", "mmc", "lmc") else ""


def refuse_not_modelled(table: Any) -> Any:
    """The table as it is; for a validator that runs before any other.

    Raises
    ------
    ValueError : a key, or what it says, is not modelled.
    """
    for key in _KEYS.keys() & (table.keys() if isinstance(table, Mapping) else set()):
        value = table[key]
        told = _KEYS[key] if value is not False else None
        if key == "what" and isinstance(value, str) and value.strip().casefold() == "concentricity":
            raise ValueError('ask for "coaxiality", of a circle as of an axis')
        if isinstance(value, str):
            told = _WORDS.get(value.strip().casefold().replace(" ", "_").replace("-", "_").strip("()"), told)
        if told:
            raise ValueError(f"{key} = {value!r} {told}: {_INSTEAD}")
    return table
