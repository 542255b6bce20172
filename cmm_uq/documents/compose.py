"""From a result to the document that certifies it (ISO/IEC 17025:2017, 7.8.2 and 7.8.4)."""

from __future__ import annotations

from cmm_uq.conformity.accuracy import TITLES
from cmm_uq.conformity.statement import Statement
from cmm_uq.documents import tolerance_section
from cmm_uq.documents.corner import corner_plot
from cmm_uq.documents.diagnosis_page import diagnosis_sections
from cmm_uq.documents.document import Block, Column, Decision, Document, Facts, Paragraph, Section, Signature, Table
from cmm_uq.documents.origin import CERTIFICATE, came_about
from cmm_uq.documents.outcome import Outcome, Page
from cmm_uq.documents.posterior_file import posterior_file, posterior_name
from cmm_uq.documents.program import program
from cmm_uq.documents.result import Result
from cmm_uq.documents.results_file import results
from cmm_uq.documents.summary import summary
from cmm_uq.documents.warning import warnings
from cmm_uq.documents.wording import expanded, listed, measured, probability, title_of
from cmm_uq.jobs.job import Job, JobFile
from cmm_uq.jobs.origin import MEASURED, SIMULATED
from cmm_uq.model.measurement import ARTEFACT
from cmm_uq.uncertainty.rounding import rounded, significant
from cmm_uq.units import MICROMETRE

STATEMENTS = (
    "The results relate only to the item named above, in its condition and place at the time of the measurement.",
    "This certificate shall not be reproduced except in full without the written approval of the issuing laboratory.",
)
"""ISO/IEC 17025:2017, 7.8.2.1 l) and the note to 7.8.2.1."""

UNCERTAINTY = (
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


def _certificate(result: Result, page: Page, told: tuple[str, ...]) -> Document:
    sections = [_performance(result), _conformity(result), _errors(result), _traceability(result)]
    sections += tolerance_section.sections(result)
    sections += page.sections(result)
    if result.job.facts.job.diagnosis_on_certificate:
        sections += diagnosis_sections(result.diagnosed)
    sections += [_posterior(result), _method(result)]
    produced_by = f"{program()}, {result.posterior.sampler}, seed {result.posterior.seed}"
    files = (posterior_name(result.job.origin),) if len(result.draws) else ()
    return certificate_of(result.job, sections, told, produced_by, files)


def certificate_of(
    job: Job, sections: list[Section], told: tuple[str, ...], produced_by: str, files: tuple[str, ...] = ()
) -> Document:
    """Sections and warnings between what every certificate has; ``files`` are attached beside job and recording."""
    facts = job.facts
    return Document(
        title=CERTIFICATE,
        number=facts.job.number or facts.job.id,
        subject=f"{facts.machine.name}, {came_about(job)} {facts.job.date.isoformat()}",
        issuer=tuple(line for line in (facts.laboratory.name, *facts.laboratory.address.splitlines()) if line),
        particulars=_particulars(facts),
        warnings=told,
        sections=tuple(section for section in sections if section.blocks),
        statements=STATEMENTS,
        signatures=(Signature(facts.laboratory.signatory, facts.laboratory.signatory_role),)
        if facts.laboratory.signatory
        else (),
        attachments=(*job.inputs, "results.json", *files),
        produced_by=produced_by,
        date=facts.job.issued or facts.job.date,
    )


def _particulars(facts: JobFile) -> tuple[Facts, ...]:
    job, machine, laboratory = facts.job, facts.machine, facts.laboratory
    measured = job.origin == MEASURED
    travel = [
        f"{axis.upper()} {given[0]:g} … {given[1]:g}".replace("-", "−")
        for axis in "xyz"
        if (given := getattr(machine.travel_mm, axis))
    ]
    groups = (
        (
            ("Certificate number" if measured else "Job", job.number if measured and job.number else job.id),
            ("Customer", "\n".join(filter(None, (job.customer, job.address)))),
            ("Order", job.order),
            ("Accreditation", laboratory.accreditation if measured else ""),
            ("Date of measurement" if job.origin != SIMULATED else "Date", job.date.isoformat()),
            ("Date of issue", job.issued.isoformat() if job.issued else ""),
        ),
        (
            ("Machine", machine.name),
            ("Manufacturer, model", ", ".join(filter(None, (machine.manufacturer, machine.model)))),
            ("Serial number", machine.serial),
            ("Owner", machine.owner),
            ("Measuring range", f"{', '.join(travel)} mm" if travel else ""),
            ("Place", job.place),
        ),
        (
            ("Method", job.procedure),
            ("Conditions", job.conditions),
            ("Operator", job.operator),
            ("Remarks", job.remarks),
        ),
    )
    return tuple(Facts(rows) for group in groups if (rows := tuple((k, v) for k, v in group if v)))


def _performance(result: Result) -> Section:
    rows = []
    for name, quantity in result.accuracy.items():
        value, U, k = expanded(quantity)
        rows.append((TITLES[name], value, U, k, quantity.unit))
    if not rows:
        return Section("Figures of performance", ())
    columns = (
        Column("Quantity", numeric=False),
        Column("Value"),
        Column("U"),
        Column("k"),
        Column("Unit", numeric=False),
    )
    notes = (
        UNCERTAINTY,
        "Each figure estimates what the machine would show on average if the recording were repeated; all recorded lengths "
        "count.",
    )
    return Section("Figures of performance", (Table("Figures of performance", columns, tuple(rows), notes),))


def _conformity(result: Result) -> Section:
    return Section("Statements of conformity", tuple(_decision(statement) for statement in result.statements))


def _decision(statement: Statement) -> Decision:
    decision = statement.decision
    value, u = measured(statement)
    said = []
    if statement.outcome == "incomplete":
        said.append(f"The {statement.measured} measured conform; the test lacks what is named as missing.")
    if decision.guard_band is None:
        said.append("The uncertainty is too large for any value to be accepted.")
    elif decision.guard_band > 0:
        said.append(f"The guard band is {significant(decision.guard_band)} µm.")
    if decision.probability_conforming is not None:
        chance = probability(decision.probability_conforming)
        said.append(f"Probability that the quantity is within the limit: {chance}.")
    known = f", u = {u} µm" if u else ""
    return Decision(
        statement.facts.standard, statement.quantity, f"{value} µm{known}", f"{statement.limit_um:.4g} µm",
        decision.rule, statement.outcome, " ".join((*said, *statement.remarks)), statement.missing,
    )  # fmt: skip


def _errors(result: Result) -> Section:
    """Error factors: what is determined with its uncertainty, what is not with what is known of it instead."""
    ls = result.least_squares
    free = {key for combination in result.undetermined for key in combination}
    fitted = {unknown.key: value for unknown, value in zip(ls.unknowns, ls.value, strict=True)}
    rows = []
    for effect in result.model.effects:
        for name, quantity in result.parameters[effect.name].items():
            key = (effect.name, name)
            value, U, k = expanded(quantity)
            if key in free:
                rows.append((title_of(key, result), "not determined", "", "", "", quantity.unit))
                continue
            least = rounded(float(fitted[key]), quantity.u)[0] if key in fitted else ""
            rows.append((title_of(key, result), value, U, k, least, quantity.unit))
    columns = (
        Column("Error factor", numeric=False), Column("Estimate"), Column("U"), Column("k"), Column("Least squares"),
        Column("Unit", numeric=False),
    )  # fmt: skip
    notes = ("Sign rule: true coordinate = indicated coordinate + error.", UNCERTAINTY)
    blocks: list[Block] = [Table("Error factors of the machine", columns, tuple(rows), notes)] if rows else []
    for combination in result.undetermined:
        blocks += _free_combination(result, combination)
    return Section("Error factors", tuple(blocks))


def _free_combination(result: Result, combination: tuple[tuple[str, str], ...]) -> list[Block]:
    """A combination that no such recording determines, and the differences inside it that this one does."""
    titles = [title_of(key, result) for key in combination]
    words = Paragraph(
        f"{listed(titles)} can change together without changing any observation: the recording does not determine their "
        "common part. A certified length of the artefact would."
    )
    rows = []
    for one in result.differences(combination):
        value, U, k = expanded(one.quantity)
        name = f"{title_of(one.second, result)} − {title_of(one.first, result)}"
        rows.append((name, value, U, k, one.quantity.unit))
    heads = (
        Column("Difference", numeric=False),
        Column("Estimate"),
        Column("U"),
        Column("k"),
        Column("Unit", numeric=False),
    )
    return [words, Table("Differences that are determined", heads, tuple(rows))] if rows else [words]


def _traceability(result: Result) -> Section:
    artefact = result.job.facts.artefact
    chain = artefact.certificate
    rows: list[tuple[str, str]] = [
        ("Artefact", artefact.name or result.artefact.title),
        ("Serial number", artefact.serial),
    ]
    compared = result.job.facts.recording.earlier
    dimensions = [size for size in result.artefact.sizes if size.role == "dimension"]
    certified = [] if compared else [size for size in dimensions if size.certified]
    for size in certified:
        what = size.title.split(" of ")[0].lower()
        rows.append((f"Certified {what} at 20 °C", f"{size.nominal:.10g} {size.unit}, u = {size.sd / MICROMETRE:g} µm"))
    if compared:
        rows.append(("References", f"the earlier recording {compared}"))
    elif dimensions and not certified:
        rows.append(("Certified length", "none: uncalibrated artefact (auto-calibration)"))
    if artefact.cte_per_k:
        rows.append(("Coefficient of thermal expansion", f"{artefact.cte_per_k * 1e6:g} × 10⁻⁶ /K"))
    if chain is not None:
        dates = [f"{word} {date.isoformat()}" for word, date in (("of", chain.date), ("due", chain.due)) if date]
        rows += [("Its certificate", " ".join(filter(None, (chain.number, *dates)))), ("Issued by", chain.laboratory)]
    for size in certified:
        value, U, k = expanded(result.sizes[size.name])
        rows.append((f"{size.title} after the fit", f"{value} {size.unit}, U = {U} {size.unit} (k = {k})"))
    return Section("Artefact and traceability", (Facts(tuple((label, text) for label, text in rows if text)),))


def _posterior(result: Result) -> Section:
    posterior = result.posterior
    set_up = {(ARTEFACT, size.name) for size in result.artefact.sizes if size.role == "set-up"}
    shown = [i for i, unknown in enumerate(posterior.unknowns) if unknown.key not in set_up]
    if not shown:
        return Section("Posterior distribution", ())
    names, draws = [title_of(posterior.unknowns[i].key, result) for i in shown], posterior.draws[:, shown]
    plot = corner_plot(
        draws, names, units=[posterior.unknowns[i].unit for i in shown], estimates=draws.mean(axis=0),
        caption="Posterior distribution: each parameter, and each pair.",
        alternative=f"Marginal and pairwise posterior densities of {listed(names)}.",
    )  # fmt: skip
    return Section("Posterior distribution", (plot,))


def _method(result: Result) -> Section:
    ls, posterior, noise = result.least_squares, result.posterior, result.noise
    sigma, (low, high) = noise.coordinate.value, noise.coordinate.interval95
    spread = (
        f"{sigma:.3g} µm, 95 % interval {low:.3g} to {high:.3g} µm, from the residuals"
        if noise.coordinate.u > 0
        else f"{sigma:.3g} µm, as stated"
    )
    sd = None if ls.residual_sd is None else ls.residual_sd * 1e3
    test = f"; residuals under the stated figure: p = {noise.p_value:.2g}" if noise.p_value is not None else ""
    rows = (
        ("Observations used", str(len(ls.residuals))),
        ("Parameters, rank, condition number",
         f"{ls.rank + ls.null_space.shape[1]}, {ls.rank}, {ls.condition:.3g}"),
        ("Degrees of freedom", str(ls.degrees_of_freedom)),
        ("Residual standard deviation", "" if sd is None else f"{sd:.1f} µm"),
        ("Standard uncertainty of a coordinate", f"{spread}{test}"),
        ("Sampler", f"{posterior.sampler}, seed {posterior.seed}, {len(posterior.draws)} draws"),
        ("Convergence",
         f"{'reached' if posterior.converged else 'NOT reached'}: at least {posterior.ess_min:.0f} effective samples in every "
         f"parameter, rank-normalised R-hat {posterior.rhat_max:.4f}, autocorrelation time "
         f"{posterior.autocorrelation_time:.1f} of {posterior.steps} steps"),
    )  # fmt: skip
    what = "Rigid-body error factors" if result.model.effects else "Sizes of the artefact"
    text = Paragraph(
        f"{what} are estimated from the observations with a linear measurement model, by least squares "
        "(orthogonal factorisation) and as a posterior distribution with priors as wide as physics allows; the certified "
        "length enters with its uncertainty. The attached job, recording and results.json suffice to run it again."
    )
    return Section("Method", (text, Facts(tuple((label, value) for label, value in rows if value))))
