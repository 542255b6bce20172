"""What each key of a ``results.json`` of the schema ``cmm-uq/part/1`` is: its unit, and a sentence.

A part in capitals stands for any name, ``[]`` for each entry of a list.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from cmm_uq.certificate.results.keys import RESULTS

OWN = "its `unit`"
"""Unit of values of a characteristic: the one that stands beside them, mm or °."""

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
