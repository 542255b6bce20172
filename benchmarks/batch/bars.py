"""The share of a batch that is not the analysis, of the example's twenty-bar job: ``python -m benchmarks.batch.bars``.

Every job is the example's under an id of its own. What a job costs by itself is measured first, in this process.
"""

from __future__ import annotations

import argparse
import re
import resource
import shutil
import tempfile
import time
from pathlib import Path

from benchmarks.batch.measuring import Watch
from cmm_uq.app.commands.laboratory.batch import BatchOptions, write_batch
from cmm_uq.app.commands.laboratory.batch_jobs import begin
from cmm_uq.app.commands.reading import read_job
from tests.conftest import ROOT

EXAMPLE = ROOT / "examples" / "iota-1102-20C"


def copies(count: int, folder: Path) -> Path:
    """The example under other ids."""
    for i in range(count):
        job = Path(shutil.copytree(EXAMPLE, folder / f"bars-{i:04d}"))
        text = (job / "job.toml").read_text(encoding="utf-8")
        (job / "job.toml").write_text(re.sub(r"(?m)^id = .*", f'id = "bars-{i:04d}"', text), encoding="utf-8")
    return folder


def alone(repeats: int, *, results_only: bool) -> float:
    """Seconds of processor that one job takes in a process that has imported everything; the least of a few."""
    task, spent, report = (str(EXAMPLE), dict(read_job(EXAMPLE).inputs)), [], begin((0, results_only))
    for _ in range(repeats + 1):
        began = time.process_time()
        report(0, task)
        spent.append(time.process_time() - began)
    return min(spent[1:])


def main() -> None:
    """Measure what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=8)
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2, 4])
    given = parser.parse_args()
    for results_only in (True, False):
        what = "figures alone" if results_only else "certificates"
        cost = alone(3, results_only=results_only)
        print(f"{what}: {cost:.3f} s of processor a job: {1 / cost:.2f} jobs/s on a core", flush=True)
        for workers in given.workers:
            with tempfile.TemporaryDirectory() as folder:
                made = copies(given.count * workers, Path(folder) / "jobs")
                before = resource.getrusage(resource.RUSAGE_CHILDREN)
                with Watch() as watch:
                    found = write_batch([made], Path(folder) / "out", BatchOptions(workers, results_only=results_only),
                                        records=Path(folder) / "records.db")  # fmt: skip
                after = resource.getrusage(resource.RUSAGE_CHILDREN)
            own = watch.cpu_s / found.written
            children = (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime) / found.written
            print(f"  {workers} workers: {found.written} jobs in {watch.seconds:.1f} s, {found.written / watch.seconds:.2f}/s;"
                  f" a job takes {children:.3f} s of theirs, starting included, and {1000 * own:.1f} ms of this process"
                  f" ({100 * own / children:.1f} %); at work {100 * watch.busy_s / (watch.seconds * workers):.1f} %",
                  flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
