"""Words, tables and pictures of a proof's report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from cmm_uq.base.messages import DASH, NOTHING, Text, commas, names, number, say, semicolons
from cmm_uq.base.points import Floats
from cmm_uq.certificate.diagnosis.overview import VERDICT_WORDS
from cmm_uq.certificate.document import Block, Column, Paragraph, Plot, Section, Table
from cmm_uq.certificate.plots.style import ACCENT, BAND, INK, MUTED, bars, dots, drawn, house_style, new_figure
from cmm_uq.jobs.job import Job
from cmm_uq.laboratory.proving import cases, judgement
from cmm_uq.laboratory.proving.cases import canonical_json, sha256_of
from cmm_uq.laboratory.proving.design import (
    DRAWN,
    NO_TRAVEL,
    TAKEN,
    TOO_SMALL,
    UNRECORDED,
    Design,
    FaultReach,
    Reach,
    fault_reaches,
    reaches,
)
from cmm_uq.laboratory.proving.judgement import MISSED, OPEN, AcceptanceFigure, ProofJudgement, acceptance_figures
from cmm_uq.laboratory.proving.rates import LARGEST, OFTEN, DetectionCurve, Rate, Tenth

KIND_WORDS: Mapping[str, Text] = {
    cases.NOTHING: say("nothing"),
    cases.ONE: say("one effect"),
    cases.TWO: say("two effects"),
    cases.OUTSIDE: say("a function outside the catalogue"),
    cases.ARTEFACT: say("a fault of the artefact"),
}
NOISE_WORDS: Mapping[str, Text] = {
    cases.OWN: say("the job's own"),
    cases.WHITE: say("white"),
    cases.SET_UP: say("with set-up offsets"),
    cases.AXIS: say("one axis three times noisier"),
    cases.GROWING: say("growing with length"),
    cases.SLOWLY: say("with slow noise in time"),
    cases.WALKING: say("walking at random in time"),
    cases.TAILS: say("heavy tails"),
    cases.RESOLUTION: say("coarse display"),
}
FAULT_WORDS: Mapping[str, Text] = {
    "length": say("a wrong certified length"),
    "nodes": say("errors of its own points, common to all set-ups"),
    "warm": say("another temperature than stated, the same throughout"),
    "warming": say("warming from one set-up to the next"),
}
INTERVAL_WORDS: Mapping[str, Text] = {
    judgement.STATED: say("of effects that were found"),
    judgement.NAMED: say("of what the job names, nothing hidden"),
    judgement.NAMED_BESIDE: say("of what the job names, all that is hidden found and told apart"),
    judgement.NAMED_GROUPED: say("of what the job names, something found only as one of a group"),
    judgement.NAMED_MISSED: say("of what the job names, something hidden not found"),
}
ANSWER_WORDS: Mapping[str, Text] = {**VERDICT_WORDS, judgement.REFUSED: say("no answer")}
STANDING_WORDS: Mapping[str, Text] = {
    judgement.MET: say("shown"),
    OPEN: say("too few cases to decide"),
    MISSED: say("missed"),
}


def percent(rate: Rate) -> Text:
    return DASH if rate.value is None else number(100 * rate.value, ".1f")


def interval(rate: Rate) -> Text:
    if not rate.of:
        return DASH
    low, high = (100 * each for each in rate.interval)
    return say("{low} to {high}", low=number(low, ".1f"), high=number(high, ".1f"))


def counted(rate: Rate) -> Text:
    return say("{count} of {of}", count=rate.count, of=rate.of) if rate.of else DASH


def in_words(rate: Rate) -> Text:
    if not rate.of:
        return say("none to count")
    return say("{count} of {of}, {percent} % (95 %: {interval} %)", count=rate.count, of=rate.of, percent=percent(rate),
               interval=interval(rate))  # fmt: skip


def limits(figure: AcceptanceFigure) -> Text:
    if figure.low == 0:
        return say("at most {high:g} %", high=100 * figure.high)
    if figure.high == 1:
        return say("at least {low:g} %", low=100 * figure.low)
    return say("{low:g} to {high:g} %", low=100 * figure.low, high=100 * figure.high)


def standing(figure: AcceptanceFigure) -> Text:
    """Whether it is kept, and what would decide it."""
    told = STANDING_WORDS[figure.standing]
    if figure.standing == OPEN and figure.kept and figure.cases is not None and figure.rate.of < figure.cases:
        return say(
            "{told}; counted within the limit; {needed} cases of this sort without one would show it",
            told=told,
            needed=figure.cases,
        )
    if figure.standing == OPEN and figure.rate.of:
        return (
            say("{told}; counted within the limits", told=told)
            if figure.kept
            else say("{told}; counted outside the limits", told=told)
        )
    return told


@dataclass(frozen=True, eq=False)
class DiagnosisProof:
    """A job whose diagnosis was tried on sealed cases."""

    job: Job  # with the set-ups that cases were drawn on
    design: Design  # these, with the job's own errors and noise
    seed: int  # seed, alpha: of the cases, and rate of false alarms that the diagnosis was asked for
    alpha: float
    truth: bytes
    records: tuple[Mapping[str, Any], ...]  # what was said of each case, by number
    judgement: ProofJudgement

    @property
    def sha256(self) -> str:
        return sha256_of(self.truth)

    @property
    def answers(self) -> bytes:
        """All that was said, a line of JSON a case."""
        return b"".join(canonical_json(record) for record in self.records)

    @cached_property
    def accepted(self) -> tuple[AcceptanceFigure, ...]:
        """The figures that the laboratory accepts the method by."""
        return acceptance_figures(self.judgement, self.job.facts.prove)

    @cached_property
    def reaches(self) -> tuple[Reach, ...]:
        return reaches(self.design)

    @cached_property
    def faults(self) -> tuple[FaultReach, ...]:
        return tuple(fault_reaches(self.design))

    @property
    def conforming(self) -> bool:
        """Whether the cases show of no figure that it is missed."""
        return all(one.standing != MISSED for one in self.accepted)


def effects_section(proof: DiagnosisProof) -> Section:
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


def _smallest(proof: DiagnosisProof, reach: Reach) -> tuple[Text, Text]:
    found = proof.judgement.by_strength
    if found is None or reach.amplitude(found.often) is None:
        return DASH, DASH
    low, high = (reach.amplitude(min(end, LARGEST)) for end in found.interval)
    ends = [DASH if end is None else number(end, ".2g") for end in (low, high)]
    return number(found.often / reach.per_unit, ".2g"), say("{low} to {high}", low=ends[0], high=ends[1])


def unseen_section(proof: DiagnosisProof) -> Section:
    found: list[Block] = [Paragraph(text) for text in (*_unseen(proof.reaches), *_faults(proof))]
    by_columns: dict[tuple[str, ...], list[Text]] = {}
    for reach in proof.reaches:
        if reach.standing == UNRECORDED:
            by_columns.setdefault(reach.columns, []).append(reach.title)
    rows = tuple((semicolons(titles), commas(names(columns))) for columns, titles in by_columns.items())
    heads = (Column(say("Effects"), numeric=False), Column(say("Columns that they go by"), numeric=False))
    return Section(
        say("What these set-ups cannot see"),
        (*found, *((Table(say("Not considered, because it is not recorded"), heads, rows),) if rows else ())),
    )


def _unseen(reaches: tuple[Reach, ...]) -> list[Text]:
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


def _faults(proof: DiagnosisProof) -> list[Text]:
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


_HEIGHT_MM = 72


def strength_plot(in_bins: tuple[tuple[float, float, Rate], ...], curve: DetectionCurve) -> Plot:
    """Part of the hidden effects that is found, by their strength, with the fitted curve."""
    counted = [(low, high, rate) for low, high, rate in in_bins if rate.of]
    middle = np.array([0.5 * (low + high) for low, high, _ in counted])
    share, low, high = _rates([rate for _, _, rate in counted])
    with house_style():
        figure = new_figure(_HEIGHT_MM)
        ax = figure.subplots()
        figure.subplots_adjust(left=0.09, right=0.985, bottom=0.15, top=0.96)
        across = np.append(curve.strengths, curve.strengths[::-1])
        ax.fill(across, 100 * np.append(curve.low, curve.high[::-1]), color=BAND, lw=0, zorder=0)
        ax.plot(curve.strengths, 100 * curve.curve, color=ACCENT, lw=1.3)
        ax.axhline(100 * OFTEN, color=MUTED, lw=0.6, ls=(0, (4, 3)), zorder=1)
        bars(ax, middle, low, high, 1.0, INK)
        dots(ax, middle, share, 4.0, INK)
        ax.set(xlim=(curve.strengths[0] - 0.5, curve.strengths[-1] + 0.5), ylim=(-3, 103))
        ax.grid(axis="y")
        ax.set_xlabel(say("Strength √λ of the hidden effect"))
        ax.set_ylabel(say("Found / %"))
        return drawn(
            figure,
            say("Hidden effects that were found, by strength: counted with 95 % intervals, and the fitted curve with its "
                "band; the broken line is nine in ten."),
            say("Share of hidden effects found, growing with their strength from {low:g} to {high:g}.",
                low=float(curve.strengths[0]), high=float(curve.strengths[-1])),
        )  # fmt: skip


def said_plot(each: tuple[Tenth, ...]) -> Plot:
    """Probabilities of asserted effects, by tenths, against the share of them that act."""
    said = 100 * np.array([one.said for one in each])
    share, low, high = _rates([one.right for one in each])
    with house_style():
        figure = new_figure(_HEIGHT_MM)
        ax = figure.subplots()
        figure.subplots_adjust(left=0.09, right=0.985, bottom=0.15, top=0.96)
        ax.plot([0, 100], [0, 100], color=MUTED, lw=0.7, zorder=1)
        bars(ax, said, low, high, 1.0, ACCENT)
        dots(ax, said, share, 4.0, ACCENT)
        ax.set(xlim=(-2, 103), ylim=(-3, 103))
        ax.grid()
        ax.set_xlabel(say("Probability that was said / %"))
        ax.set_ylabel(say("Right / %"))
        return drawn(
            figure,
            say("Probability that was said of asserted effects against the share of them that act, by tenths, with 95 % "
                "intervals."),
            say("Probabilities said and shares right in {count} tenths.", count=len(each)),
        )  # fmt: skip


def _rates(rates: list[Rate]) -> tuple[Floats, Floats, Floats]:
    ends = np.array([rate.interval for rate in rates]).reshape(-1, 2)
    share = np.array([rate.count / rate.of for rate in rates])
    return 100 * share, 100 * ends[:, 0], 100 * ends[:, 1]
