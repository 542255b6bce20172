"""What each standard's test consists of, as data: positions, lengths, points, repeats, and what counts as another one.

None of these standards is public. Where a figure comes from second hand, or was chosen here, it says so; docs/standards.md
gathers it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from cmm_uq.analysis.conformity.measurement_lines import FACE_DIAGONALS, PARALLELS, SPACE_DIAGONALS
from cmm_uq.base.messages import NOTHING, Text, Verbatim, say
from cmm_uq.base.points import Floats


@dataclass(frozen=True)
class LengthPlan:
    """Calibrated lengths along lines through the volume.

    Parameters
    ----------
    positions : of the lines, by name.
    lengths : different ones in each position.
    repeats : of each length in each position.
    least_share : the longest length in a position over the travel along it.
    shortest_mm : largest that the shortest length may be.
    bidirectional : whether each length's ends are to be reached from opposite sides.
    offset_mm : of the stylus tip across the ram; lengths measured with another do not count.
    """

    positions: tuple[Text, ...]
    lengths: int
    repeats: int
    least_share: float
    shortest_mm: float
    bidirectional: bool = False
    offset_mm: float | None = None

    @property
    def total(self) -> int:
        """Lengths in all."""
        return len(self.positions) * self.lengths * self.repeats


@dataclass(frozen=True)
class BarPlan:
    """A ballbar in many positions.

    Parameters
    ----------
    positions : how many in a nearly cubic volume.
    directions : each of which some position has.
    further : positions more for each further cube of a longer volume.
    nearly_cubic : longest over shortest axis up to which a volume is taken as nearly cubic.
    apart_mm : bars of which both ends are nearer than this to those of another are in the same place.
    """

    positions: int
    directions: tuple[Text, ...]
    further: int
    nearly_cubic: float
    apart_mm: float

    def positions_in(self, size_mm: Floats) -> int:
        """How many positions a volume of this size (3,) has."""
        return self.positions + self.further * (int(np.prod(self.cubes(size_mm))) - 1)

    def cubes(self, size_mm: Floats) -> tuple[int, ...]:
        """Into how many nearly cubic parts each axis of a volume (3,), mm, is divided."""
        edge = self.nearly_cubic * float(size_mm.min())
        return tuple(int(np.ceil(extent / edge - 1e-9)) for extent in size_mm)


@dataclass(frozen=True)
class SpherePlan:
    """Points on a test sphere.

    Parameters
    ----------
    points : different ones on each sphere, or more.
    reach_deg : no direction of the hemisphere is farther than this from the nearest point.
    diameter_mm : least and largest of the sphere.
    """

    points: int
    reach_deg: float
    diameter_mm: tuple[float, float] = (0.0, np.inf)


@dataclass(frozen=True)
class RepeatPlan:
    """A sphere probed again and again in one place.

    Parameters
    ----------
    repeats : of the same measurement.
    """

    repeats: int


@dataclass(frozen=True)
class OffsetPlan:
    """A ballbar measured with the stylus tip to either side of the ram.

    Parameters
    ----------
    positions : of the bar, by name.
    """

    positions: tuple[Text, ...]


@dataclass(frozen=True)
class ShortLengthPlan:
    """A short gauge in several orientations.

    Parameters
    ----------
    orientations : that differ by more than ``apart_deg``.
    repeats : in each.
    longest_mm : that is still short.
    """

    orientations: int
    apart_deg: float
    repeats: int
    longest_mm: float


Plan = LengthPlan | BarPlan | SpherePlan


@dataclass(frozen=True)
class Condition:
    """One thing that a standard asks for.

    Parameters
    ----------
    what : it asks, and how much of it there is.
    missing : what is not there, each in words; nothing when the condition is met.
    remedy : which key of the job states what is missing, for who writes it.
    """

    what: Text
    missing: tuple[Text, ...] = ()
    remedy: Text = NOTHING

    @property
    def met(self) -> bool:
        """Whether nothing is missing."""
        return not self.missing


OFFSET_TOLERANCE_MM = 10.0
"""Within which a stylus tip has an offset; this project's figure."""

ISO_10360_2 = LengthPlan((*SPACE_DIAGONALS, *PARALLELS), 5, 3, 0.66, 30.0, bidirectional=True, offset_mm=0.0)
"""E0 and R0. Seven positions, five lengths, three repeats: Harris 2004, 2.6.3, of the edition of 2000, who has 66 % and 30 mm
too, and Renishaw's summary of ISO 10360. The four space diagonals, and the axes as the three others, are those of the edition
of 2009 as commonly reported; other positions that its user may choose are not known here."""

ISO_10360_2_OFFSET = tuple(
    LengthPlan(tuple(say("face diagonal {axes}", axes=Verbatim(f"{s}{plane[0]} +{plane[1]}")) for s in "+−"), 5, 3, 0.66,
               30.0, bidirectional=True, offset_mm=150.0)
    for plane in ("YZ", "XZ")
)  # fmt: skip
"""E150, in one of two planes that hold a vertical ram. 150 mm is in the name; two diagonals, five lengths, three repeats, as
commonly reported, not verified."""

VDI_2617_2_1 = {
    name: LengthPlan(positions, 5, 3, 0.66, 30.0)
    for name, positions in (("U1", PARALLELS), ("U2", FACE_DIAGONALS), ("U3", SPACE_DIAGONALS))
}
"""Axial, planar and spatial positions of a step gauge or of gauge blocks: Harris 2004, 2.6.2. How many lengths and repeats,
how long and how short: those of ISO 10360-2, this project's choice."""

B89_LINEAR = LengthPlan(PARALLELS, 10, 3, 0.66, np.inf)
"""A step gauge or laser along each axis: Harris 2004, 2.6.1. Ten lengths, three repeats, 66 %: this project's choice."""

B89_REPEATABILITY = RepeatPlan(10)
"""Positions of a fixed ball: Harris 2004, 2.6.1. Ten: this project's choice."""

B89_OFFSET = OffsetPlan(tuple(
    say("face diagonal {axes}", axes=Verbatim(f"{s}{plane[0]} +{plane[1]}")) for plane in ("YZ", "XZ") for s in "+−"
))  # fmt: skip
"""Four diagonals in vertical planes, each with two offsets at right angles to the ram: Harris 2004, 2.6.1. Which four: this
project's reading."""

B89_BIDIRECTIONAL = ShortLengthPlan(4, 10.0, 3, 50.0)
"""A short gauge block in four orientations: Harris 2004, 2.6.1. 10°, three repeats, what is short: this project's choice."""

B89 = BarPlan(20, (*SPACE_DIAGONALS, *FACE_DIAGONALS, *PARALLELS), 10, 2.0, 10.0)
"""Twenty positions in the directions of figure 26 of the standard, as Harris 2004, figures C 1 and C 2, carries them out. What
a longer volume needs, what nearly cubic is, and the distance are this project's figures."""

ISO_10360_5 = SpherePlan(25, 45.0, (10.0, 50.0))
"""Twenty-five points (Renishaw's summary of ISO 10360), spread over a hemisphere; the reach is this project's figure. A sphere
of 10 to 50 mm: Harris 2004, 2.6.3, of ISO 10360-2:2000; not less than 10 mm by clause 6.2.1 of the edition of 2020 too."""

ISO_10360_8 = SpherePlan(25, 45.0)
"""The 25 are in the names of the characteristics; the reach is this project's figure."""

READY: Mapping[str, Plan] = MappingProxyType(
    {"ASME B89.4.1": B89, "ISO 10360-2": ISO_10360_2, "ISO 10360-5": ISO_10360_5}
)
"""By the name of the ready plan."""
