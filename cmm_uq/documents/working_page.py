"""Pages for the laboratory's own use: a diagnosis, a plan. No certificate: nobody signs, nothing is stated."""

from __future__ import annotations

from collections.abc import Iterable

from cmm_uq.documents.document import Document, Facts, Section
from cmm_uq.jobs.job import JobFile


def working_page(
    facts: JobFile,
    title: str,
    subject: str,
    *,
    particulars: tuple[Facts, ...],
    warnings: Iterable[str],
    sections: Iterable[Section],
    produced_by: str,
    end: str = "End of diagnosis",
    attachments: tuple[str, ...] = (),
) -> Document:
    """A document about a job, without the sections that have nothing to say; see :class:`Document`."""
    return Document(
        title=title,
        number=facts.job.id,
        subject=f"{facts.machine.name}, {subject}",
        issuer=tuple(line for line in (facts.laboratory.name,) if line),
        particulars=particulars,
        warnings=tuple(warnings),
        sections=tuple(section for section in sections if section.blocks),
        statements=(),
        signatures=(),
        attachments=attachments,
        produced_by=produced_by,
        date=facts.job.date,
        end=end,
    )
