"""From a job folder to its certificate, or its diagnosis: analyse, compose, write."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from cmm_uq.analysis import PlaneShiftResult, Result, ShiftResult, analyse_job
from cmm_uq.analysis.diagnosing import diagnose_read
from cmm_uq.analysis.error_maps import MapsDiagnosed
from cmm_uq.analysis.refusals import refuse
from cmm_uq.analysis.result import Diagnosed
from cmm_uq.jobs.job import SHIFT, Job
from cmm_uq.jobs.reading import read_job
from cmm_uq.mismatch.diagnosis import FALSE_ALARMS
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
    results : contents of results.json.
    files : what was written, by name.
    """

    result: Result | ShiftResult | PlaneShiftResult
    results: bytes
    files: dict[str, Path]

    @property
    def conforming(self) -> bool:
        """Whether every statement of conformity is a pass, and the recording agrees with the model that the job names."""
        if not isinstance(self.result, Result):
            return True
        decided = all(statement.decision.outcome == "pass" for statement in self.result.statements)
        return decided and self.result.diagnosed.diagnosis.verdict == "consistent"


def write_report(
    job: Path, out: Path | None = None, *, seed: int = 0, force: bool = False, stage: Stage | None = None
) -> Report:
    """Analyse a job and write ``certificate.html``, ``certificate.pdf`` and ``results.json``, all or none.

    A shift job adds its correction table, an error map. Documents of a recording that was not measured carry its origin in
    their names.

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
    refuse(read, "reported", but=SHIFT)
    owner = Owner("report", read.facts.job.id, read.origin)
    with staged(
        out or REPORTS / owner.job, owner, inputs=read.paths, force=force, expected=_names(read, *CERTIFICATE)
    ) as place:
        result = analyse_job(read, seed=seed, progress=lambda part: tell("Sampling the posterior", 0.1 + 0.4 * part))
        contents = _contents(result, tell)
        tell("Writing", 0.95)
        files = place.write(contents)
    tell("Done", 1.0)
    return Report(result, contents["results.json"], files)


@dataclass(frozen=True, eq=False)
class WrittenDiagnosis:
    """A written diagnosis: what was found, contents of results.json, and what was written, by name."""

    diagnosed: Diagnosed | MapsDiagnosed
    results: bytes
    files: dict[str, Path]

    @property
    def conforming(self) -> bool:
        """Whether the recording agrees with the model that the job names."""
        return self.diagnosed.diagnosis.verdict == "consistent"


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
        found = diagnose_read(read, seed=seed, alpha=alpha, progress=lambda part: tell("Sampling", 0.7 + 0.2 * part))
        tell("Composing the page", 0.9)
        contents = _diagnosis_contents(found, seed)
        files = place.write(contents)
    tell("Done", 1.0)
    return WrittenDiagnosis(found, contents["results.json"], files)


def _names(job: Job, *documents: str) -> list[str]:
    """Names of the documents that will be written, and of the results."""
    from cmm_uq.certificate.origin import file_name

    return [*(file_name(document, job.origin) for document in documents), "results.json"]


def _diagnosis_contents(found: Diagnosed | MapsDiagnosed, seed: int) -> dict[str, bytes]:
    from cmm_uq.certificate.diagnosis_page import diagnosis_document, diagnosis_results
    from cmm_uq.certificate.html import render_html
    from cmm_uq.certificate.map_page import maps_document, maps_results
    from cmm_uq.certificate.origin import marked
    from cmm_uq.certificate.results_file import as_json

    if isinstance(found, MapsDiagnosed):
        data, document = maps_results(found, seed), maps_document(found, seed)
    else:
        data, document = diagnosis_results(found), diagnosis_document(found)
    page, results = _names(found.job, DIAGNOSIS)
    return {page: render_html(marked(document, found.job)).encode(), results: as_json(data)}


def _contents(result: Result | ShiftResult | PlaneShiftResult, tell: Stage) -> dict[str, bytes]:
    from cmm_uq.certificate.compose import certificate
    from cmm_uq.certificate.html import render_html
    from cmm_uq.certificate.origin import marked
    from cmm_uq.certificate.pdf import render_pdf
    from cmm_uq.certificate.results_file import as_json, results

    tell("Composing the certificate", 0.5)
    document = marked(certificate(result), result.job)
    more: dict[str, bytes] = {}
    if isinstance(result, Result):
        data = as_json(results(result))
    else:
        from cmm_uq.certificate.plane_shift_results import plane_shift_results
        from cmm_uq.certificate.shift_results import shift_results
        from cmm_uq.certificate.shift_section import table_file
        from cmm_uq.selfcalibration.correction_table import table_text

        data = as_json(shift_results(result) if isinstance(result, ShiftResult) else plane_shift_results(result))
        more[table_file(result.job)] = table_text(result.table)
    tell("Rendering", 0.8)
    pdf = render_pdf(document, {**result.job.inputs, "results.json": data, **more})
    html_name, pdf_name, results_name = _names(result.job, *CERTIFICATE)
    return {html_name: render_html(document).encode(), pdf_name: pdf, results_name: data, **more}
