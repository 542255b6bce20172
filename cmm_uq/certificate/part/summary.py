"""A part in a few lines, for the end of a command: decisions, figures, what makes their uncertainty, warnings."""

from __future__ import annotations

from math import degrees, isfinite

from cmm_uq.analysis.parts.characteristics import never_negative
from cmm_uq.analysis.parts.in_words import CHARACTERISTICS
from cmm_uq.base.messages import NOTHING, Text, Verbatim, commas, day, number, plural, say
from cmm_uq.base.units import unit
from cmm_uq.certificate.effect_words import titles
from cmm_uq.certificate.part.found import Further, PartFound
from cmm_uq.certificate.wording import Figure, Headline, Summary, probability
from cmm_uq.jobs.verdicts import standing_of
from cmm_uq.maths.uncertainty.rounding import rounded, significant


def part_summary(found: PartFound) -> Summary:
    """What was found, in short."""
    facts = found.job.facts
    return Summary(
        Verbatim(facts.part.name), day(facts.job.date), tuple(_verdicts(found)),
        tuple(_figure(found, i) for i in range(len(found.stated))), tuple(_remarks(found)), warnings=found.warnings,
    )  # fmt: skip


def _verdicts(found: PartFound) -> list[Headline]:
    told = []
    for i, judged in enumerate(found.judged):
        if judged is None or judged.outcome is None:
            continue
        chance = say("conforms with {p}", p=probability(judged.probability or 0.0))
        told.append(
            Headline(judged.outcome.upper(), standing_of(judged.outcome), _named(found, i), (chance, judged.rule))
        )
    if found.together is not None and len(told) > 1:
        whole = found.outcome or "undecided"
        chance = say("all conform with {p}", p=probability(found.together))
        told.insert(0, Headline(whole.upper(), standing_of(whole), say("the part"), (chance,)))
    return told


def _named(found: PartFound, i: int) -> Text:
    one = found.characteristics[i]
    return say("{name}, {what} of {features}", name=Verbatim(one.name), what=CHARACTERISTICS[one.what],
               features=commas(Verbatim(name) for name in one.features))  # fmt: skip


def _figure(found: PartFound, i: int) -> Figure:
    """Value with U, or U alone where nothing was measured."""
    facts, stated = found.characteristics[i], found.stated[i]
    angle = facts.asks.limits == "angles"
    own = unit("°") if angle else unit("mm")
    factor = degrees(1.0) if angle else 1.0
    U = factor * stated.U
    k = say("k = {k}", k=number(stated.k, ".2f")) if stated.u and isfinite(stated.k) else NOTHING
    if stated.value is None:
        return _named(found, i), say("U = {u} {unit}", u=significant(U), unit=own), k
    value, u = rounded(factor * stated.value, U)
    if never_negative(found.plan)[i]:
        low, high = (rounded(factor * end, U)[0] for end in stated.interval)
        return _named(found, i), say("{low} to {high} {unit}", low=low, high=high, unit=own), say("95 % interval")
    return _named(found, i), say("{value} ± {u} {unit}", value=value, u=u, unit=own), k


def _remarks(found: PartFound) -> list[Text]:
    told: list[Text] = [found.standing.path]
    largest: dict[str, tuple[float, Text, str]] = {}
    for one in found.unseen:
        if one.share > largest.get(one.line, (0.0, NOTHING, ""))[0]:
            largest[one.line] = (one.share, one.title, one.characteristic)
    for share, title, characteristic in sorted(largest.values(), key=lambda each: -each[0])[:3]:
        told.append(say(
            "{share:.0f} % of the variance of {characteristic} comes from an error that the calibration did not see: {title}.",
            share=100 * share, characteristic=Verbatim(characteristic), title=title,
        ))  # fmt: skip
    if found.further is not None:
        told.append(_further(found.further))
    return told


def _further(further: Further) -> Text:
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
