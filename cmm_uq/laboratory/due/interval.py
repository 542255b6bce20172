"""The interval of a machine by its rule, from what its certificates, and those of its model, have found.

Where the history does not bear the method, the interval that the rule begins with is taken, and it is said why.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, foreign, say
from cmm_uq.laboratory.due.observed import Pool
from cmm_uq.laboratory.due.rule import Rule, months_of
from cmm_uq.laboratory.records.facts import RecordedCertificate

if TYPE_CHECKING:
    from cmm_uq.laboratory.due.drift import DriftPrior as Prior

METHOD_WORDS: Mapping[str, Text] = {
    "fixed": say("fixed"), "A3": Verbatim("A3"), "S2": Verbatim("S2"), "staircase": say("staircase"),
    "control chart": say("control chart"), "drift": say("drift"),
}  # fmt: skip
"""Methods as they are called."""


@dataclass(frozen=True)
class RecalibrationInterval:
    """An interval, and why it is that long.

    ``days``: ``None`` where it is a number of calendar months; ``months``: that many; ``None`` where it is a number
    of days; ``why``: one sentence without a full stop.
    """

    days: float | None
    months: int | None
    why: Text


def interval_by(
    rule: Rule, certificates: Sequence[RecordedCertificate], pool: Pool, priors: Mapping[str, Prior] | None = None
) -> RecalibrationInterval:
    """The interval after the last of a machine's calibrations.

    ``certificates``: of the machine, by day, up to its newest calibration; with later interim checks for the drift
    model.
    """
    if rule.method == "fixed":
        return _fixed(rule)
    from cmm_uq.laboratory.due.methods import METHODS  # numpy and scipy: a fixed interval need not wait for them

    try:
        days, why = METHODS[rule.method](rule, certificates, pool, priors or {})
    except CmmUqError as error:
        return RecalibrationInterval(
            None, rule.every_months,
            say("{months}, as method {method} cannot say: {why}", months=months_of(rule), method=METHOD_WORDS[rule.method],
                why=foreign(error.problem)),
        )  # fmt: skip
    return RecalibrationInterval(days, None, why)


@lru_cache(maxsize=100)
def _fixed(rule: Rule) -> RecalibrationInterval:
    """A fixed interval; thousands of machines share a rule, and putting it into words takes longer than all else of it."""
    months = months_of(rule)
    stated = say("fixed interval of {months}", months=months)
    usual = say("{months}, as its job does not say otherwise", months=months)
    return RecalibrationInterval(None, rule.every_months, stated if rule.stated else usual)
