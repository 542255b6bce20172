"""What reports say as one table, a row for each value: for statistics over many machines."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from cmm_uq.app.commands.batch_jobs import verdict
from cmm_uq.app.commands.files import called
from cmm_uq.jobs.verdicts import Verdicts
from cmm_uq.laboratory.records.content import values
from cmm_uq.laboratory.schedule.parquet import Row, write_parquet

COLUMNS = (
    ("job", "string", "Id of the job."),
    ("origin", "word", "Where the recording comes from: measured, simulated or compensated."),
    ("machine", "word", "Name of the machine."),
    ("serial", "word", "Its serial number; empty where none is stated."),
    ("day", "date32", "Date of the measurement."),
    ("name", "word", "Of the value: EFFECT.PARAMETER, artefact.SIZE, accuracy.FIGURE, or performance:CHARACTERISTIC."),
    ("quantity", "word", "How it is called in the field."),
    ("unit", "word", "Of value, u, lower, upper, u_artefact and limit; 1 where it has none."),
    ("value", "float64", "Estimate; of performance the least favourable value."),
    ("u", "float64", "Standard uncertainty (k = 1)."),
    ("lower", "float64", "Lower end of the 95 % interval; of performance value − 2u."),
    ("upper", "float64", "Its upper end; of performance value + 2u."),
    ("u_artefact", "float64", "Part of u that comes from what is certified of the artefact; 0 where it is unknown."),
    ("limit", "float64", "The value conforms while its amount is no larger; null where no limit is set."),
    ("decision", "word", "The gravest of the job's statements of conformity; none where it states none."),
    ("diagnosis", "word", "Verdict of the job's diagnosis; empty where there is none."),
    ("version", "word", "Of cmm-uq, which made it."),
)
"""Name, type and meaning of each column."""


def write_table(path: Path, results: Iterable[Mapping[str, Any]], *, force: bool) -> None:
    """What reports say as a Parquet file, in their order.

    Parameters
    ----------
    path : of the file.
    results : contents of each results.json.
    force : keep a file that is there as ``NAME.previous`` instead of refusing.

    Raises
    ------
    CmmUqError : pyarrow is not installed.
    OutputError : something is there, or it cannot be written.
    """
    write_parquet(path, COLUMNS, (row for one in results for row in rows(one)), force=force)


def rows(results: Mapping[str, Any]) -> Iterator[Row]:
    """Every value of a report, as records keep it.

    Parameters
    ----------
    results : contents of its results.json.
    """
    job = results["job"]
    head = (job["id"], job["origin"], job["machine"], job.get("serial", ""), dt.date.fromisoformat(job["date"]))
    tail = (Verdicts.of_results(results).overall, verdict(results), results["software"]["version"])
    for value in values(results, called):
        yield (*head, *value, *tail)
