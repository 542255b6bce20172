"""The page of a part: its characteristics with their uncertainty, what the limits make of them, and where it comes from."""

from __future__ import annotations

from cmm_uq.base.messages import NOTHING, Text, Verbatim, day, names, say
from cmm_uq.certificate.certificate import (
    grouped,
    identified,
    in_words,
    issuer_of,
    performed,
    signatures_of,
    statements_of,
)
from cmm_uq.certificate.clauses import DRAFT, Requirement, asked, not_stated, of_every_report
from cmm_uq.certificate.document import Document, Facts
from cmm_uq.certificate.part.budget_section import budget_section, unseen_section, ways_section
from cmm_uq.certificate.part.found import PartFound
from cmm_uq.certificate.part.machine_section import certificate_rows, machine_section
from cmm_uq.certificate.part.method import method_section, not_covered_section, program_words
from cmm_uq.certificate.part.methods import methods_section
from cmm_uq.certificate.part.overview import overview_of, part_words
from cmm_uq.certificate.part.pictured import errors_section, part_section
from cmm_uq.certificate.part.results_section import conformity_section, correlation_section, results_section
from cmm_uq.certificate.results.provenance import FILE as PROVENANCE
from cmm_uq.jobs.logo import logo_of
from cmm_uq.jobs.origin import MEASURED

TITLE = say("Measurement report")
PLANNED = say("Measurement uncertainty")


def part_document(found: PartFound) -> Document:
    """Its page.

    Parameters
    ----------
    found : all that it says.
    """
    facts = found.job.facts
    measured = found.measured is not None
    lacking = lacking_of(found)
    sections = (
        results_section(found),
        conformity_section(found),
        part_section(found),
        errors_section(found),
        budget_section(found),
        unseen_section(found),
        ways_section(found),
        methods_section(found.methods),
        correlation_section(found),
        machine_section(found),
        method_section(found),
        not_covered_section(found),
    )
    date = day(facts.job.date)
    came = say("measured on {date}", date=date) if measured else say("planned for {date}", date=date)
    return in_words(Document(
        title=TITLE if measured else PLANNED,
        number=Verbatim(facts.job.number or facts.job.id),
        subject=say("{part}, {came}", part=part_words(found), came=came),
        issuer=issuer_of(facts.laboratory),
        logo=logo_of(facts.laboratory, found.job.inputs),
        particulars=_particulars(found),
        warnings=(*found.warnings, *not_stated(lacking)),
        sections=tuple(section for section in sections if section.blocks),
        statements=statements_of(facts.job) if measured else (),
        signatures=signatures_of(facts.laboratory) if measured else (),
        attachments=(*names(found.job.inputs), Verbatim("results.json"), Verbatim(PROVENANCE)),
        produced_by=say("{program}, seed {seed}", program=program_words(), seed=found.seed),
        date=facts.job.issued or facts.job.date,
        end=say("End of report"),
        banner=DRAFT if lacking else NOTHING,
        overview=overview_of(found),
        draft=bool(lacking),
    ))  # fmt: skip


def lacking_of(found: PartFound) -> tuple[Requirement, ...]:
    """What ISO/IEC 17025:2017, 7.8 asks of every report and the job does not state; nothing is asked where nobody measured."""
    facts = found.job.facts
    if found.measured is None or facts.job.origin != MEASURED:
        return ()
    item = asked("7.8.2.1 g", say("serial number of the part"), facts.part.serial, "[part] serial")
    every = (
        *of_every_report(facts.job, facts.laboratory, TITLE, item),
        asked("7.8.4.1 b", say("conditions"), facts.job.conditions, "[job] conditions"),
    )
    return tuple(one for one in every if one.status == "missing")


def _particulars(found: PartFound) -> tuple[Facts, ...]:
    facts = found.job.facts
    job, part = facts.job, facts.part
    expansion: Text = NOTHING
    if part.cte_per_k:
        expansion = say("{cte:g} × 10⁻⁶ /K", cte=part.cte_per_k * 1e6)
    if part.cte_per_k and part.u_cte_per_k:
        expansion = say("{expansion}, u = {u:g} × 10⁻⁶ /K", expansion=expansion, u=part.u_cte_per_k * 1e6)
    return grouped(
        identified(job, facts.laboratory, job.origin, say("Report number")),
        (
            (say("Part"), part.name),
            (say("Drawing"), part.drawing),
            (say("Serial number"), part.serial),
            (say("Owner"), part.owner),
            (say("Material"), part.material),
            (say("Thermal expansion"), expansion),
            (say("Place"), job.place),
        ),
        certificate_rows(found.standing),
        (*performed(job), (say("Conditions"), job.conditions)),
    )
