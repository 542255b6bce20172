"""From a part's job to its page and ``results.json``, written as one set."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from cmm_uq.app.commands.files import REPORTS, RESULTS, Finished, Stage, silent, unchanged
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.languages.translation import Code
from cmm_uq.base.messages import Text, say
from cmm_uq.base.output import Owner, staged
from cmm_uq.certificate.origin import file_name
from cmm_uq.certificate.plots.style import fonts_of
from cmm_uq.certificate.results.provenance import FILE as PROVENANCE, Behind, provenance_of
from cmm_uq.jobs.part.job import PartJob, read_part
from cmm_uq.jobs.tables.origin import SIMULATED

if TYPE_CHECKING:
    from cmm_uq.app.commands.parts.part import PartOptions
    from cmm_uq.certificate.document import Document
    from cmm_uq.certificate.part.measurement import PartMeasurement
    from cmm_uq.certificate.wording import Summary

DOCUMENTS = ("part.html", "part.pdf")
COMMAND = "part"


@dataclass(frozen=True, eq=False)
class WrittenPart:
    """What was found of a part, contents of results.json, and what was written, by name."""

    found: PartMeasurement
    results: bytes
    files: Mapping[str, Path] = field(default_factory=dict)
    recorded: str = ""

    @property
    def summary(self) -> Summary:
        """For the end of the command."""
        from cmm_uq.certificate.part.figures import part_summary

        return part_summary(self.found)

    @property
    def conforming(self) -> bool:
        return self.found.conforming

    @property
    def name(self) -> str:
        """Id of the job."""
        return self.found.job.facts.job.id

    @property
    def origin(self) -> str:
        """Of the recording."""
        return self.found.job.facts.job.origin


def in_language(job: PartJob, language: Code | None) -> PartJob:
    """A job whose page is to be said in a language; without one as job.toml has it."""
    if language is None:
        return job
    told = job.facts.job.model_copy(update={"language": language})
    return replace(job, facts=job.facts.model_copy(update={"job": told}))


def write_part(
    folder: Path, out: Path | None = None, *, options: PartOptions | None = None, force: bool = False, stage: Stage = silent,
    language: Code | None = None,
) -> WrittenPart:  # fmt: skip
    """Evaluate a part's job and write ``part.html``, ``part.pdf``, ``results.json`` and what comes with them, all or none.

    ``out``: where to write; ``reports/<job id>`` by default. ``force``: keep what stands in the way as ``NAME.previous``
    instead of refusing.
    """
    from cmm_uq.app.commands.parts.part import evaluate_part

    stage("Reading the job", 0.0)
    job = in_language(read_part(folder), language)
    return written(job, lambda: evaluate_part(job, options, stage), out, force=force, stage=stage)


def written(
    job: PartJob,
    evaluate: Callable[[], PartMeasurement],
    out: Path | None = None,
    *,
    force: bool = False,
    stage: Stage = silent,
) -> WrittenPart:
    """Make sure of the folder, then evaluate, render and write, all or none."""
    facts = job.facts.job
    fonts_of(facts.language)  # refused before anything is computed
    folder = REPORTS / facts.id if out is None else out
    names = [file_name(name, facts.origin) for name in DOCUMENTS]
    owner, inputs = Owner(COMMAND, facts.id, facts.origin), tuple(job.folder / name for name in job.inputs)
    with staged(folder, owner, inputs=inputs, force=force, expected=(*names, RESULTS, PROVENANCE)) as place:
        measurement = evaluate()
        contents = contents_of(measurement, stage)
        stage(f"Writing: {len(contents)} files to {folder}", 0.95)
        files = place.write(contents)
    stage("Done", 1.0)
    return WrittenPart(measurement, contents[RESULTS], files)


def contents_of(found: PartMeasurement, stage: Stage = silent, *, finished: Finished = unchanged) -> dict[str, bytes]:
    """Bytes of every file, by name."""
    from cmm_uq.certificate.origin import as_json
    from cmm_uq.certificate.part.results import part_results
    from cmm_uq.certificate.render.html import render_html
    from cmm_uq.certificate.render.pdf import render_pdf

    job = found.job
    if RESULTS in job.inputs:
        raise CmmUqError("has the name of a file that this command writes", where=str(job.folder / RESULTS),
                         fix="Put the machine's results into a folder of their own")  # fmt: skip
    html, pdf = (file_name(name, job.facts.job.origin) for name in DOCUMENTS)
    results = part_results(found)
    data = as_json(results)
    stage("Composing the page", 0.88)
    document = document_of(found)
    stage("Rendering", 0.92)
    page = render_html(document).encode()
    behind = provenance_of(_behind(found), results, {html: page, RESULTS: data})
    further = {RESULTS: data, PROVENANCE: finished(PROVENANCE, behind)}
    return {html: page, pdf: render_pdf(document, {**job.inputs, **further}), **further, **found.files}


def _behind(found: PartMeasurement) -> Behind:
    facts, standing = found.job.facts, found.standing
    recording = "" if facts.recording is None else facts.recording.file
    return Behind(COMMAND, facts.job, facts.laboratory, facts.job.origin, found.job.inputs, recording,
                  (standing.number, standing.laboratory))  # fmt: skip


def document_of(found: PartMeasurement) -> Document:
    """The page, in the job's language, marked where nobody measured."""
    from cmm_uq.certificate.document import translated as said
    from cmm_uq.certificate.origin import marked_as
    from cmm_uq.certificate.part.page import part_document
    from cmm_uq.certificate.plots.style import lettered_in

    facts = found.job.facts.job
    with lettered_in(facts.language):
        document = part_document(found)
    return said(marked_as(document, facts.origin, facts.id, origin_told(found.job)), facts.language)


def origin_told(job: PartJob) -> list[Text]:
    """What must be known of a job whose figures nobody measured."""
    if job.facts.job.origin != SIMULATED:
        return []
    return [
        say("Figures of this job are simulated or an example's: no part was measured, and nothing here certifies one.")
    ]
