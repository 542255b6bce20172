"""A process that reports jobs of a batch: ``python -m cmm_uq.commands.batch_job``.

It is begun by :mod:`cmm_uq.scheduling.talking`, here or on a machine of a cluster. It is sent the bytes of a job's files and
answers with the bytes of the report's, and writes nothing: these follow from those alone, wherever it runs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from cmm_uq.commands.reading import job_of
from cmm_uq.commands.report import REPORT, report_outcome
from cmm_uq.scheduling.talking import serve

PROGRAM = "cmm_uq.commands.batch_job"


@dataclass(frozen=True)
class JobSetting:
    """What every process is told first.

    Parameters
    ----------
    seed : of everything random.
    results_only : whether figures alone are wanted: no document is composed, no picture drawn.
    """

    seed: int = 0
    results_only: bool = False


@dataclass(frozen=True)
class Task:
    """A job to be reported.

    Parameters
    ----------
    folder : where it lies, for messages.
    files : contents of job.toml and of all that it names, by name.
    """

    folder: str
    files: dict[str, bytes]


def begin(setting: JobSetting) -> Callable[[int, Task], dict[str, bytes]]:
    """What answers a job with the contents of its report's files, by name."""
    return lambda number, task: reported(task, setting)


def reported(task: Task, setting: JobSetting) -> dict[str, bytes]:
    """Contents of the files of a report, by name.

    Raises
    ------
    CmmUqError : the job cannot be analysed.
    """
    job = replace(job_of(task.files), folder=Path(task.folder))
    outcome = report_outcome(job, seed=setting.seed, composed=not setting.results_only)
    return REPORT.contents(outcome, results_only=setting.results_only)


def main() -> None:
    """Answer until nobody asks."""
    serve(begin)


if __name__ == "__main__":
    main()
