"""How the figures of a certificate were estimated, and what a reader must know before using one."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.conformity.uncertainty import unknown_expansion
from cmm_uq.base.messages import NOTHING, Text, Verbatim, holding, listed, number, say, sentences
from cmm_uq.certificate.diagnosis.overview import VERDICT_SENTENCES
from cmm_uq.certificate.document import Paragraph, Section, facts, section
from cmm_uq.certificate.plots.corner import corner_plot
from cmm_uq.certificate.result import RecordingNoise, Result
from cmm_uq.certificate.sections.regions import regions_warnings
from cmm_uq.certificate.wording import stated_physics, title_of, with_uncertainty
from cmm_uq.machine.model.artefact import without_uncertainty
from cmm_uq.machine.model.artefact_doubt import CALIBRATION
from cmm_uq.machine.model.measurement import ARTEFACT, IMPLAUSIBLE
from cmm_uq.machine.model.noise import repeated_quantity
from cmm_uq.maths.inference.ensembles import Chains
from cmm_uq.maths.inference.posterior import Posterior
from cmm_uq.maths.uncertainty.quantity import alike, figure, nominal, significant

_SHOWN = 0.8  # probability from which a component is said to be there; beforehand it is at most one half
_WIDER = 1.05


def noise_found(noise: RecordingNoise, *, heavy_tails: bool, repeats: bool = False) -> Text:
    """What was found, could not show, and does to the uncertainties.

    ``heavy_tails``: by the diagnosis, not the estimate; ``repeats``: whether anything was repeated.
    """
    there = _components(noise)
    if heavy_tails:
        there.append(say("heavier tails than those of the normal distribution that the estimate assumes"))
    found: Text = say("independent readings, nothing else")
    if there:
        found = say("independent readings, and {what}", what=listed(there))
    if noise.wider >= _WIDER:
        found = say("{found}; standard uncertainties are up to {times:.2f} times those under white noise",
                    found=found, times=noise.wider)  # fmt: skip
    unseen = (
        say("set-up offsets (one with where the artefact stands)") if repeats else say("set-up offsets (no repeats)")
    )
    hidden = [] if "placing" in noise.components else [unseen]
    drifted = "slow" in noise.components
    hidden.append(say("what had drifted before the first reading") if drifted else say("slow noise (no times)"))
    return say("{found}; not to be seen in this recording: {what}", found=found, what=listed(hidden))


def _components(noise: RecordingNoise) -> list[Text]:
    there: list[Text] = []
    if noise.axes_apart > _SHOWN:
        x, y, z = (noise.components[axis].size.value for axis in "xyz")
        there.append(say("a scatter that differs by axis (X {x:.2g}, Y {y:.2g}, Z {z:.2g} µm)", x=x, y=y, z=z))
    if noise.display_um:
        there.append(say("the steps of the display, {step:.2g} µm", step=noise.display_um))
    for name in ("placing", "growth", "slow"):
        found = noise.components.get(name)
        if found is not None and found.probability > _SHOWN:
            size, p = found.size.value, found.probability
            there.append({
                "placing": say("an offset of {size:.2g} µm of each set-up, shared by its repeats (probability {p:.2f})",
                               size=size, p=p),
                "growth": say("scatter that grows with length to {size:.2g} µm (probability {p:.2f})", size=size, p=p),
                "slow": say("slow noise in time of {size:.2g} µm (probability {p:.2f})", size=size, p=p),
            }[name])  # fmt: skip
    return there


def posterior_section(result: Result) -> Section:
    """Every parameter's density, and each pair; without blocks where there are none."""
    posterior = result.posterior
    set_up = {(ARTEFACT, size.name) for size in result.artefact.sizes if size.role == "set-up"}
    shown = [i for i, unknown in enumerate(posterior.unknowns) if unknown.key not in set_up]
    if not shown:
        return section(say("Posterior distribution"))
    titles, draws = [title_of(posterior.unknowns[i].key, result) for i in shown], result.values[:, shown]
    plot = corner_plot(
        draws, titles, units=[posterior.unknowns[i].unit for i in shown], estimates=draws.mean(axis=0),
        caption=say("Posterior distribution: each parameter, and each pair.") if not result.averaged else say(
            "Posterior distribution, averaged over {rivals} explanations that remain: each parameter, and each pair.",
            rivals=result.averaged,
        ),
        alternative=say("Marginal and pairwise posterior densities of {names}.", names=listed(titles)),
    )  # fmt: skip
    return section(say("Posterior distribution"), plot)


def method(result: Result) -> Section:
    ls, posterior, noise = result.least_squares, result.posterior, result.noise
    sigma, (low, high), stated = noise.coordinate.value, noise.coordinate.interval95, noise.stated_um
    of = (
        say("the stated {stated:.3g} µm and the residuals", stated=stated or 0.0)
        if stated is not None
        else say("the residuals")
    )
    spread = say("{sigma:.3g} µm, 95 % interval {low:.3g} to {high:.3g} µm, from {of}",
                 sigma=sigma, low=low, high=high, of=of)  # fmt: skip
    if noise.p_value is not None:
        spread = say("{spread}; residuals under the stated figure: p = {p:.2g}", spread=spread, p=noise.p_value)
    count = ls.rank + ls.null_space.shape[1]
    stated_facts = facts(
        (say("Observations used"), number(len(ls.residuals))),
        (say("Parameters, rank, condition number"), number(count) if not count else
         say("{count}, {rank}, {condition:.3g}", count=count, rank=ls.rank, condition=ls.condition)),
        (say("Degrees of freedom"), number(ls.degrees_of_freedom)),
        (say("Residual standard deviation"),
         NOTHING if ls.residual_sd is None else say("{sd} µm", sd=alike(ls.residual_sd * 1e3)[0])),
        (say("Standard uncertainty of a coordinate"), spread),
        (say("Noise"), noise_found(
            noise, heavy_tails=result.diagnosed.diagnosis.noise.heavy_tails,
            repeats=bool(np.any(np.bincount(repeated_quantity(result.model, result.model.used)) > 1)),
        )),
        (say("Sampler"), say("{sampler}, seed {seed}, {count} draws", sampler=Verbatim(posterior.sampler),
                             seed=posterior.seed, count=len(posterior.draws))),
        (say("Convergence"), say(
            "{reached}: at least {ess:.0f} effective samples in every parameter, rank-normalised R-hat {rhat:.4f}, "
            "autocorrelation time {time:.1f} of {steps} steps",
            reached=say("reached") if posterior.converged else say("NOT reached"), ess=posterior.ess_min,
            rhat=posterior.rhat_max, time=posterior.autocorrelation_time, steps=posterior.steps,
        )),
        (say("Averaged"), say(
            "estimates, their covariance and draws are of the mixture of {rivals} explanations that remain, {count} draws, of "
            "each as many as it is probable; residuals, noise, least squares and the sampler are of the named model, where "
            "what it leaves out counts as noise", rivals=result.averaged, count=len(result.values),
        ) if result.averaged else NOTHING),
        *stated_physics(),
        (say("Stated of the artefact"), _stated(result)),
        (say("Calibrated lengths together"), _calibration(result)),
    )  # fmt: skip
    certified = any(size.certified and size.role == "dimension" for size in result.artefact.sizes)
    text = say(
        "{what} are estimated from the observations with a linear measurement model, by least squares (orthogonal "
        "factorisation) and as a posterior distribution with priors as wide as physics allows; {length}. The attached job, "
        "recording and results.json suffice to run it again. Equations: docs/certificate.md and docs/machine/field.md of the "
        "program's source; how often such intervals hold: docs/coverage-study.md and docs/parts-study.md.",
        what=say("Error factors") if result.model.effects else say("The quantities sought"),
        length=say("the stated dimension of the artefact enters with its uncertainty") if certified else
        say("no stated dimension of the artefact enters"),
    )  # fmt: skip
    return section(say("Method"), Paragraph(text), stated_facts)


def _stated(result: Result) -> Text:
    """What is stated of the artefact's temperature, expansion, alignment and fixturing, and which figures it reaches."""
    if causes := listed([cause.name for cause in result.causes if cause.name != CALIBRATION]):
        return say(
            "the uncertainty stated of {causes} is in U of all estimates, of figures of lengths and of the slopes of lines, "
            "as of an error that all set-ups share and as of one that each has by itself, whichever is larger; it is not in "
            "residuals, noise, least squares and the diagnosis",
            causes=causes,
        )
    none = say("what is stated of temperature, expansion, alignment and fixturing changes none of the estimates here")
    return none if result.job.circumstances.uncertainty.of_artefact else NOTHING


def _calibration(result: Result) -> Text:
    found = next((cause for cause in result.causes if cause.name == CALIBRATION), None)
    stated = say("errors of the calibrated lengths are taken with the covariance that their certificate states")
    unknown = say(
        "errors of the calibrated lengths are taken as of one cause and as of each place by itself; in every figure the "
        "larger U stands"
    )
    return NOTHING if found is None else stated if found.apart is None else unknown


ASSUMED = 0.25  # share of the prior in a parameter's variance from which on the reader is told


def warnings(result: Result) -> tuple[Text, ...]:
    each = (_mismatch, _noise, _expansion, _implausible, _undetermined, _contradicted, regions_warnings)
    screened = (
        say("{why:capital}. It is set aside: not used for the error factors.", why=one.why) if one.set_aside
        else say("{why:capital}. It is used as it stands.", why=one.why) for one in result.findings
    )  # fmt: skip
    return (*not_converged(result.posterior), *(text for of in each for text in of(result)), *screened)


def not_converged(sampled: Posterior | Chains) -> list[Text]:
    """That figures must not be used, where the sampling did not converge."""
    told = say(
        "The sampling did not converge (least effective sample size {ess_min:.0f}, R-hat "
        "{rhat_max:.3f}): estimates and uncertainties must not be used.",
        ess_min=sampled.ess_min,
        rhat_max=sampled.rhat_max,
    )
    return [] if sampled.converged else [told]


def _mismatch(result: Result) -> list[Text]:
    diagnosis = result.diagnosed.diagnosis
    shown = listed([item.title for item in diagnosis.effects])
    averaged = say(
        "Estimates below, and what is computed from them, are averaged over {rivals} explanations that remain, by their "
        "probabilities; noise, and figures of the readings as recorded, hold for the named model. See the diagnosis.",
        rivals=result.averaged,
    )
    return [] if diagnosis.agrees else [sentences(holding(
        (True, VERDICT_SENTENCES[diagnosis.verdict]), (shown, say("It shows: {named}.", named=shown)),
        (result.averaged, averaged),
        (not result.averaged, say("The figures below hold for the named model; see the diagnosis.")),
    ))]  # fmt: skip


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
    few = say(
        "Only {degrees_of_freedom} degrees of freedom are left to estimate the noise from.", degrees_of_freedom=freedom
    )
    texts += holding((freedom < 3 and noise.stated_um is None, few))
    exact = [without_uncertainty(one.title) for one in result.artefact.sizes if one.certified and one.sd == 0]
    exact += [reason for reason, _ in result.artefact.exact]
    return texts + [say("{reason} and is taken as exact.", reason=each) for each in exact]


def _expansion(result: Result) -> list[Text]:
    """An artefact of unknown expansion away from 20 °C: a mistake of its length for a length standard."""
    certified = any(size.certified and size.role == "dimension" for size in result.artefact.sizes)
    told = unknown_expansion(result.artefact, result.job.facts.artefact.cte_per_k)
    return [told] if told and certified and result.artefact.indications() is not None else []


def _implausible(result: Result) -> list[Text]:
    """Parameters far beyond what was known of them: a certified length that is wrong looks like scale errors of all axes."""
    texts: list[Text] = []
    means = result.values.mean(axis=0)
    for unknown, taken, mean in zip(result.model.unknowns, result.posterior.unknowns, means, strict=True):
        off, title, of = mean - unknown.prior_mean, title_of(unknown.key, result), unknown.unit
        if 0 < unknown.prior_sd < abs(off) / IMPLAUSIBLE:
            correction = say("Correction of the {what:small}, {nominal} {unit}", what=title,
                             nominal=nominal(unknown.prior_mean), unit=of)  # fmt: skip
            texts.append(say(
                "{parameter}: {off} {unit} is {times:.0f} times the standard uncertainty with which it was known "
                "beforehand ({sd} {unit}). Before it is used, rule out a wrong certified length, unit or expansion.",
                parameter=correction if unknown.prior_mean else title, off=figure(off), unit=of,
                times=abs(off) / unknown.prior_sd, sd=figure(unknown.prior_sd, 3),
            ))  # fmt: skip
        if taken.prior_sd > unknown.prior_sd:
            texts.append(say(
                "{parameter}: the recording contradicts what was known beforehand so clearly that {sd} {unit} was taken "
                "as its standard uncertainty instead.", parameter=title, sd=figure(taken.prior_sd, 3), unit=of,
            ))  # fmt: skip
    return texts


def _undetermined(result: Result) -> list[Text]:
    texts: list[Text] = [
        say("Not determined by this recording: the common part of {parameters}.",
            parameters=listed([title_of(key, result) for key in combination]))
        for combination in result.undetermined
    ]  # fmt: skip
    for unknown in result.posterior.unknowns:
        share, left = result.prior_share(unknown.key), unknown.key in result.left_to_prior
        if left or (share > ASSUMED and unknown.key not in result.not_given and not unknown.known):
            title = title_of(unknown.key, result)
            hardly = say("{parameter} is hardly determined by this recording", parameter=title)
            texts.append(say(
                "{of}: {share:.0f} % of its variance is the assumption that it lies within about ±{prior_sd:g} {unit}.",
                of=say("{parameter} is not determined by this recording", parameter=title) if left else hardly,
                share=100 * share, prior_sd=2 * unknown.prior_sd, unit=unknown.unit,
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
