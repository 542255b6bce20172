"""How an axis is read, as its data sheet states it: what is known of its periodic error and play before any recording.

A coordinate is the reading of a scale on the axis itself, or of a rotary encoder on the screw or pinion that drives it. Data
sheets bound two things. *Within one period* of the signal, interpolation errs by so much to either side; a screw errs so
within one turn. *Within a section* of so many millimetres all errors together, about their mean, stay within ±b (accuracy
grade of a scale within a metre, its baseline error, half of v300 of a screw). A wave of the period λ and the amplitude A
changes by 2·A·sin(πL/λ) at most within a section L, by 2·A where the section holds half of it, so that

    A(λ) ≤ b / sin(πL/λ),   L < λ/2,      A(λ) ≤ b elsewhere,

and of several sections the least holds. Periods are taken evenly in their logarithm, as where nothing is stated.

A scale on the axis does not see what its drive does at reversal (HEIDENHAIN, Exposed Linear Encoders, 208960-2F, 05/2019,
p. 2: eliminated are reversal error and the kinematic error of the ball screw's pitch), only its own hysteresis. What the
carriage does beside its scale (it yaws when it turns round) is other errors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from cmm_uq.base.messages import Text, say
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.tables.machine import SCREW, AxisFacts

Band = tuple[float, float, float]  # periods from, to, mm; amplitude that 95 of 100 do not exceed, µm


@dataclass(frozen=True)
class PublishedReading:
    """What makers publish of one kind of reading, the coarsest of it, for what a job leaves out."""

    name: Text
    within: tuple[tuple[float, float], ...]  # sections, mm, and the largest deviation within, µm to either side
    source: str  # of these figures
    of_period: float | None = None  # largest interpolation error, over the period of the signal
    period_mm: float | None = None  # the longest of a signal
    play_um: float | None = None  # hysteresis of a scale on the axis; ``None`` where the drive's play is in the reading


# largest published hysteresis of a scale on its axis: RLS, LMA10 linear absolute magnetic encoder system, technical
# specifications: hysteresis < 2 µm at 0.1 mm ride height
HYSTERESIS_UM = 2.0
# ISO 3408-3:2006, permissible travel variations v300p within 300 mm and v2πp within one turn, µm, by tolerance grade
SCREWS: Mapping[int, tuple[float, float | None]] = {1: (6.0, 4.0), 3: (12.0, 6.0), 5: (23.0, 8.0), 7: (52.0, None)}
COARSEST = 7  # of these
PUBLISHED: Mapping[str, PublishedReading] = {
    "exposed optical grating": PublishedReading(
        say("exposed optical grating"), ((1000.0, 15.0),),
        "HEIDENHAIN, Exposed Linear Encoders: within one signal period ±1 % of it, periods up to 200 µm (LIDA 2xx; Measuring "
        "accuracy); accuracy grades up to ±15 µm in any metre (LIDA 200; selection guide)", 0.01, 0.2, HYSTERESIS_UM,
    ),
    "sealed optical grating": PublishedReading(
        say("sealed optical grating"), ((1000.0, 10.0),),
        "HEIDENHAIN, Längenmessgeräte, Definition der Abweichungen: within one signal period ±2 % of it, periods up to 40 µm "
        "(LB); accuracy grades up to ±10 µm in any metre (LS 328 C, LS 628 C)", 0.02, 0.04, HYSTERESIS_UM,
    ),
    "laser interferometer": PublishedReading(
        say("laser interferometer"), ((1000.0, 0.5),),
        "a fringe of half of 633 nm that is not miscounted errs by no more than half of it; Renishaw, XL-80 laser measurement "
        "system, specification: ±0.5 ppm", 0.5, 0.000_316_5, HYSTERESIS_UM,
    ),
    "inductive scale": PublishedReading(
        say("inductive scale"), ((1000.0, 5.0),),
        "AMO, AMOSIN LMB-100, LMB-130: up to ±5 µm in a metre after linear compensation", play_um=HYSTERESIS_UM,
    ),
    "magnetic scale": PublishedReading(
        say("magnetic scale"), ((1000.0, 40.0), (10.0, 10.0)),
        "RLS, LMA10: system accuracy ±40 µm/m, short range accuracy ±10 µm/10 mm, poles of 2 mm", play_um=HYSTERESIS_UM,
    ),
    "rack and rotary encoder": PublishedReading(say("rack and rotary encoder"), (), ""),
    SCREW: PublishedReading(say("ball screw and rotary encoder"), ((300.0, 0.5 * SCREWS[COARSEST][0]),), ""),
}  # fmt: skip
LENGTHS_MM = (0.5, 1000.0)  # periods of errors whose period nobody states
_PARTS = 16  # bands of these
_TURN = 4  # bands of an error within one period: its first and second harmonic, and what lies between


def largest_amplitude(period_mm: float, within: Sequence[tuple[float, float]]) -> float:
    """Of a wave that keeps all sections (mm) within their deviations (µm to either side), µm; infinite without any."""
    each = [um / np.sin(np.pi * min(mm / period_mm, 0.5)) for mm, um in within]
    return float(min(each, default=np.inf))


@dataclass(frozen=True)
class AxisReading:
    """What is taken of an axis that is read as somebody states."""

    facts: AxisFacts
    most_um: float  # amplitude that physics allows of any axis, 95 of 100

    @property
    def published(self) -> PublishedReading:
        return PUBLISHED[self.facts.reading]

    @property
    def source(self) -> str:
        """Of figures that the job does not state; nothing where it states all."""
        facts, published = self.facts, self.published
        if facts.reading == SCREW and not facts.deviation:
            return f"ISO 3408-3:2006, v300p and v2πp of tolerance grade {facts.grade or COARSEST}"
        interpolated = published.of_period is not None and facts.interpolation_um is None
        return published.source if interpolated or not facts.deviation else ""

    @property
    def within(self) -> tuple[tuple[float, float], ...]:
        """Sections, mm, with the largest deviation, µm to either side."""
        if self.facts.deviation:
            return tuple((mm, um) for mm, um in self.facts.deviation)
        if self.facts.grade is not None:
            return ((300.0, 0.5 * SCREWS[self.facts.grade][0]),)
        return self.published.within

    @property
    def interpolation(self) -> tuple[float, float] | None:
        """A period, mm, and the largest deviation within it, µm; ``None`` where that is in the deviations of sections."""
        facts, published = self.facts, self.published
        period, most = facts.period_mm or published.period_mm, facts.interpolation_um
        if most is None and facts.grade is not None:
            most = None if (turn := SCREWS[facts.grade][1]) is None else 0.5 * turn
        elif most is None and period is not None and published.of_period is not None:
            most = 1000 * period * published.of_period
        return None if most is None or period is None else (period, most)

    @property
    def play_um(self) -> float | None:
        """Gap that 95 of 100 do not exceed; ``None`` where nothing is known but what physics allows."""
        return self.facts.play_um or self.published.play_um

    @property
    def errors(self) -> tuple[tuple[Band, ...], ...]:
        """Errors that the periodic error of the axis is the sum of: of any period, and within one of the signal."""
        ends = np.geomspace(*LENGTHS_MM, _PARTS + 1)
        middles = np.sqrt(ends[:-1] * ends[1:])
        sizes = [min(largest_amplitude(float(middle), self.within), self.most_um) for middle in middles]
        found = [tuple(zip(ends[:-1].tolist(), ends[1:].tolist(), sizes, strict=True))]
        if self.interpolation is not None:
            period, most = self.interpolation
            ends = np.geomspace(0.5 * period, period, _TURN + 1)
            found.append(tuple((low, high, most) for low, high in pairwise(ends.tolist())))
        return tuple(found)

    @property
    def largest_um(self) -> float:
        """Of all errors together, in the root mean square over their periods."""
        return float(np.sqrt(sum(np.mean([most**2 for *_, most in bands]) for bands in self.errors)))
