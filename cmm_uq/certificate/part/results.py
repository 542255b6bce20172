"""``results.json`` of a part, schema ``cmm-uq/part/1``, for other programs. Lengths in mm, angles in °, shares from 0 to 1.

What each key of a ``results.json`` of the schema ``cmm-uq/part/1`` is: its unit, and a sentence.

A part in capitals stands for any name, ``[]`` for each entry of a list.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import degrees, isfinite
from types import MappingProxyType
from typing import Any

from cmm_uq import __version__
from cmm_uq.analysis.conformity.decision import rule_name
from cmm_uq.analysis.conformity.limits import LimitDecision
from cmm_uq.analysis.parts.characteristics import never_negative
from cmm_uq.base.languages.translation import ENGLISH
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats
from cmm_uq.certificate.origin import NAME
from cmm_uq.certificate.part.measurement import CertificateStatus, FurtherSetUps, PartMeasurement, UnseenError
from cmm_uq.certificate.part.method import methods_data
from cmm_uq.certificate.results.keys import RESULTS
from cmm_uq.certificate.sections.priors import families_data, priors_data
from cmm_uq.jobs.part.feature import CharacteristicFacts
from cmm_uq.jobs.part.job import PartJob
from cmm_uq.jobs.source import sha256
from cmm_uq.jobs.verdicts import Verdicts

SCHEMA = "cmm-uq/part/1"


def part_results(found: PartMeasurement) -> dict[str, Any]:
    """Contents of ``results.json``."""
    simulated, facts = found.simulated, found.job.facts
    names = [one.name for one in found.characteristics]
    stated = [_characteristic(found, i) for i in range(len(names))]
    return {
        "schema": SCHEMA,
        "software": {"name": NAME, "version": __version__},
        "job": _job(found.job),
        "part": {"name": facts.part.name, "drawing": facts.part.drawing or None, "serial": facts.part.serial or None,
                 "not_measured": list(facts.part.not_measured)},
        "machine": standing_data(found.standing) | {
            "families": families_data(found.given.machine.scales),
            "bounds": [one.model_dump() for one in facts.machine_state.bound],
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
                       "matrix": _covariance(found).tolist()},
        "decision": {
            "rule": rule_name(facts.decision.rule), "words": _plain(found.judged_by),
            "prior": None if facts.decision.prior is None else facts.decision.prior.model_dump(),
            "outcome": found.outcome, "probability_all_conform": found.together,
        },
        "verdicts": Verdicts.of_results({"characteristics": stated}).data(),
        "budget": _budget(found),
        "unseen": [_unseen(one) for one in found.unseen],
        "priors": priors_data(found.influence),
        "further": None if found.further is None else _further(found.further),
        "ways": [
            {"way": _plain(way.name), "u": list(map(_in, found.characteristics, way.u.tolist()))} for way in found.ways
        ],
        "other_methods": methods_data(found.methods),
        "warnings": [_plain(text) for text in found.warnings],
    }  # fmt: skip


def unit_of(one: CharacteristicFacts) -> str:
    """Of a characteristic in ``results.json``."""
    return "°" if one.asks.limits == "angles" else "mm"


def standing_data(one: CertificateStatus) -> dict[str, Any]:
    """The machine's certificate."""
    return {
        "source": one.source, "files": list(one.files), "number": one.number or None, "laboratory": one.laboratory or None,
        "machine": one.machine, "serial": one.serial or None, "origin": one.origin, "date": one.date.isoformat(),
        "age_days": one.age.days, "valid_until": None if one.valid_until is None else one.valid_until.isoformat(),
        "verdict": one.verdict,
        "checked": [{"what": each.what, "count": each.count} for each in one.checked if not each.why],
        "not_checked": [{"what": each.what, "why": each.why} for each in one.checked if each.why],
        "computed_again": one.again, "signatures_held_to_trusted": one.trusted, "draft": one.draft,
        "given_recording": one.given_recording, "drawn": _plain(one.path), "drift": _plain(one.drift),
        "changes": None if one.changes is None else [
            {"parameter": name, "change": change} for name, change in one.changes.items()
        ],
        "temperature_c": one.temperature_c, "inputs_sha256": dict(one.inputs_sha256),
    }  # fmt: skip


def _job(job: PartJob) -> dict[str, Any]:
    said = job.facts.job
    return {
        "id": said.id, **({"number": said.number} if said.number else {}), "origin": said.origin,
        "date": said.date.isoformat(),
        **({"language": said.language} if said.language != ENGLISH else {}), "inputs_sha256": sha256(job.inputs),
    }  # fmt: skip


def _characteristic(found: PartMeasurement, i: int) -> dict[str, Any]:
    facts, stated, judged = found.characteristics[i], found.stated[i], found.judged[i]
    low, high = (_in(facts, end) for end in stated.interval)
    return {
        "name": facts.name, "what": facts.what, "features": list(facts.features), "datums": list(facts.datums),
        "association": found.plan.characteristics[i].association, "unit": unit_of(facts),
        "measured": None if found.measured is None else _in(facts, float(found.measured[i])),
        "mean_error": _in(facts, stated.error), "value": None if stated.value is None else _in(facts, stated.value),
        "value_is": "median" if never_negative(found.plan)[i] else "mean",
        "stated_by": "interval" if stated.value is not None and never_negative(found.plan)[i] else "U",
        "u": _in(facts, stated.u), "U": _in(facts, stated.U), "k": stated.k if isfinite(stated.k) else None,
        "interval95": [low, high], "worst_cause": found.budget.worst(facts.name),
        "limits": None if judged is None else _limits(facts, judged),
        "decision": None if judged is None or judged.outcome is None else {
            "outcome": judged.outcome, "probability_conforming": judged.probability, "probability_beyond": judged.beyond,
            "margin_u": float(found.margins[i]) if isfinite(found.margins[i]) else None,
        },
    }  # fmt: skip


def _limits(facts: CharacteristicFacts, judged: LimitDecision) -> dict[str, Any]:
    ends = None if judged.accepted is None else [None if end is None else _in(facts, end) for end in judged.accepted]
    return {
        "lower": None if judged.lower is None else _in(facts, judged.lower),
        "upper": None if judged.upper is None else _in(facts, judged.upper), "accepted": ends,
    }  # fmt: skip


def _budget(found: PartMeasurement) -> dict[str, Any]:
    shares = found.budget
    return {
        "characteristics": list(shares.characteristics),
        "causes": [
            {"cause": name, "first": first, "total": total}
            for name, first, total in zip(shares.causes, shares.first.tolist(), shares.total.tolist(), strict=True)
        ],
        "factors": [
            {"factor": name, "share": share} for name, share in zip(shares.factors, shares.within.tolist(), strict=True)
        ],
    }


def _unseen(one: UnseenError) -> dict[str, Any]:
    return {
        "characteristic": one.characteristic, "effect": one.effect or None, "line": one.line, "title": _plain(one.title),
        "share": one.share, "why": _plain(one.why),
    }  # fmt: skip


def _further(one: FurtherSetUps) -> dict[str, Any]:
    return {
        "effects": list(one.effects), "setups": one.setups, "text": _plain(one.text), "command": one.command or None,
        "file": one.file or None, "missed": list(one.missed),
    }  # fmt: skip


def _covariance(found: PartMeasurement) -> Floats:
    factor = [degrees(1.0) if one.asks.limits == "angles" else 1.0 for one in found.characteristics]
    matrix: Floats = found.simulated.covariance * factor
    return matrix * [[each] for each in factor]


def _in(one: CharacteristicFacts, value: float) -> float:
    """A value of a characteristic in its unit."""
    return degrees(value) if one.asks.limits == "angles" else value


def _plain(text: Text) -> str:
    return str.__str__(text)


OWN = "its `unit`"  # unit of values of a characteristic: the one that stands beside them, mm or °

PART_RESULTS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "schema": ("", "Name of the layout; what is there keeps its meaning while it keeps its name."),
        "software.name": ("", "The program."),
        "software.version": ("", "Its version."),
        "job.id": ("", "Id of the job."),
        "job.number": ("", "Number of the certificate, where it is stated."),
        "job.origin": ("", "Where the measured points come from: measured or simulated."),
        "job.date": ("", "Date of the measurement."),
        "job.language": ("", "Language of the documents, where it is not English."),
        "job.inputs_sha256.FILE": ("", "SHA-256 of each input, the machine's certificate among them."),
        "part.name": ("", "Name of the part."),
        "part.drawing": ("", "Its drawing."),
        "part.serial": ("", "Its serial number."),
        "part.not_measured": ("", "What the drawing asks for besides and the job leaves out."),
        "machine.source": ("", "`certificate` with its recording inside; `results` and draws alone; `job`, analysed anew."),
        "machine.files": ("", "What states the machine."),
        "machine.number": ("", "Number of its certificate."),
        "machine.laboratory": ("", "Who issued it."),
        "machine.machine": ("", "Name of the machine."),
        "machine.serial": ("", "Its serial number."),
        "machine.origin": ("", "Where the recording of its calibration comes from: measured, simulated or compensated."),
        "machine.date": ("", "Date of the calibration."),
        "machine.age_days": ("d", "Its age on the day of the part's measurement."),
        "machine.valid_until": ("", "Last day on which it holds."),
        "machine.verdict": ("", "Of its verification."),
        "machine.checked[].what": ("", "What was verified."),
        "machine.checked[].count": ("", "In how many places."),
        "machine.not_checked[].what": ("", "What was not verified."),
        "machine.not_checked[].why": ("", "Why, in words."),
        "machine.computed_again": ("", "Whether its figures were computed again, with `--rerun`."),
        "machine.signatures_held_to_trusted": ("", "Whether its signatures were held to trusted ones, with `--trust`."),
        "machine.draft": ("", "Whether it is a draft, which nobody has completed."),
        "machine.given_recording": ("", "Whether errors were drawn given the recording of the calibration."),
        "machine.drawn": ("", "How they were drawn, in words."),
        "machine.drift": ("", "What is reckoned with of changes since, in words."),
        "machine.changes[].parameter": ("", "A reported parameter of an error, where records of the machine were given."),
        "machine.changes[].change": ("its own", "Root mean square of its change since, as the records let expect."),
        "machine.temperature_c": ("°C", "Mean temperature of the scales that the calibration recorded."),
        "machine.inputs_sha256.FILE": ("", "SHA-256 of each input of the calibration."),
        "machine.bounds[].errors": ("", "Errors whose bound the job states."),
        "machine.bounds[].largest_um": ("µm", "What 95 of 100 do not exceed."),
        "machine.bounds[].source": ("", "Who states it."),
        "machine.families[].family": ("", "A family of errors of one size, where the recording says how large it is."),
        "machine.families[].unit": ("", "Of the sizes beside it."),
        "machine.families[].allowed": (OWN, "Root mean square that physics allows: the width of its half-normal prior."),
        "machine.families[].size": (OWN, "As the recording shows it, the median."),
        "machine.families[].low": (OWN, "Lower end of its 95 % interval."),
        "machine.families[].high": (OWN, "Upper end."),
        "simulation.virtual_measurements": ("", "How many were drawn."),
        "simulation.asked": ("", "How many were asked for; `--digits` may take more."),
        "simulation.seed": ("", "Seed of the random numbers."),
        "simulation.coverage": ("", "Probability of the intervals."),
        "simulation.digits": ("", "Digits of u that were asked for."),
        "simulation.settled": ("", "Whether so many measurements sufficed for them."),
        "simulation.first_order": ("", "Whether errors of points were taken to first order, which then sufficed."),
        "simulation.places": ("", "Places of the part that were drawn."),
        "simulation.points": ("", "Points of the plan."),
        "simulation.coefficients": ("", "Numbers that each virtual measurement draws."),
        "simulation.not_drawn[].effect": ("", "An error that could not be drawn."),
        "simulation.not_drawn[].lacks": ("", "Column that it needs."),
        "characteristics[].name": ("", "Name of the characteristic, as the job has it."),
        "characteristics[].what": ("", "What is asked for."),
        "characteristics[].features": ("", "Features that it is of."),
        "characteristics[].datums": ("", "Its datums."),
        "characteristics[].association": ("", "How its features are made of their points."),
        "characteristics[].unit": ("", "Of all values beside it: mm or °."),
        "characteristics[].measured": (OWN, "Value of the measured points."),
        "characteristics[].mean_error": (OWN, "What such measurements err by on average."),
        "characteristics[].value": (OWN, "What is stated, by `value_is`."),
        "characteristics[].stated_by": (
            "",
            "How a page states it: `U` for value and U with k; `interval` for a measured width, which has one side, by its "
            "`interval95`.",
        ),
        "characteristics[].value_is": (
            "", "mean: measured less mean_error; median: of the values that such a measurement may come from, zero at least."),
        "characteristics[].u": (OWN, "Standard uncertainty."),
        "characteristics[].U": (
            OWN,
            "Half of the shortest 95 % interval of the errors; of a measured width no less than half of interval95, and "
            "to its end where it begins at zero.",
        ),
        "characteristics[].k": ("", "U over u."),
        "characteristics[].interval95": (OWN, "Ends of the 95 % interval; of the error where nothing was measured."),
        "characteristics[].worst_cause": ("", "Line of the budget with the largest share."),
        "characteristics[].limits.lower": (OWN, "Lower limit of the drawing."),
        "characteristics[].limits.upper": (OWN, "Upper limit."),
        "characteristics[].limits.accepted": (OWN, "Smallest and largest value that the rule accepts."),
        "characteristics[].decision.outcome": ("", "What follows from value, limits and rule."),
        "characteristics[].decision.probability_conforming": ("", "Probability that the true value lies within its limits."),
        "characteristics[].decision.probability_beyond": ("", "Probability that it lies beyond."),
        "characteristics[].decision.margin_u": ("u", "From the value to the nearest limit."),
        "correlation.characteristics": ("", "Names of rows and columns of the matrix."),
        "correlation.matrix": ("", "Correlation of the errors of the characteristics."),
        "covariance.characteristics": ("", "Names of rows and columns of the matrix."),
        "covariance.units": ("", "Their units."),
        "covariance.matrix": ("", "Covariances, in the product of the units of row and column."),
        "decision.rule": ("", "Decision rule."),
        "decision.words": ("", "The same in words, with its edition."),
        "decision.prior": ("", "What was known beforehand, as the job says."),
        "decision.outcome": ("", "Of the part: the worst of all."),
        "decision.probability_all_conform": ("", "Probability that all limits are kept at once."),
        **{key: ("", sentence) for key, sentence in RESULTS.items() if key.startswith("verdicts.")},
        "budget.characteristics": ("", "Names of the columns of the shares."),
        "budget.causes[].cause": ("", "Line of the budget."),
        "budget.causes[].first": ("", "First-order share of each variance (Sobol), by characteristic."),
        "budget.causes[].total": ("", "Total share, likewise."),
        "budget.factors[].factor": ("", "An error of the machine."),
        "budget.factors[].share": (
            "",
            "By characteristic, what knowing it alone would take away of the variance; they hang together.",
        ),
        "unseen[].characteristic": ("", "Of errors that the calibration left free or did not see and that make 5 % or more "
                                        "of a variance: whose."),
        "unseen[].effect": ("", "The effect, by name."),
        "unseen[].line": ("", "Its line of the budget."),
        "unseen[].title": ("", "The same in words."),
        "unseen[].share": ("", "Its share of the variance."),
        "unseen[].why": ("", "Why it was not seen, in words."),
        "priors[].family": ("", "A family of errors, an error that no recording shows, or `all` of them."),
        "priors[].times": ("", "By which its prior is narrower or wider."),
        "priors[].u_ratio": ("", "u that would follow over u as stated, by characteristic."),
        "priors[].shift_u": ("u", "Change of the value, likewise."),
        "priors[].u_percent": ("%", "The largest change of u."),
        "priors[].value_percent": ("%", "The largest change of a value, of its u."),
        "further.effects": ("", "Effects that further set-ups of the calibration's artefact show."),
        "further.setups": ("", "How many set-ups."),
        "further.text": ("", "The same in words."),
        "further.command": ("", "Command that plans them."),
        "further.file": ("", "Job that was written for it."),
        "further.missed": ("", "Effects that no set-up of the artefact shows."),
        "ways[].way": ("", "What would change u; the measurement as it is planned first."),
        "ways[].u": (OWN, "u that it would have, by characteristic."),
        "other_methods": ("", "What other methods say; null where the job has none. How they are done: "
                              "[other methods](../machine/other-methods.md)."),
        "other_methods.methods[].method": ("", "`calibrated_part` or `orientations`."),
        "other_methods.methods[].characteristics[].name": ("", "Name of a characteristic that it was tested on."),
        "other_methods.methods[].characteristics[].unit": ("", "Of all values beside it: mm or °."),
        "other_methods.methods[].characteristics[].value": (
            OWN, "Value of the part, corrected; null where it was not measured."),
        "other_methods.methods[].characteristics[].u": (OWN, "Standard uncertainty."),
        "other_methods.methods[].characteristics[].U": (
            OWN, "Expanded uncertainty, 95 %; with the systematic error where that is not corrected."),
        "other_methods.methods[].characteristics[].k": ("", "Coverage factor."),
        "other_methods.methods[].characteristics[].dof": ("", "Effective degrees of freedom; null where they are infinite."),
        "other_methods.methods[].characteristics[].systematic_error": (OWN, "What the method found that measurements err by."),
        "other_methods.methods[].characteristics[].corrected": ("", "Whether it is taken off."),
        "other_methods.methods[].characteristics[].u_one_measurement": (
            OWN, "Standard uncertainty of one measurement, where `u` is of the mean of all; else null."),
        "other_methods.methods[].characteristics[].scatter": (
            OWN, "Standard deviation of one measurement among the repeats."),
        "other_methods.methods[].characteristics[].budget[].line": ("", "Line of the budget, in words."),
        "other_methods.methods[].characteristics[].budget[].depth": ("", "0 of a line; 1 of a part of the line above it."),
        "other_methods.methods[].characteristics[].budget[].share": ("", "Its share of u²."),
        "other_methods.methods[].characteristics[].budget[].dof": (
            "", "Its degrees of freedom; null where they are infinite."),
        "other_methods.methods[].conditions[].asked": ("", "What the method asks of its test, in words."),
        "other_methods.methods[].conditions[].met": ("", "Whether it is met; null where the job does not say."),
        "other_methods.methods[].seen.CAUSE": (
            "", "How the method takes hold of a sort of causes: varied (as scatter), systematic, corrected, stated, unseen."),
        "other_methods.compared[].name": ("", "Name of a characteristic that several methods state."),
        "other_methods.compared[].normalised_errors[].one": ("", "A method: `virtual`, or one of the others."),
        "other_methods.compared[].normalised_errors[].other": ("", "Another, of which the same characteristic has a value."),
        "other_methods.compared[].normalised_errors[].E_n": (
            "", "(x₁ − x₂)/√(U₁² + U₂²): beyond 1 in size they contradict each other (ISO/IEC 17043:2023)."),
        "other_methods.compared[].why": ("", "Why they differ, in words."),
        "warnings": ("", "What must be known before a figure is used."),
    }
)  # fmt: skip
"""By key, its unit, empty where it has none, and what it is."""
