"""A proof of the diagnosis as a document: a laboratory's validation of the method (ISO/IEC 17025:2017, 7.2.2)."""

from __future__ import annotations

from cmm_uq.base.messages import NOTHING, Text, Verbatim, commas, number, plural, say
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import Block, Column, Document, Facts, Paragraph, Section, Table, working_page
from cmm_uq.certificate.origin import program
from cmm_uq.certificate.proof.sections import (
    ANSWER_WORDS,
    INTERVAL_WORDS,
    KIND_WORDS,
    NOISE_WORDS,
    DiagnosisProof,
    counted,
    effects_section,
    in_words,
    interval,
    limits,
    percent,
    said_plot,
    standing,
    strength_plot,
    unseen_section,
)
from cmm_uq.certificate.wording import titles
from cmm_uq.laboratory.proving.answers import RECORDS, TRUTH
from cmm_uq.laboratory.proving.cases import KINDS, STRONGEST, WEAKEST, micrometres
from cmm_uq.laboratory.proving.judgement import MISSED, OPEN, REFUSED, VERDICTS
from cmm_uq.laboratory.proving.rates import FEWEST, LARGEST, Rate
from cmm_uq.laboratory.proving.sensitivity import ALLOWED

# Purpose, cases, strengths, noise, seal
METHOD: tuple[Text, ...] = (
    say(
        "Purpose: validation of a method (ISO/IEC 17025:2017, 7.2.2). The diagnosis of cmm-uq is to be fit for "
        "recordings made with these set-ups: to find what the job's model leaves out, to call it by its name, to stay "
        "silent where nothing is left out, and to state uncertainties and probabilities that hold."
    ),
    say(
        "Cases are drawn by the forward model of the job: its artefact in its set-ups, the errors that the job "
        "names as they were estimated, the size of the artefact within its certificate's uncertainty, and noise. "
        "Of every ten cases three hide nothing, three an effect of the catalogue, two two effects, one a "
        "function of place, time or set-up that no effect has, and one a fault of the artefact. Where a cause "
        "does not show in these set-ups, another takes its place."
    ),
    say(
        "A hidden cause has a strength √λ: its length in all observations over the noise, once all that the job "
        "names, and what else is hidden, has taken what it can. Strengths are evenly distributed from {weakest:g} "
        "to {strongest:g}, or to that of {allowed:g} standard deviations of what physics allows where an effect is "
        "then weaker. Of a function or a fault, no single effect leaves less than {weakest:g}.",
        weakest=WEAKEST, strongest=STRONGEST, allowed=ALLOWED,
    ),
    say(
        "Every other case has the noise of the job; the others in turn each kind of noise that these set-ups "
        "could show, as large as the job's readings."
    ),
    say(
        "The truth of all cases was written down and sealed by its hash before the first of them was diagnosed. "
        "Each recording then went through screening and diagnosis as a measured one does, with a seed of its "
        "own."
    ),
)  # fmt: skip

NOT_COVERED: tuple[Text, ...] = (
    say(
        "Cases are drawn by the same forward model that the diagnosis fits. What is shown is that the diagnosis "
        "does what it says where machine and artefact behave as that model says, or have one of the strangers "
        "that were drawn; not that this machine does. An error in the model's own equations would not show here."
    ),
    say(
        "Not drawn: three and more causes at once, damaged and mistyped recordings, wrong temperatures and other "
        "columns beside a job's own, periods shorter than 6 mm or longer than the readings reach, set-ups other "
        "than these."
    ),
    say(
        "The figures hold for the strengths and the mixture that were drawn. Another share of strong causes "
        "would give another share of them found; the table by strength does not depend on it."
    ),
)

HOW_TO_CHECK: tuple[Text, ...] = (
    say(
        "{truth} holds the truth of every case, {records} what was said of it. The hash above is that of the "
        "first file as it stands: sha256sum {truth} gives it again.",
        truth=Verbatim(TRUTH), records=Verbatim(RECORDS),
    ),
    say("The same command with the same seed, on any number of processes, writes the same files."),
)  # fmt: skip


def proof_document(proof: DiagnosisProof) -> Document:
    facts, judgement = proof.job.facts, proof.judgement
    points = proof.design.model.artefact.points
    return working_page(
        facts,
        say("Validation of the diagnosis"),
        say("proved on {count} sealed cases", count=len(judgement.cases)),
        particulars=(
            Facts(
                (
                    (say("Machine"), Verbatim(facts.machine.name)),
                    (say("Artefact"), proof.design.model.artefact.title),
                    (say("Set-ups"), _set_ups(len(set(points.measurement.tolist())), len(points))),
                    (say("Effects that the job names"), commas(titles(facts.model.effects)) or say("none")),
                )
            ),
            Facts(
                (
                    (say("Cases"), number(len(judgement.cases))),
                    (say("Seed"), number(proof.seed)),
                    (say("False-alarm rate asked for"), say("{alpha:g} %", alpha=100 * proof.alpha)),
                    (say("Program"), program(proof.job)),
                    (say("Truth sealed by SHA-256"), Verbatim(proof.sha256)),
                )
            ),
        ),
        warnings=warnings_of(proof),
        sections=(
            Section(say("Conclusion"), _conclusion(proof)),
            Section(say("Purpose and method"), tuple(Paragraph(text) for text in METHOD)),
            Section(say("Set-ups and noise"), (_noise(proof),)),
            Section(say("What was hidden, and what was said"), _answers(proof)),
            Section(say("How strong a cause must be"), _strength(proof)),
            Section(say("Probability said, and right"), _probabilities(proof)),
            Section(say("Intervals"), (_intervals(proof),)),
            Section(say("Kinds of noise"), (_by_noise(proof),)),
            effects_section(proof),
            unseen_section(proof),
            Section(say("What this does not cover"), tuple(Paragraph(text) for text in NOT_COVERED)),
            Section(say("How to check it"), tuple(Paragraph(text) for text in HOW_TO_CHECK)),
        ),
        attachments=tuple(Verbatim(name) for name in (TRUTH, RECORDS, "results.json")),
        produced_by=say("{program}, seed {seed}", program=program(proof.job), seed=proof.seed),
        end=say("End of validation"),
    )


def warnings_of(proof: DiagnosisProof) -> tuple[Text, ...]:
    """What must be known before a figure is used."""
    found = [
        say(
            "{what}: {rate}; asked for: {limits}. This is missed.",
            what=one.what,
            rate=in_words(one.rate),
            limits=limits(one),
        )
        for one in proof.accepted
        if one.standing == MISSED
    ]
    refused = proof.judgement.refused
    if refused.count:
        found.append(plural(
            refused.count, one=say("One case got no answer; it counts in no other figure."),
            many=say("{count} cases got no answer; they count in no other figure.", count=refused.count),
        ))  # fmt: skip
    return tuple(found)


def conclusion_of(proof: DiagnosisProof) -> Text:
    standings = [one.standing for one in proof.accepted]
    if MISSED in standings:
        return say("The diagnosis does not keep the acceptance figures on these set-ups.")
    if OPEN in standings:
        return say(
            "The cases contradict no acceptance figure, but are too few to show that all of them are kept on these "
            "set-ups."
        )
    return say(
        "The diagnosis keeps the acceptance figures on these set-ups, with a confidence of 95 % in each of them."
    )


def _set_ups(count: int, points: int) -> Text:
    return plural(
        count,
        one=say("one, {points} points", points=points),
        many=say("{count}, {points} points", count=count, points=points),
    )


def _conclusion(proof: DiagnosisProof) -> tuple[Block, ...]:
    rows = tuple(
        (one.what, counted(one.rate), percent(one.rate), interval(one.rate), limits(one), standing(one))
        for one in proof.accepted
    )
    heads = (
        Column(say("Figure"), numeric=False), Column(say("Counted")), Column(say("Rate"), unit("%")),
        Column(say("95 % interval"), unit("%")), Column(say("Asked for"), numeric=False),
        Column(say("Standing"), numeric=False),
    )  # fmt: skip
    note = say(
        "Shown or missed: the whole interval (Clopper and Pearson) lies within or beyond what is asked for. What is "
        "asked for was sealed with the truth."
    )
    return (Paragraph(conclusion_of(proof)), Table(say("Acceptance"), heads, rows, (note,)))


def _noise(proof: DiagnosisProof) -> Block:
    own = micrometres(proof.design.noise)
    rows = [
        (say("Reading along x, y, z"), say("{x:.3g}, {y:.3g}, {z:.3g} µm", x=own["x_um"], y=own["y_um"], z=own["z_um"]))
    ]
    for key, what in (
        ("placing_um", say("Set-up offset")), ("growth_um", say("Growing, at the longest length")),
        ("slow_um", say("Slow in time")),
        ("resolution_um", say("Step of the display")),
    ):  # fmt: skip
        rows.append((what, say("{size:.3g} µm", size=own[key]) if own[key] else say("none")))
    counts = {kind: sum(one.case.noise_kind == kind for one in proof.judgement.cases) for kind in NOISE_WORDS}
    drawn = commas(
        say("{what} {count}", what=NOISE_WORDS[kind], count=count) for kind, count in counts.items() if count
    )
    return Facts((*rows, (say("Noise of the cases"), drawn)))


def _answers(proof: DiagnosisProof) -> tuple[Block, ...]:
    judgement = proof.judgement
    heads = (
        Column(say("Hidden"), numeric=False), Column(say("Cases")),
        *(Column(ANSWER_WORDS[verdict]) for verdict in (*VERDICTS, REFUSED)), Column(say("Right")),
    )  # fmt: skip
    rows = []
    for kind in KINDS:
        said, own = judgement.verdicts(kind), judgement.of_kind(kind)
        cells = [number(said.get(verdict, 0)) for verdict in (*VERDICTS, REFUSED)]
        rows.append((KIND_WORDS[kind], number(sum(said.values())), *cells, number(sum(one.right for one in own))))
    note = say(
        "Right: consistent of nothing; explained of effects that are all found and no other named; of a function, "
        "that no known effect accounts for it; of a fault of the artefact, that something is there and no effect of "
        "the machine named."
    )
    return (Table(say("Verdicts"), heads, tuple(rows), (note,)), _rates(proof))


def _rates(proof: DiagnosisProof) -> Block:
    judgement = proof.judgement
    figures: tuple[tuple[Text, Rate], ...] = (
        (say("False alarms, of cases that hide nothing"), judgement.false_alarms),
        (say("Right verdicts, of all cases"), judgement.right),
        (say("Hidden effects found"), judgement.found),
        (say("Hidden effects found and told from all others"), judgement.found_alone),
        (say("Cases with a wrong name"), judgement.wrong_names),
        (say("Detected functions that are taken for no effect"), judgement.recognised),
        (say("Faults of the artefact blamed on the machine"), judgement.machine_blamed),
        (say("Assertions that predict better what was held out"), judgement.predicts_better),
    )
    rows = tuple((what, counted(rate), percent(rate), interval(rate)) for what, rate in figures)
    notes = [
        say(
            "Found: asserted, alone or as one of a group that is said not to be told apart. A wrong name: an effect "
            "asserted that does not act, in no group with one that does; of a fault of the artefact, any effect of "
            "the machine."
        )
    ]
    if judgement.held_out_ratio is not None:
        notes.append(
            say(
                "Held out: the rms of predictions after over before is {ratio:.2f} in the median.",
                ratio=judgement.held_out_ratio,
            )
        )
    return Table(say("Rates"), _rate_heads(say("What")), rows, tuple(notes))


def _rate_heads(what: Text) -> tuple[Column, ...]:
    return (
        Column(what, numeric=False),
        Column(say("Counted")),
        Column(say("Rate"), unit("%")),
        Column(say("95 % interval"), unit("%")),
    )


def _strength(proof: DiagnosisProof) -> tuple[Block, ...]:
    judgement, found = proof.judgement, proof.judgement.by_strength
    if found is None:
        return (Paragraph(say("Fewer than {fewest} effects were hidden: too few to say.", fewest=FEWEST)),)
    rows = tuple(
        (say("{low:g} to {high:g}", low=low, high=high), counted(rate), percent(rate), interval(rate))
        for low, high, rate in judgement.in_bins
    )
    return (
        Paragraph(often_words(proof)),
        strength_plot(judgement.in_bins, found),
        Table(say("Found by strength"), _rate_heads(say("Strength √λ")), rows),
    )


def often_words(proof: DiagnosisProof) -> Text:
    """From which strength on an effect is found in nine of ten."""
    found = proof.judgement.by_strength
    if found is None:
        return NOTHING
    low, high = (_strength_words(each) for each in found.interval)
    if found.often > STRONGEST:
        return say(
            "An effect is found in nine of ten recordings from a strength on that was not drawn: more than "
            "{strongest:g} (95 %: {low} to {high}).",
            strongest=STRONGEST, low=low, high=high,
        )  # fmt: skip
    return say(
        "An effect is found in nine of ten recordings from a strength of {often:.1f} on (95 %: {low} to {high}), all "
        "effects and kinds of noise taken together.",
        often=found.often, low=low, high=high,
    )  # fmt: skip


def _strength_words(value: float) -> Text:
    return number(value, ".1f") if value <= LARGEST else say("beyond {largest:g}", largest=LARGEST)


def _probabilities(proof: DiagnosisProof) -> tuple[Block, ...]:
    each = proof.judgement.probabilities
    if not each:
        return (Paragraph(say("No effect was asserted.")),)
    heads = (
        Column(say("Said"), unit("%"), numeric=False), Column(say("Mean said"), unit("%")), *_rate_heads(say("What"))[1:],
        Column(say("Agree"), numeric=False),
    )  # fmt: skip
    rows = tuple(
        (say("{low:.0f} to {high:.0f}", low=100 * one.low, high=100 * one.high), number(100 * one.said, ".1f"),
         counted(one.right), percent(one.right), interval(one.right), say("yes") if one.agrees else say("no"))
        for one in each
    )  # fmt: skip
    note = say(
        "Of every effect that was asserted, cases with a fault of the artefact left out. Agree: the mean said lies "
        "in the interval of what was right."
    )
    return (said_plot(each), Table(say("Probabilities"), heads, rows, (note,)))


def _intervals(proof: DiagnosisProof) -> Block:
    rows = []
    for sort, what in INTERVAL_WORDS.items():
        rate = proof.judgement.coverage_of(sort)
        rows.append((what, counted(rate), percent(rate), interval(rate)))
    rate = proof.judgement.coverage
    rows.append((say("all but the last, pooled"), counted(rate), percent(rate), interval(rate)))
    note = say(
        "95 % intervals that hold the truth. Those of one recording are not independent; the interval of the rate "
        "allows for that. What is estimated beside a cause that was not found is shown for itself: it cannot be "
        "right."
    )
    return Table(say("95 % intervals that hold"), _rate_heads(say("Intervals")), tuple(rows), (note,))


def _by_noise(proof: DiagnosisProof) -> Block:
    rows = []
    for kind in dict.fromkeys(proof.design.noises):
        alarms, found, coverage = proof.judgement.by_noise(kind)
        rows.append(
            (
                NOISE_WORDS[kind],
                *(cell for rate in (alarms, found, coverage) for cell in (counted(rate), percent(rate))),
            )
        )
    heads = (
        Column(say("Noise"), numeric=False), Column(say("False alarms")), Column(say("Rate"), unit("%")),
        Column(say("Effects found")), Column(say("Rate"), unit("%")), Column(say("Intervals that hold")),
        Column(say("Rate"), unit("%")),
    )  # fmt: skip
    return Table(say("By kind of noise"), heads, tuple(rows))
