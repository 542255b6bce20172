"""What was found of a part: all that its page and its ``results.json`` say, as data."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterable, Mapping
from functools import cached_property
from math import degrees, isfinite
from typing import Any, Literal

import numpy as np

from cmm_uq import __version__
from cmm_uq.analysis.conformity.decision import Outcome, rule_name, rule_words
from cmm_uq.analysis.conformity.limits import LimitDecision
from cmm_uq.analysis.machine.performance import PriorInfluence
from cmm_uq.analysis.machine.recordings import FurtherRecordings
from cmm_uq.analysis.parts.budget import PointErrors, VarianceShares
from cmm_uq.analysis.parts.characteristics import never_negative
from cmm_uq.analysis.parts.foreseen import ForeseenMeasurement, foretold
from cmm_uq.analysis.parts.methods import method as other_methods
from cmm_uq.analysis.parts.methods.method import MethodComparison
from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.analysis.parts.result import StatedCharacteristic
from cmm_uq.analysis.parts.virtual import MeasurementConditions, Virtual
from cmm_uq.analysis.parts.ways import Way
from cmm_uq.base.languages.translation import ENGLISH
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, field
from cmm_uq.certificate.clauses import of_a_part
from cmm_uq.certificate.origin import NAME, FurtherCertificate, PassedTest, attributes, further_data, passed_data, rows
from cmm_uq.certificate.sections.regions import (
    evidence_data,
    families_data,
    priors_data,
    readings_data,
    shrinking,
    smaller_by,
)
from cmm_uq.jobs.part.feature import CharacteristicFacts
from cmm_uq.jobs.part.job import PartJob
from cmm_uq.jobs.part.values import Reported
from cmm_uq.jobs.source import sha256
from cmm_uq.jobs.verdicts import Verdicts, gravest
from cmm_uq.machine.model.measurement import RecordingModel
from cmm_uq.maths.uncertainty.propagation import Simulated

# what states the machine: a certificate with its inputs inside, the figures and draws alone, or a job that was analysed
Source = Literal["certificate", "results", "job"]
MATTERS = 0.05  # share of a variance from which on what nobody saw is told by name
TOO_LARGE = 0.1  # part of a tolerance from which on U is told how to be made smaller


@dataclass(frozen=True)
class VerificationCheck:
    """What the verification of the machine's certificate did, or could not do."""

    what: str  # in words
    count: int = 0  # of things compared; 0 of what was left
    why: str = ""  # it was left; empty where it was done


@dataclass(frozen=True)
class CertificateStatus:
    """The machine's certificate on the day of the measurement."""

    source: Source  # what states the machine
    files: tuple[str, ...]  # that were read, as the job names them; the folder of a job that was analysed
    # number, laboratory: of the certificate; empty where it does not say
    number: str
    laboratory: str
    # machine, serial: that it is of
    machine: str
    serial: str
    origin: str  # of the calibration's recording: ``measured``, ``simulated``, ``compensated``
    date: dt.date
    age: dt.timedelta  # of it on the day of the part's measurement
    valid_until: dt.date | None  # last day on which it holds; ``None`` where neither it nor the job says so
    verdict: str  # of the verification; ``ANALYSED`` of a job
    checked: tuple[VerificationCheck, ...]  # what was verified, then what was not
    again: bool  # whether everything was computed again
    trusted: bool  # whether signatures were held to trusted certificates
    draft: bool  # whether nobody has issued it
    given_recording: bool  # whether the machine's errors were drawn given the recording of its calibration
    path: Text  # how they were drawn, in a sentence
    drift: Text  # what is reckoned with of changes since the calibration, in a sentence
    temperature_c: float | None = None  # of the calibration; ``None`` where it does not say
    inputs_sha256: Mapping[str, str] = field(default_factory=dict)  # of the calibration, by name
    # root mean square change of each reported parameter since the calibration, in its unit, as records let expect; ``None``
    # of one where they do not say, and as a whole without records
    changes: Mapping[str, float | None] | None = None
    further: tuple[FurtherCertificate, ...] = ()
    circular: bool = False  # whether an artefact of the calibration was certified on this very machine
    passed: tuple[PassedTest, ...] = ()
    interim: bool = False  # whether it is an interim check, and no calibration
    against: tuple[
        Text, ...
    ] = ()  # what contradicts it: of its own figures, or of the machine as it is known with others


@dataclass(frozen=True)
class UnseenError:
    """An error that the calibration left free or did not see, and how much of a characteristic's variance it makes."""

    characteristic: str
    line: str  # of the budget
    effect: str  # name of the effect; empty where it is none of a machine
    title: Text  # in words
    share: float  # of the variance, 0 to 1
    why: Text  # nobody knows it better


@dataclass(frozen=True)
class FurtherSetUps:
    """What to measure on the machine, so that what is unseen would be seen."""

    effects: tuple[str, ...]  # names of those that it is for, of the largest share first
    setups: int  # how many set-ups of the artefact; 0 where none of it would help
    text: Text  # in a sentence
    command: str = ""  # line that plans it; empty where there is none
    file: str = ""  # of the set-ups, to be filled in; empty where there are none
    missed: tuple[str, ...] = ()  # names of those that no set-up of the artefact would show


@dataclass(frozen=True, eq=False)
class PartMeasurement:
    """A part's measurement, with its uncertainty and what follows."""

    job: PartJob
    # plan, given: geometry, and circumstances with the machine's state
    plan: Plan
    given: MeasurementConditions
    # virtual, simulated: virtual measurements, and what they say of the errors
    virtual: Virtual
    simulated: Simulated
    stated: tuple[StatedCharacteristic, ...]  # of each characteristic, in the order of the plan; mm and rad
    # (c,) values of the measured points, before their mean error is taken off; ``None`` where nothing was measured
    measured: Floats | None
    budget: VarianceShares  # shares by cause
    # what the calibration left free or did not see, by characteristic in the order of the plan, largest first
    unseen: tuple[UnseenError, ...]
    further: FurtherSetUps | None  # what to measure on the machine for that
    judged: tuple[LimitDecision | None, ...]  # by characteristic; ``None`` where the drawing has no limits
    together: float | None  # probability that all limits are kept at once; ``None`` without measured points or limits
    ways: tuple[Way, ...]  # as planned, then what would change u
    displaced: PointErrors  # contact points
    # where the part's origin lies in coordinates of the machine, or about which place it does
    origin_mm: tuple[float, float, float]
    standing: CertificateStatus  # the machine's certificate
    methods: MethodComparison | None = None  # other methods on this part; ``None`` where the job has none
    digits: int | None = None  # of u that were asked for; ``None`` where the number of draws was
    seed: int = 0  # of everything random
    asked: int = 0  # virtual measurements that were asked for, of which ``digits`` may need more
    warnings: tuple[Text, ...] = ()  # what the reader must know before using a figure
    files: Mapping[str, bytes] = field(default_factory=dict)  # that come with the page, by name
    influence: tuple[PriorInfluence, ...] = ()  # what other priors of the machine's errors would change
    withheld: tuple[Text, ...] = ()  # why nothing is called conforming, whatever its value
    # of the machine's calibration, and those beside it, where all of its errors follow from these
    recordings: tuple[RecordingModel, FurtherRecordings] | None = None
    foreseen: tuple[ForeseenMeasurement, ...] = ()  # what further measurements of the machine would do

    @property
    def characteristics(self) -> list[CharacteristicFacts]:
        return list(self.job.facts.characteristic)

    @cached_property
    def correlation(self) -> Floats:
        """(c, c) of the errors; of a characteristic without any spread 0 beside the diagonal."""
        spread = np.where(self.simulated.u > 0, self.simulated.u, 1.0)
        found = self.simulated.covariance / np.outer(spread, spread)
        np.fill_diagonal(found, 1.0)
        return np.asarray(found)

    @cached_property
    def margins(self) -> Floats:
        """(c,) distance of each value from its nearest limit, inwards, in standard uncertainties; ``nan`` without either."""
        found = np.full(len(self.stated), np.nan)
        for i, (stated, judged) in enumerate(zip(self.stated, self.judged, strict=True)):
            if judged is None or stated.value is None or not stated.u:
                continue
            sides = [judged.upper - stated.value] if judged.upper is not None else []
            sides += [stated.value - judged.lower] if judged.lower is not None else []
            found[i] = min(sides) / stated.u
        return found

    @property
    def nearest(self) -> int | None:
        """Place of the characteristic with the least margin; ``None`` where nothing is decided."""
        return None if np.isnan(self.margins).all() else int(np.nanargmin(self.margins))

    @cached_property
    def too_uncertain(self) -> list[int]:
        """Places of characteristics that are undecided, or of which U takes more than a tenth of the tolerance."""
        found, every = [], self.plan.characteristics
        for i, (one, judged, facts) in enumerate(zip(every, self.judged, self.characteristics, strict=True)):
            low = 0.0 if facts.asks.limits == "zone" else one.lower
            width = float("nan") if low is None or one.upper is None else one.upper - low
            if judged is not None and (judged.outcome == "undecided" or TOO_LARGE * width < self.stated[i].U):
                found.append(i)
        return found

    @property
    def outcomes(self) -> list[Outcome]:
        return [one.outcome for one in self.judged if one is not None and one.outcome is not None]

    @property
    def outcome(self) -> str | None:
        """Of the part: the gravest of its characteristics, incomplete without some; ``None`` where nothing is decided."""
        left = ["incomplete"] if self.job.facts.part.not_measured else []
        return gravest([*self.outcomes, *left]) if self.outcomes else None

    @property
    def judged_by(self) -> Text:
        return rule_words(self.job.facts.decision.rule)

    @property
    def conforming(self) -> bool:
        """Whether nothing that was decided is anything but a pass."""
        return self.outcome in (None, "pass")


SCHEMA = "cmm-uq/part/1"
_plain = str.__str__


def part_results(found: PartMeasurement) -> dict[str, Any]:
    simulated, facts, further, job = found.simulated, found.job.facts, found.further, found.job.facts.job
    names, shares = [one.name for one in found.characteristics], found.budget
    stated = [_characteristic(found, i) for i in range(len(names))]
    said = {one.of: one for one in found.given.machine.statements}
    read_by = readings_data(found.given.machine.machine, found.given.machine.statements)
    factors = np.array([in_unit(one, 1.0) for one in found.characteristics])
    part = {"name": facts.part.name, "drawing": facts.part.drawing or None, "serial": facts.part.serial or None,
            "not_measured": list(facts.part.not_measured)}  # fmt: skip
    decision = {
        "rule": rule_name(facts.decision.rule), "words": _plain(found.judged_by),
        "prior": None if facts.decision.prior is None else facts.decision.prior.model_dump(),
        "outcome": found.outcome, "probability_all_conform": found.together,
        **({"withheld": list(map(_plain, found.withheld))} if found.withheld else {}),
    }  # fmt: skip
    return {
        "schema": SCHEMA,
        "software": {"name": NAME, "version": __version__},
        "job": {
            "id": job.id, **({"number": job.number} if job.number else {}), "origin": job.origin, "date": job.date.isoformat(),
            **({"language": job.language} if job.language != ENGLISH else {}), "inputs_sha256": sha256(found.job.inputs),
        },
        "part": part,
        "machine": standing_data(found.standing) | {
            "families": families_data(found.given.machine.scales),
            "bounds": [
                one.model_dump() | {"recording": [{"error": name, **evidence_data(said.get(name))} for name in one.errors]}
                for one in facts.machine_state.bound
            ],
            **({"axes": read_by} if read_by else {}),
        },
        "simulation": {
            "virtual_measurements": simulated.trials, "asked": found.asked, "seed": found.seed, "coverage": simulated.coverage,
            "digits": found.digits, "settled": simulated.stable, "first_order": not found.virtual.exact,
            "places": len(found.virtual.places), "points": len(found.plan.points),
            "coefficients": sum(len(cause.factors) for cause in found.virtual.places[0].causes),
            "not_drawn": [{"effect": name, "lacks": column} for name, column in found.virtual.places[0].lacking.items()],
        },
        "characteristics": stated,
        "correlation": {"characteristics": names, "matrix": found.correlation.tolist()},
        "covariance": {"characteristics": names, "units": [unit_of(one) for one in found.characteristics],
                       "matrix": (simulated.covariance * factors * factors[:, None]).tolist()},
        "decision": decision,
        "verdicts": Verdicts.of_results({"characteristics": stated, "part": part, "decision": decision}).data(),
        "budget": {
            "characteristics": list(shares.characteristics),
            "causes": rows(cause=shares.causes, first=shares.first.tolist(), total=shares.total.tolist()),
            "factors": rows(factor=shares.factors, share=shares.within.tolist()),
        },
        "unseen": [
            {"characteristic": one.characteristic, "effect": one.effect or None,
             **attributes(one, "line", "title", "share", "why"), "u_smaller_by": smaller_by(one.share),
             "shown_or_bounded_by": _plain(shrinking(one.effect, found.given.machine.machine)) or None}
            for one in found.unseen
        ],
        "priors": priors_data(found.influence),
        "further": further and attributes(further, "effects", "setups", "text") | {
            "command": further.command or None, "file": further.file or None, "missed": list(further.missed),
        },
        "ways": [
            {"way": _plain(way.name), "u": list(map(in_unit, found.characteristics, way.u.tolist()))} for way in found.ways
        ],
        **({"foreseen": foreseen_data(found, found.foreseen)} if found.foreseen else {}),
        "other_methods": methods_data(found.methods), **_reported(found.job.reported),
        "warnings": [_plain(text) for text in found.warnings],
        **({"iso17025": asks} if (asks := [one.data for one in of_a_part(facts, found.measured)]) else {}),
    }  # fmt: skip


def _reported(said: Reported | None) -> dict[str, Any]:
    """Of values that another program stated, where they stand; nothing of those of points."""
    if said is None:
        return {}
    places = [{"name": name, "where": one.where[one.where.find(said.file) :]} for name, one in said.values.items()]
    whose = {"file": said.file, "program": _plain(said.program)}
    return {"reported": whose | {"values": places, "by_features": list(said.derived)}}


def unit_of(one: CharacteristicFacts) -> str:
    """Of a characteristic in ``results.json``."""
    return "°" if one.asks.limits == "angles" else "mm"


def standing_data(one: CertificateStatus) -> dict[str, Any]:
    return {
        **attributes(one, "source", "files"), "number": one.number or None, "laboratory": one.laboratory or None,
        "machine": one.machine, "serial": one.serial or None, "origin": one.origin, "date": one.date.isoformat(),
        "age_days": one.age.days, "valid_until": None if one.valid_until is None else one.valid_until.isoformat(),
        "verdict": one.verdict,
        "checked": [{"what": each.what, "count": each.count} for each in one.checked if not each.why],
        "not_checked": [{"what": each.what, "why": each.why} for each in one.checked if each.why],
        "computed_again": one.again, "signatures_held_to_trusted": one.trusted, "draft": one.draft,
        "given_recording": one.given_recording, "drawn": _plain(one.path), "drift": _plain(one.drift),
        "changes": None if one.changes is None else rows(parameter=one.changes, change=one.changes.values()),
        "temperature_c": one.temperature_c, "inputs_sha256": dict(one.inputs_sha256),
        **further_data(one.further), **passed_data(one.passed),
        **({"against": list(map(_plain, one.against))} if one.against else {}),
    }  # fmt: skip


def _characteristic(found: PartMeasurement, i: int) -> dict[str, Any]:
    facts, stated, judged = found.characteristics[i], found.stated[i], found.judged[i]
    sided, known_as = bool(never_negative(found.plan)[i]), "stated" if found.job.reported else "median"

    def inside(value: float | None) -> float | None:
        return None if value is None else in_unit(facts, value)

    return {
        "name": facts.name, "what": facts.what, "features": list(facts.features), "datums": list(facts.datums),
        "association": found.plan.characteristics[i].association, "unit": unit_of(facts),
        "measured": None if found.measured is None else in_unit(facts, float(found.measured[i])),
        "mean_error": in_unit(facts, stated.error), "value": inside(stated.value), "value_is": known_as if sided else "mean",
        "stated_by": "interval" if stated.value is not None and sided else "U",
        "u": in_unit(facts, stated.u), "U": in_unit(facts, stated.U), "k": stated.k if isfinite(stated.k) else None,
        "interval95": list(map(inside, stated.interval)), "worst_cause": found.budget.worst(facts.name),
        "limits": judged and {
            "lower": inside(judged.lower), "upper": inside(judged.upper),
            "accepted": judged.accepted and list(map(inside, judged.accepted)),
        },
        "decision": None if judged is None or judged.outcome is None else {
            "outcome": judged.outcome, "probability_conforming": judged.probability, "probability_beyond": judged.beyond,
            "margin_u": float(found.margins[i]) if isfinite(found.margins[i]) else None,
        },
    }  # fmt: skip


def foreseen_data(found: PartMeasurement, foreseen: Iterable[ForeseenMeasurement]) -> list[dict[str, Any]]:
    told, names = np.flatnonzero(foretold(found.plan)).tolist(), ("U_low", "U", "U_high")

    def figures(i: int, way: ForeseenMeasurement) -> dict[str, Any]:
        one = found.characteristics[i]
        each = (in_unit(one, U) for U in way.U[:, i].tolist())
        return {"name": one.name, "unit": unit_of(one), **dict(zip(names, each, strict=True))}

    return [{"measurement": _plain(way.name), "characteristics": [figures(i, way) for i in told]} for way in foreseen]


def in_unit(one: CharacteristicFacts, value: float) -> float:
    return degrees(value) if one.asks.limits == "angles" else value


def methods_data(comparison: other_methods.MethodComparison | None) -> dict[str, Any] | None:
    """All of it; ``None`` where the job has no other method."""
    if comparison is None:
        return None
    methods = [
        {"method": one.method, "characteristics": [_figure(each) for each in one.figures],
         "conditions": [{"asked": _plain(each.text), "met": each.met} for each in one.conditions],
         "seen": dict(one.seen)}
        for one in comparison.methods
    ]  # fmt: skip
    compared = [
        {"name": one.name,
         "normalised_errors": [{"one": pair.one, "other": pair.other, "E_n": pair.normalised} for pair in one.pairs],
         "why": list(map(_plain, one.why))}
        for one in comparison.characteristics
    ]  # fmt: skip
    return {"methods": methods, "compared": compared}


def _figure(one: other_methods.MethodFigure) -> dict[str, Any]:
    def given(value: float | None) -> float | None:
        return degrees(value) if one.angle and value is not None else value

    budget = one.budget
    return {
        "name": one.name, "unit": "°" if one.angle else "mm", "value": given(one.value), "u": given(one.u), "U": given(one.U),
        "k": budget.k, "dof": budget.dof if isfinite(budget.dof) else None, "systematic_error": given(one.systematic),
        "corrected": one.corrected, "u_one_measurement": given(one.single), "scatter": given(one.scatter),
        "budget": [
            {"line": _plain(line.name), "depth": depth, "share": share, "dof": line.dof if isfinite(line.dof) else None}
            for depth, line, share in budget.flat()
        ],
    }  # fmt: skip
