"""What a standard is: what it tests, on which observations, what a complete test consists of, and what is decided."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cache, cached_property, partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.conformity import decision as rules, uncertainty
from cmm_uq.analysis.conformity.as_recorded import OutsideReadings, numbered
from cmm_uq.analysis.conformity.decision import Decision, PriorKnowledge
from cmm_uq.analysis.conformity.plans import Condition, SpherePlan
from cmm_uq.analysis.conformity.statement import Clause, Decided, Statement, clauses_in_words, counted, least_favourable
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, Verbatim, at_key, say
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import ARCSECOND, MICROMETRE, unit
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.jobs.recording.beside import ShortGauge
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.conformity import Circumstances, ConformityFacts, TestUncertainty, needed, needs_prior
from cmm_uq.machine.model.artefact import Artefact, Indications
from cmm_uq.machine.model.kind import POSITIONING
from cmm_uq.maths.uncertainty.budget import Budget, BudgetLine
from cmm_uq.maths.uncertainty.quantity import Quantity, nominal

NOT_CONSIDERED = say(
    "Simple acceptance takes no account of the uncertainty: at the limit itself conforming is as likely as not."
)
NOT_STATED = say("No uncertainty is stated above zero: none is considered, and no probability can be given.")
RAISED = say(
    "Where the test uncertainty evaluated is smaller, u is half of the laboratory's calibration and measurement capability "
    "(k = 2){key}.",
    key=at_key("[laboratory.cmc]"),
)
CMC = say("the laboratory's calibration and measurement capability")
BY_MEASUREMENT_ALONE = say(
    "Probabilities rest on this measurement alone, without prior knowledge of such machines; near the limit they may be "
    "several percentage points too high or too low."
)


@dataclass(frozen=True)
class Characteristic:
    """One thing that a standard decides."""

    name: str  # as in [[conformity]] characteristic
    observed: str  # what it is decided on, one of Kind.tested
    statement: Callable[[Test], Statement]  # compares and decides; see Test.stated
    # what a complete test consists of, and what is missing of it, for an artefact with its points, recorded or a plan's
    conditions: Callable[..., tuple[Condition, ...]] = lambda artefact, *, recorded: ()
    # key of [artefact] that a rule with an uncertainty needs and that is not stated; None when nothing is missing
    unstated: Callable[[ArtefactFacts], str | None] = lambda artefact: None
    # what a complete test asks of artefact, probe and surroundings beside its points
    asks: Callable[[Test], tuple[Condition, ...]] = lambda test: ()
    also: tuple[str, ...] = ()  # other names of it
    needs: str | None = None  # key of [test_uncertainty] without which a rule with an uncertainty says nothing
    # how a short gauge recorded beside the artefact enters; not at all where left out
    beside: Callable[[Artefact, ShortGauge | None], Artefact] | None = None
    lines: tuple[str, ...] = ()  # of the test uncertainty that apply; see cmm_uq.analysis.conformity.uncertainty
    angle: bool = False  # whether its values are arcs over their lengths, so that it may have a limit in arcsec


@dataclass(frozen=True)
class Standard:
    """A standard as it can be stated."""

    name: str  # with its part and edition, as in [[conformity]] standard
    characteristics: tuple[Characteristic, ...]  # that are decided; the first is meant where the job names none
    remarks: tuple[Text, ...] = ()  # what every statement by it says
    sensing: Literal["contacting", "optical"] | None = None  # for which probes it is; None for any
    clauses: tuple[Clause, ...] = ()  # what it takes the standard to ask, for the form that a laboratory fills in

    @property
    def clause_names(self) -> tuple[str, ...]:
        return tuple(clause.name for clause in self.clauses)

    def characteristic(self, name: str | None) -> Characteristic:
        for each in self.characteristics:
            if name in (None, each.name, *each.also):
                return each
        known = ", ".join(each.name for each in self.characteristics)
        raise ValueError(f"characteristic = {name!r} of {self.name} is not decided here: only {known}")

    def instead(self, tested: Collection[str]) -> str:
        """What to do where one of its characteristics is not decided on what a kind offers."""
        others = ", ".join(one.name for one in self.characteristics if one.observed in tested)
        if others:
            return f"Name as characteristic one of: {others}"
        return "Leave the statement out, or record the artefact that the standard asks for"

    def uncertainty_missing(
        self, wish: ConformityFacts, artefact: ArtefactFacts, stated: TestUncertainty
    ) -> str | None:
        if wish.rule == "simple":
            return None
        one = self.characteristic(wish.characteristic)
        if one.lines and one.lines != uncertainty.FORM_LINES and all(stated.declared(line) for line in one.lines):
            return None
        if one.observed == POSITIONING and wish.angle_arcsec is not None:  # its recording says by what
            return None
        if one.needs is None or getattr(stated, one.needs) or stated.u_temperature_k or stated.u_fixturing_um:
            return one.unstated(artefact)
        return one.needs


@dataclass(frozen=True, eq=False)
class Test:
    """A test that is to be decided."""

    __test__ = False  # no test of pytest's

    standard: Standard  # standard, characteristic: what is tested
    characteristic: Characteristic
    facts: ConformityFacts  # limit and rule
    artefact: Artefact  # with its recording
    recorded: Artefact  # the same as recorded, where artefact has been corrected: that makes no copy a measurement
    accuracy: Mapping[str, Quantity]  # figures of performance with uncertainty, by name
    key: str  # of job.toml, for messages
    circumstances: Circumstances = field(default_factory=Circumstances)  # under which it was carried out
    # what the screening left out of the estimates; it is in artefact and in recorded
    left_out: OutsideReadings | None = None

    def error(self, problem: str, of: str = "standard", fix: str = "Leave the statement out") -> CmmUqError:
        return CmmUqError(problem, where=f"job.toml {self.key} {of}", fix=fix)

    def set_aside(self, rows: Ints) -> NDArray[np.bool_]:
        """Which values (m,), each of several points (m, j), rest on a reading that the screening left out."""
        return np.zeros(len(rows), dtype=bool) if self.left_out is None else self.left_out.any_of(rows)

    def set_aside_in(self, measurement: int, repeat: int | None = None) -> bool:
        """Whether the screening left out a reading of a measurement, or of one repeat of it."""
        points = self.artefact.points
        own = (points.measurement == measurement) & (True if repeat is None else points.repeat == repeat)
        return bool(self.set_aside(np.flatnonzero(own)[:, None]).any())

    def indications(self) -> Indications:
        found = self.artefact.indications()
        if found is None:
            problem = f"{self.facts.standard} compares with calibrated lengths, and the {self.artefact.kind} has none"
            raise self.error(problem, fix="Give length_mm and u_um in [artefact], or leave the statement out")
        return found

    def limits_um(self, lengths_mm: Floats) -> Floats:
        """The limit of each of some lengths (m,), µm: ``limit_um``, an arc, A + L/K, B, or the lesser of these two."""
        mpe, angle = self.facts.mpe, self.facts.angle_arcsec
        if angle is not None:
            return np.asarray(angle * ARCSECOND * lengths_mm / MICROMETRE, dtype=np.float64)
        if mpe is None:
            return np.full(len(lengths_mm), self.facts.limit_um, dtype=np.float64)
        return mpe.at(lengths_mm)

    def limit_um(self, length_mm: float) -> float:
        return float(self.limits_um(np.array([length_mm]))[0])

    @cached_property
    def unstated(self) -> tuple[Condition, ...]:
        """Lines of the test uncertainty that are neither stated nor declared."""
        return uncertainty.uncertainty_conditions(self.characteristic.lines, self.recorded, self.circumstances)

    @property
    def answered(self) -> bool:
        """Whether an uncertainty of nought is one that somebody answers for, and not an unknown one."""
        return bool(self.characteristic.lines) and not self.unstated

    def _length(self, length_mm: float | None) -> float:
        return self.artefact.sizes[0].nominal if length_mm is None else length_mm

    def decide(
        self, value_um: float, u_um: float, limit_um: float, *, signed: bool, length_mm: float | None = None
    ) -> Decision:
        """One value by the rule and the prior of the job.

        Where all lines of the uncertainty are declared negligible every rule comes to simple acceptance. Where some are
        unknown, what they may well be of the length (of the artefact's size by default) counts before anything is proved to
        be beyond the limit.
        """
        rule = self.facts.rule
        if u_um <= 0 and self.answered and rules.needs_uncertainty(rule):
            return replace(rules.decide(value_um, 0.0, limit_um, "simple", signed=signed), rule=rules.rule_words(rule))
        unstated, prior = self._u_of_unstated(self._length(length_mm)), self.prior(limit_um)
        return rules.decide(value_um, u_um, limit_um, rule, signed=signed, prior=prior, unstated=unstated)

    @cached_property
    def _u_of_unstated(self) -> Callable[[float], float]:
        """Standard uncertainty, µm, that what is not stated may well have, of a length in mm."""
        lines, under = self.characteristic.lines, self.circumstances
        return cache(partial(uncertainty.u_of_unstated, lines, self.recorded, under))

    def decided(
        self, value_um: float, u_um: float, limit_um: float, *, signed: bool, measurement: int | None = None,
        repeat: int | None = None, length_mm: float | None = None, position: Text = NOTHING, set_aside: bool = False,
    ) -> Decided:  # fmt: skip
        """One value with what follows from it, and where it comes from."""
        decision = self.decide(value_um, u_um, limit_um, signed=signed, length_mm=length_mm)
        where = (measurement, repeat, length_mm, position)
        return Decided(value_um, u_um, limit_um, decision, *where, set_aside=set_aside)

    def each_decided(
        self, values_um: Floats, u_um: Floats, lengths_mm: Floats, *, signed: bool, measurement: Sequence[int | None],
        set_aside: NDArray[np.bool_], repeat: Sequence[int | None] = (), position: Sequence[Text] = (),
    ) -> tuple[Decided, ...]:  # fmt: skip
        """Values (m,), with their standard uncertainties, each against the limit of its length, mm."""
        count = len(values_um)
        columns = (each.tolist() for each in (values_um, u_um, self.limits_um(lengths_mm), lengths_mm, set_aside))
        of = measurement, repeat or [None] * count, position or [NOTHING] * count
        return tuple(
            self.decided(value, u, limit, signed=signed, measurement=number, repeat=turn, length_mm=length,
                         position=where, set_aside=aside)
            for value, u, limit, length, aside, number, turn, where in zip(*columns, *of, strict=True)
        )  # fmt: skip

    def least_u(self, lengths_mm: Floats) -> Floats:
        """(m,) µm: half the laboratory's capability, k = 2 (ILAC-P14:09/2020), at lengths (m,); 0 where none is given."""
        cmc = self.circumstances.cmc
        if cmc and self.artefact.angular:  # as an arc where 1 µm is 1″
            return np.full(len(lengths_mm), 0.5 * cmc.least(unit("″"), 0.0))
        return np.array([0.5 * cmc.least(unit("µm"), float(each)) if cmc else 0.0 for each in lengths_mm])

    def at_least(self, u_um: float, length_mm: float) -> float:
        """A standard uncertainty not below that; one that is not stated stays 0."""
        return max(u_um, float(self.least_u(np.array([length_mm]))[0])) if u_um > 0 else u_um

    def prior(self, limit_um: float) -> PriorKnowledge | None:
        given = self.facts.prior
        if given is None:
            return None
        return PriorKnowledge(given.mean_um, given.sd_um or (given.share_of_limit or 0.0) * limit_um)

    def refuse_without_uncertainty(self, u: float, name: str) -> None:
        if u <= 0 and rules.needs_uncertainty(self.facts.rule) and not self.answered:
            problem, fix = needed(name, self.facts)
            raise self.error(problem, "rule", fix)

    def refuse_nothing_measured(self, measured: bool, what: str) -> None:
        if not measured:
            asked = f"{self.characteristic.name} of {self.facts.standard} is decided on {what}"
            fix = "Record them, or leave the statement out"
            raise self.error(f"{asked}, and the recording has none", "characteristic", fix)

    def stated(
        self, quantity: Text, measured: Text, items: tuple[Decided, ...], remarks: Sequence[Text], *,
        signed: bool = True, causes: uncertainty.Causes | None = None, budget: Budget | None = None,
        repeats: int | None = None, lacking: Sequence[Text] = (),
    ) -> Statement:  # fmt: skip
        """What was decided, with what the test lacks, and what the rule leaves out.

        ``causes``: of the uncertainty of each item, from which follows the probability that all conform; ``budget``: of the
        least favourable; ``repeats``: up to which a repeat has every point of its measurement; all of them by default.
        """
        under, points, left_out = self.circumstances, self.recorded.points, self.left_out
        lines, worst = self.characteristic.lines, least_favourable(items)
        clauses = [one for one in self.standard.clauses if not one.of or self.characteristic.name in one.of]
        form = under.clauses.get(self.facts.clauses or "")
        checked, differing = clauses_in_words(self.standard.name, clauses, form)
        asked = (
            *self.characteristic.conditions(self.recorded, recorded=True),
            *self.characteristic.asks(self),
            *(Condition(what, (what,)) for what in (*lacking, *differing)),
            *self.unstated,
            *uncertainty.rated_conditions(under, points),
            *numbered(points if left_out is None else left_out.recording, repeats),
            *self._gaps_of_short_gauge(),
            *(Condition(what, (what,), Verbatim(at)) for what, at in under.lapsed),
        )
        missing = {text: condition for condition in asked for text in condition.missing}
        aside = [item for item in items if item.set_aside]
        outside = () if left_out is None else left_out.without_value
        more = [*remarks, *_set_aside(under.set_aside)]
        if left_out is not None and (aside or outside):
            more += left_out.in_words([item.measurement for item in aside] if not outside else [None])
        more += self._of_the_rule(items, worst)
        if copies := uncertainty.copies_in_words(points):
            more.append(copies)
        more += uncertainty.declared_in_words(lines, under.uncertainty)
        more += [*uncertainty.rated_in_words(under.rated), *checked]
        joint = None
        if causes is not None and not outside and not counted(aside):
            left = [i for i, item in enumerate(items) if item.standing != "replaced"]
            errors, limits = [items[i].error_um for i in left], [items[i].limit_um for i in left]
            own = causes.of(np.array(left, dtype=np.int64))
            joint = uncertainty.probability_of_all(errors, limits, own, signed=signed)
        if budget is not None:
            declared = uncertainty.with_declared(self._at_least(budget, worst), lines, under.uncertainty)
            budget = declared if budget.u > 0 else None
        return Statement(
            self.facts, self.characteristic.name, quantity, measured, items, tuple(missing), tuple(more), signed,
            joint, budget, self._risks(worst, signed), outside, tuple(missing.values()),
        )  # fmt: skip

    def _of_the_rule(self, items: Sequence[Decided], worst: Decided) -> list[Text]:
        """What the rule leaves out, what the standard always says, and whether the capability stood for a smaller u."""
        more: list[Text] = [NOT_CONSIDERED] if self.facts.rule == "simple" and worst.u_um > 0 else []
        if (prior := self.prior(worst.limit_um)) is None and worst.u_um > 0:
            more.append(BY_MEASUREMENT_ALONE)
        elif prior is not None and worst.u_um > 0:
            share = 100 * prior.share(worst.u_um)
            more.append(
                say("Prior knowledge of such machines has {share:.1f} % of the weight in the probability.", share=share)
            )
            more += [rules.NOT_BY_PRIOR_ALONE] if needs_prior(self.facts.rule) else []
        more += self.standard.remarks
        least = self.least_u(np.array([self._length(item.length_mm) for item in items]))
        if any(0 < item.u_um <= floor * (1 + 1e-9) for item, floor in zip(items, least, strict=True)):
            more.append(RAISED)
        return more

    def _at_least(self, budget: Budget, item: Decided) -> Budget:
        """The budget of a value, with a line for what the capability has more."""
        least = float(self.least_u(np.array([self._length(item.length_mm)]))[0])
        least *= MICROMETRE if budget.unit == unit("mm") else 1.0
        if not budget.u < least:
            return budget
        u, what = float(np.sqrt(least**2 - budget.variance)), say("raised to the laboratory's capability")
        return replace(budget, lines=[*budget.lines, BudgetLine(what, u, CMC, unit=budget.unit)])

    def _gaps_of_short_gauge(self) -> tuple[Condition, ...]:
        gauge, found = self.circumstances.short_gauge, self.artefact.indications()
        if gauge is None or found is None or found.u_beside is None or not found.u_beside.any():
            return ()
        gaps = [text for condition in numbered(gauge.points, measurements=False) for text in condition.missing]
        return tuple(Condition(text, (say("short gauge, {gap}", gap=text),)) for text in gaps)

    def _risks(self, worst: Decided, signed: bool) -> rules.Risks | None:
        prior, band = self.prior(worst.limit_um), worst.decision.guard_band
        if prior is None or worst.u_um <= 0:
            return None
        accepted = -20.0 * worst.u_um if band is None else worst.limit_um - band
        return rules.global_risks(accepted, worst.limit_um, worst.u_um, prior, signed=signed)


def _set_aside(reasons: Mapping[int, str]) -> list[Text]:
    return [
        say("Measurement {number}, left out of the estimates by the laboratory, is decided with the others: {reason}.",
            number=number, reason=Verbatim(reason.rstrip(". ")))
        if reason
        else say("Measurement {number}, left out of the estimates by the laboratory, is decided with the others; no reason is "
                 "stated.", number=number)
        for number, reason in reasons.items()
    ]  # fmt: skip


def characteristic_of(standard: Standard, facts: ConformityFacts, key: str) -> Characteristic:
    try:
        return standard.characteristic(facts.characteristic)
    except ValueError as error:
        raise CmmUqError(str(error), where=f"job.toml {key} characteristic", fix="Leave it out") from None


def length_unstated(artefact: ArtefactFacts) -> str | None:
    return "u_um" if artefact.certified and not artefact.u_um else None


def diameter_allowed(test: Test, plan: SpherePlan) -> tuple[Condition, ...]:
    (low, high), diameter = plan.diameter_mm, test.artefact.sizes[0].nominal
    what = say("test sphere of {low:g} to {high:g} mm", low=low, high=high)
    lacks = say("{what} ({diameter} mm)", what=what, diameter=nominal(diameter))
    return (Condition(what, () if low <= diameter <= high else (lacks,)),)
