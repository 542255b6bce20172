"""What the reader of a certificate must know before using a figure."""

from __future__ import annotations

from cmm_uq.documents.diagnosis_words import VERDICTS
from cmm_uq.documents.result import Result
from cmm_uq.documents.wording import listed, title_of
from cmm_uq.jobs.origin import MEASURED
from cmm_uq.uncertainty.rounding import significant

ASSUMED = 0.25
"""Share of the prior in a parameter's variance from which on the reader is told."""


def warnings(result: Result) -> tuple[str, ...]:
    """All warnings, the gravest first."""
    return tuple(
        text
        for texts in (
            _convergence(result),
            _mismatch(result),
            _noise(result),
            _undetermined(result),
            _screening(result),
            _missing(result),
        )
        for text in texts
    )


def _convergence(result: Result) -> list[str]:
    posterior = result.posterior
    if posterior.converged:
        return []
    return [
        f"The sampling did not converge (least effective sample size {posterior.ess_min:.0f}, R-hat "
        f"{posterior.rhat_max:.3f}): estimates and uncertainties must not be used."
    ]


def _mismatch(result: Result) -> list[str]:
    diagnosis = result.diagnosed.diagnosis
    if diagnosis.verdict == "consistent":
        return []
    named = [item.title for item in diagnosis.effects]
    found = f" It shows: {listed(named)}." if named else ""
    return [f"{VERDICTS[diagnosis.verdict]}{found} The figures below hold for the named model; see the diagnosis."]


def _noise(result: Result) -> list[str]:
    noise, ls = result.noise, result.least_squares
    texts = []
    if noise.contradicts_stated and noise.stated_um is not None:
        texts.append(
            f"The residuals contradict the stated uncertainty of a coordinate, {significant(noise.stated_um)} µm (p = "
            f"{noise.p_value:.1g}): the model leaves something out, or the recording is noisier than stated. The "
            f"uncertainties below rest on the residuals ({significant(noise.coordinate.value)} µm), not on the stated figure."
        )
    if ls.degrees_of_freedom < 3 and noise.stated_um is None:
        texts.append(f"Only {ls.degrees_of_freedom} degrees of freedom are left to estimate the noise from.")
    return texts + [
        f"{size.title} is given without an uncertainty (u_um) and is taken as exact."
        for size in result.artefact.sizes
        if size.certified and size.sd == 0
    ]


def _undetermined(result: Result) -> list[str]:
    texts = [
        f"Not determined by this recording: the common part of {listed([title_of(key, result) for key in combination])}."
        for combination in result.undetermined
    ]
    free = {key for combination in result.undetermined for key in combination}
    for unknown in result.posterior.unknowns:
        share = result.prior_share(unknown.key)
        if share > ASSUMED and unknown.key not in free and not unknown.known:
            texts.append(
                f"{title_of(unknown.key, result)} is hardly determined by this recording: {100 * share:.0f} % of its variance "
                f"is the assumption that it lies within about ±{2 * unknown.prior_sd:g} {unknown.unit}."
            )
    return texts


def _screening(result: Result) -> list[str]:
    return [
        f"{finding.why[0].upper()}{finding.why[1:]}. "
        + ("It is set aside: not used for the error factors." if finding.set_aside else "It is used as it stands.")
        for finding in result.findings
    ]


def _missing(result: Result) -> list[str]:
    """What ISO/IEC 17025:2017 asks for and the job does not say; a recording that nobody measured has no certificate."""
    if result.job.origin != MEASURED:
        return []
    facts = result.job.facts
    wanted = (
        (facts.laboratory.name, "name of the laboratory (7.8.2.1 b)"),
        (facts.laboratory.address, "address of the laboratory (7.8.2.1 b)"),
        (facts.job.place, "place of the measurement (7.8.2.1 c)"),
        (facts.job.customer, "customer (7.8.2.1 e)"),
        (facts.job.procedure, "method (7.8.2.1 f)"),
        (facts.machine.serial, "serial number of the machine (7.8.2.1 g)"),
        (facts.job.issued, "date of issue (7.8.2.1 j)"),
        (facts.laboratory.signatory, "who authorises it (7.8.2.1 o)"),
        (facts.job.conditions, "conditions (7.8.4.1 b)"),
        (facts.artefact.length_mm is None or facts.artefact.certificate, "certificate of the artefact (7.8.4.1 c)"),
    )
    missing = [name for given, name in wanted if not given]
    return [f"Not complete by ISO/IEC 17025:2017; the job does not state: {', '.join(missing)}."] if missing else []
