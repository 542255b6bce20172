"""Certificates and working pages: what each of them has (ISO/IEC 17025:2017, 7.8), and the sections in their order."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from cmm_uq.base.messages import NOTHING, Text, Verbatim, commas, day, foreign, names, say, signed, without_keys
from cmm_uq.base.units import unit
from cmm_uq.certificate import clauses, document, origin as origins
from cmm_uq.certificate.clauses import claimed, traceability
from cmm_uq.certificate.diagnosis.page import diagnosis_sections
from cmm_uq.certificate.document import Document, Facts, Overview, Section, Signature, with_each_text
from cmm_uq.certificate.plots.machine import machine_section
from cmm_uq.certificate.result import Outcome, Page, Result, StatedUncertainty
from cmm_uq.certificate.results.contents import results
from cmm_uq.certificate.results.provenance import COMPARED, NOT_COMPARED, REBUILT
from cmm_uq.certificate.sections import results as of_result
from cmm_uq.certificate.sections.conformity import (
    conformity_section,
    machine_alone,
    own_figures,
    performance,
    with_performance,
)
from cmm_uq.certificate.sections.method import method, posterior_section, warnings
from cmm_uq.certificate.sections.regions import regions_section, with_regions
from cmm_uq.certificate.wording import TEMPERATURES
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.logo import logo_of
from cmm_uq.jobs.tables.identification import MEASURED, SIMULATED, Identification, Laboratory
from cmm_uq.maths.uncertainty.quantity import nominal


def conditions(job: Job) -> Facts:
    """As stated, and the least and largest recorded temperatures; without rows where there are none."""
    columns, constant = job.points.columns, job.facts.recording.constant
    recorded = commas(
        say("{what} {value} {unit}, stated for the whole recording", what=what, value=signed(constant[name], ".2f"),
            unit=unit("°C")) if name in constant else
        say("{what} {low} to {high} {unit}", what=what, low=signed(float(columns[name].min()), ".2f"),
            high=signed(float(columns[name].max()), ".2f"), unit=unit("°C"))
        for name, what in TEMPERATURES.items() if name in columns
    )  # fmt: skip
    return document.facts(
        (say("Conditions"), Verbatim(job.facts.job.conditions)), (say("Temperatures recorded"), recorded)
    )


Row = tuple[Text, str]  # what a particular is, and what the job states of it; empty where it states nothing


def certificate_of(
    job: Job, sections: list[Section], warnings: tuple[Text, ...], produced_by: Text, files: tuple[Text, ...] = (),
    overview: Overview | None = None,
) -> Document:  # fmt: skip
    """Sections and warnings between what every certificate has; ``files`` are attached beside job and recording."""
    facts = job.facts
    name, date = Verbatim(facts.machine.name), day(facts.job.date)
    return formal_document(
        facts.job, facts.laboratory, job.inputs,
        (Verbatim(origins.file_name(origins.DIGITAL, job.origin)), *files), draft=clauses.draft(job),
        title=origins.CERTIFICATE,
        subject=say("{name}, {came_about} {date}", name=name, came_about=origins.came_about(job), date=date),
        particulars=_particulars(job), warnings=(*warnings, *clauses.formal_warnings(job)), overview=overview, decides=True,
        sections=tuple(sorted((one for one in sections if one.blocks), key=lambda one: (not one.first, one.opinion))),
        produced_by=produced_by,
    )  # fmt: skip


def formal_document(
    job: Identification, laboratory: Laboratory, inputs: Mapping[str, bytes], files: tuple[Text, ...] = (), *, draft: bool,
    authorised: bool = True, general: tuple[Text, ...] = clauses.STATEMENTS, **stated: Any,
) -> Document:  # fmt: skip
    """A document that the laboratory answers for, and signs where it is ``authorised``; ``stated``: see :class:`Document`.

    It is without keys of the job, which the laboratory reads from ``check``, the terminal and results.json.
    """
    statements = (*general, *((clauses.NOT_OURS,) if job.from_customer else ()))
    signature = Signature(Verbatim(laboratory.signatory), Verbatim(laboratory.signatory_role))
    found: Document = with_each_text(Document(
        number=Verbatim(job.number or job.id), date=job.issued or job.date, logo=logo_of(laboratory, inputs),
        issuer=tuple(Verbatim(line) for line in (laboratory.name, *laboratory.address.splitlines()) if line),
        statements=statements if authorised else (), signatures=(signature,) if authorised and laboratory.signatory else (),
        attachments=(*names(inputs), Verbatim("results.json"), *files, REBUILT),
        banner=clauses.DRAFT if draft else NOTHING, draft=draft, **stated,
    ), without_keys)  # fmt: skip
    return found


def _particulars(of: Job) -> tuple[Facts, ...]:
    facts, job, machine = of.facts, of.facts.job, of.facts.machine
    method, *others = performed(job)
    travel = [
        say("{axis}\u00a0{low}\u00a0…\u00a0{high}", axis=Verbatim(axis.upper()), low=nominal(ends[0]), high=nominal(ends[1]))
        for axis in "xyz" if (ends := getattr(machine.travel_mm, axis))
    ]  # fmt: skip
    traced = ((say("Traceability"), claimed(of).statement),) if of.origin == MEASURED else ()
    # no interval is recommended that the customer did not agree to (7.8.4.3)
    agreed = day(job.recalibration_agreed) if job.recalibration_agreed else NOTHING
    return grouped(
        (*identified(job, facts.laboratory, of.origin), (say("Next calibration, as agreed with the customer"), agreed)),
        (
            (say("Machine"), machine.name),
            (say("Manufacturer, model"), ", ".join(filter(None, (machine.manufacturer, machine.model)))),
            (say("Serial number"), machine.serial),
            (say("Owner"), machine.owner),
            (say("Measuring range"), say("{travel}\u00a0mm", travel=commas(travel)) if travel else NOTHING),
            (say("Place"), job.place),
        ),
        (method, *conditions(of).rows, *traced, *others),
    )


def grouped(*groups: tuple[Row, ...]) -> tuple[Facts, ...]:
    return tuple(Facts(rows) for group in groups if (rows := tuple((k, foreign(v)) for k, v in group if v)))


CERTIFICATE_NUMBER = say("Certificate number")


def identified(
    job: Identification, laboratory: Laboratory, origin: str, numbered: Text = CERTIFICATE_NUMBER
) -> tuple[Row, ...]:
    """Number, by what it is called, customer, order and dates of any certificate or report."""
    measured, of = origin == MEASURED, job.replaces
    replaced: tuple[Row, ...] = () if of is None else (  # why, and what changed (7.8.8)
        (say("Replaces certificate"), clauses.replaced_certificate(of)), (say("Reason for the replacement"), of.reason),
        (say("Changed against it"), of.changed), (COMPARED, NOT_COMPARED),
    )  # fmt: skip
    return (
        (numbered if measured else say("Job"), job.number if measured and job.number else job.id),
        *(replaced if measured else ()),
        (say("Customer"), "\n".join(filter(None, (job.customer, job.address)))),
        (say("Order"), job.order),
        (say("Accreditation"), laboratory.accreditation if measured else ""),
        (say("Date of measurement") if origin != SIMULATED else say("Date"), day(job.date)),
        (say("Date of receipt"), day(job.received) if job.received else ""),
        (say("Date of issue"), day(job.issued) if job.issued else ""),
    )


def performed(job: Identification) -> tuple[Row, ...]:
    return (
        (say("Method"), job.procedure), (say("Deviations from the method"), job.deviations),
        (say("Results of external providers"), job.external), (say("Data from the customer"), job.from_customer),
        (say("Operator"), job.operator), (say("Remarks"), job.remarks),
    )  # fmt: skip


def with_capability(result: Result) -> tuple[Result, StatedUncertainty]:
    """The result as a certificate states it, and what was raised; lengths are taken at the artefact's longest dimension."""
    longest = max((s.nominal for s in result.artefact.sizes if s.role == "dimension" and s.unit == "mm"), default=0.0)
    stating = StatedUncertainty.of(result.job, longest)
    reported = [size.name for size in result.artefact.sizes if size.role != "set-up"]
    stated = replace(
        result,
        parameters={effect: stating.all(effect, found) for effect, found in result.parameters.items()},
        sizes=dict(result.sizes) | stating.all("artefact", {name: result.sizes[name] for name in reported}),
        accuracy=stating.all("accuracy", result.accuracy),
        stating=stating,
    )
    own_figures(stated)  # what is raised of them is in the warning
    return stated, stating


def certified(result: Result, page: Page) -> Outcome:
    """What there is to write of a result: the certificate, complete but for its looks, and its figures."""
    result, stating = with_capability(result)
    own = (*warnings(result), *stating.warnings())
    warned = (*own, *clauses.formal_warnings(result.job))
    draws = origins.posterior_file(result.draws, result.job.origin) if len(result.draws) else None
    data = results(result) | of_result.as_found_data(result.job) | clauses.clauses_data(result.job) | stating.data()
    if draws is not None:
        data["posterior"] = draws.entry
    return Outcome(
        result, lambda: _certificate(result, page, own),
        with_performance(with_regions(page.with_further(result, data), result), result),
        of_result.summary(result, warned), warned, {draws.name: draws.content} if draws else {}, draws=result.draws,
        verdicts=result.verdicts,
        in_order=result.diagnosed.diagnosis.agrees,
    )  # fmt: skip


def _certificate(result: Result, page: Page, warned: tuple[Text, ...]) -> Document:
    job, posterior = result.job, result.posterior
    diagnosis = diagnosis_sections(result.diagnosed) if job.facts.job.diagnosis_on_certificate else ()
    sections = [
        *of_result.with_first(result, [*_ordered(result, page.sections(result)), *of_result.tolerance_sections(result)]),
        *filter(None, [machine_section(job.points.machine)]), method(result),
        *(replace(section, opinion=True) for section in (*diagnosis, posterior_section(result))),
    ]  # fmt: skip
    produced_by = say("{program}, {sampler}, seed {seed}", program=origins.program(job), sampler=Verbatim(posterior.sampler),
                      seed=posterior.seed)  # fmt: skip
    files = (Verbatim(origins.posterior_name(job.origin)),) if len(result.draws) else ()
    return certificate_of(job, sections, warned, produced_by, files, of_result.overview_of(result))


def _ordered(result: Result, own: list[Section]) -> list[Section]:
    """Results first (figures of lengths, else error factors, else the first of ``own``), then decisions and their basis."""
    figures, factors = performance(result), of_result.error_factors(result)
    decided, rests_on = conformity_section(result.statements, machine_alone(result)), traceability(result)
    before = of_result.as_found_section(result.job, of_result.quantities_left(result), result.verdicts)
    if figures.blocks:
        return [figures, decided, before, factors, regions_section(result), rests_on, *own]
    if factors.blocks:
        return [factors, decided, before, regions_section(result), rests_on, *own]
    return [*own[:1], decided, before, rests_on, *own[1:]]
