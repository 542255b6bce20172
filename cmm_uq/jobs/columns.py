"""What each column of a recording is: in a sentence, and in a few words for the middle of a text or the axis of a picture.

Which there must be, and how large a number each may hold. Columns of one kind alone stand with the kind; a column that only
the user knows keeps its name.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from types import MappingProxyType

from cmm_uq.base.files.csv_table import LARGEST, conversion
from cmm_uq.base.files.table import LONGEST_MM
from cmm_uq.base.messages import NOTHING, Text, Verbatim, say
from cmm_uq.base.points import AXES
from cmm_uq.base.rotary import ROTARY
from cmm_uq.base.units import unit

COORDINATES = ("x_mm", "y_mm", "z_mm")
SENSORS = tuple(f"sensor_{a}_um" for a in AXES)
REQUIRED = ("measurement", "point", *COORDINATES)
WHOLE = ("measurement", "point", "repeat")

_TABLE = tomllib.loads(Path(__file__).with_name("columns.toml").read_text(encoding="utf-8"))
COLUMNS: Mapping[str, str] = MappingProxyType({
    name.format(axis=a, rotary=a): text.format(axis=a, rotary=a.upper())
    for name, text in _TABLE.items()
    for a in (ROTARY if "{rotary}" in name else AXES if "{axis}" in name else "_")
})  # fmt: skip
_OF_SOME_MACHINES = re.compile(
    r"temp_(bridge|ram)_.*|depth_mm|turned_deg|[abc]_deg|[abc]_approach|sensor_.*|load_kg|(acceleration|since_reversal)_.*"
)
# columns that a recording may have, and that are refused in another unit than that of their name
OPTIONAL = tuple(name for name in COLUMNS if name not in REQUIRED and not _OF_SOME_MACHINES.fullmatch(name))
AMBIENT = tuple(name for name in OPTIONAL if re.fullmatch(r"temp_\w+_c|pressure_hpa|humidity_pct", name))
# what instruments read, which the kinds that go by it describe
READINGS = (
    *(f"reading_{name}" for name in ("um", "mm", "arcsec")),
    *("straightedge", "square", "face", "face_arcsec", "u_mm", "v_mm", "alpha_deg", "beta_deg"),
    *(f"{name}_{a}" for name in ("read", "turn") for a in AXES),
)
LARGEST_NUMBER = 1e9  # of a measurement, point or repeat
LARGEST_OF = {"_mm": LONGEST_MM, "_um": 1e9, "_c": 1e5, "_pct": 1e6, "_deg": 1e6}
"""By the ending of a column's name: far beyond any recording in its unit, so that a mistaken unit is still told as one."""


def largest(column: str) -> float:
    """Largest number, either way, that a column of this name may hold; that of every number where its name says nothing."""
    if column in WHOLE:
        return LARGEST_NUMBER
    return next((most for ending, most in LARGEST_OF.items() if column.endswith(ending)), LARGEST)


_QUANTITIES = {re.sub(r"_(mm|um|c|s|hpa|pct|deg|mm_s)$", "", name): name for name in (*REQUIRED, *OPTIONAL)}
_NEARLY = 0.93  # a letter of some fourteen: `temp_artifact_c`, but no other axis: `temp_w_c`, `approach_w`
_OTHER_UNITS = re.compile(
    r"_(m|cm|um|µm|mm|nm|in|inch|mil|k|f|c|min|ms|h|s|pa|kpa|hpa|mbar|mmhg|rad|deg|arcsec|pct|percent)$"
)


def misnamed(column: str, header: Sequence[str]) -> tuple[str, str] | None:
    """What is wrong with a name that is one of a recording but for its unit, a letter, case or a word written out; the fix."""
    if column in (*COLUMNS, *READINGS):
        return None
    if known := _QUANTITIES.get(_OTHER_UNITS.sub("", column)):
        fix = conversion(column, [known]) or f"Convert it and name it {known}, or say unit under [recording]"
        return f"the column {column!r} is not in the unit of {known!r}", fix
    written = re.sub("^temperature_", "temp_", column.casefold())
    for meant in get_close_matches(written, [name for name in COLUMNS if name not in header], 1, _NEARLY):
        problem = f"the column {column!r} is nearly {meant!r} and would not be used"
        return problem, f"Name it {meant}, or otherwise where it is something else"
    return None


_AXES = {a: Verbatim(a.upper()) for a in AXES}

# by name of the column
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
    **{f"{a}_deg": say("angle of the table {axis}", axis=Verbatim(a.upper())) for a in ROTARY},
    **{f"{a}_approach": say("sense of turning of the table {axis}", axis=Verbatim(a.upper())) for a in ROTARY},
    "depth_mm": say("scan depth"), "load_kg": say("load at the ram"),
    **{f"acceleration_{a}_m_s2": say("acceleration of {axis}", axis=axis) for a, axis in _AXES.items()},
    **{f"since_reversal_{a}_mm": say("way of {axis} since its reversal", axis=axis) for a, axis in _AXES.items()},
    "radius_mm": say("fitted radius"), "fit_rms_um": say("residuals of the fit"), "n_points": say("number of points fitted"),
})  # fmt: skip
_UNITS: Mapping[str, Text] = MappingProxyType({
    "_mm_s": Verbatim("mm/s"), "_mm": unit("mm"), "_um": unit("µm"), "_c": unit("°C"), "_s": unit("s"),
    "_hpa": Verbatim("hPa"), "_pct": unit("%"), "_deg": unit("°"), "_m_s2": Verbatim("m/s²"), "_kg": Verbatim("kg"),
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
    what, printed = in_words(column), unit_of(column)
    return say("{what:capital} / {unit}", what=what, unit=printed) if printed else say("{what:capital}", what=what)
