"""A process that reports jobs of a batch: ``python -m cmm_uq.app.commands.laboratory.batch_job``.

It is begun by ``talking``, here or on a machine of a cluster. It is sent the bytes of a job's files and
answers with the bytes of the report's, and writes nothing: these follow from those alone, wherever it runs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from cmm_uq.app.commands.reading import job_of
from cmm_uq.app.commands.report import REPORT, report_outcome
from cmm_uq.laboratory.schedule.processes import serve

PROGRAM = "cmm_uq.app.commands.laboratory.batch_job"


Setting = tuple[int, bool]
"""Seed of everything random, and whether figures alone are wanted: no document is composed, no picture drawn."""

Task = tuple[str, dict[str, bytes]]
"""Folder that a job lies in, for messages, and contents of job.toml and of all that it names, by name."""


def begin(setting: Setting) -> Callable[[int, Task], dict[str, bytes]]:
    """What answers a job with the contents of its report's files, by name."""
    return lambda number, task: reported(task, setting)


def reported(task: Task, setting: Setting) -> dict[str, bytes]:
    """Contents of the files of a report, by name."""
    (folder, files), (seed, results_only) = task, setting
    job = replace(job_of(files), folder=Path(folder))
    outcome = report_outcome(job, seed=seed, composed=not results_only)
    return REPORT.contents(outcome, results_only=results_only)


def main() -> None:
    serve(begin)


if __name__ == "__main__":
    main()
