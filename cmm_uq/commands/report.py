"""From a job folder to its certificate: analyse, compose, write."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from cmm_uq.commands.analysis import PlaneShiftResult, Result, ShiftResult, analyse
from cmm_uq.commands.diagnosing import diagnose_folder
from cmm_uq.diagnosis.diagnosis import FALSE_ALARMS
from cmm_uq.documents.result import Diagnosed
from cmm_uq.kinds.error_maps.analysis import MapsDiagnosed
from cmm_uq.writing import staging, write_whole

Stage = Callable[[str, float], None]
"""Told what is being done, and the part of the whole that is done."""


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


def write_report(job: Path, out: Path | None = None, *, seed: int = 0, stage: Stage | None = None) -> Report:
    """Analyse a job and write ``certificate.html``, ``certificate.pdf`` and ``results.json``, all or none.

    A shift job adds its correction table, an error map.

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
        contents = _contents(result, tell)
        tell("Writing", 0.95)
        files = write_whole(place, folder, contents)
    tell("Done", 1.0)
    return Report(result, contents["results.json"], files)


@dataclass(frozen=True, eq=False)
class WrittenDiagnosis:
    """A written diagnosis: what was found, contents of results.json, and what was written, by name."""

    diagnosed: Diagnosed | MapsDiagnosed
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
        contents = _diagnosis_contents(found, seed)
        files = write_whole(place, folder, contents)
    tell("Done", 1.0)
    return WrittenDiagnosis(found, contents["results.json"], files)


def _diagnosis_contents(found: Diagnosed | MapsDiagnosed, seed: int) -> dict[str, bytes]:
    from cmm_uq.documents.diagnosis_page import diagnosis_document, diagnosis_results
    from cmm_uq.documents.html import render_html
    from cmm_uq.documents.results_file import as_json
    from cmm_uq.kinds.error_maps.page import maps_document, maps_results

    if isinstance(found, MapsDiagnosed):
        data, document = maps_results(found, seed), maps_document(found, seed)
    else:
        data, document = diagnosis_results(found), diagnosis_document(found)
    return {"diagnosis.html": render_html(document).encode(), "results.json": as_json(data)}


def _contents(result: Result | ShiftResult | PlaneShiftResult, tell: Stage) -> dict[str, bytes]:
    from cmm_uq.commands.compose import certificate
    from cmm_uq.documents.html import render_html
    from cmm_uq.documents.pdf import render_pdf
    from cmm_uq.documents.results_file import as_json, results

    tell("Composing the certificate", 0.5)
    document = certificate(result)
    more: dict[str, bytes] = {}
    if isinstance(result, Result):
        data = as_json(results(result))
    else:
        from cmm_uq.kinds.shift_axis.page import TABLE_FILE
        from cmm_uq.kinds.shift_axis.results import shift_results
        from cmm_uq.kinds.shift_plate.results import plane_shift_results
        from cmm_uq.kinds.shifting.correction_table import table_text

        data = as_json(shift_results(result) if isinstance(result, ShiftResult) else plane_shift_results(result))
        more[TABLE_FILE] = table_text(result.table)
    tell("Rendering", 0.8)
    pdf = render_pdf(document, {**result.job.inputs, "results.json": data, **more})
    return {"certificate.html": render_html(document).encode(), "certificate.pdf": pdf, "results.json": data, **more}
