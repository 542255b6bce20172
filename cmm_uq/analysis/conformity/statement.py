"""A statement of conformity: a finding, which every quantity decided by itself makes, and completeness.

A pass needs both. A finding that is worse than a conditional pass is the outcome whatever is missing beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Literal

from cmm_uq.analysis.conformity.decision import Decision
from cmm_uq.analysis.conformity.risk import Risks
from cmm_uq.base.messages import NOTHING, Text, say
from cmm_uq.jobs.conformity import ConformityFacts
from cmm_uq.maths.uncertainty.budget import Budget

StatementFinding = Literal["pass", "conditional pass", "undecided", "remeasure", "conditional fail", "fail"]
StatementOutcome = StatementFinding | Literal["incomplete"]

GRAVEST: tuple[StatementFinding, ...] = (
    "fail", "conditional fail", "remeasure", "undecided", "conditional pass", "pass",
)  # fmt: skip
"""Findings in the order of their gravity."""

Standing = Literal["counts", "again", "replaced"]


@dataclass(frozen=True)
class Decided:
    """One quantity against its own limit, with its own uncertainty.

    Parameters
    ----------
    error_um, u_um, limit_um : measured value with its sign, standard uncertainty, limit.
    decision : what follows.
    measurement, repeat : that it comes from; ``None`` where it comes from all of them.
    length_mm : calibrated length or size that it belongs to.
    position : where it was measured, in words.
    standing : ``again`` where the standard asks for more readings before it counts, ``replaced`` where these were made.
    set_aside : whether it rests on a reading that the screening left out of the estimates, and is outside for that.
    """

    error_um: float
    u_um: float
    limit_um: float
    decision: Decision
    measurement: int | None = None
    repeat: int | None = None
    length_mm: float | None = None
    position: Text = NOTHING
    standing: Standing = "counts"
    set_aside: bool = False

    @property
    def outcome(self) -> StatementFinding:
        """What follows from it for the test."""
        if self.standing == "again":
            return "remeasure"
        return "fail" if self.set_aside else self.decision.outcome


@dataclass(frozen=True)
class Statement:
    """A statement of conformity with all it rests on.

    Parameters
    ----------
    facts : the job's wish.
    characteristic : the one of the standard's that is decided.
    quantity : what is compared, in words.
    measured : what was measured, in the plural, for "… conform".
    errors : all that was decided, in the recording's order.
    missing : what the test lacks of its standard's plan, or of its uncertainty, in words.
    remarks : what the reader must know of this use of the standard.
    signed : whether limits hold on both sides of zero.
    joint : probability that all quantities conform, what they share being correlated; ``None`` where it is not known.
    budget : uncertainty of the named quantity, line by line; ``None`` where it has none.
    risks : of all machines alike, for the named quantity; ``None`` without a prior.
    outside : readings that the screening left out of the estimates and that have no value, in words: each fails.
    remedies : of each that is missing, which key of the job would state it; nothing where its words say that.
    """

    facts: ConformityFacts
    characteristic: str
    quantity: Text
    measured: Text
    errors: tuple[Decided, ...]
    missing: tuple[Text, ...]
    remarks: tuple[Text, ...]
    signed: bool = True
    joint: float | None = None
    budget: Budget | None = None
    risks: Risks | None = None
    outside: tuple[Text, ...] = ()
    remedies: tuple[Text, ...] = ()

    @property
    def missing_with_remedies(self) -> tuple[Text, ...]:
        """What is missing with the keys that would state it, for who wrote the job."""
        return tuple(
            say("{what} ({remedy})", what=what, remedy=remedy) if remedy else what
            for what, remedy in zip_longest(self.missing, self.remedies, fillvalue=NOTHING)
        )

    @property
    def scope(self) -> Literal["complete", "partial"]:
        """Whether all that the standard asks for was measured."""
        return "partial" if self.missing else "complete"

    @property
    def named(self) -> Decided:
        """The least favourable: of those with the gravest outcome the one with the lowest probability of conforming."""
        return least_favourable(self.errors)

    @property
    def finding(self) -> StatementFinding:
        """The gravest of all decisions; what is outside without a value fails."""
        return "fail" if self.outside else self.named.outcome

    @property
    def outcome(self) -> StatementOutcome:
        """The finding; ``incomplete`` where it is a pass, conditional or not, and anything is missing."""
        return "incomplete" if self.finding in ("pass", "conditional pass") and self.missing else self.finding

    @property
    def value_um(self) -> float:
        """Size of the named error."""
        return abs(self.named.error_um)

    @property
    def u_um(self) -> float:
        """Its standard uncertainty."""
        return self.named.u_um

    @property
    def limit_um(self) -> float:
        """Its limit."""
        return self.named.limit_um

    @property
    def decision(self) -> Decision:
        """What follows from it alone."""
        return self.named.decision


def counted(errors: Sequence[Decided]) -> tuple[Decided, ...]:
    """Those that no further readings stand for."""
    return tuple(item for item in errors if item.standing != "replaced")


def least_favourable(errors: Sequence[Decided]) -> Decided:
    """See :attr:`Statement.named`; where the probabilities agree to the last digit, the farthest towards or over its limit."""

    def order(item: Decided) -> tuple[int, float, float, float]:
        decision, room = item.decision, item.limit_um - abs(item.error_um)
        within, beyond = decision.probability_conforming, decision.probability_beyond
        return GRAVEST.index(item.outcome), 0.0 if within is None else within, -(beyond or 0.0), room

    return min(counted(errors), key=order)
