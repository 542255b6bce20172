"""What a proof of the diagnosis found, and its words: kinds of cases and of noise, faults, rates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from cmm_uq.base.messages import DASH, Text, number, say
from cmm_uq.certificate.diagnosis.overview import VERDICT_WORDS
from cmm_uq.jobs.job import Job
from cmm_uq.laboratory.proving import cases, judgement
from cmm_uq.laboratory.proving.cases import canonical_json, sha256_of
from cmm_uq.laboratory.proving.design import Design
from cmm_uq.laboratory.proving.judgement import MISSED, OPEN, AcceptanceFigure, ProofJudgement, acceptance_figures
from cmm_uq.laboratory.proving.rates import Rate
from cmm_uq.laboratory.proving.reach import FaultReach, Reach, fault_reaches, reaches

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
