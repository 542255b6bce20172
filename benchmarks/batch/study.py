"""What is around the analysis in a batch, measured: ``python -m benchmarks.batch.study WHAT COUNT --workers N [--cluster]``.

WHAT is ``nothing`` (tasks that do nothing: the scheduling alone), ``around`` (jobs are found, read, sent, written, recorded
and tabled as ever, but their analysis is made up), or ``real`` (small jobs of ten points of a surface plate, figures alone).
``--keep FOLDER`` keeps jobs and reports, so that a run can be interrupted and resumed.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
from contextlib import nullcontext
from pathlib import Path

from benchmarks.batch.cluster import local_cluster
from benchmarks.batch.measuring import Watch
from cmm_uq.app.commands.laboratory import batch as batch_asked
from cmm_uq.app.commands.laboratory.batch import BatchOptions, write_batch
from cmm_uq.laboratory.schedule.cluster import cluster_answers
from cmm_uq.laboratory.schedule.processes import WorkerTask, answers
from tests.laboratory.schedule.small_jobs import small_job

NOTHING, CANNED = "benchmarks.batch.nothing", "tests.laboratory.schedule.canned"


def nothing(count: int, workers: int, address: str | None) -> None:
    """Tasks that do nothing."""
    work, tasks = WorkerTask(NOTHING, None), ((i, None) for i in range(count))
    found = answers(work, tasks, workers) if address is None else cluster_answers(address, work, tasks, count)
    with Watch(0.5) as watch:
        done = sum(one.failure is None for one in found)
    told("nothing", done, workers, address, watch)


def jobs(what: str, count: int, workers: int, address: str | None, folder: Path, *, records: bool) -> None:
    """Jobs of a batch, figures alone."""
    made = folder / "jobs"
    for i in range(count):
        if not (made / f"{i // 1000:03d}" / f"plane-{i:06d}").exists():
            small_job(made / f"{i // 1000:03d}", f"plane-{i:06d}", shift_um=0.001 * (i % 997))
    if what == "around":
        batch_asked.PROGRAM = CANNED
    asked = BatchOptions(workers if address is None else None, address, results_only=True, resume=True, seconds=3600.0)
    out = folder / "reports"
    with Watch() as watch:
        found = write_batch(
            [made], out, asked, parquet=folder / "values.parquet", records=out / "records.db" if records else "none"
        )
    print(f"{found.already} were there, {len(found.failed)} failed, {found.ended} processes ended over one;"
          f" table {(folder / 'values.parquet').stat().st_size / 2**20:.2f} MiB")  # fmt: skip
    told(what, found.written, workers, address, watch)


def told(what: str, done: int, workers: int, address: str | None, watch: Watch) -> None:
    """One run, in lines."""
    by = f"{workers} workers of a cluster" if address else f"{workers} processes"
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"{what}: {done} by {by} in {watch.seconds:.1f} s: {done / watch.seconds:.2f}/s")
    print(f"  this process: {1000 * watch.cpu_s / max(1, done):.2f} ms of processor a job")
    if address is None:
        spent = 1000 * (used.ru_utime + used.ru_stime) / max(1, done)
        print(f"  children: {spent:.1f} ms of processor a job, starting included;"
              f" at work {100 * watch.busy_s / (watch.seconds * workers):.1f} % of the time")  # fmt: skip
    print(f"  memory of this process + largest child, MiB: {watch.curve()}")


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("nothing", "around", "real"))
    parser.add_argument("count", type=int)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--cluster", action="store_true")
    parser.add_argument("--records", action="store_true")
    parser.add_argument("--keep", type=Path)
    given = parser.parse_args()
    with (
        local_cluster(given.workers) if given.cluster else nullcontext() as address,
        nullcontext(str(given.keep)) if given.keep else tempfile.TemporaryDirectory() as folder,
    ):
        if given.what == "nothing":
            nothing(given.count, given.workers, address)
        else:
            jobs(given.what, given.count, given.workers, address, Path(folder), records=given.records)


if __name__ == "__main__":
    main()
