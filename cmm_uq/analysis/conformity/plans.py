"""What standards ask of a complete test, and where in the volume a length lies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.messages import NOTHING, Argument, Message, Text, Verbatim, say
from cmm_uq.base.points import AXES, Floats, Machine
from cmm_uq.base.values import dataclass

ALIGNED = np.sin(np.radians(10.0))  # a direction cosine below this does not count: as good as square to that axis
# Part of the travel of each axis that a position is named by, which a line, produced to the ends of travel, crosses; this
# project's figure, which leaves room for the fixture.
CORNER_TO_CORNER = 0.75
# three quarters to the last digit of a percentage with one, for ends are measured
_LEAST_OF_AXIS = CORNER_TO_CORNER - 0.0005
_ROUNDING = 1e-6  # mm; a line as near as this to the end of an axis' travel lies in it
PARALLELS = tuple(say("parallel to {axis}", axis=Verbatim(a.upper())) for a in AXES)
SPACE_DIAGONALS = tuple(say("space diagonal {axes}", axes=Verbatim(f"{x}X {y}Y +Z")) for x in "+−" for y in "+−")
FACE_DIAGONALS = tuple(
    say("face diagonal {axes}", axes=Verbatim(f"{s}{a} +{b}")) for a, b in ("XY", "YZ", "XZ") for s in "+−"
)


def position_of(direction: Floats) -> Text:
    """Position of a line in words, from its direction (3,), either way along it."""
    u = direction / np.linalg.norm(direction)
    counts = np.abs(u) > ALIGNED
    if np.sum(counts) == 1:
        return PARALLELS[int(np.argmax(counts))]
    axes = _signed(u, counts)
    return say("space diagonal {axes}", axes=axes) if np.all(counts) else say("face diagonal {axes}", axes=axes)


def position_on(machine: Machine, middle: Floats, direction: Floats) -> Text:
    """Position of a line through ``middle`` (3,), mm in the recorded frame, where the travel is known: by what it crosses."""
    return _position_on(*_line(machine, middle, direction))


def crossed_travel(machine: Machine, middle: Floats, direction: Floats) -> float | None:
    """Travel, mm, along a line through ``middle`` (3,) in the recorded frame; 0 outside it, ``None`` where none is stated."""
    return _crossed(*_line(machine, middle, direction))


def too_short(position: Message, machine: Machine, lines: Sequence[tuple[int, Floats, Floats]]) -> Text:
    """A diagonal that is missing, with the line of its direction that crosses most of the travel and is none.

    lines : number of the measurement, middle (3,) and direction (3,) of each.
    """
    share, axis, measurement = 0.0, "", -1
    for number, middle, direction in lines:
        if position_on(machine, middle, direction) == _oblique(position.arguments.get("axes", NOTHING)):
            u = np.abs(direction / np.linalg.norm(direction))
            shares = (crossed_travel(machine, middle, direction) or 0.0) * u / np.ptp(machine.travel_mm, axis=1)
            own = min((float(shares[k]), AXES[k].upper()) for k in np.flatnonzero(u > ALIGNED))
            share, axis, measurement = max((share, axis, measurement), (*own, number))
    if not axis:
        return position
    return say(
        "{position} (measurement {measurement} lies along it, but its line crosses {share:.0f} % of the travel of {axis}, "
        "less than {least:.0f} %)",
        position=position,
        measurement=measurement,
        share=float(np.floor(100 * share)),
        axis=Verbatim(axis),
        least=100 * CORNER_TO_CORNER,
    )


Numbers = tuple[float, ...]


def _line(machine: Machine, middle: Floats, direction: Floats) -> tuple[Numbers, Numbers, Numbers]:
    """Ends of travel, place in scale readings and direction, as keys."""
    ends, place, along = (each.ravel().tolist() for each in (machine.travel_mm, middle + machine.origin_mm, direction))
    return tuple(ends), tuple(place), tuple(along)


@lru_cache(maxsize=16_384)  # conditions, figures and remarks of several standards ask for the same lines
def _position_on(ends: Numbers, place: Numbers, direction: Numbers) -> Text:
    travel, along = np.reshape(ends, (-1, 2)), np.array(direction)
    crossed, u = _crossed(ends, place, direction), along / np.linalg.norm(along)
    if crossed is None:
        return position_of(u)
    counts, reached = np.abs(u) > ALIGNED, crossed * np.abs(u) >= _LEAST_OF_AXIS * np.ptp(travel, axis=1)
    if np.all(reached):
        return say("space diagonal {axes}", axes=_signed(u, np.ones(3, dtype=bool)))
    if np.all(counts) or (crossed and not np.all(reached[counts])):
        return _oblique(_signed(u, counts))
    return position_of(u)


@lru_cache(maxsize=16_384)
def _crossed(ends: Numbers, place_mm: Numbers, direction: Numbers) -> float | None:
    travel, place, along = np.reshape(ends, (-1, 2)), np.array(place_mm), np.array(direction)
    if not np.all(np.isfinite(travel)):
        return None
    u = along / np.linalg.norm(along)
    moving = np.abs(u) > 1e-9
    if np.any((np.abs(place - travel.mean(axis=1)) > 0.5 * np.ptp(travel, axis=1) + _ROUNDING)[~moving]):
        return 0.0
    crossed = (travel - place[:, None])[moving] / u[moving, None]
    return max(0.0, float(crossed.max(axis=1).min() - crossed.min(axis=1).max()))


def _oblique(axes: Argument) -> Message:
    return say("oblique {axes}", axes=axes)


def share_of_travel(machine: Machine, middle: Floats, direction: Floats, length: float) -> float | None:
    """Length, mm, over the travel along its line; ``None`` where no travel is stated or the line lies outside it."""
    available = crossed_travel(machine, middle, direction)
    return length / available if available else None


def _signed(u: Floats, counts: NDArray[np.bool_]) -> Text:
    signs = np.sign(u) * np.sign(u[counts][-1])
    taken = zip(AXES, signs, counts, strict=True)
    return Verbatim(" ".join(f"{'+' if sign > 0 else '−'}{axis.upper()}" for axis, sign, counted in taken if counted))


@dataclass(frozen=True)
class LengthPlan:
    positions: tuple[Message, ...]
    lengths: int  # different ones in each position
    repeats: int  # of each length in each position
    least_share: float  # the longest length in a position over the travel along it
    shortest_mm: float  # largest that the shortest length may be
    bidirectional: bool = False  # whether each length's ends are to be reached from opposite sides
    offset_mm: float | None = None  # of the stylus tip across the ram; lengths measured with another do not count

    @property
    def total(self) -> int:
        return len(self.positions) * self.lengths * self.repeats


@dataclass(frozen=True)
class BarPlan:
    """A ballbar in many positions."""

    positions: int  # how many in a nearly cubic volume
    directions: tuple[Text, ...]  # each of which some position has
    further: int  # positions more for each further cube of a longer volume
    nearly_cubic: float  # longest over shortest axis up to which a volume is taken as nearly cubic
    apart_mm: float  # bars of which both ends are nearer than this to those of another are in the same place

    def positions_in(self, size_mm: Floats) -> int:
        """How many positions a volume of this size (3,) has."""
        return self.positions + self.further * (int(np.prod(self.cubes(size_mm))) - 1)

    def cubes(self, size_mm: Floats) -> tuple[int, ...]:
        """Into how many nearly cubic parts each axis of a volume (3,), mm, is divided."""
        edge = self.nearly_cubic * float(size_mm.min())
        return tuple(int(np.ceil(extent / edge - 1e-9)) for extent in size_mm)


@dataclass(frozen=True)
class SpherePlan:
    points: int  # different ones on each sphere, or more
    reach_deg: float  # no direction of the hemisphere is farther than this from the nearest point
    diameter_mm: tuple[float, float] = (0.0, np.inf)  # least and largest of the sphere


@dataclass(frozen=True)
class ShortLengthPlan:
    """A short gauge in several orientations."""

    orientations: int  # that differ by more than apart_deg
    apart_deg: float
    repeats: int
    longest_mm: float


Plan = LengthPlan | BarPlan | SpherePlan


@dataclass(frozen=True)
class Condition:
    """One thing that a standard asks for."""

    what: Text  # it asks, and how much of it there is
    missing: tuple[Text, ...] = ()  # what is not there, each in words; nothing when the condition is met
    remedy: Text = NOTHING  # which key of the job states what is missing, for who writes it
    line: Text = NOTHING  # of the test uncertainty, which is neither stated nor declared; key: in [test_uncertainty]
    key: str = ""

    @property
    def met(self) -> bool:
        return not self.missing


OFFSET_TOLERANCE_MM = 10.0  # Within which a stylus tip has an offset; this project's figure
# E0 and R0. Seven positions, five lengths, three repeats, 66 %, 30 mm: Harris 2004, 2.6.3, of the edition of 2000, and
# Renishaw's summary of ISO 10360. Four space diagonals and the axes are those of the edition of 2009 as commonly reported;
# other positions that its user may choose are not known here
ISO_10360_2 = LengthPlan((*SPACE_DIAGONALS, *PARALLELS), 5, 3, 0.66, 30.0, bidirectional=True, offset_mm=0.0)

# E150, in one of two planes that hold a vertical ram. 150 mm is in the name; two diagonals, five lengths, three repeats, as
# commonly reported, not verified
ISO_10360_2_OFFSET = tuple(
    LengthPlan(plane, 5, 3, 0.66, 30.0, bidirectional=True, offset_mm=150.0)
    for plane in (FACE_DIAGONALS[2:4], FACE_DIAGONALS[4:])
)

# Axial, planar and spatial positions of a step gauge or of gauge blocks: Harris 2004, 2.6.2. How many lengths and repeats,
# how long and how short: those of ISO 10360-2, this project's choice
VDI_2617_2_1 = {
    name: LengthPlan(positions, 5, 3, 0.66, 30.0)
    for name, positions in (("U1", PARALLELS), ("U2", FACE_DIAGONALS), ("U3", SPACE_DIAGONALS))
}

# A step gauge or laser along each axis: Harris 2004, 2.6.1. Ten lengths, three repeats, 66 %: this project's choice
B89_LINEAR = LengthPlan(PARALLELS, 10, 3, 0.66, np.inf)
B89_REPEATABILITY = 10  # positions of a fixed ball: Harris 2004, 2.6.1. Ten: this project's choice
# Four diagonals in vertical planes, each with two offsets at right angles to the ram: Harris 2004, 2.6.1. Which four: this
# project's reading
B89_OFFSET = FACE_DIAGONALS[2:]

# A short gauge block in four orientations: Harris 2004, 2.6.1. 10°, three repeats, what is short: this project's choice
B89_BIDIRECTIONAL = ShortLengthPlan(4, 10.0, 3, 50.0)
# Twenty positions in the directions of figure 26 of the standard, as Harris 2004, figures C 1 and C 2, carries them out.
# What a longer volume needs, what nearly cubic is, and the distance are this project's figures
B89 = BarPlan(20, (*SPACE_DIAGONALS, *FACE_DIAGONALS, *PARALLELS), 10, 2.0, 10.0)
# Twenty-five points (Renishaw's summary of ISO 10360), spread over a hemisphere; the reach is this project's figure. A
# sphere of 10 to 50 mm: Harris 2004, 2.6.3, of ISO 10360-2:2000; not less than 10 mm by clause 6.2.1 of the edition of 2020
# too
ISO_10360_5 = SpherePlan(25, 45.0, (10.0, 50.0))
ISO_10360_8 = SpherePlan(25, 45.0)  # The 25 are in the names of the characteristics; the reach is this project's figure

READY: Mapping[str, Plan] = MappingProxyType(  # by name
    {"ASME B89.4.1": B89, "ISO 10360-2": ISO_10360_2, "ISO 10360-5": ISO_10360_5}
)
