"""What diagnoses of sealed cases said, against what was true, and the figures that a laboratory accepts the method by.

*Found*: an effect that is hidden is asserted, alone or as one of a group that is said not to be told apart. *Wrongly
named*: an effect is asserted that does not act, and no group with one that does is named with it; of a fault of the
artefact, any effect of the machine. The *verdict is right* when it says *consistent* of nothing, *explained* of effects
of the catalogue that are all found without a wrong name, and of any other cause that something is there which no effect
explains, or that it is the artefact.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from cmm_uq.base.messages import Text, say
from cmm_uq.jobs.tables.plan import ProveFacts
from cmm_uq.laboratory.proving.cases import ARTEFACT, KINDS, NOTHING, ONE, OUTSIDE, TWO, Case
from cmm_uq.laboratory.proving.rates import DetectionCurve, Rate, Tenth, cases_to_decide, detection_curve, tenths

CONSISTENT, EXPLAINED, PARTIAL, UNEXPLAINED = "consistent", "explained", "partial", "unexplained"
VERDICTS = (CONSISTENT, EXPLAINED, PARTIAL, UNEXPLAINED)
REFUSED = "refused"
ANSWER = frozenset({"number", "verdict", "effects", "groups", "named", "heldout_um"})  # keys of what is no refusal
# which 95 % intervals are counted: of effects that were found; of those that the job names, by what was hidden
STATED, NAMED, NAMED_BESIDE, NAMED_GROUPED, NAMED_MISSED = (
    "found", "named, nothing hidden", "named, all found and told apart", "named, found in a group", "named, not all found",
)  # fmt: skip

_CIRCLE = 2 * np.pi
_BINS = (3.0, 4.5, 6.0, 9.0, 12.0, 15.0)


@dataclass(frozen=True)
class JudgedCase:
    """One case."""

    case: Case
    verdict: str  # what was said; refused where the diagnosis gave no answer
    # found, alone: hidden effects that were found, and those of them that no group was named with
    found: tuple[str, ...] = ()
    alone: tuple[str, ...] = ()
    wrong: tuple[str, ...] = ()  # effects that were named wrongly
    said: tuple[tuple[float, bool], ...] = ()  # probability of each asserted effect, and whether it acts
    intervals: tuple[
        tuple[str, int, int], ...
    ] = ()  # which, as STATED; how many hold the truth, and how many there are
    right: bool = False
    # rms of predictions of what the fit has not seen, before and after; None where nothing was asserted
    heldout_um: tuple[float, float] | None = None


def judge(
    case: Case, record: Mapping[str, Any], named: Mapping[str, float], of_artefact: Callable[[str], bool]
) -> JudgedCase:
    if REFUSED in record:
        return JudgedCase(case, REFUSED)
    hidden = {h.effect: h for h in case.hidden}
    groups = [set(group) for group in record["groups"]]
    asserted = {each["effect"]: each for each in record["effects"]}
    with_group = {name: {name}.union(*(group for group in groups if name in group)) for name in asserted}
    reached = set().union(*with_group.values()) & set(hidden)
    alone = {name for name in reached if with_group.get(name) == {name}}
    wrong = sorted(
        name for name, group in with_group.items()
        if not group & set(hidden) and not (case.kind == ARTEFACT and of_artefact(name))
    )  # fmt: skip
    counted = [
        _inside(each["parameters"], hidden[name].parameters) for name, each in asserted.items() if name in hidden
    ]
    intervals = [(STATED, k, n) for k, n in counted]
    whole, apart, verdict = reached == set(hidden) and not wrong, alone == set(hidden), record["verdict"]
    if case.kind in (NOTHING, ONE, TWO):
        sort = (
            NAMED if case.kind == NOTHING else NAMED_MISSED if not whole else NAMED_BESIDE if apart else NAMED_GROUPED
        )
        intervals.append((sort, *_inside(record["named"], named)))
    fitting = {NOTHING: (CONSISTENT,), ONE: (EXPLAINED,), TWO: (EXPLAINED,), OUTSIDE: (PARTIAL, UNEXPLAINED)}
    right = verdict in fitting.get(case.kind, (EXPLAINED, PARTIAL, UNEXPLAINED)) and (whole or case.kind == NOTHING)
    before, after = record["heldout_um"] if record["effects"] else (None, None)
    return JudgedCase(
        case, verdict, tuple(sorted(reached)), tuple(sorted(alone)), tuple(wrong),
        tuple((float(each["probability"]), name in hidden) for name, each in asserted.items()), tuple(intervals), right,
        None if before is None or after is None else (float(before), float(after)),
    )  # fmt: skip


def _inside(said: Mapping[str, Sequence[float | None]], true: Mapping[str, float]) -> tuple[int, int]:
    """How many intervals hold the truth, of how many that have two ends; of a phase on the circle."""
    inside = []
    for name, (_, low, high) in said.items():
        if name in true and low is not None and high is not None:
            turns = np.ceil((low - true[name]) / _CIRCLE) if name.endswith("phase_rad") else 0.0
            inside.append(bool(low <= true[name] + _CIRCLE * turns <= high))
    return sum(inside), len(inside)


@dataclass(frozen=True, eq=False)
class ProofJudgement:
    """All cases together."""

    cases: tuple[JudgedCase, ...]

    def of_kind(self, *kinds: str) -> list[JudgedCase]:
        """Cases that hide this and were answered."""
        return [one for one in self.cases if one.case.kind in kinds and one.verdict != REFUSED]

    @property
    def answered(self) -> list[JudgedCase]:
        return self.of_kind(*KINDS)

    @cached_property
    def refused(self) -> Rate:
        return Rate(len(self.cases) - len(self.answered), len(self.cases))

    @cached_property
    def false_alarms(self) -> Rate:
        """Cases that hide nothing and of which something else than *consistent* is said."""
        return _rate(self.of_kind(NOTHING), lambda one: one.verdict != CONSISTENT)

    @cached_property
    def found(self) -> Rate:
        return Rate.pooled((len(one.found), len(one.case.hidden)) for one in self.of_kind(ONE, TWO))

    @cached_property
    def found_alone(self) -> Rate:
        """Those of them that are told from all others."""
        return Rate.pooled((len(one.alone), len(one.case.hidden)) for one in self.of_kind(ONE, TWO))

    @cached_property
    def wrong_names(self) -> Rate:
        """Cases in which an effect is named that does not act."""
        return _rate(self.answered, lambda one: bool(one.wrong))

    @cached_property
    def right(self) -> Rate:
        return _rate(self.answered, lambda one: one.right)

    @cached_property
    def coverage(self) -> Rate:
        """95 % intervals that hold the truth, where all that acts was named or found."""
        return self.coverage_of(STATED, NAMED, NAMED_BESIDE, NAMED_GROUPED)

    def coverage_of(self, *sorts: str) -> Rate:
        """The same of some sorts of intervals; those of one recording are not independent of each other."""
        return Rate.pooled(
            (
                sum(k for sort, k, _ in one.intervals if sort in sorts),
                sum(n for sort, _, n in one.intervals if sort in sorts),
            )
            for one in self.answered
        )

    @cached_property
    def recognised(self) -> Rate:
        """Of detected causes outside the catalogue, those that are taken for no effect of it."""
        return _rate([one for one in self.of_kind(OUTSIDE) if one.verdict != CONSISTENT], lambda one: one.right)

    @cached_property
    def machine_blamed(self) -> Rate:
        """Faults of the artefact for which an effect of the machine is named."""
        return _rate(self.of_kind(ARTEFACT), lambda one: bool(one.wrong))

    @cached_property
    def probabilities(self) -> tuple[Tenth, ...]:
        """Said against right, of every effect that was asserted where no artefact has a fault."""
        return tenths([each for one in self.of_kind(NOTHING, ONE, TWO, OUTSIDE) for each in one.said])

    @cached_property
    def predicts_better(self) -> Rate:
        """Cases with an assertion in which what the fit has not seen is predicted better with it."""
        asserted = [one for one in self.answered if one.heldout_um is not None]
        return _rate(asserted, lambda one: one.heldout_um is not None and one.heldout_um[1] < one.heldout_um[0])

    @cached_property
    def held_out_ratio(self) -> float | None:
        """Median, over these, of the rms of predictions after over that before."""
        pairs = [one.heldout_um for one in self.answered if one.heldout_um and one.heldout_um[0] > 0]
        return float(np.median([after / before for before, after in pairs])) if pairs else None

    @property
    def _strengths(self) -> list[tuple[float, bool]]:
        return [(h.strength, h.effect in one.found) for one in self.of_kind(ONE, TWO) for h in one.case.hidden]

    @cached_property
    def by_strength(self) -> DetectionCurve | None:
        return detection_curve([s for s, _ in self._strengths], [f for _, f in self._strengths])

    @cached_property
    def in_bins(self) -> tuple[tuple[float, float, Rate], ...]:
        """Hidden effects that are found, by their strength: from, to, and how many."""
        own = {
            (low, high): [f for s, f in self._strengths if low <= s < high or s == high == _BINS[-1]]
            for low, high in pairwise(_BINS)
        }
        return tuple((low, high, Rate(sum(some), len(some))) for (low, high), some in own.items())

    def of_effect(self, name: str) -> tuple[Rate, int]:
        """How often an effect was found where it was hidden, and how often it was named where it did not act."""
        where = [one for one in self.of_kind(ONE, TWO) if any(h.effect == name for h in one.case.hidden)]
        return _rate(where, lambda one: name in one.found), sum(name in one.wrong for one in self.answered)

    def by_noise(self, kind: str) -> tuple[Rate, Rate, Rate]:
        """False alarms, effects found, and intervals that hold, under one kind of noise."""
        own = ProofJudgement(tuple(one for one in self.cases if one.case.noise_kind == kind))
        return own.false_alarms, own.found, own.coverage

    def verdicts(self, kind: str) -> Mapping[str, int]:
        return Counter(one.verdict for one in self.cases if one.case.kind == kind)


def _rate(cases: Iterable[JudgedCase], counts: Callable[[JudgedCase], bool]) -> Rate:
    answers = [counts(one) for one in cases]
    return Rate(sum(answers), len(answers))


MET, OPEN, MISSED = "met", "open", "missed"


@dataclass(frozen=True)
class AcceptanceFigure:
    """A figure with its limits."""

    key: str  # key, what: in results.json, and in words
    what: Text
    rate: Rate
    low: float  # low, high: limits of the rate
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


def acceptance_figures(judgement: ProofJudgement, facts: ProveFacts) -> tuple[AcceptanceFigure, ...]:
    low, high = (each / 100 for each in facts.coverage_pct)
    every = (
        ("false_alarms", say("False alarms"), judgement.false_alarms, 0.0, facts.false_alarms_pct / 100),
        ("coverage", say("95 % intervals that hold the truth"), judgement.coverage, low, high),
        (
            "wrong_names",
            say("Cases with a wrong name"),
            judgement.wrong_names,
            0.0,
            (facts.wrong_names_pct or 0.0) / 100,
        ),
        ("found", say("Hidden effects found"), judgement.found, (facts.found_pct or 0.0) / 100, 1.0),
    )
    left_out = {"wrong_names": facts.wrong_names_pct is None, "found": facts.found_pct is None}
    return tuple(AcceptanceFigure(*figure) for figure in every if not left_out.get(figure[0]))
