"""Words, tables and pictures of a proof's report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from cmm_uq.base.messages import DASH, NOTHING, Text, commas, names, number, say, semicolons
from cmm_uq.base.points import Floats
from cmm_uq.base.units import unit
from cmm_uq.base.values import dataclass
from cmm_uq.certificate.diagnosis.overview import VERDICT_WORDS
from cmm_uq.certificate.document import Column, Facts, Paragraph, Plot, Section, Standing, section, table
from cmm_uq.certificate.plots.style import ACCENT, BAND, INK, MUTED, bars, dots, drawn, picture
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.verdicts import DIAGNOSES
from cmm_uq.laboratory.proving import cases, design as set_ups, judgement
from cmm_uq.laboratory.proving.cases import canonical_json, micrometres, sha256_of
from cmm_uq.laboratory.proving.design import Design, FaultReach, Reach, fault_reaches, reaches
from cmm_uq.laboratory.proving.judgement import OPEN, AcceptanceFigure, DetectionCurve, ProofJudgement, Rate, Tenth

KIND_WORDS: Mapping[str, Text] = {
    cases.NOTHING: say("nothing"), cases.ONE: say("one effect"), cases.TWO: say("two effects"),
    cases.OUTSIDE: say("a function outside the catalogue"), cases.ARTEFACT: say("a fault of the artefact"),
}  # fmt: skip
NOISE_WORDS: Mapping[str, Text] = {
    cases.OWN: say("the job's own"), cases.WHITE: say("white"), cases.SET_UP: say("with set-up offsets"),
    cases.AXIS: say("one axis three times noisier"), cases.GROWING: say("growing with length"),
    cases.SLOWLY: say("with slow noise in time"), cases.WALKING: say("walking at random in time"),
    cases.TAILS: say("heavy tails"), cases.RESOLUTION: say("coarse display"),
}  # fmt: skip
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
    judgement.MET: say("shown"), OPEN: say("too few cases to decide"), judgement.MISSED: say("missed"),
}  # fmt: skip
HEADLINES: Mapping[str, tuple[str, Standing]] = {
    judgement.MET: ("SHOWN", "good"), OPEN: ("OPEN", "open"), judgement.MISSED: ("MISSED", "bad"),
}  # fmt: skip
RATE_HEADS = (Column(say("Counted")), Column(say("Rate"), unit("%")), Column(say("95 % interval"), unit("%")))


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


def cells(rate: Rate) -> tuple[Text, Text, Text]:
    return counted(rate), percent(rate), interval(rate)


def standing(figure: AcceptanceFigure) -> Text:
    told, undecided = STANDING_WORDS[figure.standing], figure.standing == OPEN
    if undecided and figure.kept and figure.cases is not None and figure.rate.of < figure.cases:
        return say("{told}; counted within the limit; {needed} cases of this sort without one would show it",
                   told=told, needed=figure.cases)  # fmt: skip
    if not (undecided and figure.rate.of):
        return told
    outside = say("{told}; counted outside the limits", told=told)
    return say("{told}; counted within the limits", told=told) if figure.kept else outside


@dataclass(frozen=True, eq=False)
class DiagnosisProof:
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
        return b"".join(canonical_json(record) for record in self.records)

    @cached_property
    def accepted(self) -> tuple[AcceptanceFigure, ...]:
        return judgement.acceptance_figures(self.judgement, self.job.facts.prove)

    @cached_property
    def reaches(self) -> tuple[Reach, ...]:
        return reaches(self.design)

    @cached_property
    def faults(self) -> tuple[FaultReach, ...]:
        return tuple(fault_reaches(self.design))

    @property
    def conforming(self) -> bool:
        """Whether the cases show of no figure that it is missed."""
        return all(one.standing != judgement.MISSED for one in self.accepted)


def conclusion_section(conclusion: Text, figures: Sequence[AcceptanceFigure]) -> Section:
    rows = ((one.what, *cells(one.rate), limits(one), standing(one)) for one in figures)
    heads = (say("Figure"), *RATE_HEADS, say("Asked for"), say("Standing"))
    return section(say("Conclusion"), Paragraph(conclusion), table(say("Acceptance"), heads, rows, say(
        "Shown or missed: the whole interval (Clopper and Pearson) lies within or beyond what is asked for. What is "
        "asked for was sealed with the truth."
    )))  # fmt: skip


def noise_section(proof: DiagnosisProof) -> Section:
    own, drawn_noise = micrometres(proof.design.noise), [one.case.noise_kind for one in proof.judgement.cases]
    reading = say("{x:.3g}, {y:.3g}, {z:.3g} µm", x=own["x_um"], y=own["y_um"], z=own["z_um"])
    sizes = (
        (say("Set-up offset"), own["placing_um"]), (say("Growing, at the longest length"), own["growth_um"]),
        (say("Slow in time"), own["slow_um"]), (say("Step of the display"), own["resolution_um"]),
    )  # fmt: skip
    rows = ((what, say("{size:.3g} µm", size=size) if size else say("none")) for what, size in sizes)
    drawn_words = commas(
        say("{what} {count}", what=what, count=drawn_noise.count(kind))
        for kind, what in NOISE_WORDS.items()
        if kind in drawn_noise
    )
    facts = Facts(((say("Reading along x, y, z"), reading), *rows, (say("Noise of the cases"), drawn_words)))
    return section(say("Set-ups and noise"), facts)


def answers_section(proof: DiagnosisProof) -> Section:
    judged, rows, answers = proof.judgement, [], (*DIAGNOSES, judgement.REFUSED)
    for kind, what in KIND_WORDS.items():
        said, right = judged.verdicts(kind), sum(one.right for one in judged.of_kind(kind))
        rows.append((what, *map(number, (sum(said.values()), *(said.get(verdict, 0) for verdict in answers), right))))
    answered = [Column(ANSWER_WORDS[verdict]) for verdict in answers]
    verdicts = table(say("Verdicts"), (say("Hidden"), Column(say("Cases")), *answered, Column(say("Right"))), rows, say(
        "Right: consistent of nothing; explained of effects that are all found and no other named; of a function, "
        "that no known effect accounts for it; of a fault of the artefact, that something is there and no effect of "
        "the machine named."
    ))  # fmt: skip
    figures = (
        (say("False alarms, of cases that hide nothing"), judged.false_alarms),
        (say("Right verdicts, of all cases"), judged.right),
        (say("Hidden effects found"), judged.found),
        (say("Hidden effects found and told from all others"), judged.found_alone),
        (say("Cases with a wrong name"), judged.wrong_names),
        (say("Detected functions that are taken for no effect"), judged.recognised),
        (say("Faults of the artefact blamed on the machine"), judged.machine_blamed),
        (say("Assertions that predict better what was held out"), judged.predicts_better),
    )
    notes = [say(
        "Found: asserted, alone or as one of a group that is said not to be told apart. A wrong name: an effect "
        "asserted that does not act, in no group with one that does; of a fault of the artefact, any effect of "
        "the machine."
    )]  # fmt: skip
    if (ratio := judged.held_out_ratio) is not None:
        notes.append(
            say("Held out: the rms of predictions after over before is {ratio:.2f} in the median.", ratio=ratio)
        )
    rates = table(say("Rates"), (say("What"), *RATE_HEADS), ((what, *cells(rate)) for what, rate in figures), *notes)
    return section(say("What was hidden, and what was said"), verdicts, rates)


def strength_section(proof: DiagnosisProof, often: Text) -> Section:
    title, curve, in_bins = say("How strong a cause must be"), proof.judgement.by_strength, proof.judgement.in_bins
    if curve is None:
        few = say("Fewer than {fewest} effects were hidden: too few to say.", fewest=judgement.FEWEST)
        return section(title, Paragraph(few))
    rows = ((say("{low:g} to {high:g}", low=low, high=high), *cells(rate)) for low, high, rate in in_bins)
    by_strength = table(say("Found by strength"), (say("Strength √λ"), *RATE_HEADS), rows)
    return section(title, Paragraph(often), strength_plot(in_bins, curve), by_strength)


def strength_words(value: float) -> Text:
    return number(value, ".1f") if value <= judgement.LARGEST else say("beyond {largest:g}", largest=judgement.LARGEST)


def probabilities_section(proof: DiagnosisProof) -> Section:
    title, each = say("Probability said, and right"), proof.judgement.probabilities
    if not each:
        return section(title, Paragraph(say("No effect was asserted.")))
    said = Column(say("Said"), unit("%"), numeric=False), Column(say("Mean said"), unit("%"))
    heads = (*said, *RATE_HEADS, say("Agree"))
    rows = (
        (say("{low:.0f} to {high:.0f}", low=100 * one.low, high=100 * one.high), number(100 * one.said, ".1f"),
         *cells(one.right), say("yes") if one.agrees else say("no"))
        for one in each
    )  # fmt: skip
    note = say(
        "Of every effect that was asserted, cases with a fault of the artefact left out. Agree: the mean said lies "
        "in the interval of what was right."
    )
    return section(title, said_plot(each), table(say("Probabilities"), heads, rows, note))


def intervals_section(proof: DiagnosisProof) -> Section:
    judged = proof.judgement
    rows = [(what, *cells(judged.coverage_of(sort))) for sort, what in INTERVAL_WORDS.items()]
    rows.append((say("all but the last, pooled"), *cells(judged.coverage)))
    return section(say("Intervals"), table(say("95 % intervals that hold"), (say("Intervals"), *RATE_HEADS), rows, say(
        "95 % intervals that hold the truth. Those of one recording are not independent; the interval of the rate allows for "
        "that. What is estimated beside a cause that was not found is shown for itself: it cannot be right."
    )))  # fmt: skip


def kinds_section(proof: DiagnosisProof) -> Section:
    rows = (
        (NOISE_WORDS[kind], *(cell for rate in proof.judgement.by_noise(kind) for cell in cells(rate)[:2]))
        for kind in dict.fromkeys(proof.design.noises)
    )
    counts = (say("False alarms"), say("Effects found"), say("Intervals that hold"))
    rates = (column for count in counts for column in (Column(count), Column(say("Rate"), unit("%"))))
    return section(say("Kinds of noise"), table(say("By kind of noise"), (say("Noise"), *rates), rows))


def effects_section(proof: DiagnosisProof) -> Section:
    """Every effect that cases could hide: how often it was found, and how large it must be."""
    titles, rows = {reach.effect: reach.title for reach in proof.reaches}, []
    for reach in proof.reaches:
        if reach.standing == set_ups.DRAWN:
            found, wrong = proof.judgement.of_effect(reach.effect)
            rows.append((
                reach.title, counted(found), number(wrong), *_smallest(proof, reach), number(reach.allowed, ".3g"), reach.unit,
                titles[reach.alike] if reach.alike else NOTHING,
            ))  # fmt: skip
    heads = (
        say("Effect"), Column(say("Times found")), Column(say("Wrongly named")), Column(say("Found in 9 of 10 from")),
        Column(say("95 %")), Column(say("Physics allows")), say("Unit"), say("Hardly told from"),
    )  # fmt: skip
    return section(say("Every effect"), table(say("Effects that cases hide"), heads, rows,
        say(
            "Found in 9 of 10 from: the strength that all hidden effects together show, as a size of this effect "
            "under the job's noise; with its 95 % interval. A dash: not within what physics allows, or too few cases "
            "to say. Of a periodic effect for a typical period."
        ),
        say(
            "Hardly told from: an effect that leaves less than a tenth of this one in these set-ups; one then stands "
            "for the other, and the diagnosis is to name both."
        ),
    ))  # fmt: skip


def _smallest(proof: DiagnosisProof, reach: Reach) -> tuple[Text, Text]:
    found = proof.judgement.by_strength
    if found is None or reach.amplitude(found.often) is None:
        return DASH, DASH
    low, high = (reach.amplitude(min(end, judgement.LARGEST)) for end in found.interval)
    ends = [DASH if end is None else number(end, ".2g") for end in (low, high)]
    return number(found.often / reach.per_unit, ".2g"), say("{low} to {high}", low=ends[0], high=ends[1])


def unseen_section(proof: DiagnosisProof) -> Section:
    standings: tuple[tuple[str, Text], ...] = (
        (
            set_ups.TAKEN,
            say("Nothing of these shows, for they leave the observations as they are or what the job names takes all:"),
        ),
        (set_ups.TOO_SMALL, say("These drown in the noise even as large as physics allows:")),
        (set_ups.NO_TRAVEL, say("Not considered, for the job does not say what they need of the machine:")),
    )
    texts: list[Text] = []
    for standing, what in standings:
        if effects := [reach.title for reach in proof.reaches if reach.standing == standing]:
            texts.append(say("{what} {effects}.", what=what, effects=semicolons(effects)))
    titles = {reach.effect: reach.title for reach in proof.reaches}
    for fault in proof.faults:
        kind = FAULT_WORDS[fault.what]
        if not fault.shows:
            texts.append(say("Of the artefact, nothing shows of {what}: what the job names takes it.", what=kind))
        elif fault.hidden:
            texts.append(say("Of the artefact, {what} looks like {effect:small}; only other set-ups would tell.",
                             what=kind, effect=titles[fault.like]))  # fmt: skip
    by_columns: dict[tuple[str, ...], list[Text]] = {}
    for reach in proof.reaches:
        if reach.standing == set_ups.UNRECORDED:
            by_columns.setdefault(reach.columns, []).append(reach.title)
    rows = ((semicolons(effects), commas(names(columns))) for columns, effects in by_columns.items())
    heads = (say("Effects"), say("Columns that they go by"))
    left_out = table(say("Not considered, because it is not recorded"), heads, rows)
    return section(say("What these set-ups cannot see"), *map(Paragraph, texts), left_out)


EDGES = {"left": 0.09, "right": 0.985, "bottom": 0.15, "top": 0.96}  # of the axes, in a picture 72 mm high


def strength_plot(in_bins: tuple[tuple[float, float, Rate], ...], curve: DetectionCurve) -> Plot:
    """Part of the hidden effects that is found, by their strength, with the fitted curve."""
    some = [one for one in in_bins if one[2].of]
    middle, (share, low, high) = (
        np.array([0.5 * (low + high) for low, high, _ in some]),
        _rates([one[2] for one in some]),
    )
    with picture(72, **EDGES) as (figure, ax):
        across = np.append(curve.strengths, curve.strengths[::-1])
        ax.fill(across, 100 * np.append(curve.low, curve.high[::-1]), color=BAND, lw=0, zorder=0)
        ax.plot(curve.strengths, 100 * curve.curve, color=ACCENT, lw=1.3)
        ax.axhline(100 * judgement.OFTEN, color=MUTED, lw=0.6, ls=(0, (4, 3)), zorder=1)
        bars(ax, middle, low, high, 1.0, INK)
        dots(ax, middle, share, 4.0, INK)
        ax.set(xlim=(curve.strengths[0] - 0.5, curve.strengths[-1] + 0.5), ylim=(-3, 103))
        ax.grid(axis="y")
        ax.set(xlabel=say("Strength √λ of the hidden effect"), ylabel=say("Found / %"))
        return drawn(
            figure,
            say("Hidden effects that were found, by strength: counted with 95 % intervals, and the fitted curve with its "
                "band; the broken line is nine in ten."),
            say("Share of hidden effects found, growing with their strength from {low:g} to {high:g}.",
                low=float(curve.strengths[0]), high=float(curve.strengths[-1])),
            "found",
        )  # fmt: skip


def said_plot(each: tuple[Tenth, ...]) -> Plot:
    """Probabilities of asserted effects, by tenths, against the share of them that act."""
    said = 100 * np.array([one.said for one in each])
    share, low, high = _rates([one.right for one in each])
    with picture(72, **EDGES) as (figure, ax):
        ax.plot([0, 100], [0, 100], color=MUTED, lw=0.7, zorder=1)
        bars(ax, said, low, high, 1.0, ACCENT)
        dots(ax, said, share, 4.0, ACCENT)
        ax.set(xlim=(-2, 103), ylim=(-3, 103))
        ax.grid()
        ax.set(xlabel=say("Probability that was said / %"), ylabel=say("Right / %"))
        return drawn(
            figure,
            say("Probability that was said of asserted effects against the share of them that act, by tenths, with 95 % "
                "intervals."),
            say("Probabilities said and shares right in {count} tenths.", count=len(each)),
            "said",
        )  # fmt: skip


def _rates(rates: list[Rate]) -> tuple[Floats, Floats, Floats]:
    ends = np.array([rate.interval for rate in rates]).reshape(-1, 2)
    share = np.array([rate.count / rate.of for rate in rates])
    return 100 * share, 100 * ends[:, 0], 100 * ends[:, 1]
