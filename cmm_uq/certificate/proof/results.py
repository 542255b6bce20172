"""results.json of a proof, its few lines for the end of the command, and its outcome."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cmm_uq.base.messages import NOTHING, Verbatim, say
from cmm_uq.certificate.document import Standing
from cmm_uq.certificate.outcome import Outcome
from cmm_uq.certificate.proof.page import conclusion_of, often_words, proof_document, warnings_of
from cmm_uq.certificate.proof.sections import DiagnosisProof, in_words, limits, standing
from cmm_uq.certificate.results.contents import head
from cmm_uq.certificate.wording import Headline, Summary
from cmm_uq.laboratory.proving.answers import RECORDS, TRUTH
from cmm_uq.laboratory.proving.cases import KINDS, micrometres
from cmm_uq.laboratory.proving.judgement import (
    MET,
    MISSED,
    NAMED,
    NAMED_BESIDE,
    NAMED_GROUPED,
    NAMED_MISSED,
    OPEN,
    REFUSED,
    STATED,
    VERDICTS,
)
from cmm_uq.laboratory.proving.rates import Rate

SCHEMA = "cmm-uq/prove/1"

# Below every key that is said to be a rate
RATE: Mapping[str, str] = {
    "count": "How many.",
    "of": "Of how many.",
    "rate": "Their quotient; null of none.",
    "interval95": "Exact 95 % interval (Clopper and Pearson); of intervals for as many as would be independent.",
}

# By dotted name; a part in capitals stands for any name, [] for each entry of a list
KEYS: Mapping[str, str] = {
    "schema": "Name of the layout.",
    "software.KEY": "The program and what took part, as in results of a report.",
    "job.KEY": "The job, with the hashes of its inputs.",
    "cases": "Number of cases.",
    "seed": "Seed of the cases.",
    "alpha": "Rate of false alarms that the diagnosis was asked for.",
    "truth_sha256": "SHA-256 of truth.json, written and told before the first diagnosis.",
    "noise.KEY": "The job's own noise: reading along each axis, set-up offset, growing and slow part, display.",
    "verdicts.KIND.VERDICT": "How often each verdict was given of cases that hide this.",
    "rates.false_alarms": "Rate: other verdicts than consistent, of cases that hide nothing.",
    "rates.right": "Rate: right verdicts.",
    "rates.found": "Rate: hidden effects that are found, alone or in a group.",
    "rates.found_alone": "Rate: those told from all others.",
    "rates.wrong_names": "Rate: cases in which an effect is named that does not act.",
    "rates.recognised": "Rate: of detected functions outside the catalogue, those taken for no effect.",
    "rates.machine_blamed": "Rate: faults of the artefact for which an effect of the machine is named.",
    "rates.predicts_better": "Rate: cases with an assertion that predicts better what the fit has not seen.",
    "rates.refused": "Rate: cases without an answer.",
    "held_out_ratio": "Median rms of predictions of what was held out, after over before; null without assertions.",
    "coverage.pooled": "Rate: 95 % intervals that hold the truth, where all that acts was named or found.",
    "coverage.SORT": "Rate: the same of effects that were found, and of those that the job names by what was hidden.",
    "probabilities[].from": "Lower end of a tenth of probabilities that were said.",
    "probabilities[].to": "Its upper end.",
    "probabilities[].said": "Mean of the probabilities in it.",
    "probabilities[].right": "Rate: of these assertions, those whose effect acts.",
    "strength[].from": "Lower end of strengths √λ.",
    "strength[].to": "Upper end.",
    "strength[].found": "Rate: effects of such a strength that are found.",
    "found_in_nine_of_ten.strength": "Strength √λ from which on an effect is found in nine of ten; null if none.",
    "found_in_nine_of_ten.interval95": "Its 95 % interval; an end that is not reached is null, both are of too few cases.",
    "effects[].effect": "An effect that the job does not name.",
    "effects[].standing": "drawn, or why no case hides it: unrecorded, taken, too small, no travel.",
    "effects[].parameter": "Its first parameter.",
    "effects[].unit": "The parameter's unit.",
    "effects[].strength_per_unit": "√λ of one unit under the job's noise.",
    "effects[].allowed": "Largest size that physics allows.",
    "effects[].found": "Rate: how often it was found where it was hidden.",
    "effects[].wrongly_named": "How often it was named where it did not act.",
    "effects[].found_in_nine_of_ten": "Size from which on it is found in nine of ten; null beyond what physics allows.",
    "effects[].columns": "Columns that it goes by and that were not recorded.",
    "effects[].alike": "Another effect that these set-ups hardly tell from it; null where there is none.",
    "artefact_faults[].what": "A fault of the artefact.",
    "artefact_faults[].shows": "Whether it shows in these set-ups.",
    "artefact_faults[].left": "Part of it that the nearest effect of the machine leaves.",
    "artefact_faults[].like": "That effect; null where there is none.",
    "by_noise.KIND.false_alarms": "Rate: under one kind of noise.",
    "by_noise.KIND.found": "Rate: the same of hidden effects.",
    "by_noise.KIND.coverage": "Rate: the same of intervals.",
    "acceptance[].figure": "A figure that the laboratory accepts the method by.",
    "acceptance[].lowest": "Lowest rate asked for.",
    "acceptance[].highest": "Highest.",
    "acceptance[].rate": "Rate: counted.",
    "acceptance[].standing": "met, missed, or open where so many cases do not decide it.",
}


def proof_outcome(proof: DiagnosisProof) -> Outcome:
    judgement = proof.judgement
    words: dict[str, tuple[str, Standing]] = {MET: ("SHOWN", "good"), OPEN: ("OPEN", "open"), MISSED: ("MISSED", "bad")}
    verdicts = tuple(
        Headline(
            *words[one.standing],
            one.what,
            (in_words(one.rate), say("asked for: {limits}", limits=limits(one)), standing(one)),
        )
        for one in proof.accepted
    )
    figures = (
        (say("Hidden effects found"), in_words(judgement.found), NOTHING),
        (say("Cases with a wrong name"), in_words(judgement.wrong_names), NOTHING),
        (say("Right verdicts"), in_words(judgement.right), NOTHING),
    )
    remarks = [
        conclusion_of(proof),
        often_words(proof),
        say("Truth sealed by SHA-256 {sha256}.", sha256=Verbatim(proof.sha256)),
    ]
    return Outcome(
        proof, lambda: proof_document(proof), proof_results(proof), Summary(
        say("{count} sealed cases", count=len(judgement.cases)), verdicts=verdicts, figures=figures,
        remarks=tuple(text for text in remarks if text), warnings=warnings_of(proof),
    ), warnings_of(proof),
        {TRUTH: proof.truth, RECORDS: proof.answers}, in_order=proof.conforming,
    )  # fmt: skip


def proof_results(proof: DiagnosisProof) -> dict[str, Any]:
    judgement, found = proof.judgement, proof.judgement.by_strength
    sorts = {
        "found": STATED,
        "named": NAMED,
        "named_beside_found": NAMED_BESIDE,
        "named_beside_group": NAMED_GROUPED,
        "named_beside_missed": NAMED_MISSED,
    }
    rates = (
        "false_alarms", "right", "found", "found_alone", "wrong_names", "recognised", "machine_blamed", "predicts_better",
        "refused",
    )  # fmt: skip
    return {
        **head(proof.job, SCHEMA),
        "cases": len(judgement.cases),
        "seed": proof.seed,
        "alpha": proof.alpha,
        "truth_sha256": proof.sha256,
        "noise": micrometres(proof.design.noise),
        "verdicts": {
            kind.replace(" ", "_"): {said: judgement.verdicts(kind).get(said, 0) for said in (*VERDICTS, REFUSED)}
            for kind in KINDS
        },
        "rates": {name: _rate(getattr(judgement, name)) for name in rates},
        "held_out_ratio": judgement.held_out_ratio,
        "coverage": {
            "pooled": _rate(judgement.coverage),
            **{k: _rate(judgement.coverage_of(v)) for k, v in sorts.items()},
        },
        "probabilities": [
            {"from": one.low, "to": one.high, "said": one.said, "right": _rate(one.right)}
            for one in judgement.probabilities
        ],
        "strength": [{"from": low, "to": high, "found": _rate(rate)} for low, high, rate in judgement.in_bins],
        "found_in_nine_of_ten": {
            "strength": None if found is None else _finite(found.often),
            "interval95": [None, None] if found is None else [_finite(end) for end in found.interval],
        },
        "effects": _effects(proof),
        "artefact_faults": [
            {"what": one.what, "shows": one.shows, "left": one.left, "like": one.like or None} for one in proof.faults
        ],
        "by_noise": {
            kind: dict(zip(("false_alarms", "found", "coverage"), map(_rate, judgement.by_noise(kind)), strict=True))
            for kind in dict.fromkeys(proof.design.noises)
        },
        "acceptance": [
            {
                "figure": one.key,
                "lowest": one.low,
                "highest": one.high,
                "rate": _rate(one.rate),
                "standing": one.standing,
            }
            for one in proof.accepted
        ],
    }


def _effects(proof: DiagnosisProof) -> list[dict[str, Any]]:
    strength, rows = proof.judgement.by_strength, []
    for reach in proof.reaches:
        found, wrong = proof.judgement.of_effect(reach.effect)
        rows.append({
            "effect": reach.effect, "standing": reach.standing, "parameter": reach.parameter, "unit": reach.unit,
            "strength_per_unit": reach.per_unit, "allowed": reach.allowed, "found": _rate(found), "wrongly_named": wrong,
            "found_in_nine_of_ten": None if strength is None else reach.amplitude(strength.often),
            "columns": list(reach.columns), "alike": reach.alike or None,
        })  # fmt: skip
    return rows


def _rate(rate: Rate) -> dict[str, Any]:
    return {"count": rate.count, "of": rate.of, "rate": rate.value, "interval95": list(rate.interval)}


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
