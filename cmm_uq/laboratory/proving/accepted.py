"""Figures that a laboratory accepts the method by, and whether the cases show that they are kept."""

from __future__ import annotations

from dataclasses import dataclass

from cmm_uq.base.messages import Text, say
from cmm_uq.jobs.prove import ProveFacts
from cmm_uq.laboratory.proving.intervals import Rate, cases_to_decide
from cmm_uq.laboratory.proving.judged import Judgement

MET, OPEN, MISSED = "met", "open", "missed"


@dataclass(frozen=True)
class Accepted:
    """A figure with its limits.

    Parameters
    ----------
    key, what : in results.json, and in words.
    rate : that was counted.
    low, high : limits of the rate.
    """

    key: str
    what: Text
    rate: Rate
    low: float
    high: float

    @property
    def standing(self) -> str:
        """``met`` or ``missed`` where all of the interval says so; else ``open``: so many cases do not decide it."""
        low, high = self.rate.interval
        if not self.rate.of:
            return OPEN
        if self.low <= low and high <= self.high:
            return MET
        return MISSED if high < self.low or low > self.high else OPEN

    @property
    def kept(self) -> bool:
        """Whether the rate that was counted lies within the limits, whatever its interval."""
        return self.rate.value is not None and self.low <= self.rate.value <= self.high

    @property
    def cases(self) -> int | None:
        """Fewest cases that could show it, of a rate that is to be small; ``None`` of another."""
        return cases_to_decide(self.high) if self.low == 0 < self.high < 1 else None


def accepted(judgement: Judgement, facts: ProveFacts) -> tuple[Accepted, ...]:
    """Every figure that is asked for."""
    low, high = (each / 100 for each in facts.coverage_pct)
    found = [
        Accepted("false_alarms", say("False alarms"), judgement.false_alarms, 0.0, facts.false_alarms_pct / 100),
        Accepted("coverage", say("95 % intervals that hold the truth"), judgement.coverage, low, high),
    ]
    if facts.wrong_names_pct is not None:
        rate = judgement.wrong_names
        found.append(Accepted("wrong_names", say("Cases with a wrong name"), rate, 0.0, facts.wrong_names_pct / 100))
    if facts.found_pct is not None:
        found.append(Accepted("found", say("Hidden effects found"), judgement.found, facts.found_pct / 100, 1.0))
    return tuple(found)
