"""Statements of conformity: every error with its limit and decision, and what they come to together.

A pass needs a finding and completeness; a finding worse than a conditional pass is the outcome whatever is missing. Of ISO
10360-2:2009 at most five lengths may have one of three values outside, each measured ten times more, all inside.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Collection, Sequence
from typing import Literal

import numpy as np

from cmm_uq.analysis.conformity.decision import Decision, Risks
from cmm_uq.analysis.conformity.plans import Condition
from cmm_uq.base.messages import NOTHING, Text, Verbatim, commas, day, say
from cmm_uq.base.points import Ints
from cmm_uq.base.units import UNITS
from cmm_uq.base.values import dataclass, replace
from cmm_uq.jobs.tables.conformity import ClausesForm, ConformityFacts, HeldClause
from cmm_uq.jobs.verdicts import TOLERANCE_OUTCOMES, Verdict
from cmm_uq.maths.uncertainty.budget import Budget
from cmm_uq.maths.uncertainty.quantity import Quantity

StatementFinding = Literal["pass", "conditional pass", "undecided", "remeasure", "conditional fail", "fail"]
StatementOutcome = StatementFinding | Literal["incomplete"]

GRAVEST: tuple[StatementFinding, ...] = (  # findings in the order of their gravity
    "fail", "conditional fail", "remeasure", "undecided", "conditional pass", "pass",
)  # fmt: skip
Standing = Literal["counts", "again", "replaced"]


@dataclass(frozen=True)
class Decided:
    """One quantity against its own limit, with its own uncertainty."""

    error_um: float  # error_um, u_um, limit_um: measured value with its sign, standard uncertainty, limit
    u_um: float
    limit_um: float
    decision: Decision  # what follows
    measurement: int | None = None  # measurement, repeat: that it comes from; None where it comes from all of them
    repeat: int | None = None
    length_mm: float | None = None  # calibrated length or size that it belongs to
    position: Text = NOTHING  # where it was measured, in words
    # again where the standard asks for more readings before it counts, replaced where these were made
    standing: Standing = "counts"
    # whether it is outside for resting on a reading that the screening left out of the estimates
    set_aside: bool = False

    @property
    def outcome(self) -> StatementFinding:
        if self.standing == "again":
            return "remeasure"
        return "fail" if self.set_aside else self.decision.outcome


@dataclass(frozen=True)
class Statement:
    """A statement of conformity with all it rests on."""

    facts: ConformityFacts  # the job's wish
    characteristic: str  # the one of the standard's that is decided
    quantity: Text  # what is compared, in words
    measured: Text  # what was measured, in the plural, for "… conform"
    errors: tuple[Decided, ...]  # all that was decided, in the recording's order
    missing: tuple[Text, ...]  # what the test lacks of its standard's plan, or of its uncertainty, in words
    remarks: tuple[Text, ...]  # what the reader must know of this use of the standard
    signed: bool = True  # whether limits hold on both sides of zero
    # probability that all quantities conform, what they share being correlated; None where it is not known
    joint: float | None = None
    budget: Budget | None = None  # uncertainty of the named quantity, line by line; None where it has none
    risks: Risks | None = None  # of all machines alike, for the named quantity; None without a prior
    # readings that the screening left out of the estimates and that have no value, in words: each fails
    outside: tuple[Text, ...] = ()
    conditions: tuple[Condition, ...] = ()  # that each which is missing is of, with the key that would state it

    @property
    def missing_with_remedies(self) -> tuple[Text, ...]:
        """What is missing with the keys that would state it, for who wrote the job."""
        of = self.conditions or (Condition(NOTHING),) * len(self.missing)
        return tuple(
            say("{what} ({remedy})", what=what, remedy=one.remedy) if one.remedy else what
            for what, one in zip(self.missing, of, strict=True)
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
        return abs(self.named.error_um)

    @property
    def u_um(self) -> float:
        return self.named.u_um

    @property
    def limit_um(self) -> float:
        return self.named.limit_um

    @property
    def decision(self) -> Decision:
        return self.named.decision


def counted(errors: Sequence[Decided]) -> tuple[Decided, ...]:
    return tuple(item for item in errors if item.standing != "replaced")


def least_favourable(errors: Sequence[Decided]) -> Decided:
    def order(item: Decided) -> tuple[int, float, float, float]:
        decision, room = item.decision, item.limit_um - abs(item.error_um)
        within, beyond = decision.probability_conforming, decision.probability_beyond
        return GRAVEST.index(item.outcome), 0.0 if within is None else within, -(beyond or 0.0), room

    return min(counted(errors), key=order)


TOLERANCE_WORDS = {outcome: word for word, outcome in TOLERANCE_OUTCOMES.items()}  # by outcome: in, out or open


def by_standard(statement: Statement) -> Verdict:
    U = 2 * statement.u_um if statement.u_um > 0 else None
    return Verdict(statement.characteristic, statement.outcome, statement.value_um, U, statement.limit_um, UNITS["µm"],
                   statement.facts.standard, statement.quantity, statement.missing)  # fmt: skip


def by_tolerance(
    name: str,
    title: Text,
    quantity: Quantity,
    tolerance: float,
    *,
    determined: bool = True,
    against: Sequence[Text] = (),
) -> Verdict:
    """A parameter, named as ``scale_x.ppm`` and in words, against its tolerance by its whole 95 % interval (ISO 14253-1).

    ``against``: what speaks against a pass, whatever the interval; ``determined``: whether the recording determines it.
    """
    missing = tuple(against) if determined else (NOT_DETERMINED,)
    if not determined or (missing and by_tolerance(name, title, quantity, tolerance).outcome == "pass"):
        return Verdict(name, "undecided", None, None, tolerance, quantity.unit, title=title, missing=missing)
    low, high = quantity.interval95
    within, beyond = -tolerance <= low and high <= tolerance, low > tolerance or high < -tolerance
    outcome = "pass" if within else "fail" if beyond else "undecided"
    return Verdict(name, outcome, quantity.value, quantity.expanded, tolerance, quantity.unit, title=title)


NOT_DETERMINED = say("the recording does not determine it")
NOT_CONVERGED = say("the sampling did not converge")
OUTSIDE = ("fail", "conditional fail")  # outcomes of a value that lies outside
# Outcomes of one outside the zone of conformance: further readings stand for it, too, where they were made, or a larger
# error would pass where a smaller one does not.
NOT_INSIDE = (*OUTSIDE, "undecided", "conditional pass")


@dataclass(frozen=True)
class Remeasurement:
    repeats: int  # of each length in the test itself
    outside: int
    lengths: int
    readings: int  # more of each, all of which must lie inside


def with_standing(items: Sequence[Decided], nominal: Ints, again: Remeasurement) -> tuple[Decided, ...]:
    """The same, each with what it counts for; ``nominal`` (m,) says which nominal length each is of."""
    sets: dict[tuple[int | None, int], list[int]] = {}
    for i, item in enumerate(items):
        sets.setdefault((item.measurement, int(nominal[i])), []).append(i)
    standing: dict[int, Standing] = {}
    for not_inside in (OUTSIDE, NOT_INSIDE):
        each = {key: _not_inside(items, rows, again, not_inside) for key, rows in sets.items()}
        eligible = {key: found for key, found in each.items() if found is not None}
        failed = {key for key, rows in sets.items() if any(items[i].outcome in OUTSIDE for i in rows)}
        # the test fails, whatever more is measured
        if len(eligible) > again.lengths or (not_inside is OUTSIDE and failed - set(eligible)):
            break
        for outside, further in eligible.values():
            if any(items[i].outcome in OUTSIDE for i in further):
                continue
            if len({items[i].repeat for i in further}) >= again.readings:
                standing |= dict.fromkeys(outside, "replaced")
            elif not_inside is OUTSIDE:
                standing |= dict.fromkeys(outside, "again")
    return tuple(replace(item, standing=standing.get(i, "counts")) for i, item in enumerate(items))


def _not_inside(
    items: Sequence[Decided], rows: Sequence[int], again: Remeasurement, not_inside: Collection[str]
) -> tuple[list[int], list[int]] | None:
    """Those not inside among the repeats of the test, and the further readings; ``None`` where the clause does not apply."""
    repeats = np.unique([items[i].repeat or 0 for i in rows])
    if len(repeats) < again.repeats:
        return None
    test = [i for i in rows if (items[i].repeat or 0) in repeats[: again.repeats]]
    outside = [i for i in test if items[i].outcome in not_inside]
    beyond = [i for i in test if abs(items[i].error_um) > items[i].limit_um]  # proved or not
    if not outside or len({items[i].repeat for i in (*outside, *beyond)}) > again.outside:
        return None
    return outside, [i for i in rows if i not in test]


@dataclass(frozen=True)
class Clause:
    """What this program takes one clause of a standard to ask, where that comes from, and whether anyone read the text."""

    name: str
    title: Text
    does: str
    source: str  # where that comes from
    # whether the words of the standard were read for it, in its text or as its publisher quotes them
    read: bool = False
    of: tuple[str, ...] = ()  # characteristics that it is for; all of the standard's by default

    def held(self, form: ClausesForm | None) -> HeldClause | None:
        """What a form says of it; ``None`` where nobody looked, or the program does something else by now."""
        given = None if form is None else form.clauses.get(self.name)
        return None if given is None or given.agrees is None or given.does != self.does else given


REPORTED, CHOSEN = "as commonly reported", "this project"  # sources of clauses
ITS_RULE = (
    Clause("decision_rule", say("default decision rule"), "ISO 14253-1, where the job names no other.",
           "publisher's words on ISO 10360-8:2013, of the series: its default rules apply unless otherwise specified", True)
)  # fmt: skip


def clauses_in_words(
    standard: str, asked: Sequence[Clause], form: ClausesForm | None
) -> tuple[list[Text], tuple[Text, ...]]:
    """What a certificate says of the clauses that a statement goes by, and what the test lacks by the laboratory's copy."""
    each = [(one, one.held(form)) for one in asked]
    said: list[Text] = []
    who: dict[tuple[str, dt.date, str], list[Text]] = {}
    for one, given in each:
        if form is not None and given is not None:
            key = (given.checked_by or form.checked_by, given.on or form.on, given.edition or form.edition)
            who.setdefault(key, []).append(one.title)
    for (name, when, edition), titles in who.items():
        said.append(say("Clauses checked by {name} on {day}, edition {edition}: {titles}.", name=Verbatim(name), day=day(when),
                        edition=Verbatim(edition), titles=commas(titles)))  # fmt: skip
    differing = [(one.title, given) for one, given in each if given is not None and given.agrees is False]
    for title, given in differing:
        how = Verbatim(given.differs.rstrip(". "))
        said.append(say("By the laboratory's copy this differs, {title}: {how}.", title=title, how=how))
    if unread := [one.title for one, given in each if given is None and not one.read]:
        said.append(say("Clauses not checked against the text of {standard}: {titles}.", standard=Verbatim(standard),
                        titles=commas(unread)))  # fmt: skip
    lacking = (title for title, given in differing if not given.stricter)
    return said, tuple(say("{title} as the laboratory's copy has it", title=title) for title in lacking)
