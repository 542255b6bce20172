"""Pages for the laboratory's own use: a diagnosis, a plan. No certificate: nobody signs, nothing is stated."""

from __future__ import annotations

from collections.abc import Iterable

from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.certificate.document import Document, Facts, Overview, Section
from cmm_uq.jobs.job import JobFile


def working_page(
    facts: JobFile,
    title: Text,
    subject: Text,
    *,
    particulars: tuple[Facts, ...],
    warnings: Iterable[Text],
    sections: Iterable[Section],
    produced_by: Text,
    end: Text = say("End of diagnosis"),
    attachments: tuple[Text, ...] = (),
    overview: Overview | None = None,
) -> Document:
    """A document about a job, without the sections that have nothing to say; see :class:`Document`."""
    return Document(
        title=title,
        number=Verbatim(facts.job.id),
        subject=say("{name}, {subject}", name=Verbatim(facts.machine.name), subject=subject),
        issuer=tuple(Verbatim(line) for line in (facts.laboratory.name,) if line),
        particulars=particulars,
        warnings=tuple(warnings),
        sections=tuple(section for section in sections if section.blocks),
        statements=(),
        signatures=(),
        attachments=attachments,
        produced_by=produced_by,
        date=facts.job.date,
        end=end,
        overview=overview,
    )
