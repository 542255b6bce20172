"""What a reader must know before using a figure."""

from __future__ import annotations

from cmm_uq.analysis.conformity.lengths_decided import unknown_expansion
from cmm_uq.base.messages import Text, listed, say, sentences
from cmm_uq.certificate.diagnosis.overview import VERDICTS
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.wording import title_of, with_uncertainty
from cmm_uq.maths.inference.ensembles import Chains
from cmm_uq.maths.inference.posterior import Posterior
from cmm_uq.maths.uncertainty.quantity import figure, nominal, significant

ASSUMED = 0.25  # share of the prior in a parameter's variance from which on the reader is told
IMPLAUSIBLE = 4.0  # standard deviations of what was known beforehand from which on an estimate is held to be a mistake


def warnings(result: Result) -> tuple[Text, ...]:
    each = (_mismatch, _noise, _expansion, _implausible, _undetermined, _contradicted, _screening)
    return *not_converged(result.posterior), *(text for of in each for text in of(result))


def not_converged(sampled: Posterior | Chains) -> list[Text]:
    """That figures must not be used, where the sampling did not converge."""
    told = say(
        "The sampling did not converge (least effective sample size {ess_min:.0f}, R-hat "
        "{rhat_max:.3f}): estimates and uncertainties must not be used.",
        ess_min=sampled.ess_min, rhat_max=sampled.rhat_max,
    )  # fmt: skip
    return [] if sampled.converged else [told]


def _mismatch(result: Result) -> list[Text]:
    diagnosis = result.diagnosed.diagnosis
    if diagnosis.verdict == "consistent":
        return []
    said = [VERDICTS[diagnosis.verdict]]
    if diagnosis.effects:
        said.append(say("It shows: {named}.", named=listed([item.title for item in diagnosis.effects])))
    holds = say("The figures below hold for the named model; see the diagnosis.")
    if result.averaged:
        holds = say(
            "Estimates below, and what is computed from them, are averaged over {rivals} explanations that remain, by their "
            "probabilities; noise, and figures of the readings as recorded, hold for the named model. See the diagnosis.",
            rivals=result.averaged,
        )
    return [sentences((*said, holds))]


def _noise(result: Result) -> list[Text]:
    noise, freedom = result.noise, result.least_squares.degrees_of_freedom
    texts: list[Text] = []
    if noise.contradicts_stated and noise.stated_um is not None and noise.p_value is not None:
        stated, value = significant(noise.stated_um), significant(noise.coordinate.value)
        texts.append(say(
            "The residuals contradict the stated uncertainty of a coordinate, {stated_um} µm (p = "
            "{p_value:.1g}): the model leaves something out, or the recording is noisier than stated. "
            "The uncertainties below rest on the residuals ({value} µm), not on the stated figure.",
            stated_um=stated, p_value=noise.p_value, value=value,
        ))  # fmt: skip
    if freedom < 3 and noise.stated_um is None:
        texts.append(say("Only {degrees_of_freedom} degrees of freedom are left to estimate the noise from.",
                         degrees_of_freedom=freedom))  # fmt: skip
    exact = [size.title for size in result.artefact.sizes if size.certified and size.sd == 0]
    return texts + [
        say("{title} is given without an uncertainty and is taken as exact.", title=title) for title in exact
    ]


def _expansion(result: Result) -> list[Text]:
    """An artefact of unknown expansion away from 20 °C: a mistake of its length for a length standard."""
    certified = any(size.certified and size.role == "dimension" for size in result.artefact.sizes)
    told = unknown_expansion(result.artefact, result.job.facts.artefact.cte_per_k)
    return [told] if told and certified and result.artefact.indications() is not None else []


def _implausible(result: Result) -> list[Text]:
    """Parameters far beyond what was known of them: a certified length that is wrong looks like scale errors of all axes."""
    texts: list[Text] = []
    means = result.values.mean(axis=0)
    for unknown, mean in zip(result.posterior.unknowns, means, strict=True):
        off = mean - unknown.prior_mean
        if 0 < unknown.prior_sd < abs(off) / IMPLAUSIBLE:
            parameter = title_of(unknown.key, result)
            if unknown.prior_mean:
                parameter = say("Correction of the {what:small}, {nominal} {unit}", what=parameter,
                                nominal=nominal(unknown.prior_mean), unit=unknown.unit)  # fmt: skip
            texts.append(say(
                "{parameter}: {off} {unit} is {times:.0f} times the standard uncertainty with which it was known "
                "beforehand ({sd} {unit}). Before it is used, rule out a wrong certified length, unit or expansion.",
                parameter=parameter, off=figure(off), unit=unknown.unit, times=abs(off) / unknown.prior_sd,
                sd=figure(unknown.prior_sd, 3),
            ))  # fmt: skip
    return texts


def _undetermined(result: Result) -> list[Text]:
    texts: list[Text] = [
        say("Not determined by this recording: the common part of {parameters}.",
            parameters=listed([title_of(key, result) for key in combination]))
        for combination in result.undetermined
    ]  # fmt: skip
    for unknown in result.posterior.unknowns:
        share = result.prior_share(unknown.key)
        if share > ASSUMED and unknown.key not in result.not_given and not unknown.known:
            texts.append(say(
                "{parameter} is hardly determined by this recording: {share:.0f} % of its variance is the "
                "assumption that it lies within about ±{prior_sd:g} {unit}.",
                parameter=title_of(unknown.key, result), share=100 * share, prior_sd=2 * unknown.prior_sd, unit=unknown.unit,
            ))  # fmt: skip
    return texts


def _contradicted(result: Result) -> list[Text]:
    return [
        say(
            "{parameter} is not given: {averaged} {unit} on average over {rivals} explanations, while the line of measurement "
            "{measurement} alone says {alone} {unit}.",
            parameter=title_of(one.key, result), averaged=with_uncertainty(result.parameters[one.key[0]][one.key[1]]),
            rivals=result.averaged, measurement=one.measurement, alone=with_uncertainty(one.alone), unit=one.alone.unit,
        )
        for one in result.contradictions
    ]  # fmt: skip


def _screening(result: Result) -> list[Text]:
    return [
        say("{why:capital}. It is set aside: not used for the error factors.", why=finding.why)
        if finding.set_aside
        else say("{why:capital}. It is used as it stands.", why=finding.why)
        for finding in result.findings
    ]
