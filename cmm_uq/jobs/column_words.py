"""A column of a recording in a few words, for the middle of a sentence and for the axis of a picture.

What a column means is told in whole sentences in :mod:`cmm_uq.jobs.columns`; a column that only the user knows keeps its name.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from cmm_uq.base.messages import NOTHING, Text, Verbatim, say
from cmm_uq.base.units import unit

_AXES = {a: Verbatim(a.upper()) for a in "xyz"}

WORDS: Mapping[str, Text] = MappingProxyType({
    **{f"{a}_mm": axis for a, axis in _AXES.items()},
    **{f"approach_{a}": say("direction of travel along {axis}", axis=axis) for a, axis in _AXES.items()},
    **{f"n{a}": say("part of the surface's normal along {axis}", axis=axis) for a, axis in _AXES.items()},
    **{f"reference_{a}_mm": say("{axis} in the artefact's own frame", axis=axis) for a, axis in _AXES.items()},
    **{f"temp_{a}_c": say("temperature of scale {axis}", axis=axis) for a, axis in _AXES.items()},
    **{f"tip_{a}_mm": say("offset of the stylus tip along {axis}", axis=axis) for a, axis in _AXES.items()},
    "reference_mm": say("certified distance"), "time_s": say("time"), "order": say("order of measurement"),
    "azimuth_deg": say("direction about Z"), "temp_artefact_c": say("temperature of the artefact"),
    "temp_table_top_c": say("temperature of the table's top"),
    "temp_table_bottom_c": say("temperature of the table's underside"),
    "temp_bridge_top_c": say("temperature of the top of the bridge"),
    "temp_bridge_bottom_c": say("temperature of the underside of the bridge"),
    "temp_ram_front_c": say("temperature of the front of the ram"),
    "temp_ram_back_c": say("temperature of the back of the ram"),
    "temp_air_c": say("temperature of the air"), "pressure_hpa": say("air pressure"), "humidity_pct": say("humidity"),
    "speed_mm_s": say("speed"), "gamma_deg": say("turn of the digitizer"), "turned_deg": say("turn of the sphere"),
    "depth_mm": say("scan depth"),
    "radius_mm": say("fitted radius"), "fit_rms_um": say("residuals of the fit"), "n_points": say("number of points fitted"),
})  # fmt: skip
"""By name of the column."""

_UNITS: Mapping[str, Text] = MappingProxyType({
    "_mm_s": Verbatim("mm/s"), "_mm": unit("mm"), "_um": unit("µm"), "_c": unit("°C"), "_s": unit("s"),
    "_hpa": Verbatim("hPa"), "_pct": unit("%"), "_deg": unit("°"),
})  # fmt: skip
"""By the end of the name; of several that fit, the first."""


def in_words(column: str) -> Text:
    """What it is: ``temperature of scale X``."""
    return WORDS.get(column, Verbatim(column))


def unit_of(column: str) -> Text:
    """Its unit as printed; nothing where it has none, or its name says it."""
    if column not in WORDS:
        return NOTHING
    return next((found for end, found in _UNITS.items() if column.endswith(end)), NOTHING)


def labelled(column: str) -> Text:
    """The same for the axis of a picture: ``Temperature of scale X / °C``."""
    own = unit_of(column)
    what = in_words(column)
    return say("{what:capital} / {unit}", what=what, unit=own) if own else say("{what:capital}", what=what)
