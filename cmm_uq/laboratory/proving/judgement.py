"""What diagnoses of sealed cases said, against what was true, and the figures that a laboratory accepts the method by.

*Found*: an effect that is hidden is asserted, alone or as one of a group that is said not to be told apart. *Wrongly
named*: an effect is asserted that does not act, and no group with one that does is named with it; of a fault of the
artefact, any effect of the machine. The *verdict is right* when it says *consistent* of nothing, *explained* of effects
of the catalogue that are all found without a wrong name, and of any other cause that something is there which no effect
explains, or that it is the artefact. A hidden effect of strength s is found with the probability 1/(1 + exp(−b·(s − m))).
Both numbers are averaged over, on a grid, with flat priors for m and ln b: that has an answer where every effect is found,
or none, and an interval that says how little was measured. Effects are taken together, for their strength is what the
noise lets anyone see of them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from scipy import special

from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.tables.plan import ProveFacts
from cmm_uq.jobs.verdicts import AGREES, DIAGNOSES
from cmm_uq.laboratory.proving.cases import ARTEFACT, KINDS, NOTHING, ONE, OUTSIDE, TWO, Case

LEVEL = 0.95


@dataclass(frozen=True)
class Rate:
    """So many of so many, with the interval of Clopper and Pearson (Biometrika 26 (1934), 404–413)."""

    count: int  # count, of: how many of how many
    of: int
    # where those come in clusters, such as the intervals of one recording, (count, of) of each: what one cluster says
    # is then worth less than as many that know nothing of each other
    clusters: tuple[tuple[int, int], ...] = ()

    @classmethod
    def pooled(cls, clusters: Iterable[tuple[int, int]]) -> Rate:
        kept = tuple((k, n) for k, n in clusters if n)
        return cls(sum(k for k, _ in kept), sum(n for _, n in kept), kept)

    @property
    def value(self) -> float | None:
        return self.count / self.of if self.of else None

    @cached_property
    def interval(self) -> tuple[float, float]:
        """Lower and upper end, 95 %, each missed with half of the rest; all there is where nothing was counted."""
        n = self._effective
        return clopper_pearson(n * self.count / self.of if self.of else 0.0, n)

    @property
    def _effective(self) -> float:
        each = np.array(self.clusters, dtype=np.float64).reshape(-1, 2)
        clusters, total = len(each), each[:, 1].sum()
        if clusters < 2 or (p := each[:, 0].sum() / total) in (0.0, 1.0):
            return float(self.of)
        off = each[:, 0] - p * each[:, 1]
        # variance of a ratio of sums over clusters (Cochran, Sampling Techniques, 1977, 6.3)
        variance = clusters / (clusters - 1) * float(off @ off) / total**2
        return float(min(self.of, p * (1 - p) / variance)) if variance > 0 else float(self.of)


def clopper_pearson(count: float, of: float, level: float = LEVEL) -> tuple[float, float]:
    tail = 0.5 * (1 - level)
    low = float(special.betaincinv(count, of - count + 1, tail)) if count > 0 else 0.0
    high = float(special.betaincinv(count + 1, of - count, 1 - tail)) if count < of else 1.0
    return low, high


def cases_to_decide(limit: float, level: float = LEVEL) -> int:
    """Fewest cases after which a rate of zero is known to lie below a limit."""
    return int(np.ceil(np.log(0.5 * (1 - level)) / np.log1p(-limit)))


@dataclass(frozen=True)
class Tenth:
    """Probabilities said between two tenths: how many, their mean, and how many of these were right."""

    low: float
    high: float
    said: float
    right: Rate

    @property
    def agrees(self) -> bool:
        """Whether the mean that was said lies in the interval of what was right."""
        low, high = self.right.interval
        return low <= self.said <= high


def tenths(said: Sequence[tuple[float, bool]]) -> tuple[Tenth, ...]:
    """Probabilities that were said, and whether it was so, by tenths; without those in which nothing was said."""
    own = [[(p, right) for p, right in said if min(int(10 * p), 9) == i] for i in range(10)]
    return tuple(
        Tenth(i / 10, (i + 1) / 10, float(np.mean([p for p, _ in some])), Rate(sum(right for _, right in some), len(some)))
        for i, some in enumerate(own) if some
    )  # fmt: skip


OFTEN = 0.9
LARGEST = 30.0  # strength up to which the answer is looked for: twice the strongest that is drawn
FEWEST = 8  # hidden effects from which on there is an answer
_MIDDLE, _SLOPE, _CURVE = np.linspace(0.0, LARGEST, 241), np.geomspace(0.15, 6.0, 40), np.linspace(3.0, 15.0, 49)


@dataclass(frozen=True, eq=False)
class DetectionCurve:
    """How finding grows with strength."""

    # often, interval: strength found in nine of ten, median and 95 % interval; beyond LARGEST it is infinite
    often: float
    interval: tuple[float, float]
    # strengths, curve, low, high: (p,) strengths, and the probability to be found there, median and 95 % interval
    strengths: Floats
    curve: Floats
    low: Floats
    high: Floats


def detection_curve(strengths: Sequence[float], detected: Sequence[bool]) -> DetectionCurve | None:
    """How it grows with strength, from what was hidden and what was found; ``None`` of too few."""
    if len(strengths) < FEWEST:
        return None
    m, b = (grid.ravel() for grid in np.meshgrid(_MIDDLE, _SLOPE, indexing="ij"))
    z = b[:, None] * (np.asarray(strengths, dtype=np.float64) - m[:, None])
    log = np.where(np.asarray(detected, dtype=bool), -np.logaddexp(0, -z), -np.logaddexp(0, z)).sum(axis=1)
    weight = np.exp(log - log.max())
    weight /= weight.sum()
    often = m + np.log(OFTEN / (1 - OFTEN)) / b
    low, middle, high = (float(np.inf) if q > LARGEST else q for q in _quantiles(often, weight))
    curve = 1 / (1 + np.exp(-b[:, None] * (_CURVE - m[:, None])))
    ends = np.array([_quantiles(column, weight) for column in curve.T])
    return DetectionCurve(middle, (low, high), _CURVE, ends[:, 1], ends[:, 0], ends[:, 2])


def _quantiles(values: Floats, weight: Floats) -> tuple[float, float, float]:
    """Of 2.5 %, one half and 97.5 % of the weight."""
    order = np.argsort(values)
    total = np.cumsum(weight[order])
    low, middle, high = values[order][np.minimum(np.searchsorted(total, (0.025, 0.5, 0.975)), len(values) - 1)]
    return float(low), float(middle), float(high)


CONSISTENT, UNDETERMINED, EXPLAINED, PARTIAL, EMPIRICAL, UNEXPLAINED = DIAGNOSES
BEYOND = (PARTIAL, EMPIRICAL, UNEXPLAINED)
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
    intervals: tuple[tuple[str, int, int], ...] = ()  # which, as STATED; how many hold the truth, of how many
    right: bool = False
    # rms of predictions of what the fit has not seen, before and after; None where nothing was asserted
    heldout_um: tuple[float, float] | None = None


def judge(
    case: Case, record: Mapping[str, Any], named: Mapping[str, float], of_artefact: Callable[[str], bool]
) -> JudgedCase:
    if REFUSED in record:
        return JudgedCase(case, REFUSED)
    hidden, groups = {h.effect: h for h in case.hidden}, [set(group) for group in record["groups"]]
    asserted = {each["effect"]: each for each in record["effects"]}
    with_group = {name: {name}.union(*(group for group in groups if name in group)) for name in asserted}
    reached = set().union(*with_group.values()) & set(hidden)
    alone = {name for name in reached if with_group.get(name) == {name}}
    wrong = sorted(
        name for name, group in with_group.items()
        if not group & set(hidden) and not (case.kind == ARTEFACT and of_artefact(name))
    )  # fmt: skip
    counted = [_inside(asserted[name]["parameters"], hidden[name].parameters) for name in asserted if name in hidden]
    intervals = [(STATED, k, n) for k, n in counted]
    whole, apart, verdict = reached == set(hidden) and not wrong, alone == set(hidden), record["verdict"]
    if case.kind in (NOTHING, ONE, TWO):
        sort = NAMED if case.kind == NOTHING else NAMED_BESIDE if apart else NAMED_GROUPED
        sort = sort if whole or case.kind == NOTHING else NAMED_MISSED
        intervals.append((sort, *_inside(record["named"], named)))
    fitting = {NOTHING: AGREES, ONE: (EXPLAINED,), TWO: (EXPLAINED,), OUTSIDE: BEYOND}
    right = verdict in fitting.get(case.kind, (EXPLAINED, *BEYOND)) and (whole or case.kind == NOTHING)
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
    def hiding(self) -> list[JudgedCase]:
        """Cases that hide effects; of one without an answer none is found."""
        return [one for one in self.cases if one.case.kind in (ONE, TWO)]

    @cached_property
    def refused(self) -> Rate:
        return Rate(len(self.cases) - len(self.answered), len(self.cases))

    @cached_property
    def false_alarms(self) -> Rate:
        """Cases that hide nothing and of which something is said to be missing, or that got no answer."""
        return _rate([one for one in self.cases if one.case.kind == NOTHING], lambda one: one.verdict not in AGREES)

    @cached_property
    def found(self) -> Rate:
        return Rate.pooled((len(one.found), len(one.case.hidden)) for one in self.hiding)

    @cached_property
    def found_alone(self) -> Rate:
        """Those of them that are told from all others."""
        return Rate.pooled((len(one.alone), len(one.case.hidden)) for one in self.hiding)

    @cached_property
    def wrong_names(self) -> Rate:
        """Cases in which an effect is named that does not act."""
        return _rate(self.answered, lambda one: bool(one.wrong))

    @cached_property
    def right(self) -> Rate:
        return _rate(self.cases, lambda one: one.right)

    @cached_property
    def coverage(self) -> Rate:
        """95 % intervals that hold the truth, where all that acts was named or found."""
        return self.coverage_of(STATED, NAMED, NAMED_BESIDE, NAMED_GROUPED)

    def coverage_of(self, *sorts: str) -> Rate:
        """The same of some sorts of intervals; those of one recording are not independent of each other."""
        each = [[(k, n) for sort, k, n in one.intervals if sort in sorts] for one in self.answered]
        return Rate.pooled((sum(k for k, _ in own), sum(n for _, n in own)) for own in each)

    @cached_property
    def recognised(self) -> Rate:
        """Of detected causes outside the catalogue, those that are taken for no effect of it."""
        return _rate([one for one in self.of_kind(OUTSIDE) if one.verdict not in AGREES], lambda one: one.right)

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
        return [(h.strength, h.effect in one.found) for one in self.hiding for h in one.case.hidden]

    @cached_property
    def by_strength(self) -> DetectionCurve | None:
        return detection_curve([s for s, _ in self._strengths], [f for _, f in self._strengths])

    @cached_property
    def in_bins(self) -> tuple[tuple[float, float, Rate], ...]:
        """Hidden effects that are found, by their strength: from, to, and how many."""
        ends, each = list(pairwise(_BINS)), self._strengths
        own = [[found for s, found in each if low <= s < high or s == high == _BINS[-1]] for low, high in ends]
        return tuple((*end, Rate(sum(some), len(some))) for end, some in zip(ends, own, strict=True))

    def of_effect(self, name: str) -> tuple[Rate, int]:
        """How often an effect was found where it was hidden, and how often it was named where it did not act."""
        where = [one for one in self.hiding if any(h.effect == name for h in one.case.hidden)]
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
    low, high = facts.coverage_pct
    every: list[tuple[str, Text, Rate, float, float]] = [
        ("false_alarms", say("False alarms"), judgement.false_alarms, 0.0, facts.false_alarms_pct),
        ("coverage", say("95 % intervals that hold the truth"), judgement.coverage, low, high),
    ]
    if facts.wrong_names_pct is not None:
        every.append(("wrong_names", say("Cases with a wrong name"), judgement.wrong_names, 0.0, facts.wrong_names_pct))
    if facts.found_pct is not None:
        every.append(("found", say("Hidden effects found"), judgement.found, facts.found_pct, 100.0))
    return tuple(AcceptanceFigure(key, what, rate, low / 100, high / 100) for key, what, rate, low, high in every)
