"""From a result to the document that certifies it (ISO/IEC 17025:2017, 7.8.2 and 7.8.4)."""

from __future__ import annotations

from cmm_uq.conformity.accuracy import TITLES
from cmm_uq.documents import tolerance_section
from cmm_uq.documents.conformity_section import conformity_section
from cmm_uq.documents.corner import corner_plot
from cmm_uq.documents.diagnosis_page import diagnosis_sections
from cmm_uq.documents.document import Block, Column, Document, Facts, Paragraph, Section, Signature, Table
from cmm_uq.documents.noise_words import noise_found
from cmm_uq.documents.origin import CERTIFICATE, came_about
from cmm_uq.documents.outcome import Outcome, Page
from cmm_uq.documents.posterior_file import posterior_file, posterior_name
from cmm_uq.documents.program import program
from cmm_uq.documents.result import Result
from cmm_uq.documents.results_file import results
from cmm_uq.documents.summary import summary
from cmm_uq.documents.warning import warnings
from cmm_uq.documents.wording import expanded, title_of
from cmm_uq.inference.posterior import Posterior
from cmm_uq.jobs.job import Job, JobFile
from cmm_uq.jobs.origin import MEASURED, SIMULATED
from cmm_uq.messages import NOTHING, Text, Verbatim, commas, day, foreign, listed, names, number, say, sentences, signed
from cmm_uq.model.artefact import Size
from cmm_uq.model.measurement import ARTEFACT
from cmm_uq.uncertainty.quantity import Quantity
from cmm_uq.uncertainty.rounding import rounded
from cmm_uq.units import MICROMETRE

STATEMENTS = (
    say("The results relate only to the item named above, in its condition and place at the time of the measurement."),
    say(
        "This certificate shall not be reproduced except in full without the written approval of the "
        "issuing laboratory."
    ),
)
"""ISO/IEC 17025:2017, 7.8.2.1 l) and the note to 7.8.2.1."""

UNCERTAINTY = say(
    "U is the expanded uncertainty for a coverage probability of 95 %, from the 95 % coverage interval of the posterior "
    "distribution; k = U/u is its ratio to the standard uncertainty u."
)


def certified(result: Result, page: Page) -> Outcome:
    """What there is to write of a result: the certificate, complete but for its looks, and its figures.

    Parameters
    ----------
    result : of the analysis.
    page : what its kind adds.
    """
    told = warnings(result)
    draws = posterior_file(result.draws, result.job.origin) if len(result.draws) else None
    data = results(result) if draws is None else {**results(result), "posterior": draws.entry}
    passed = all(statement.outcome == "pass" for statement in result.statements)
    return Outcome(
        result, _certificate(result, page, told), page.with_further(result, data), tuple(summary(result)), told,
        {draws.name: draws.content} if draws else {}, draws=result.draws,
        conforming=passed and result.diagnosed.diagnosis.verdict == "consistent",
    )  # fmt: skip


def _certificate(result: Result, page: Page, told: tuple[Text, ...]) -> Document:
    sections = [_performance(result), conformity_section(result.statements), _errors(result), _traceability(result)]
    sections += tolerance_section.sections(result)
    sections += page.sections(result)
    if result.job.facts.job.diagnosis_on_certificate:
        sections += diagnosis_sections(result.diagnosed)
    sections += [_posterior(result), _method(result)]
    produced_by = say(
        "{program}, {sampler}, seed {seed}",
        program=program(result.job),
        sampler=Verbatim(result.posterior.sampler),
        seed=result.posterior.seed,
    )
    files = (Verbatim(posterior_name(result.job.origin)),) if len(result.draws) else ()
    return certificate_of(result.job, sections, told, produced_by, files)


def certificate_of(
    job: Job, sections: list[Section], told: tuple[Text, ...], produced_by: Text, files: tuple[Text, ...] = ()
) -> Document:
    """Sections and warnings between what every certificate has; ``files`` are attached beside job and recording."""
    facts = job.facts
    return Document(
        title=CERTIFICATE,
        number=Verbatim(facts.job.number or facts.job.id),
        subject=say(
            "{name}, {came_about} {date}",
            name=Verbatim(facts.machine.name),
            came_about=came_about(job),
            date=day(facts.job.date),
        ),
        issuer=tuple(
            Verbatim(line) for line in (facts.laboratory.name, *facts.laboratory.address.splitlines()) if line
        ),
        particulars=_particulars(facts),
        warnings=told,
        sections=tuple(section for section in sections if section.blocks),
        statements=STATEMENTS,
        signatures=(Signature(Verbatim(facts.laboratory.signatory), Verbatim(facts.laboratory.signatory_role)),)
        if facts.laboratory.signatory
        else (),
        attachments=(*names(job.inputs), Verbatim("results.json"), *files),
        produced_by=produced_by,
        date=facts.job.issued or facts.job.date,
    )


def _particulars(facts: JobFile) -> tuple[Facts, ...]:
    job, machine, laboratory = facts.job, facts.machine, facts.laboratory
    measured = job.origin == MEASURED
    groups = (
        (
            (say("Certificate number") if measured else say("Job"), job.number if measured and job.number else job.id),
            (say("Customer"), "\n".join(filter(None, (job.customer, job.address)))),
            (say("Order"), job.order),
            (say("Accreditation"), laboratory.accreditation if measured else ""),
            (say("Date of measurement") if job.origin != SIMULATED else say("Date"), day(job.date)),
            (say("Date of issue"), day(job.issued) if job.issued else ""),
        ),
        (
            (say("Machine"), machine.name),
            (say("Manufacturer, model"), ", ".join(filter(None, (machine.manufacturer, machine.model)))),
            (say("Serial number"), machine.serial),
            (say("Owner"), machine.owner),
            (say("Measuring range"), _travel(facts)),
            (say("Place"), job.place),
        ),
        (
            (say("Method"), job.procedure),
            (say("Conditions"), job.conditions),
            (say("Operator"), job.operator),
            (say("Remarks"), job.remarks),
        ),
    )
    return tuple(Facts(rows) for group in groups if (rows := tuple((k, foreign(v)) for k, v in group if v)))


def _travel(facts: JobFile) -> Text:
    travel = [
        say("{axis} {low} … {high}", axis=Verbatim(axis.upper()), low=signed(given[0], "g"), high=signed(given[1], "g"))
        for axis in "xyz"
        if (given := getattr(facts.machine.travel_mm, axis))
    ]
    return say("{travel} mm", travel=commas(travel)) if travel else NOTHING


def _performance(result: Result) -> Section:
    rows = []
    for name, quantity in result.accuracy.items():
        value, U, k = expanded(quantity)
        rows.append((TITLES[name], value, U, k, quantity.unit))
    if not rows:
        return Section(say("Figures of performance"), ())
    columns = (
        Column(say("Quantity"), numeric=False),
        Column(say("Value")),
        Column(say("U")),
        Column(say("k")),
        Column(say("Unit"), numeric=False),
    )
    notes = (
        UNCERTAINTY,
        say(
            "Each figure estimates what the machine would show on average if the recording were "
            "repeated; all recorded lengths count."
        ),
    )
    return Section(say("Figures of performance"), (Table(say("Figures of performance"), columns, tuple(rows), notes),))


def _errors(result: Result) -> Section:
    """Error factors: what is determined with its uncertainty, what is not with what is known of it instead."""
    ls = result.least_squares
    free = {key for combination in result.undetermined for key in combination}
    fitted = {unknown.key: value for unknown, value in zip(ls.unknowns, ls.value, strict=True)}
    rows: list[tuple[Text, ...]] = []
    for effect in result.model.effects:
        for name, quantity in result.parameters[effect.name].items():
            key = (effect.name, name)
            value, U, k = expanded(quantity)
            if key in free:
                rows.append((title_of(key, result), say("not determined"), NOTHING, NOTHING, NOTHING, quantity.unit))
                continue
            least = rounded(float(fitted[key]), quantity.u)[0] if key in fitted else NOTHING
            rows.append((title_of(key, result), value, U, k, least, quantity.unit))
    columns = (
        Column(say("Error factor"), numeric=False),
        Column(say("Estimate")),
        Column(say("U")),
        Column(say("k")),
        Column(say("Least squares")),
        Column(say("Unit"), numeric=False),
    )
    notes = (say("Sign rule: true coordinate = indicated coordinate + error."), UNCERTAINTY)
    blocks: list[Block] = [Table(say("Error factors of the machine"), columns, tuple(rows), notes)] if rows else []
    for combination in result.undetermined:
        blocks += _free_combination(result, combination)
    return Section(say("Error factors"), tuple(blocks))


def _free_combination(result: Result, combination: tuple[tuple[str, str], ...]) -> list[Block]:
    """A combination that no such recording determines, and the differences inside it that this one does."""
    titles = [title_of(key, result) for key in combination]
    words = Paragraph(
        say(
            "{titles} can change together without changing any observation: the recording does not "
            "determine their common part. A certified length of the artefact would.",
            titles=listed(titles),
        )
    )
    rows = []
    for one in result.differences(combination):
        value, U, k = expanded(one.quantity)
        name = say("{second} − {first}", second=title_of(one.second, result), first=title_of(one.first, result))
        rows.append((name, value, U, k, one.quantity.unit))
    heads = (
        Column(say("Difference"), numeric=False),
        Column(say("Estimate")),
        Column(say("U")),
        Column(say("k")),
        Column(say("Unit"), numeric=False),
    )
    return [words, Table(say("Differences that are determined"), heads, tuple(rows))] if rows else [words]


def _traceability(result: Result) -> Section:
    artefact = result.job.facts.artefact
    chain = artefact.certificate
    rows: list[tuple[Text, Text]] = [
        (say("Artefact"), Verbatim(artefact.name) if artefact.name else result.artefact.title),
        (say("Serial number"), Verbatim(artefact.serial)),
    ]
    compared = result.job.facts.recording.earlier
    dimensions = [size for size in result.artefact.sizes if size.role == "dimension"]
    certified = [] if compared else [size for size in dimensions if size.certified]
    rows += [_certified(size) for size in certified]
    if compared:
        rows.append((say("References"), say("the earlier recording {file}", file=Verbatim(compared))))
    elif dimensions and not certified:
        rows.append((say("Certified length"), say("none: uncalibrated artefact (auto-calibration)")))
    if artefact.cte_per_k:
        cte = say("{cte:g} × 10⁻⁶ /K", cte=artefact.cte_per_k * 1e6)
        rows.append((say("Coefficient of thermal expansion"), cte))
    if chain is not None:
        issued = [say("of {date}", date=day(chain.date))] if chain.date else []
        issued += [say("due {date}", date=day(chain.due))] if chain.due else []
        rows += [
            (say("Its certificate"), sentences((*names(filter(None, (chain.number,))), *issued))),
            (say("Issued by"), Verbatim(chain.laboratory)),
        ]
    rows += [_fitted(size, result.sizes[size.name]) for size in certified]
    return Section(say("Artefact and traceability"), (Facts(tuple((label, text) for label, text in rows if text)),))


def _certified(size: Size) -> tuple[Text, Text]:
    u = size.sd / MICROMETRE
    figure = say("{nominal:.10g} {unit}, u = {u:g} µm", nominal=size.nominal, unit=size.unit, u=u)
    return say("Certified {what} at 20 °C", what=size.what or say("{title:small}", title=size.title)), figure


def _fitted(size: Size, quantity: Quantity) -> tuple[Text, Text]:
    value, U, k = expanded(quantity)
    figure = say("{value} {unit}, U = {U} {unit} (k = {k})", value=value, unit=size.unit, U=U, k=k)
    return say("{size} after the fit", size=size.title), figure


def _posterior(result: Result) -> Section:
    posterior = result.posterior
    set_up = {(ARTEFACT, size.name) for size in result.artefact.sizes if size.role == "set-up"}
    shown = [i for i, unknown in enumerate(posterior.unknowns) if unknown.key not in set_up]
    if not shown:
        return Section(say("Posterior distribution"), ())
    titles, draws = [title_of(posterior.unknowns[i].key, result) for i in shown], posterior.draws[:, shown]
    plot = corner_plot(
        draws, titles, units=[posterior.unknowns[i].unit for i in shown], estimates=draws.mean(axis=0),
        caption=say("Posterior distribution: each parameter, and each pair."),
        alternative=say("Marginal and pairwise posterior densities of {names}.", names=listed(titles)),
    )  # fmt: skip
    return Section(say("Posterior distribution"), (plot,))


def _method(result: Result) -> Section:
    ls, posterior, noise = result.least_squares, result.posterior, result.noise
    sigma, (low, high) = noise.coordinate.value, noise.coordinate.interval95
    spread = (
        say(
            "{sigma:.3g} µm, 95 % interval {low:.3g} to {high:.3g} µm, from the residuals",
            sigma=sigma,
            low=low,
            high=high,
        )
        if noise.stated_um is None
        else say(
            "{sigma:.3g} µm, 95 % interval {low:.3g} to {high:.3g} µm, from the stated {stated:.3g} µm and the residuals",
            sigma=sigma,
            low=low,
            high=high,
            stated=noise.stated_um,
        )
    )
    if noise.p_value is not None:
        spread = say("{spread}; residuals under the stated figure: p = {p:.2g}", spread=spread, p=noise.p_value)
    sizes = say(
        "{count}, {rank}, {condition:.3g}", count=ls.rank + ls.null_space.shape[1], rank=ls.rank, condition=ls.condition
    )
    sampler = say(
        "{sampler}, seed {seed}, {count} draws",
        sampler=Verbatim(posterior.sampler), seed=posterior.seed, count=len(posterior.draws),
    )  # fmt: skip
    rows = (
        (say("Observations used"), number(len(ls.residuals))),
        (say("Parameters, rank, condition number"), sizes),
        (say("Degrees of freedom"), number(ls.degrees_of_freedom)),
        (
            say("Residual standard deviation"),
            NOTHING if ls.residual_sd is None else say("{sd:.1f} µm", sd=ls.residual_sd * 1e3),
        ),
        (say("Standard uncertainty of a coordinate"), spread),
        (say("Noise"), noise_found(noise)),
        (say("Sampler"), sampler),
        (say("Convergence"), _convergence(posterior)),
    )
    text = Paragraph(
        say(
            "{what} are estimated from the observations with a linear measurement "
            "model, by least squares (orthogonal factorisation) and as a posterior distribution with "
            "priors as wide as physics allows; the certified length enters with its uncertainty. The "
            "attached job, recording and results.json suffice to run it again.",
            what=say("Rigid-body error factors") if result.model.effects else say("Sizes of the artefact"),
        )
    )
    return Section(say("Method"), (text, Facts(tuple((label, value) for label, value in rows if value))))


def _convergence(posterior: Posterior) -> Text:
    return say(
        "{reached}: at least {ess:.0f} effective samples in every parameter, rank-normalised R-hat {rhat:.4f}, "
        "autocorrelation time {time:.1f} of {steps} steps",
        reached=say("reached") if posterior.converged else say("NOT reached"),
        ess=posterior.ess_min, rhat=posterior.rhat_max, time=posterior.autocorrelation_time, steps=posterior.steps,
    )  # fmt: skip
