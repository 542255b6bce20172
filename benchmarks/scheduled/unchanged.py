"""How long a run takes that finds nothing new: ``python -m benchmarks.scheduled.unchanged [JOBS]``.

Job folders of two files each, every one with its report in the folder and in the records; then what a nightly run does.
"""

from __future__ import annotations

import hashlib
import json
import resource
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.scheduled.scheduler import begin
from cmm_uq.base.output import MANIFEST, Manifest, Owner
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.schedule.state import FolderState, RecordsState
from tests.laboratory.records.histories import certificate
from tests.laboratory.schedule.runs import Jobs


def main(count: int = 10_000) -> None:
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        begin(root, count, 10**9)
        out = root / "jobs" / "reports"
        contents = []
        for job in sorted((root / "jobs").iterdir()):
            inputs = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(job.iterdir())}
            results = json.dumps({"job": {"id": job.name, "inputs_sha256": inputs}}).encode()
            digest = hashlib.sha256(results).hexdigest()
            (out / job.name).mkdir(parents=True)
            (out / job.name / "results.json").write_bytes(results)
            manifest = Manifest(Owner("report", job.name), {"results.json": digest})
            (out / job.name / MANIFEST).write_bytes(manifest.as_json({"results.json": len(results)}))
            contents.append(("report", certificate(job=job.name, results_sha256=digest, inputs=inputs), None))
        with open_records(out / "records.db", create=True) as records:
            records.append_all(contents)
            states: dict[str, FolderState] = {"folder": FolderState(out), "records": RecordsState(records, out)}
            for name, state in states.items():
                jobs = Jobs(root / "jobs", state=state)
                begun = time.perf_counter()
                code = jobs.run()
                took = time.perf_counter() - begun
                assert (code, jobs.lines[-1]["run"]) == (0, {"unchanged": count})
                print(f"state in the {name}: {took:.1f} s, {1e3 * took / count:.2f} ms a job")
        print(f"largest memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MiB")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
