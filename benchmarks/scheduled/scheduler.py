"""One scheduled run whose reports take no time: ``python -m benchmarks.scheduled.scheduler ROOT PORT PAUSE_S``.

All else is as it is for real: folders, hashes, locks, staged sets of files, the outbox, a web server that takes the messages.
Every report that is begun is counted in ``begun``, so that a second one of the same job shows.
"""

from __future__ import annotations

import datetime as dt
import hashlib
import json
import os
import sys
import time
from pathlib import Path

from cmm_uq.base.output import Owner, staged
from cmm_uq.laboratory.schedule.jobs import JobFolder, JobReporting
from cmm_uq.laboratory.schedule.notices import Outbox
from cmm_uq.laboratory.schedule.run import RunClock, ScheduledRun
from cmm_uq.laboratory.schedule.settings import RunTable, ScheduleFile, channels
from cmm_uq.laboratory.schedule.state import FolderState

JOB = '[job]\nid = "{id}"\n[recording]\nfile = "points.csv"\n'


def begin(root: Path, count: int, failing: int) -> None:
    """Job folders; every ``failing``-th one is decided as a failure, and so has a message."""
    for i in range(count):
        folder = root / "jobs" / f"job-{i:04}"
        folder.mkdir(parents=True)
        (folder / "job.toml").write_text(JOB.format(id=folder.name))
        (folder / "points.csv").write_text("fail" if i % failing == 0 else "pass")


def main(root: Path, port: int, pause_s: float) -> int:
    """One run; its exit code."""
    out = root / "reports"
    state = FolderState(out)
    hook = {"url": f"http://localhost:{port}/", "timeout_s": 5.0}
    clock = RunClock(lambda: dt.datetime.now(dt.UTC), time.monotonic, time.sleep)
    outbox = Outbox(out, channels(ScheduleFile.model_validate({"webhook": [hook]}), root), state, clock.moment)

    def report(job: JobFolder) -> bytes:
        inputs = {name: (job.folder / name).read_bytes() for name in ("job.toml", "points.csv")}
        hashes = {name: hashlib.sha256(content).hexdigest() for name, content in inputs.items()}
        decided = [{"standard": "S", "decision": inputs["points.csv"].decode()}]
        content = json.dumps({"job": {"id": job.id, "inputs_sha256": hashes}, "conformity": decided}).encode()
        with staged(out / job.id, Owner("report", job.id)) as place:
            time.sleep(pause_s)
            place.write({"results.json": content, "certificate.pdf": content * 20})
        descriptor = os.open(root / "begun", os.O_WRONLY | os.O_APPEND | os.O_CREAT)
        os.write(descriptor, f"{job.id}\n".encode())
        os.close(descriptor)
        return content

    print("begun", flush=True)
    work = JobReporting(out, state, report, outbox.announce)
    settings = RunTable(quiet_s=0.0, back_off_s=0.1)
    return ScheduledRun(
        [root / "jobs"], settings, work, outbox, lambda on: (), lambda line: None, lambda text: None, clock
    ).through()


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])))
