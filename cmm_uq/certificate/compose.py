"""From a result to the document that certifies it: the sections in the order in which a customer asks for them."""

from __future__ import annotations

from dataclasses import replace

from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.certificate import tolerance_section
from cmm_uq.certificate.as_found_section import as_found_data, as_found_section, quantities_left
from cmm_uq.certificate.capability import with_capability
from cmm_uq.certificate.certificate import certificate_of
from cmm_uq.certificate.clauses import clauses_data
from cmm_uq.certificate.completeness import formal_warnings
from cmm_uq.certificate.conformity_section import conformity_section
from cmm_uq.certificate.diagnosis.page import diagnosis_sections
from cmm_uq.certificate.document import Document, Section
from cmm_uq.certificate.first_page import overview_of, with_first
from cmm_uq.certificate.method_section import method, posterior_section
from cmm_uq.certificate.outcome import Outcome, Page
from cmm_uq.certificate.posterior_file import posterior_file, posterior_name
from cmm_uq.certificate.program import program
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.results_file import results
from cmm_uq.certificate.results_section import error_factors, performance
from cmm_uq.certificate.summary import summary
from cmm_uq.certificate.traceability_section import traceability
from cmm_uq.certificate.warning import warnings


def certified(result: Result, page: Page) -> Outcome:
    """What there is to write of a result: the certificate, complete but for its looks, and its figures.

    Parameters
    ----------
    result : of the analysis.
    page : what its kind adds.
    """
    result, stating = with_capability(result)
    told = (*warnings(result), *stating.warnings())
    warned = (*told, *formal_warnings(result.job))
    draws = posterior_file(result.draws, result.job.origin) if len(result.draws) else None
    data = (
        results(result)
        | as_found_data(result.job)
        | clauses_data(result.job)
        | stating.data()
        | ({} if draws is None else {"posterior": draws.entry})
    )
    return Outcome(
        result, lambda: _certificate(result, page, told), page.with_further(result, data), summary(result, warned), warned,
        {draws.name: draws.content} if draws else {}, draws=result.draws, verdicts=result.verdicts,
        in_order=result.diagnosed.diagnosis.verdict == "consistent",
    )  # fmt: skip


def _certificate(result: Result, page: Page, told: tuple[Text, ...]) -> Document:
    diagnosis = diagnosis_sections(result.diagnosed) if result.job.facts.job.diagnosis_on_certificate else ()
    sections = [
        *with_first(result, [*_ordered(result, page.sections(result)), *tolerance_section.sections(result)]), method(result),
        *(replace(section, opinion=True) for section in (*diagnosis, posterior_section(result))),
    ]  # fmt: skip
    produced_by = say(
        "{program}, {sampler}, seed {seed}",
        program=program(result.job),
        sampler=Verbatim(result.posterior.sampler),
        seed=result.posterior.seed,
    )
    files = (Verbatim(posterior_name(result.job.origin)),) if len(result.draws) else ()
    return certificate_of(result.job, sections, told, produced_by, files, overview_of(result))


def _ordered(result: Result, own: list[Section]) -> list[Section]:
    """Results first, then what is decided on them and what they rest on, then what else the kind shows (``own``).

    The results of an artefact without lengths are the error factors, and without these the first of the kind's own sections.
    """
    figures, factors, decided = performance(result), error_factors(result), conformity_section(result.statements)
    before = as_found_section(result.job, quantities_left(result), result.verdicts)
    rests_on = traceability(result)
    if figures.blocks:
        return [figures, decided, before, factors, rests_on, *own]
    if factors.blocks:
        return [factors, decided, before, rests_on, *own]
    return [*own[:1], decided, before, rests_on, *own[1:]]
