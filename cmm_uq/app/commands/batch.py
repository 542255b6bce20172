"""Many jobs to their reports: found, sent to processes or a cluster, and written here, one after the other as they come.

Whoever computes is sent bytes and answers with bytes; one process writes. So the files are the same whatever computes them,
nothing is half-written where a process is killed, and a cluster needs no disk in common.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cmm_uq.app.commands.batch_asked import Asked, Batch, Failed
from cmm_uq.app.commands.batch_jobs import Wanted, jobs_in, results_of
from cmm_uq.app.commands.batch_run import Run
from cmm_uq.app.commands.batch_table import write_table
from cmm_uq.app.commands.files import REPORTS, Stage, opened, silent
from cmm_uq.base.output import interruption
from cmm_uq.laboratory.records.place import NONE
from cmm_uq.laboratory.schedule.parquet import check_parquet

__all__ = ["Asked", "Batch", "Failed", "write_batch"]


def write_batch(
    folders: Sequence[Path], out: Path | None = None, asked: Asked | None = None, *, parquet: Path | None = None,
    stage: Stage | None = None, records: str | Path | None = NONE,
) -> Batch:  # fmt: skip
    """Report every job in folders and below them, as :func:`~cmm_uq.app.commands.report.write_report` reports one.

    Parameters
    ----------
    folders : job folders, or such as hold them.
    out : folder in which each job has one of its id; ``reports`` by default.
    asked : how.
    parquet : file to be written with a row for each value.
    stage : told of progress.
    records : that reports are recorded in: file, URL, ``none``, or ``None`` for those of the environment, else beside them.

    Returns
    -------
    what came of it; a job that fails never stops the others.

    Raises
    ------
    CmmUqError : no job was found, two of them have one id, or the cluster or the file cannot be used.
    OutputError : nothing more can be written; what was written stays.
    """
    how, tell, place = asked or Asked(), stage or silent, out or REPORTS
    if parquet is not None:
        check_parquet(parquet, force=how.force)
    tell("Looking for jobs", 0.0)
    listed, planned = jobs_in(folders, place)
    batch = Batch(place, len(listed), planned)
    with opened(records, None if out is None else out / "job") as history:
        run = Run(listed, how, Wanted(place, how.seed, how.results_only, how.force), batch, history)
        batch.records = "" if history is None else history.shown
        with interruption.keeping(run.kept):
            run.through(tell)
            if parquet is not None:
                tell("Writing the table", 1.0)
                write_table(parquet, filter(None, map(results_of, run.folders())), force=how.force)
                batch.parquet = parquet
    return batch
