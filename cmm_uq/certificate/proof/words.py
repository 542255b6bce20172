"""Words of a proof: kinds of cases and of noise, faults, rates, and whether a figure is kept."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from cmm_uq.base.messages import DASH, Text, number, say
from cmm_uq.certificate.diagnosis.words import VERDICT_WORDS
from cmm_uq.laboratory.proving import accepted, cases, judged
from cmm_uq.laboratory.proving.accepted import Accepted
from cmm_uq.laboratory.proving.intervals import Rate

KIND_WORDS: Mapping[str, Text] = MappingProxyType(
    {
        cases.NOTHING: say("nothing"),
        cases.ONE: say("one effect"),
        cases.TWO: say("two effects"),
        cases.OUTSIDE: say("a function outside the catalogue"),
        cases.ARTEFACT: say("a fault of the artefact"),
    }
)
NOISE_WORDS: Mapping[str, Text] = MappingProxyType(
    {
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
)
FAULT_WORDS: Mapping[str, Text] = MappingProxyType(
    {
        "length": say("a wrong certified length"),
        "nodes": say("errors of its own points, common to all set-ups"),
        "warm": say("another temperature than stated, the same throughout"),
        "warming": say("warming from one set-up to the next"),
    }
)
INTERVAL_WORDS: Mapping[str, Text] = MappingProxyType(
    {
        judged.STATED: say("of effects that were found"),
        judged.NAMED: say("of what the job names, nothing hidden"),
        judged.NAMED_BESIDE: say("of what the job names, all that is hidden found and told apart"),
        judged.NAMED_GROUPED: say("of what the job names, something found only as one of a group"),
        judged.NAMED_MISSED: say("of what the job names, something hidden not found"),
    }
)
ANSWER_WORDS: Mapping[str, Text] = MappingProxyType({**VERDICT_WORDS, judged.REFUSED: say("no answer")})
STANDING_WORDS: Mapping[str, Text] = MappingProxyType(
    {
        accepted.MET: say("shown"),
        accepted.OPEN: say("too few cases to decide"),
        accepted.MISSED: say("missed"),
    }
)


def percent(rate: Rate) -> Text:
    """A rate in percent."""
    return DASH if rate.value is None else number(100 * rate.value, ".1f")


def interval(rate: Rate) -> Text:
    """Its 95 % interval in percent."""
    if not rate.of:
        return DASH
    low, high = (100 * each for each in rate.interval)
    return say("{low} to {high}", low=number(low, ".1f"), high=number(high, ".1f"))


def counted(rate: Rate) -> Text:
    """How many of how many."""
    return say("{count} of {of}", count=rate.count, of=rate.of) if rate.of else DASH


def in_words(rate: Rate) -> Text:
    """All of it in a line."""
    if not rate.of:
        return say("none to count")
    return say("{count} of {of}, {percent} % (95 %: {interval} %)", count=rate.count, of=rate.of, percent=percent(rate),
               interval=interval(rate))  # fmt: skip


def limits(one: Accepted) -> Text:
    """What is asked of a figure."""
    if one.low == 0:
        return say("at most {high:g} %", high=100 * one.high)
    if one.high == 1:
        return say("at least {low:g} %", low=100 * one.low)
    return say("{low:g} to {high:g} %", low=100 * one.low, high=100 * one.high)


def standing(one: Accepted) -> Text:
    """Whether it is kept, and what would decide it."""
    told = STANDING_WORDS[one.standing]
    if one.standing == accepted.OPEN and one.kept and one.cases is not None and one.rate.of < one.cases:
        return say(
            "{told}; counted within the limit; {needed} cases of this sort without one would show it",
            told=told,
            needed=one.cases,
        )
    if one.standing == accepted.OPEN and one.rate.of:
        return (
            say("{told}; counted within the limits", told=told)
            if one.kept
            else say("{told}; counted outside the limits", told=told)
        )
    return told
