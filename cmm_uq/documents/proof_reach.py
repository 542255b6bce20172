"""What the set-ups of a proof can show: every effect with the smallest size that is found, and what cannot be seen."""

from __future__ import annotations

from collections.abc import Iterable

from cmm_uq.documents.document import Block, Column, Paragraph, Section, Table
from cmm_uq.documents.proof import Proof
from cmm_uq.documents.proof_words import FAULT_WORDS
from cmm_uq.messages import DASH, NOTHING, Text, Verbatim, commas, names, number, say
from cmm_uq.proving.reach import DRAWN, NO_TRAVEL, TAKEN, TOO_SMALL, UNRECORDED, FaultReach, Reach
from cmm_uq.proving.smallest import LARGEST


def effects_section(proof: Proof) -> Section:
    """Every effect that cases could hide: how often it was found, and how large it must be."""
    rows = []
    for reach in proof.reaches:
        if reach.standing != DRAWN:
            continue
        found, wrong = proof.judgement.of_effect(reach.effect)
        cell = say("{count} of {of}", count=found.count, of=found.of) if found.of else DASH
        alike: Text = Verbatim(reach.alike) if reach.alike else NOTHING
        rows.append(
            (
                Verbatim(reach.effect),
                cell,
                number(wrong),
                *_smallest(proof, reach),
                number(reach.allowed, ".3g"),
                reach.unit,
                alike,
            )
        )
    heads = (
        Column(say("Effect"), numeric=False), Column(say("Found")), Column(say("Wrongly named")),
        Column(say("Found in 9 of 10 from")), Column(say("95 %")), Column(say("Physics allows")),
        Column(say("Unit"), numeric=False), Column(say("Hardly told from"), numeric=False),
    )  # fmt: skip
    notes = (
        say(
            "Found in 9 of 10 from: the strength that all hidden effects together show, as a size of this effect "
            "under the job's noise; with its 95 % interval. A dash: not within what physics allows, or too few cases "
            "to say. Of a periodic effect for a typical period."
        ),
        say(
            "Hardly told from: an effect that leaves less than a tenth of this one in these set-ups; one then stands "
            "for the other, and the diagnosis is to name both."
        ),
    )
    blocks: tuple[Block, ...] = (Table(say("Effects that cases hide"), heads, tuple(rows), notes),) if rows else ()
    return Section(say("Every effect"), blocks)


def _smallest(proof: Proof, reach: Reach) -> tuple[Text, Text]:
    """Smallest size that is found in nine of ten, and its interval."""
    found = proof.judgement.by_strength
    if found is None or reach.amplitude(found.often) is None:
        return DASH, DASH
    low, high = (reach.amplitude(min(end, LARGEST)) for end in found.interval)
    ends = [DASH if end is None else number(end, ".2g") for end in (low, high)]
    return number(found.often / reach.per_unit, ".2g"), say("{low} to {high}", low=ends[0], high=ends[1])


def unseen_section(proof: Proof) -> Section:
    """What these set-ups cannot see, and why."""
    sentences = [*_unseen(proof.reaches), *_faults(proof.faults)]
    return Section(say("What these set-ups cannot see"), tuple(Paragraph(text) for text in sentences))


def _unseen(reaches: tuple[Reach, ...]) -> list[Text]:
    def of(standing: str) -> list[str]:
        return [reach.effect for reach in reaches if reach.standing == standing]

    found: list[Text] = []
    if taken := of(TAKEN):
        found.append(
            say(
                "Nothing of these shows: they leave the observations as they are, or what the job names takes all: {effects}.",
                effects=commas(names(taken)),
            )
        )
    if small := of(TOO_SMALL):
        found.append(
            say("These drown in the noise even as large as physics allows: {effects}.", effects=commas(names(small)))
        )
    by_columns: dict[tuple[str, ...], list[str]] = {}
    for reach in reaches:
        if reach.standing == UNRECORDED:
            by_columns.setdefault(reach.columns, []).append(reach.effect)
    for columns, effects in by_columns.items():
        found.append(say("Not recorded, so not considered: {effects}, for want of {columns}.", effects=commas(names(effects)),
                         columns=commas(names(columns))))  # fmt: skip
    if travel := of(NO_TRAVEL):
        found.append(
            say(
                "Not considered, for the job does not say what they need of the machine: {effects}.",
                effects=commas(names(travel)),
            )
        )
    return found


def _faults(faults: Iterable[FaultReach]) -> list[Text]:
    found: list[Text] = []
    for fault in faults:
        what = FAULT_WORDS[fault.what]
        if not fault.shows:
            found.append(say("Of the artefact, nothing shows of {what}: what the job names takes it.", what=what))
        elif fault.hidden:
            like = Verbatim(fault.like)
            told = say(
                "Of the artefact, {what} looks like {effect}; only other set-ups would tell.", what=what, effect=like
            )
            found.append(told)
    return found
