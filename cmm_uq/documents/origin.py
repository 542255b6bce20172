"""What a document says of a recording that nobody measured: on every page, in its title, in its file's name."""

from __future__ import annotations

from dataclasses import replace
from pathlib import PurePosixPath

from cmm_uq.documents.document import Document
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.origin import COMPENSATED, MEASURED, SIMULATED

BANNERS = {
    SIMULATED: "SIMULATED RECORDING, not a calibration certificate",
    COMPENSATED: "COMPENSATED RECORDING, not a calibration certificate",
}
TITLES = {SIMULATED: "Evaluation of a simulated recording", COMPENSATED: "Evaluation of a compensated recording"}
_WHAT = {
    SIMULATED: "The recording was simulated: no machine was measured, and nothing here certifies one.",
    COMPENSATED: "The coordinates were corrected by computation: nothing here certifies what the machine indicates.",
}


def file_name(name: str, origin: str) -> str:
    """Name of a document, with the origin of a recording that was not measured: ``certificate-simulated.pdf``."""
    path = PurePosixPath(name)
    return name if origin == MEASURED else f"{path.stem}-{origin}{path.suffix}"


def marked(document: Document, job: Job) -> Document:
    """The document with its origin on every page; as it is where the recording was measured.

    Nobody signs for such a recording, it has no certificate's number, and its first warning says what it is.
    """
    warnings = (*origin_warnings(job), *document.warnings)
    if job.origin == MEASURED:
        return replace(document, warnings=warnings)
    is_certificate = document.title == CERTIFICATE
    return replace(
        document,
        title=TITLES[job.origin] if is_certificate else f"{document.title} of a {job.origin} recording",
        number=job.facts.job.id,
        banner=BANNERS[job.origin],
        warnings=warnings,
        statements=(),
        signatures=(),
        end="End of evaluation" if is_certificate else document.end,
    )


CERTIFICATE = "Calibration certificate"
"""Title of a document that certifies."""


def came_about(job: Job) -> str:
    """The word before the date of a recording."""
    return "simulated, dated" if job.origin == SIMULATED else "measured on"


def origin_warnings(job: Job) -> list[str]:
    """What the reader must know of where the recording comes from."""
    if job.origin == MEASURED:
        return []
    source = job.facts.job.derived_from
    told = f" It was derived from job {source.job} by {source.program} ({source.by})." if source else ""
    texts = [_WHAT[job.origin] + told]
    if job.altered:
        texts.append(f"Changed after it was derived: {', '.join(job.altered)}.")
    return texts
