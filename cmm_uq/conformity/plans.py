"""What each standard's test consists of, as data: positions, lengths, points, repeats, and what counts as another one.

None of these standards is public. Where a figure comes from second hand, or was chosen here, it says so; docs/standards.md
gathers it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from cmm_uq.conformity.measurement_lines import FACE_DIAGONALS, PARALLELS, SPACE_DIAGONALS
from cmm_uq.messages import Text
from cmm_uq.points import Floats


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
    """

    positions: tuple[Text, ...]
    lengths: int
    repeats: int
    least_share: float
    shortest_mm: float

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
    points : on each sphere, neither more nor fewer, all different.
    reach_deg : no direction of the hemisphere is farther than this from the nearest point.
    """

    points: int
    reach_deg: float


Plan = LengthPlan | BarPlan | SpherePlan


@dataclass(frozen=True)
class Condition:
    """One thing that a standard asks for.

    Parameters
    ----------
    what : it asks, and how much of it there is.
    missing : what is not there, each in words; nothing when the condition is met.
    """

    what: Text
    missing: tuple[Text, ...] = ()

    @property
    def met(self) -> bool:
        """Whether nothing is missing."""
        return not self.missing


ISO_10360_2 = LengthPlan((*SPACE_DIAGONALS, *PARALLELS), 5, 3, 0.66, 30.0)
"""Seven positions, five lengths, three repeats: Harris 2004, 2.6.3, of the edition of 2000, who has 66 % and 30 mm too, and
Renishaw's summary of ISO 10360. The four space diagonals, and the axes as the three others, are those of the edition of 2009
as commonly reported; other positions that its user may choose are not known here."""

B89 = BarPlan(20, (*SPACE_DIAGONALS, *FACE_DIAGONALS, *PARALLELS), 10, 2.0, 10.0)
"""Twenty positions in the directions of figure 26 of the standard, as Harris 2004, figures C 1 and C 2, carries them out. What
a longer volume needs, what nearly cubic is, and the distance are this project's figures."""

ISO_10360_5 = SpherePlan(25, 45.0)
"""Twenty-five points (Renishaw's summary of ISO 10360), spread over a hemisphere; the reach is this project's figure."""

READY: Mapping[str, Plan] = MappingProxyType(
    {"ASME B89.4.1": B89, "ISO 10360-2": ISO_10360_2, "ISO 10360-5": ISO_10360_5}
)
"""By the name of the ready plan."""
