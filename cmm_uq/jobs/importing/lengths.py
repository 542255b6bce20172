"""In which unit the lengths of a file are: as it says, as the job says, or as the machine's travel leaves no doubt."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import Floats
from cmm_uq.jobs.importing.keys import ImportKeys
from cmm_uq.jobs.importing.sheet import Fact, Sheet
from cmm_uq.jobs.importing.units import UNITS, WrittenUnit, length_named
from cmm_uq.jobs.recording import COORDINATES

LARGEST_MACHINE_MM = 40_000.0
"""Longest diagonal of a coordinate measuring machine: gantries of 30 m are the largest made."""

Written = Mapping[str, Sequence[tuple[Floats, WrittenUnit | None, int]]]
"""Values of each column as written, with its unit and its index."""


def lengths_unit(
    sheet: Sheet, keys: ImportKeys, named: Mapping[str, WrittenUnit], written: Written, where: str,
    reach_mm: float | None = None,
) -> tuple[WrittenUnit, list[Fact]]:  # fmt: skip
    """The unit of the coordinates, and of every length whose unit is not named.

    Parameters
    ----------
    sheet : with the unit that its format or its text names.
    keys : what the job says.
    named : units in headings of coordinates.
    written : coordinates as written.
    where : the file, for messages.
    reach_mm : diagonal of the machine's travel, where it is known.

    Raises
    ------
    CmmUqError : two of these contradict each other, or nothing says the unit and millimetres and inches both fit.
    """
    found = {unit.name: heading for heading, unit in reversed(list(named.items()))}
    if len(found) > 1:
        (one, first), (other, second) = list(found.items())[:2]
        raise CmmUqError(f"{first!r} is in {one} and {second!r} in {other}: the coordinates mix units", where=where,
                         fix="Export all coordinates in one unit")  # fmt: skip
    said: list[tuple[WrittenUnit, Text]] = []
    if found:
        heading = next(iter(found.values()))
        said.append((named[heading], say("in the heading {heading}", heading=Verbatim(heading))))
    if sheet.unit is not None and (unit := length_named(sheet.unit)):
        said.append((unit, say("in the file")))
    if keys.unit is not None and (unit := length_named(keys.unit)):
        said.append((unit, say("by the key unit")))
    if len({unit.name for unit, _ in said}) > 1:
        told = " and ".join(f"{unit.name} {how}" for unit, how in said)
        raise CmmUqError(f"the unit is {told}", where=where, fix="Mend the file, or leave out unit")
    unit, how = said[0] if said else _by_extent(written, where, reach_mm)
    return unit, [Fact("unit", say("Unit of lengths"), say("{unit}, {how}", unit=Verbatim(unit.name), how=how))]


def _by_extent(written: Written, where: str, reach_mm: float | None) -> tuple[WrittenUnit, Text]:
    """Millimetres, where inches would lead out of the machine."""
    lengths = [name for name in COORDINATES if name in written] or [name for name in written if name.endswith("_mm")]
    extents = [np.ptp(np.concatenate([values for values, _, _ in written[name]])) for name in lengths if written[name]]
    extent, reach = float(np.linalg.norm(extents)), reach_mm or LARGEST_MACHINE_MM
    inch, mm = UNITS["inch"], UNITS["mm"]
    if extent <= reach < extent * inch.up / inch.down:
        return mm, say("since in inches the points would lie {extent:.3g} mm apart, and {reach:.3g} mm is the most",
                       extent=extent * inch.up / inch.down, reach=reach)  # fmt: skip
    raise CmmUqError(
        f"nothing says the unit of lengths: points {extent:.4g} apart may be in mm or in inch", where=where,
        fix='Say unit = "mm" or unit = "inch"',
    )  # fmt: skip
