"""Effects that are probable and yet not asserted, in words: why, and which periods fit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from cmm_uq.analysis.diagnosis.assertion import WithheldEffect
from cmm_uq.analysis.diagnosis.diagnosis import OmittedEffect
from cmm_uq.analysis.diagnosis.joint import Mode
from cmm_uq.base.messages import NOTHING, Text, commas, say
from cmm_uq.certificate.wording import probability
from cmm_uq.maths.uncertainty.rounding import rounded

_TOLD = 8
"""Periods that a sentence tells; results.json has all."""


def sentences(withheld: Sequence[WithheldEffect]) -> list[Text]:
    """A sentence on each."""
    return [
        say(
            "{title} (probability {probability}) is not asserted: {why}.",
            title=item.title, probability=probability(item.probability), why=_told(item.why, item.modes),
        )
        for item in withheld
    ]  # fmt: skip


def other_periods(item: OmittedEffect) -> Text:
    """A sentence on further periods that fit, to follow that on an effect; nothing where there are none."""
    if not item.modes:
        return NOTHING
    if item.settled:
        return say("Other periods that fit: {periods}.", periods=_listed(item.modes))
    return say(
        "The positions do not tell its period; a correction would hold where was measured, not between. "
        "Periods that fit: {periods}.",
        periods=_listed(item.modes),
    )  # fmt: skip


def withheld_data(withheld: Sequence[WithheldEffect]) -> list[dict[str, Any]]:
    """For results.json."""
    return [
        {
            "effect": item.effect, "probability": item.probability, "why": item.why,
            "periods_mm": periods_data(item.modes),
        }
        for item in withheld
    ]  # fmt: skip


def periods_data(modes: Sequence[Mode]) -> list[dict[str, Any]]:
    """Every period that fits, for results.json."""
    return [
        {
            "value": m.period.value, "u": m.period.u, "interval95": list(m.period.interval95),
            "probability": m.probability,
        }
        for m in modes
    ]  # fmt: skip


def _told(why: Text, modes: Sequence[Mode]) -> Text:
    return say("{why} ({periods})", why=why, periods=_listed(modes)) if modes else why


def _listed(modes: Sequence[Mode]) -> Text:
    told = [_one(mode) for mode in modes[:_TOLD]]
    if len(modes) > _TOLD:
        told.append(say("and {count} more", count=len(modes) - _TOLD))
    return commas(told)


def _one(mode: Mode) -> Text:
    value, U = rounded(mode.period.value, mode.period.expanded)
    return say(
        "{value} ± {U} {unit}: {probability}",
        value=value, U=U, unit=mode.period.unit, probability=probability(mode.probability),
    )  # fmt: skip
