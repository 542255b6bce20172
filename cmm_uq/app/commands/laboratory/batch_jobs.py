"""The jobs of a batch: which there are, which are done, a process that reports them, and what reports say as one table.

``python -m cmm_uq.app.commands.laboratory.batch_jobs`` is sent the bytes of a job's files, answers with the bytes of the
report's, and writes nothing: these follow from those alone, wherever it runs. The table is a Parquet file, written a group of
rows at a time; it is there when it is whole, and not before, and its bytes follow from its rows and the version of pyarrow.
"""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from itertools import islice
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from cmm_uq.app.commands.files import RESULTS, called
from cmm_uq.app.commands.reading import job_of
from cmm_uq.app.commands.report import REPORT, report_outcome
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.output.manifest import new_file, refuse_taken
from cmm_uq.base.unused import lighten
from cmm_uq.jobs.verdicts import AGREES, Verdicts
from cmm_uq.laboratory.records.content import values
from cmm_uq.laboratory.records.facts import Heads
from cmm_uq.laboratory.schedule.jobs import job_folders
from cmm_uq.laboratory.schedule.processes import serve


class BatchJob(NamedTuple):
    """Folder and id of a job; an id is empty where job.toml cannot be read, which its report will say."""

    folder: str
    id: str


def jobs_in(folders: Iterable[Path], out: Path) -> tuple[list[BatchJob], int]:
    """Every job in folders and below them, and how many more are still to be measured."""
    roots = list(folders)
    jobs: dict[str, BatchJob] = {}
    planned: set[str] = set()
    for root in roots:
        for one in job_folders(root.parent if root.name == "job.toml" else root, leave_out=out):
            key = str(one.folder.resolve())
            if one.planned:
                planned.add(key)
            else:
                jobs.setdefault(key, BatchJob(str(one.folder), one.id))
    if not jobs:
        more = f"; {len(planned)} still to be measured" if planned else ""
        raise CmmUqError(f"no job was found{more}", where=", ".join(map(str, roots)),
                         fix="A job is a folder with a job.toml and the recording that it names")  # fmt: skip
    first: dict[str, BatchJob] = {}
    for job in jobs.values():  # ids that differ in case alone are one folder for some systems
        if job.id and (other := first.setdefault(job.id.casefold(), job)) is not job:
            raise CmmUqError(f"has the id {job.id!r}, as {other.folder} has {other.id!r}", where=job.folder,
                             fix="Give each job an id of its own: its report goes to a folder of that name")  # fmt: skip
    return list(jobs.values()), len(planned)


def results_of(folder: Path) -> dict[str, Any] | None:
    """Contents of a report's results.json; ``None`` where there is none that can be read."""
    try:
        data = json.loads((folder / RESULTS).read_bytes())
    except (OSError, ValueError):
        return None
    return data if isinstance(data, dict) else None


def conforming(results: Mapping[str, Any]) -> bool:
    """Whether every statement of conformity is a pass, and the recording agrees with the model that the job names."""
    return Verdicts.of_results(results).conforming and verdict(results) in (*AGREES, "")


def verdict(results: Mapping[str, Any]) -> str:
    """Of the diagnosis; empty where there is none."""
    return str((results.get("diagnosis") or {}).get("verdict") or "")


COLUMNS = (  # name, type and meaning of each
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


def write_table(path: Path, results: Iterable[Mapping[str, Any]], *, force: bool) -> None:
    write_parquet(path, COLUMNS, (row for one in results for row in rows(one)), force=force)


def rows(results: Mapping[str, Any]) -> Iterator[Row]:
    job = results["job"]
    head = (job["id"], job["origin"], job["machine"], job.get("serial", ""), dt.date.fromisoformat(job["date"]))
    tail = (Verdicts.of_results(results).overall, verdict(results), results["software"]["version"])
    for value in values(results, called):
        yield (*head, *value, *tail)


PROGRAM = "cmm_uq.app.commands.laboratory.batch_jobs"

Setting = tuple[int, bool]  # seed of everything random, and whether figures alone are wanted: no document, no picture
# folder of a job, for messages, contents of job.toml and of all that it names, and where the records stand
Task = tuple[str, dict[str, bytes], Heads]


def begin(setting: Setting) -> Callable[[int, Task], dict[str, bytes]]:
    """What answers a job with the contents of its report's files, by name."""
    seed, results_only = setting

    def reported(number: int, task: Task) -> dict[str, bytes]:
        folder, files, heads = task
        job = replace(job_of(files), folder=Path(folder))
        outcome = report_outcome(job, seed=seed, composed=not results_only)
        return REPORT.contents(outcome, results_only=results_only, heads=heads)

    return reported


Row = tuple[Any, ...]
GROUP = 20_000  # rows in a group: a few megabytes, and few enough groups
Columns = Sequence[tuple[str, str, str]]
"""Name, Arrow type and meaning of each column; a ``word`` is text that is said again and again, and kept once."""


def check_parquet(path: Path, *, force: bool) -> None:
    """Make sure, before there are any rows, that they could be written."""
    arrow("pyarrow")
    if not force:
        refuse_taken(path)


def write_parquet(path: Path, columns: Columns, rows: Iterable[Row], *, force: bool) -> None:
    module, parquet, left = arrow("pyarrow"), arrow("pyarrow.parquet"), iter(rows)
    fields = [module.field(name, _type(module, kind), metadata={"meaning": told}) for name, kind, told in columns]
    schema, zstd = module.schema(fields), {"compression": "zstd"}
    with new_file(path, force=force) as unfinished, parquet.ParquetWriter(unfinished, schema, **zstd) as file:
        while group := list(islice(left, GROUP)):
            each = zip(zip(*group, strict=True), schema, strict=True)
            arrays = [module.array(column, type=field.type) for column, field in each]
            file.write_batch(module.record_batch(arrays, schema=schema))


def arrow(module: str) -> ModuleType:
    try:
        return import_module(module)
    except ModuleNotFoundError:
        raise CmmUqError("Parquet needs pyarrow", where="--parquet", fix="Install it: pip install pyarrow") from None


def _type(module: Any, kind: str) -> Any:
    return module.dictionary(module.int32(), module.string()) if kind == "word" else getattr(module, kind)()


if __name__ == "__main__":
    lighten()
    serve(begin)
