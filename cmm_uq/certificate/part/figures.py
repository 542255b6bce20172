"""The figures of a part's characteristics as a page states them: lengths in mm and µm, angles in degrees and seconds.

A part in a few lines, for the end of a command: decisions, figures, what makes their uncertainty, warnings.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from math import degrees, isfinite

import numpy as np

from cmm_uq.analysis.conformity.limits import LimitDecision
from cmm_uq.analysis.parts.budget import CHARACTERISTICS
from cmm_uq.analysis.parts.characteristics import never_negative
from cmm_uq.analysis.parts.result import StatedCharacteristic
from cmm_uq.base.messages import DASH, NOTHING, Number, Text, Verbatim, commas, day, names, number, plural, say, signed
from cmm_uq.base.units import ARCSECOND, MICROMETRE, Unit, unit
from cmm_uq.base.values import dataclass
from cmm_uq.certificate.part.measurement import FurtherSetUps, PartMeasurement
from cmm_uq.certificate.wording import Figure, Headline, Summary, probability, titles
from cmm_uq.jobs.part.feature import CharacteristicFacts
from cmm_uq.jobs.verdicts import standing_of
from cmm_uq.maths.uncertainty.quantity import rounded, significant


@dataclass(frozen=True)
class PrintedUnits:
    """Units in which a value and its uncertainty are printed."""

    value: Unit  # of values and limits
    small: Unit  # of uncertainties
    # one of each in the units inside, mm or rad
    per_value: float
    per_small: float


LENGTHS = PrintedUnits(unit("mm"), unit("µm"), 1.0, MICROMETRE)
ANGLES = PrintedUnits(unit("°"), unit("″"), float(np.pi / 180), ARCSECOND)


@dataclass(frozen=True, eq=False)
class CharacteristicFigures:
    """One characteristic in figures, printed to the place of its U, in its units."""

    found: PartMeasurement
    place: int  # among those of the part, from 0
    facts: CharacteristicFacts
    stated: StatedCharacteristic
    judged: LimitDecision | None

    @property
    def scale(self) -> PrintedUnits:
        return ANGLES if self.angular else LENGTHS

    @property
    def angular(self) -> bool:
        return self.facts.asks.limits == "angles"

    @property
    def zone(self) -> bool:
        """Whether it is the width of a zone, which is never negative."""
        return self.facts.asks.limits == "zone"

    @property
    def number(self) -> Number:
        """Of it on this page, from 1."""
        return number(self.place + 1)

    @property
    def name(self) -> Text:
        return Verbatim(self.stated.name)

    @property
    def what(self) -> Text:
        """What it is of which features: ``position of bore | A, B``."""
        facts = self.facts
        told = say("{what} of {features}", what=CHARACTERISTICS[facts.what], features=commas(names(facts.features)))
        return say("{what} to {datums}", what=told, datums=commas(names(facts.datums))) if facts.datums else told

    @property
    def titled(self) -> Text:
        return say("{name}: {what}", name=self.name, what=self.what)

    @property
    def beside(self) -> Text:
        """The same beside its number, which it does not say again."""
        return say("{what:capital}", what=self.what) if self.stated.name == self.number else self.titled

    @property
    def called(self) -> Text:
        return say("characteristic {name}", name=self.name)

    @property
    def expanded(self) -> float:
        """Half of the shortest 95 % interval of the errors, mm or rad."""
        return self.stated.U

    @cached_property
    def one_sided(self) -> bool:
        """Whether it is a measured width, which has no side below zero: it is stated by its interval."""
        return self.stated.value is not None and bool(never_negative(self.found.plan)[self.place])

    @property
    def interval(self) -> Text:
        """Of the value, mm or °; where nothing was measured, of value less indication, µm or ″."""
        low, high = map(self.error if self.stated.value is None else self.at, self.stated.interval)
        return say("{low} to {high}", low=low, high=high)

    @property
    def limits(self) -> tuple[float | None, float | None]:
        """Lower and upper, mm or rad."""
        one = self.found.plan.characteristics[self.place]
        return one.lower, one.upper

    @property
    def width(self) -> float:
        """Between the limits, mm or rad, of a zone its own; ``nan`` where a side is open."""
        low, high = self.limits
        low = 0.0 if self.zone else low
        return float("nan") if low is None or high is None else high - low

    @property
    def allowed(self) -> Text:
        (low, high), shown = self.limits, self.scale.value
        if low is not None and high is not None:
            return say("{low} to {high} {unit}", low=self.limit(low), high=self.limit(high), unit=shown)
        if high is not None:
            return say("at most {limit} {unit}", limit=self.limit(high), unit=shown)
        return say("at least {limit} {unit}", limit=self.limit(low), unit=shown) if low is not None else NOTHING

    @property
    def result(self) -> Text:
        """The value with U, or the interval of a width; U alone where nothing was measured."""
        U = say("U = {U} {unit}", U=self.small(self.expanded), unit=self.scale.small)
        if self.stated.value is None:
            return U
        value, shown = self.at(self.stated.value), self.scale.value
        if self.one_sided:
            return say(
                "{value} {unit}, 95 % interval {interval} {unit}", value=value, interval=self.interval, unit=shown
            )
        return say("{value} {unit}, {U}", value=value, unit=shown, U=U)

    @property
    def with_factor(self) -> tuple[Text, Text]:
        """U and k, a dash where there is no u; dashes of what is stated by its interval."""
        k = number(self.stated.k, ".2f") if np.isfinite(self.stated.k) else DASH
        return (DASH, DASH) if self.one_sided else (self.small(self.expanded), k)

    def small(self, size: float) -> Number:
        """An uncertainty, two digits of it, in µm or ″."""
        return significant(size / self.scale.per_small)

    def at(self, value: float) -> Number:
        """A value to the place of its U, in mm or °."""
        return rounded(value / self.scale.per_value, self.expanded / self.scale.per_value)[0]

    def error(self, value: float) -> Number:
        """A difference to the place of U, in µm or ″."""
        return rounded(value / self.scale.per_small, self.expanded / self.scale.per_small)[0]

    def limit(self, value: float | None) -> Text:
        """A limit or a nominal value as it was given, in mm or °."""
        return DASH if value is None else signed(float(f"{value / self.scale.per_value:.10g}"), ".10g")

    def accepted_of(self, accepted: tuple[float | None, float | None] | None) -> Text:
        """Which values a rule accepts, mm or °."""
        if accepted is None:
            return say("none")
        low, high = accepted
        if low is not None and high is not None:
            return say("{low} to {high}", low=self.at(low), high=self.at(high))
        if high is not None:
            return say("up to {limit}", limit=self.at(high))
        return DASH if low is None else say("from {limit}", limit=self.at(low))


def figures_of(found: PartMeasurement) -> list[CharacteristicFigures]:
    """Every characteristic, in the order of the job."""
    each = zip(found.characteristics, found.stated, found.judged, strict=True)
    return [CharacteristicFigures(found, place, *one) for place, one in enumerate(each)]


def critical(found: PartMeasurement) -> CharacteristicFigures:
    """What is told of first: the least margin; else what takes most of its tolerance; else the first."""
    every, nearest = figures_of(found), found.nearest
    shares = [one.expanded / one.width if one.width > 0 else -1.0 for one in every]
    return every[int(np.argmax(shares)) if nearest is None else nearest]


def by_margin(found: PartMeasurement) -> list[CharacteristicFigures]:
    """Every characteristic, the least margin first; those without any margin last, in their order."""
    margins, every = np.where(np.isnan(found.margins), np.inf, found.margins), figures_of(found)
    return [every[int(place)] for place in np.argsort(margins, kind="stable")]


def part_summary(found: PartMeasurement) -> Summary:
    facts, every = found.job.facts, figures_of(found)
    return Summary(
        Verbatim(facts.part.name), day(facts.job.date), tuple(_verdicts(found, every)), tuple(map(_figure, every)),
        tuple(_remarks(found)), warnings=found.warnings,
    )  # fmt: skip


def _verdicts(found: PartMeasurement, every: Sequence[CharacteristicFigures]) -> list[Headline]:
    told = []
    for one in every:
        if (judged := one.judged) is not None and judged.outcome is not None:
            chance = say("conforms with {p}", p=probability(judged.probability or 0.0))
            standing = standing_of(judged.outcome)
            told.append(Headline(judged.outcome.upper(), standing, _named(one), (chance, judged.rule)))
    if found.together is not None and (len(told) > 1 or found.job.facts.part.not_measured):
        whole = found.outcome or "undecided"
        chance = say("all conform with {p}", p=probability(found.together))
        told.insert(0, Headline(whole.upper(), standing_of(whole), say("the part"), (chance,)))
    return told


def _named(one: CharacteristicFigures) -> Text:
    return say("{name}, {what} of {features}", name=one.name, what=CHARACTERISTICS[one.facts.what],
               features=commas(names(one.facts.features)))  # fmt: skip


def _figure(one: CharacteristicFigures) -> Figure:
    """Value with U, or U alone where nothing was measured."""
    stated, unit_of = one.stated, one.scale.value
    factor = degrees(1.0) if one.angular else 1.0
    U = factor * stated.U
    k = say("k = {k}", k=number(stated.k, ".2f")) if stated.u and isfinite(stated.k) else NOTHING
    if stated.value is None:
        return _named(one), say("U = {u} {unit}", u=significant(U), unit=unit_of), k
    if one.one_sided:
        low, high = (rounded(factor * end, U)[0] for end in stated.interval)
        return _named(one), say("{low} to {high} {unit}", low=low, high=high, unit=unit_of), say("95 % interval")
    value, u = rounded(factor * stated.value, U)
    return _named(one), say("{value} ± {u} {unit}", value=value, u=u, unit=unit_of), k


def _remarks(found: PartMeasurement) -> list[Text]:
    order = sorted(found.unseen, key=lambda one: -one.share)
    largest = [next(one for one in order if one.line == line) for line in dict.fromkeys(one.line for one in order)]
    unseen = [
        say("{share:.0f} % of the variance of {characteristic} comes from an error that the calibration did not see: {title}.",
            share=100 * one.share, characteristic=Verbatim(one.characteristic), title=one.title)
        for one in largest[:3] if one.share > 0
    ]  # fmt: skip
    return [found.standing.path, *unseen, *([] if found.further is None else [_further(found.further)])]


def _further(further: FurtherSetUps) -> Text:
    """What to measure on the machine, its set-ups left to the page and to their file."""
    if not further.setups:
        return say("No further set-up of the artefact as it was recorded shows what the calibration did not see.")
    shown = commas(titles(name for name in further.effects if name not in further.missed))
    return plural(
        further.setups,
        one=say("One further set-up of the artefact shows {effects}: {file}.", effects=shown, file=Verbatim(further.file)),
        many=say("{count} further set-ups of the artefact show {effects}: {file}.",
                 count=further.setups, effects=shown, file=Verbatim(further.file)),
    )  # fmt: skip
