"""A proof of the diagnosis, the validation of a method (ISO/IEC 17025:2017, 7.2.2): page, results.json and outcome."""

from __future__ import annotations

from typing import Any

import numpy as np

from cmm_uq.base.messages import NOTHING, Text, Verbatim, commas, number, plural, say
from cmm_uq.certificate.document import Document, Facts, Paragraph, Section, working_page
from cmm_uq.certificate.origin import attributes, program
from cmm_uq.certificate.proof import sections as parts
from cmm_uq.certificate.proof.sections import DiagnosisProof, in_words, limits, standing
from cmm_uq.certificate.result import Outcome
from cmm_uq.certificate.results.contents import head
from cmm_uq.certificate.wording import Headline, Summary, titles
from cmm_uq.jobs.verdicts import DIAGNOSES
from cmm_uq.laboratory.proving import judgement as judged
from cmm_uq.laboratory.proving.answers import RECORDS, TRUTH
from cmm_uq.laboratory.proving.cases import ALLOWED, KINDS, STRONGEST, WEAKEST, micrometres
from cmm_uq.laboratory.proving.judgement import MISSED, OPEN, REFUSED, Rate

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
        "The truth of all cases was written down and sealed by its hash before the first of them was diagnosed. Each "
        "recording then went through screening and diagnosis as a measured one does, with a seed of its own."
    ),
)  # fmt: skip

NOT_COVERED: tuple[Text, ...] = (
    say(
        "Cases are drawn by the same forward model that the diagnosis fits. What is shown is that the diagnosis "
        "does what it says where machine and artefact behave as that model says, or have one of the strangers "
        "that were drawn; not that this machine does. An error in the model's own equations would not show here."
    ),
    say(
        "Not drawn: three and more causes at once, damaged and mistyped recordings, wrong temperatures and other columns "
        "beside a job's own, periods shorter than 6 mm or longer than the readings reach, set-ups other than these."
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
        truth=Verbatim(TRUTH),
        records=Verbatim(RECORDS),
    ),
    say("The same command with the same seed, on any number of processes, writes the same files."),
)


def proof_document(proof: DiagnosisProof) -> Document:
    facts, count, points = proof.job.facts, len(proof.judgement.cases), proof.design.model.artefact.points
    set_ups = len(set(points.measurement.tolist()))
    size = plural(set_ups, one=say("one, {points} points", points=len(points)),
                  many=say("{count}, {points} points", count=set_ups, points=len(points)))  # fmt: skip
    of_the_job = (
        (say("Machine"), Verbatim(facts.machine.name)), (say("Artefact"), proof.design.model.artefact.title),
        (say("Set-ups"), size), (say("Effects that the job names"), commas(titles(facts.model.effects)) or say("none")),
    )  # fmt: skip
    of_the_proof = (
        (say("Cases"), number(count)), (say("Seed"), number(proof.seed)),
        (say("False-alarm rate asked for"), say("{alpha:g} %", alpha=100 * proof.alpha)),
        (say("Program"), program(proof.job)), (say("Truth sealed by SHA-256"), Verbatim(proof.sha256)),
    )  # fmt: skip

    def told(title: Text, texts: tuple[Text, ...]) -> Section:
        return Section(title, tuple(map(Paragraph, texts)))

    return working_page(
        facts, say("Validation of the diagnosis"), say("proved on {count} sealed cases", count=count),
        particulars=(Facts(of_the_job), Facts(of_the_proof)), warnings=warnings_of(proof),
        sections=(
            parts.conclusion_section(conclusion_of(proof), proof.accepted),
            told(say("Purpose and method"), METHOD),
            parts.noise_section(proof), parts.answers_section(proof), parts.strength_section(proof, often_words(proof)),
            parts.probabilities_section(proof), parts.intervals_section(proof), parts.kinds_section(proof),
            parts.effects_section(proof), parts.unseen_section(proof),
            told(say("What this does not cover"), NOT_COVERED), told(say("How to check it"), HOW_TO_CHECK),
        ),
        attachments=tuple(Verbatim(name) for name in (TRUTH, RECORDS, "results.json")),
        produced_by=say("{program}, seed {seed}", program=program(proof.job), seed=proof.seed),
        end=say("End of validation"),
    )  # fmt: skip


def warnings_of(proof: DiagnosisProof) -> tuple[Text, ...]:
    found: list[Text] = [
        say("{what}: {rate}; asked for: {limits}. This is missed.", what=one.what, rate=in_words(one.rate), limits=limits(one))
        for one in proof.accepted if one.standing == MISSED
    ]  # fmt: skip
    if count := proof.judgement.refused.count:
        one = say("One case got no answer; it is a false alarm where it hides nothing, else not found.")
        many = say(
            "{count} cases got no answer; each is a false alarm where it hides nothing, else not found.", count=count
        )
        found.append(plural(count, one=one, many=many))
    return tuple(found)


def conclusion_of(proof: DiagnosisProof) -> Text:
    standings = [one.standing for one in proof.accepted]
    if MISSED in standings:
        return say("The diagnosis does not keep the acceptance figures on these set-ups.")
    few = say(
        "The cases contradict no acceptance figure, but are too few to show that all of them are kept on these set-ups."
    )
    kept = say(
        "The diagnosis keeps the acceptance figures on these set-ups, with a confidence of 95 % in each of them."
    )
    return few if OPEN in standings else kept


def often_words(proof: DiagnosisProof) -> Text:
    """From which strength on an effect is found in nine of ten."""
    found = proof.judgement.by_strength
    if found is None:
        return NOTHING
    low, high = (parts.strength_words(each) for each in found.interval)
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


SCHEMA = "cmm-uq/prove/1"


def proof_outcome(proof: DiagnosisProof) -> Outcome:
    judgement, warned = proof.judgement, warnings_of(proof)
    verdicts = tuple(
        Headline(*parts.HEADLINES[one.standing], one.what,
                 (in_words(one.rate), say("asked for: {limits}", limits=limits(one)), standing(one)))
        for one in proof.accepted
    )  # fmt: skip
    figures = (
        (say("Hidden effects found"), in_words(judgement.found), NOTHING),
        (say("Cases with a wrong name"), in_words(judgement.wrong_names), NOTHING),
        (say("Right verdicts"), in_words(judgement.right), NOTHING),
    )
    sealed = say("Truth sealed by SHA-256 {sha256}.", sha256=Verbatim(proof.sha256))
    remarks = tuple(text for text in (conclusion_of(proof), often_words(proof), sealed) if text)
    subject = say("{count} sealed cases", count=len(judgement.cases))
    return Outcome(
        proof, lambda: proof_document(proof), proof_results(proof),
        Summary(subject, verdicts=verdicts, figures=figures, remarks=remarks, warnings=warned), warned,
        {TRUTH: proof.truth, RECORDS: proof.answers}, in_order=proof.conforming,
    )  # fmt: skip


SORTS = {
    "found": judged.STATED, "named": judged.NAMED, "named_beside_found": judged.NAMED_BESIDE,
    "named_beside_group": judged.NAMED_GROUPED, "named_beside_missed": judged.NAMED_MISSED,
}  # fmt: skip
RATES = (
    "false_alarms", "right", "found", "found_alone", "wrong_names", "recognised", "machine_blamed", "predicts_better",
    "refused",
)  # fmt: skip


def proof_results(proof: DiagnosisProof) -> dict[str, Any]:
    judgement, found = proof.judgement, proof.judgement.by_strength
    effects = []
    for reach in proof.reaches:
        times, wrong = judgement.of_effect(reach.effect)
        effects.append({
            **attributes(reach, "effect", "standing", "parameter", "unit"), "strength_per_unit": reach.per_unit,
            "allowed": reach.allowed, "found": _rate(times), "wrongly_named": wrong,
            "found_in_nine_of_ten": None if found is None else reach.amplitude(found.often),
            "columns": list(reach.columns), "alike": reach.alike or None,
        })  # fmt: skip
    noises = {kind: map(_rate, judgement.by_noise(kind)) for kind in dict.fromkeys(proof.design.noises)}
    return {
        **head(proof.job, SCHEMA), "cases": len(judgement.cases), "seed": proof.seed, "alpha": proof.alpha,
        "truth_sha256": proof.sha256, "noise": micrometres(proof.design.noise),
        "verdicts": {
            kind.replace(" ", "_"): {said: judgement.verdicts(kind).get(said, 0) for said in (*DIAGNOSES, REFUSED)}
            for kind in KINDS
        },
        "rates": {name: _rate(getattr(judgement, name)) for name in RATES},
        "held_out_ratio": judgement.held_out_ratio,
        "coverage": {"pooled": _rate(judgement.coverage),
                     **{name: _rate(judgement.coverage_of(sort)) for name, sort in SORTS.items()}},
        "probabilities": [
            {"from": one.low, "to": one.high, "said": one.said, "right": _rate(one.right)}
            for one in judgement.probabilities
        ],
        "strength": [{"from": low, "to": high, "found": _rate(rate)} for low, high, rate in judgement.in_bins],
        "found_in_nine_of_ten": {
            "strength": None if found is None else _finite(found.often),
            "interval95": [None, None] if found is None else [_finite(end) for end in found.interval],
        },
        "effects": effects,
        "artefact_faults": [attributes(one, "what", "shows", "left") | {"like": one.like or None} for one in proof.faults],
        "by_noise": {
            kind: dict(zip(("false_alarms", "found", "coverage"), rates, strict=True)) for kind, rates in noises.items()
        },
        "acceptance": [
            {"figure": one.key, "lowest": one.low, "highest": one.high, "rate": _rate(one.rate), "standing": one.standing}
            for one in proof.accepted
        ],
    }  # fmt: skip


def _rate(rate: Rate) -> dict[str, Any]:
    return {"count": rate.count, "of": rate.of, "rate": rate.value, "interval95": list(rate.interval)}


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
