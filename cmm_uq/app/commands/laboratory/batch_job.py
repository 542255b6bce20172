"""A process that reports jobs of a batch: ``python -m cmm_uq.app.commands.laboratory.batch_job``.

It is sent the bytes of a job's files, answers with the bytes of the report's, and writes nothing: these follow from those
alone, wherever it runs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from cmm_uq.app.commands.reading import job_of
from cmm_uq.app.commands.report import REPORT, report_outcome
from cmm_uq.laboratory.schedule.processes import serve

PROGRAM = "cmm_uq.app.commands.laboratory.batch_job"

Setting = tuple[int, bool]  # seed of everything random, and whether figures alone are wanted: no document, no picture
Task = tuple[str, dict[str, bytes]]  # folder of a job, for messages, and contents of job.toml and of all that it names


def begin(setting: Setting) -> Callable[[int, Task], dict[str, bytes]]:
    """What answers a job with the contents of its report's files, by name."""
    seed, results_only = setting

    def reported(number: int, task: Task) -> dict[str, bytes]:
        folder, files = task
        job = replace(job_of(files), folder=Path(folder))
        outcome = report_outcome(job, seed=seed, composed=not results_only)
        return REPORT.contents(outcome, results_only=results_only)

    return reported


def main() -> None:
    serve(begin)


if __name__ == "__main__":
    main()
