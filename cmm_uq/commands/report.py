"""From a job folder to its certificate: analyse, compose, write."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from cmm_uq.commands.analysis import analyse, outcome_of
from cmm_uq.commands.diagnosing import diagnose_folder, diagnosis_outcome
from cmm_uq.diagnosis.diagnosis import FALSE_ALARMS
from cmm_uq.documents.outcome import Found, Outcome
from cmm_uq.writing import staging, write_whole

Stage = Callable[[str, float], None]
"""Told what is being done, and the part of the whole that is done."""


@dataclass(frozen=True, eq=False)
class Report:
    """A written report.

    Parameters
    ----------
    result : what was found.
    summary : rows of what, figure and remark.
    results : contents of results.json.
    files : what was written, by name.
    """

    result: Found
    summary: tuple[tuple[str, ...], ...]
    results: bytes
    files: dict[str, Path]


def write_report(job: Path, out: Path | None = None, *, seed: int = 0, stage: Stage | None = None) -> Report:
    """Analyse a job and write ``certificate.html``, ``certificate.pdf`` and ``results.json``, all or none.

    A kind may add files of its own.

    Parameters
    ----------
    job : the job folder.
    out : where to write; ``reports/<job id>`` by default.
    seed : of everything random.
    stage : told of progress.

    Raises
    ------
    CmmUqError : the job cannot be analysed, or the folder cannot be written to.
    """
    tell = stage or (lambda what, part: None)
    with ExitStack() as stack:
        place = stack.enter_context(staging(out)) if out else None
        tell("Reading the job", 0.0)
        result = analyse(job, seed=seed, progress=lambda part: tell("Sampling the posterior", 0.1 + 0.4 * part))
        folder = out or Path("reports") / result.job.facts.job.id
        place = place or stack.enter_context(staging(folder))
        tell("Composing the certificate", 0.5)
        outcome = outcome_of(result, seed)
        contents = _contents(outcome, tell)
        tell("Writing", 0.95)
        files = write_whole(place, folder, contents)
    tell("Done", 1.0)
    return Report(result, outcome.summary, contents["results.json"], files)


@dataclass(frozen=True, eq=False)
class WrittenDiagnosis:
    """A written diagnosis: what was found, rows of its summary, contents of results.json, and what was written, by name."""

    diagnosed: Found
    summary: tuple[tuple[str, ...], ...]
    results: bytes
    files: dict[str, Path]


def write_diagnosis(
    job: Path, out: Path | None = None, *, seed: int = 0, alpha: float = FALSE_ALARMS, stage: Stage | None = None
) -> WrittenDiagnosis:
    """Diagnose a job and write ``diagnosis.html`` and ``results.json``, both or none.

    Parameters
    ----------
    job : the job folder.
    out : where to write; ``reports/<job id>`` by default.
    seed : of everything random.
    alpha : rate of false alarms.
    stage : told of progress.

    Raises
    ------
    CmmUqError : the job cannot be diagnosed, or the folder cannot be written to.
    """
    tell = stage or (lambda what, part: None)
    with ExitStack() as stack:
        place = stack.enter_context(staging(out)) if out else None
        tell("Searching for what was left out", 0.0)
        found = diagnose_folder(job, seed=seed, alpha=alpha, progress=lambda part: tell("Sampling", 0.7 + 0.2 * part))
        folder = out or Path("reports") / found.job.facts.job.id
        place = place or stack.enter_context(staging(folder))
        tell("Composing the page", 0.9)
        from cmm_uq.documents.html import render_html
        from cmm_uq.documents.results_file import as_json

        outcome = diagnosis_outcome(found, seed)
        data = as_json(outcome.results)
        contents = {"diagnosis.html": render_html(outcome.document).encode(), "results.json": data}
        files = write_whole(place, folder, contents)
    tell("Done", 1.0)
    return WrittenDiagnosis(found, outcome.summary, data, files)


def _contents(outcome: Outcome, tell: Stage) -> dict[str, bytes]:
    from cmm_uq.documents.html import render_html
    from cmm_uq.documents.pdf import render_pdf
    from cmm_uq.documents.results_file import as_json

    data = as_json(outcome.results)
    tell("Rendering", 0.8)
    pdf = render_pdf(outcome.document, {**outcome.found.job.inputs, "results.json": data, **outcome.files})
    page = render_html(outcome.document).encode()
    return {"certificate.html": page, "certificate.pdf": pdf, "results.json": data, **outcome.files}
