"""What the set-ups of a proof can show: every effect with the smallest size that is found, and what cannot be seen."""

from __future__ import annotations

from cmm_uq.base.messages import DASH, NOTHING, Text, commas, names, number, say, semicolons
from cmm_uq.certificate.document import Block, Column, Paragraph, Section, Table
from cmm_uq.certificate.proof.proof import Proof
from cmm_uq.certificate.proof.words import FAULT_WORDS
from cmm_uq.laboratory.proving.reach import DRAWN, NO_TRAVEL, TAKEN, TOO_SMALL, UNRECORDED, Reach
from cmm_uq.laboratory.proving.smallest import LARGEST


def effects_section(proof: Proof) -> Section:
    """Every effect that cases could hide: how often it was found, and how large it must be."""
    titles = {reach.effect: reach.title for reach in proof.reaches}
    rows = []
    for reach in proof.reaches:
        if reach.standing != DRAWN:
            continue
        found, wrong = proof.judgement.of_effect(reach.effect)
        cell = say("{count} of {of}", count=found.count, of=found.of) if found.of else DASH
        alike: Text = titles[reach.alike] if reach.alike else NOTHING
        rows.append(
            (
                reach.title,
                cell,
                number(wrong),
                *_smallest(proof, reach),
                number(reach.allowed, ".3g"),
                reach.unit,
                alike,
            )
        )
    heads = (
        Column(say("Effect"), numeric=False), Column(say("Times found")), Column(say("Wrongly named")),
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
    found: list[Block] = [Paragraph(text) for text in (*_unseen(proof.reaches), *_faults(proof))]
    return Section(say("What these set-ups cannot see"), (*found, *_unrecorded(proof.reaches)))


def _unseen(reaches: tuple[Reach, ...]) -> list[Text]:
    """Effects that act on what is recorded, and do not show."""
    told = {
        TAKEN: say(
            "Nothing of these shows, for they leave the observations as they are or what the job names takes all:"
        ),
        TOO_SMALL: say("These drown in the noise even as large as physics allows:"),
        NO_TRAVEL: say("Not considered, for the job does not say what they need of the machine:"),
    }
    found: list[Text] = []
    for standing, what in told.items():
        titles = [reach.title for reach in reaches if reach.standing == standing]
        if titles:
            found.append(say("{what} {effects}.", what=what, effects=semicolons(titles)))
    return found


def _unrecorded(reaches: tuple[Reach, ...]) -> tuple[Block, ...]:
    """Effects that go by what was not recorded."""
    by_columns: dict[tuple[str, ...], list[Text]] = {}
    for reach in reaches:
        if reach.standing == UNRECORDED:
            by_columns.setdefault(reach.columns, []).append(reach.title)
    rows = tuple((semicolons(titles), commas(names(columns))) for columns, titles in by_columns.items())
    heads = (Column(say("Effects"), numeric=False), Column(say("Columns that they go by"), numeric=False))
    return (Table(say("Not considered, because it is not recorded"), heads, rows),) if rows else ()


def _faults(proof: Proof) -> list[Text]:
    titles = {reach.effect: reach.title for reach in proof.reaches}
    found: list[Text] = []
    for fault in proof.faults:
        what = FAULT_WORDS[fault.what]
        if not fault.shows:
            found.append(say("Of the artefact, nothing shows of {what}: what the job names takes it.", what=what))
        elif fault.hidden:
            like = titles[fault.like]
            told = say(
                "Of the artefact, {what} looks like {effect:small}; only other set-ups would tell.",
                what=what,
                effect=like,
            )
            found.append(told)
    return found
