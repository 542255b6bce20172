"""Results of a report as a file of QIF 3.0."""

from __future__ import annotations

from pathlib import Path

from cmm_uq.base.files.content import content_of
from cmm_uq.base.files.limits import TABLE_BYTES
from cmm_uq.base.output.new_file import refuse_taken, write_new
from cmm_uq.certificate.qif_file import qif
from cmm_uq.jobs.file_names import RESULTS
from cmm_uq.jobs.reported import Reported
from cmm_uq.jobs.results_named import read_results

_FIX = "Name the results.json of a report, or the folder it lies in"


def write_qif(report: Path, out: Path | None = None) -> Path:
    """Write the results of a report as QIF.

    Parameters
    ----------
    report : its results.json, or the folder it lies in.
    out : file to write, ``<job id>.qif`` by default.

    Returns
    -------
    the file.

    Raises
    ------
    CmmUqError : it is no results.json of a report.
    OutputError : the file is there already, or cannot be written.
    """
    path = report / RESULTS if report.is_dir() else report
    found = read_results(Reported, content_of(path, TABLE_BYTES, _FIX), str(path), "results.json of a report", _FIX)
    file = out or Path(f"{found.job.id}.qif")
    refuse_taken(file)
    write_new(file, qif(found))
    return file
