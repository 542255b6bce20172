"""What reports say as one table, a row for each value: for statistics over many machines."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from cmm_uq.commands.batch_jobs import decision, verdict
from cmm_uq.jobs.sentences import unit_of
from cmm_uq.scheduling.parquet import Row, write_parquet

COLUMNS = (
    ("job", "string", "Id of the job."),
    ("origin", "word", "Where the recording comes from: measured, simulated or compensated."),
    ("machine", "word", "Name of the machine."),
    ("serial", "word", "Its serial number; empty where none is stated."),
    ("day", "date32", "Date of the measurement."),
    ("name", "word", "Of the value: EFFECT.PARAMETER, artefact.SIZE, accuracy.FIGURE, or performance:CHARACTERISTIC."),
    ("unit", "word", "Of value, u, lower, upper and limit; empty where it has none."),
    ("value", "float64", "Estimate; of performance the least favourable value."),
    ("u", "float64", "Standard uncertainty (k = 1)."),
    ("lower", "float64", "Lower end of the 95 % interval; null of performance."),
    ("upper", "float64", "Its upper end."),
    ("limit", "float64", "Limit that it is decided on; null where there is none."),
    ("outcome", "word", "What is decided on the value, in the words of results.json; empty where nothing is."),
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
    """Every value of a report.

    Parameters
    ----------
    results : contents of its results.json.
    """
    job = results["job"]
    head = (job["id"], job["origin"], job["machine"], job.get("serial", ""), dt.date.fromisoformat(job["date"]))
    tail = (decision(results), verdict(results), results["software"]["version"])
    for name, quantity, limit, outcome in _quantities(results):
        lower, upper = quantity["interval95"]
        value = (quantity["value"], quantity["u"], lower, upper, limit)
        yield (*head, name, unit_of(name.replace(".", "_")), *value, outcome, *tail)
    for one in results.get("conformity") or ():
        stated = (one["value_um"], one["u_um"], None, None, one["limit_um"], one["decision"])
        yield (*head, f"performance:{one['characteristic']}", unit_of("_um"), *stated, *tail)


def _quantities(results: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any], float | None, str]]:
    """Name, quantity, limit and outcome of each estimate, size and figure."""
    tolerances = results.get("tolerances") or {}
    for effect, values in results["estimates"].items():
        judged = tolerances.get(effect, {})
        for parameter, quantity in values.items():
            limit = judged.get(parameter)
            yield f"{effect}.{parameter}", quantity, limit, "" if limit is None else judged["verdict"]
    for owner, key in (("artefact", "artefact"), ("accuracy", "accuracy_uncertainty")):
        for name, quantity in (results.get(key) or {}).items():
            if isinstance(quantity, Mapping) and "interval95" in quantity:
                yield f"{owner}.{name}", quantity, None, ""
