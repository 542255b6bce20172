"""What each key of a ``results.json`` of the schema ``cmm-uq/results/1`` is, in a sentence.

A part in capitals stands for any name, ``[]`` for each entry of a list; what a kind adds of its own stands with the kind.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

QUANTITY: Mapping[str, str] = MappingProxyType(
    {
        "value": "Estimate, in the unit that the key above it ends with.",
        "u": "Standard uncertainty (k = 1), in the same unit.",
        "interval95": "Lower and upper end of the 95 % interval.",
        "U": "Expanded uncertainty, 95 %, as a certificate states it.",
        "k": "U over u.",
    }
)
"""Below every key that is said to be a quantity."""

RESULTS: Mapping[str, str] = MappingProxyType(
    {
        "schema": "Name of the layout; what is there keeps its meaning while it keeps its name.",
        "software.name": "The program.",
        "software.version": "Its version.",
        "software.plugins.PACKAGE": "Version of each other package that took part.",
        "job.id": "Id of the job.",
        "job.origin": "Where the recording comes from: measured, simulated or compensated.",
        "job.date": "Date of the measurement.",
        "job.machine": "Name of the machine.",
        "job.serial": "Its serial number, where stated.",
        "job.derived_from.KEY": "Of a derived recording, what it was made from, as job.toml has it.",
        "job.altered": "Files that were changed after a command derived them.",
        "job.inputs_sha256.FILE": "SHA-256 of each input.",
        "import[].KEY": "Of each file in another format than the project's own, how it was read: format, encoding, unit, …",
        "import[].columns.COLUMN": "Heading of the file that a column of the recording was taken from.",
        "acquisition.KEY": "How a recording was taken live: program, sessions, points typed, taken back or read from files.",
        "acquisition.instruments[].KEY": "Name, maker, model, serial, firmware, certificate, columns, latency_ms.",
        "acquisition.columns.COLUMN.u": "Standard uncertainty (rms) of a column by interpolation in time.",
        "acquisition.columns.COLUMN.u_largest": "The largest of them.",
        "acquisition.columns.COLUMN.missing": "Measurement, point and repeat of points that it has no value of.",
        "acquisition.gaps[].KEY": "When an instrument was silent: since when and how long in s since the start, and why.",
        "acquisition.undone[].KEY": "A point that was taken back, with the reason.",
        "acquisition.files.SHA256": "Name of a file that points were read from, by its SHA-256.",
        "estimates.EFFECT.PARAMETER": "Quantity: a parameter of an effect that the model names, by its posterior.",
        "artefact.SIZE": "Quantity: a size of the artefact as the measurement leaves it.",
        "certified.SIZE.value": "A certified size.",
        "certified.SIZE.u": "Its standard uncertainty.",
        "covariance.parameters": "Names of rows and columns of the matrix.",
        "covariance.units": "Their units.",
        "covariance.matrix": "Covariances, in the product of the units of row and column.",
        "differences[].of": "Of two parameters that are not determined by themselves, the one.",
        "differences[].minus": "The other.",
        "differences[].PARAMETER": "Quantity: their difference, which is determined.",
        "tolerances.EFFECT.PARAMETER": "Largest permissible size of a parameter.",
        "tolerances.EFFECT.verdict": "Whether it is kept.",
        "noise.stated_coordinate_um": "Standard uncertainty of a coordinate that the job states; null where it states none.",
        "noise.coordinate_um": "Quantity: standard deviation of a reading.",
        "noise.COMPONENT": "Quantity: standard deviation of a further component of the noise.",
        "noise.COMPONENT.probability": "Probability that the component is there.",
        "noise.display_step_um": "Step of the display, where the readings show one.",
        "noise.axes_differ_probability": "Probability that the axes' readings scatter differently.",
        "noise.p_value": "Of the test of the stated noise; null where none is stated.",
        "noise.contradicts_stated": "Whether the residuals contradict the stated noise.",
        "sampling.sampler": "What drew from the posterior distribution.",
        "sampling.seed": "Seed of the random numbers.",
        "sampling.draws": "Number of draws.",
        "sampling.ess_min": "Smallest effective number of draws.",
        "sampling.rhat_max": "Largest rank-normalised R-hat.",
        "sampling.steps": "Steps of each chain.",
        "sampling.autocorrelation_time": "Longest autocorrelation time, steps.",
        "sampling.converged": "Whether the figures may be used.",
        "least_squares.estimates.OWNER.PARAMETER.value": "Estimate by least squares alone; null where it is not determined.",
        "least_squares.estimates.OWNER.PARAMETER.u": "Its standard uncertainty.",
        "least_squares.observations": "Number of observations.",
        "least_squares.degrees_of_freedom": "Degrees of freedom.",
        "least_squares.residual_rms_um": "Standard deviation of the residuals.",
        "identifiability.parameters": "Number of unknowns.",
        "identifiability.rank": "How many combinations of them are determined.",
        "identifiability.condition_number": "Condition number of the design; null where it is not finite.",
        "identifiability.undetermined[].PARAMETER": "Part of a parameter in a combination that stays free.",
        "identifiability.prior_share.PARAMETER": "Share of a parameter's variance that is left of its prior.",
        "accuracy.FIGURE": "A figure of performance of the lengths.",
        "accuracy_uncertainty.FIGURE": "Quantity: the same with its uncertainty.",
        "conformity[].standard": "Standard with its edition.",
        "conformity[].characteristic": "What of it is decided.",
        "conformity[].quantity": "What was compared, in words.",
        "conformity[].value_um": "The least favourable value.",
        "conformity[].limit_um": "Its limit.",
        "conformity[].u_um": "Its standard uncertainty.",
        "conformity[].rule": "Decision rule.",
        "conformity[].guard_band_um": "Guard band.",
        "conformity[].decision": "The gravest of all decisions.",
        "conformity[].probability_conforming": "Probability that the value lies within its limit.",
        "conformity[].scope": "Whether the test is complete or partial.",
        "conformity[].missing": "What of the standard's plan is missing.",
        "conformity[].remarks": "What must be known besides.",
        "conformity[].probability_all_conform": "Probability that all values conform, with what they share.",
        "conformity[].mpe": "Maximum permissible error; null where the limit is one number.",
        "conformity[].mpe.KEY": "A, K or B of it, as job.toml has them.",
        "conformity[].prior": "What was known beforehand; null where nothing is stated.",
        "conformity[].prior.KEY": "The same, as job.toml has it.",
        "conformity[].global_risks": "Global risks; null without a prior.",
        "conformity[].global_risks.KEY": "Risk of consumer or producer.",
        "conformity[].test_uncertainty": "Budget of the value named; null where the rule takes none.",
        "conformity[].test_uncertainty.KEY": "Its combined figures.",
        "conformity[].test_uncertainty.lines[].KEY": "Its lines.",
        "conformity[].errors[].measurement": "Measurement of one value.",
        "conformity[].errors[].repeat": "Its repeat.",
        "conformity[].errors[].length_mm": "Length that it is of.",
        "conformity[].errors[].error_um": "The value.",
        "conformity[].errors[].u_um": "Its standard uncertainty.",
        "conformity[].errors[].U_um": "Twice that.",
        "conformity[].errors[].limit_um": "Its limit.",
        "conformity[].errors[].probability_conforming": "Probability that it lies within its limit.",
        "conformity[].errors[].outcome": "Decision on it.",
        "conformity[].errors[].guard_band_um": "Its guard band.",
        "conformity[].errors[].position": "Where it was measured, in words.",
        "conformity[].errors[].standing": "What it counts for in the test.",
        "diagnosis.verdict": "Whether recording and model agree: consistent, explained, partial or unexplained.",
        "diagnosis.p_value": "Of the lack-of-fit test.",
        "diagnosis.where[].KEY": "Where they do not agree.",
        "diagnosis.effects[].effect": "An effect that was left out.",
        "diagnosis.effects[].probability": "Its posterior probability.",
        "diagnosis.effects[].parameters.PARAMETER": "Quantity: a parameter of it.",
        "diagnosis.effects[].KEY": "What more is said of it.",
        "diagnosis.indistinguishable": "Groups of effects that these data cannot tell apart.",
        "diagnosis.suggested_measurements[].KEY": "What to measure to part them.",
        "diagnosis.noise.coordinate_um": "Quantity: standard deviation of a reading.",
        "diagnosis.noise.placing_um": "Quantity: standard deviation of a set-up offset.",
        "diagnosis.noise.KEY": "What else the noise shows.",
        "diagnosis.screening[].KEY": "As `screening` below.",
        "diagnosis.improvement": "What modelling the effects gains; null where nothing was left out.",
        "diagnosis.improvement.KEY": "Residuals before and after, also for placings that the fit has not seen.",
        "diagnosis.rivals[].explanation": "An explanation that was compared.",
        "diagnosis.rivals[].probability": "Its probability.",
        "diagnosis.compared_on": "Number of observations compared, where not all were.",
        "diagnosis.corrected": "What a correction would change; null where there is none.",
        "diagnosis.corrected.KEY": "Figures and statements before and after it.",
        "screening[].kind": "What is odd in the recording.",
        "screening[].rows": "Measurements that it concerns.",
        "screening[].lines": "Lines of the file.",
        "screening[].file": "The file.",
        "screening[].why": "In words, and how to mend it.",
        "screening[].set_aside": "Whether the estimates leave it out.",
        "cmc.length_mm": "Length at which the laboratory's capability was taken.",
        "cmc.raised": "Quantities whose U was raised to the laboratory's capability.",
        "as_found.KEY": "What the results of the machine as it was found say, under the same keys.",
        "posterior.KEY": "The file of draws: its name, SHA-256 and what it holds.",
    }
)
"""By dotted name."""


def described(path: str) -> bool:
    """Whether a key of results.json has a sentence here, itself or as part of a quantity or of what stands above it."""
    return any(_covers(pattern.split("."), path.split(".")) for pattern in RESULTS)


def _covers(pattern: list[str], path: list[str]) -> bool:
    head = path[: len(pattern)]
    alike = len(head) == len(pattern) and all(_same(one, other) for one, other in zip(pattern, head, strict=True))
    rest = path[len(pattern) :]
    quantity = RESULTS[".".join(pattern)].startswith("Quantity:")
    return alike and (not rest or pattern[-1] == "KEY" or (quantity and rest[0] in QUANTITY))


def _same(pattern: str, part: str) -> bool:
    return pattern.removesuffix("[]").isupper() or pattern == part
