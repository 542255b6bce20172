"""What every certificate has (ISO/IEC 17025:2017, 7.8): particulars, results, statements, and opinions in an annex."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import Any

from cmm_uq.base.messages import NOTHING, Text, Verbatim, commas, day, foreign, names, say, without_keys
from cmm_uq.certificate.clauses import DRAFT, NOT_OURS, STATEMENTS, draft, replaced_certificate
from cmm_uq.certificate.completeness import formal_warnings
from cmm_uq.certificate.conditions import conditions
from cmm_uq.certificate.document import Document, Facts, Overview, Section, Signature
from cmm_uq.certificate.origin import CERTIFICATE, DIGITAL, came_about, file_name
from cmm_uq.certificate.provenance import FILE as PROVENANCE
from cmm_uq.certificate.reissue import COMPARED, NOT_COMPARED
from cmm_uq.certificate.traceability_section import claimed
from cmm_uq.jobs.identification import Identification
from cmm_uq.jobs.job import Job, JobFacts, JobFile
from cmm_uq.jobs.laboratory import Laboratory
from cmm_uq.jobs.logo import logo_of
from cmm_uq.jobs.origin import MEASURED, SIMULATED
from cmm_uq.maths.uncertainty.rounding import nominal

Row = tuple[Text, str]
"""What a particular is, and what the job states of it; empty where it states nothing."""


def certificate_of(
    job: Job,
    sections: list[Section],
    told: tuple[Text, ...],
    produced_by: Text,
    files: tuple[Text, ...] = (),
    overview: Overview | None = None,
) -> Document:
    """Sections and warnings between what every certificate has.

    Parameters
    ----------
    job : that was analysed.
    sections : of which the first page shows those that are marked.
    told : warnings on the results; those on what the job does not state follow them.
    produced_by : program, sampler and seed.
    files : attached beside job and recording.
    overview : what every statement of conformity comes to.
    """
    facts = job.facts
    return in_words(Document(
        title=CERTIFICATE,
        number=Verbatim(facts.job.number or facts.job.id),
        subject=say(
            "{name}, {came_about} {date}",
            name=Verbatim(facts.machine.name),
            came_about=came_about(job),
            date=day(facts.job.date),
        ),
        issuer=issuer_of(facts.laboratory),
        particulars=_particulars(job),
        warnings=(*told, *formal_warnings(job)),
        sections=tuple(sorted((one for one in sections if one.blocks), key=lambda one: (not one.first, one.opinion))),
        statements=statements_of(facts.job),
        signatures=signatures_of(facts.laboratory),
        attachments=(
            *names(job.inputs), Verbatim("results.json"), Verbatim(file_name(DIGITAL, job.origin)), *files,
            Verbatim(PROVENANCE),
        ),
        produced_by=produced_by,
        date=facts.job.issued or facts.job.date,
        banner=DRAFT if draft(job) else NOTHING,
        draft=draft(job),
        logo=logo_of(facts.laboratory, job.inputs),
        overview=overview,
        decides=True,
    ))  # fmt: skip


def in_words(document: Document) -> Document:
    """The document without keys of the job, which the laboratory reads from ``check``, the terminal and results.json."""
    made: Document = _in_words(document)
    return made


def _in_words(value: Any) -> Any:
    if isinstance(value, Text):
        return without_keys(value)
    if isinstance(value, tuple):
        return tuple(map(_in_words, value))
    if is_dataclass(value) and not isinstance(value, type):
        return replace(value, **{field.name: _in_words(getattr(value, field.name)) for field in fields(value)})
    return value


def _particulars(of: Job) -> tuple[Facts, ...]:
    facts, job, machine = of.facts, of.facts.job, of.facts.machine
    method, *others = performed(job)
    return grouped(
        (
            *identified(job, facts.laboratory, job.origin),
            (say("Next calibration, as agreed with the customer"), _agreed(job)),
        ),
        (
            (say("Machine"), machine.name),
            (say("Manufacturer, model"), ", ".join(filter(None, (machine.manufacturer, machine.model)))),
            (say("Serial number"), machine.serial),
            (say("Owner"), machine.owner),
            (say("Measuring range"), _travel(facts)),
            (say("Place"), job.place),
        ),
        (method, *conditions(of).rows, *_traced(of), *others),
    )


def _traced(job: Job) -> tuple[Row, ...]:
    return ((say("Traceability"), claimed(job).statement),) if job.origin == MEASURED else ()


def grouped(*groups: tuple[Row, ...]) -> tuple[Facts, ...]:
    """Particulars, without what a job does not state."""
    return tuple(Facts(rows) for group in groups if (rows := tuple((k, foreign(v)) for k, v in group if v)))


CERTIFICATE_NUMBER = say("Certificate number")


def identified(
    job: Identification, laboratory: Laboratory, origin: str, numbered: Text = CERTIFICATE_NUMBER
) -> tuple[Row, ...]:  # fmt: skip
    """Number, by what it is called, customer, order and dates of any certificate or report."""
    measured = origin == MEASURED
    return (
        (numbered if measured else say("Job"), job.number if measured and job.number else job.id),
        *(_replacement(job) if measured else ()),
        (say("Customer"), "\n".join(filter(None, (job.customer, job.address)))),
        (say("Order"), job.order),
        (say("Accreditation"), laboratory.accreditation if measured else ""),
        (say("Date of measurement") if origin != SIMULATED else say("Date"), day(job.date)),
        (say("Date of receipt"), day(job.received) if job.received else ""),
        (say("Date of issue"), day(job.issued) if job.issued else ""),
    )


def performed(job: Identification) -> tuple[Row, ...]:
    """How, by whom, and with whose data anything was measured."""
    return (
        (say("Method"), job.procedure),
        (say("Deviations from the method"), job.deviations),
        (say("Results of external providers"), job.external),
        (say("Data from the customer"), job.from_customer),
        (say("Operator"), job.operator),
        (say("Remarks"), job.remarks),
    )


def issuer_of(laboratory: Laboratory) -> tuple[Text, ...]:
    """Name and address, a line each."""
    return tuple(Verbatim(line) for line in (laboratory.name, *laboratory.address.splitlines()) if line)


def signatures_of(laboratory: Laboratory) -> tuple[Signature, ...]:
    """Who authorises, where it is stated."""
    if not laboratory.signatory:
        return ()
    return (Signature(Verbatim(laboratory.signatory), Verbatim(laboratory.signatory_role)),)


def statements_of(job: Identification) -> tuple[Text, ...]:
    """What stands before the signatures."""
    return (*STATEMENTS, NOT_OURS) if job.from_customer else STATEMENTS


def _replacement(job: Identification) -> tuple[tuple[Text, str], ...]:
    """Which certificate this one replaces, why, and what changed (7.8.8)."""
    replaced = job.replaces
    if replaced is None:
        return ()
    return (
        (say("Replaces certificate"), replaced_certificate(replaced)),
        (say("Reason for the replacement"), replaced.reason),
        (say("Changed against it"), replaced.changed),
        (COMPARED, NOT_COMPARED),
    )


def _travel(facts: JobFile) -> Text:
    travel = [
        say(
            "{axis}\u00a0{low}\u00a0…\u00a0{high}",
            axis=Verbatim(axis.upper()),
            low=nominal(given[0]),
            high=nominal(given[1]),
        )
        for axis in "xyz"
        if (given := getattr(facts.machine.travel_mm, axis))
    ]
    return say("{travel} mm", travel=commas(travel)) if travel else NOTHING


def _agreed(job: JobFacts) -> Text:
    """No interval is recommended that the customer did not agree to (7.8.4.3)."""
    return day(job.recalibration_agreed) if job.recalibration_agreed else NOTHING
