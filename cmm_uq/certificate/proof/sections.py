"""What the set-ups of a proof can show, and its pictures."""

from __future__ import annotations

import numpy as np

from cmm_uq.base.messages import DASH, NOTHING, Text, commas, names, number, say, semicolons
from cmm_uq.base.points import Floats
from cmm_uq.certificate.document import Block, Column, Paragraph, Plot, Section, Table
from cmm_uq.certificate.plots.style import ACCENT, BAND, INK, MUTED, bars, dots, drawn, house_style, new_figure
from cmm_uq.certificate.proof.words import FAULT_WORDS, DiagnosisProof
from cmm_uq.laboratory.proving.rates import LARGEST, OFTEN, DetectionCurve, Rate, Tenth
from cmm_uq.laboratory.proving.reach import DRAWN, NO_TRAVEL, TAKEN, TOO_SMALL, UNRECORDED, Reach


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
