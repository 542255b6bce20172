"""From a job folder to its certificate, or its diagnosis: analyse, compose, write."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from cmm_uq.commands import analysis, diagnosing
from cmm_uq.commands.reading import read_job
from cmm_uq.diagnosis.diagnosis import FALSE_ALARMS
from cmm_uq.documents.outcome import Found, Outcome
from cmm_uq.errors import CmmUqError
from cmm_uq.jobs.job import Job
from cmm_uq.writing import Owner, staged

Stage = Callable[[str, float], None]
"""Told what is being done, and the part of the whole that is done."""

REPORTS = Path("reports")
CERTIFICATE, DIAGNOSIS = ("certificate.html", "certificate.pdf"), "diagnosis.html"


@dataclass(frozen=True, eq=False)
class Report:
    """A written report.

    Parameters
    ----------
    result : what was found.
    summary : rows of what, figure and remark.
    conforming : see :class:`~cmm_uq.documents.outcome.Outcome`.
    results : contents of results.json.
    files : what was written, by name.
    """

    result: Found
    summary: tuple[tuple[str, ...], ...]
    conforming: bool
    results: bytes
    files: dict[str, Path]


def write_report(
    job: Path, out: Path | None = None, *, seed: int = 0, force: bool = False, stage: Stage | None = None
) -> Report:
    """Analyse a job and write ``certificate.html``, ``certificate.pdf`` and ``results.json``, all or none.

    A kind may add files of its own. Documents of a recording that was not measured carry its origin in their names.

    Parameters
    ----------
    job : the job folder.
    out : where to write; ``reports/<job id>`` by default.
    seed : of everything random.
    force : keep what stands in the way as ``NAME.previous`` instead of refusing.
    stage : told of progress.

    Raises
    ------
    CmmUqError : the job cannot be analysed, or something in the folder that this command did not write for this job.
    OutputError : the folder cannot be written to.
    """
    tell = stage or (lambda what, part: None)
    tell("Reading the job", 0.0)
    read = read_job(job)
    recipe = analysis.recipe_of(read)
    owner = Owner("report", read.facts.job.id, read.origin)
    with staged(
        out or REPORTS / owner.job, owner, inputs=read.paths, force=force, expected=_names(read, *CERTIFICATE)
    ) as place:
        result = recipe.analyse(read, seed=seed, progress=lambda part: tell("Sampling the posterior", 0.1 + 0.4 * part))
        tell("Composing the certificate", 0.5)
        outcome = recipe.outcome(result, seed)
        contents = _contents(outcome, tell)
        tell("Writing", 0.95)
        files = place.write(contents)
    tell("Done", 1.0)
    return Report(result, outcome.summary, outcome.conforming, contents["results.json"], files)


@dataclass(frozen=True, eq=False)
class WrittenDiagnosis:
    """A written diagnosis: what was found, rows of its summary, whether all is well, results.json, and the files."""

    diagnosed: Found
    summary: tuple[tuple[str, ...], ...]
    conforming: bool
    results: bytes
    files: dict[str, Path]


def write_diagnosis(
    job: Path,
    out: Path | None = None,
    *,
    seed: int = 0,
    alpha: float = FALSE_ALARMS,
    force: bool = False,
    stage: Stage | None = None,
) -> WrittenDiagnosis:
    """Diagnose a job and write ``diagnosis.html`` and ``results.json``, both or none.

    Parameters
    ----------
    job : the job folder.
    out : where to write; ``reports/<job id>/diagnosis`` by default.
    seed : of everything random.
    alpha : rate of false alarms.
    force : keep what stands in the way as ``NAME.previous`` instead of refusing.
    stage : told of progress.

    Raises
    ------
    CmmUqError : the job cannot be diagnosed, or something in the folder that this command did not write for this job.
    OutputError : the folder cannot be written to.
    """
    tell = stage or (lambda what, part: None)
    read = read_job(job)
    owner = Owner("diagnose", read.facts.job.id, read.origin)
    folder = out or REPORTS / owner.job / "diagnosis"
    with staged(folder, owner, inputs=read.paths, force=force, expected=_names(read, DIAGNOSIS)) as place:
        tell("Searching for what was left out", 0.0)
        found = diagnosing.diagnose_read(
            read, seed=seed, alpha=alpha, progress=lambda part: tell("Sampling", 0.7 + 0.2 * part)
        )
        tell("Composing the page", 0.9)
        outcome = diagnosing.diagnosis_outcome(found, seed)
        contents = _diagnosis_contents(outcome)
        files = place.write(contents)
    tell("Done", 1.0)
    return WrittenDiagnosis(found, outcome.summary, outcome.conforming, contents["results.json"], files)


def _names(job: Job, *documents: str) -> list[str]:
    """Names of the documents that will be written, and of the results."""
    from cmm_uq.documents.origin import file_name

    return [*(file_name(document, job.origin) for document in documents), "results.json"]


def _diagnosis_contents(outcome: Outcome) -> dict[str, bytes]:
    from cmm_uq.documents.html import render_html
    from cmm_uq.documents.origin import marked
    from cmm_uq.documents.results_file import as_json

    job = outcome.found.job
    page, results = _names(job, DIAGNOSIS)
    return {page: render_html(marked(outcome.document, job)).encode(), results: as_json(outcome.results)}


def _contents(outcome: Outcome, tell: Stage) -> dict[str, bytes]:
    from cmm_uq.documents.html import render_html
    from cmm_uq.documents.origin import marked
    from cmm_uq.documents.pdf import render_pdf
    from cmm_uq.documents.results_file import as_json

    job, data = outcome.found.job, as_json(outcome.results)
    document = marked(outcome.document, job)
    for name in outcome.files.keys() & job.inputs.keys():
        raise CmmUqError("has the name of a file that this command writes", where=str(job.folder / name),
                         fix="Rename it, in job.toml too")  # fmt: skip
    tell("Rendering", 0.8)
    pdf = render_pdf(document, {**job.inputs, "results.json": data, **outcome.files})
    html_name, pdf_name, results_name = _names(job, *CERTIFICATE)
    return {html_name: render_html(document).encode(), pdf_name: pdf, results_name: data, **outcome.files}
