"""Kills of the real command, with records: ``python -m benchmarks.scheduled.real [KILLS] [JOBS] [SEED]``.

``cmm-uq report --scheduled`` over copies of the example job is killed with SIGKILL after a random while, again and again, and
before every fourth kill a job is changed, so that there is always something to do. Then it is left alone.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.schedule.state import RecordsState
from tests.conftest import ROOT
from tests.laboratory.schedule.servers import Taken, web_server

IOTA = ROOT / "examples" / "iota-1102-20C"
ENVIRONMENT = {key: value for key, value in os.environ.items() if key != "CMM_UQ_RECORDS"}


def start(jobs: Path) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, "-m", "cmm_uq", "report", "--scheduled", jobs, "--quiet"], env=ENVIRONMENT)


def main(kills: int = 40, count: int = 3, seed: int = 1) -> None:
    dice, taken = random.Random(seed), Taken()
    with tempfile.TemporaryDirectory() as folder, web_server(taken) as port:
        jobs = Path(folder) / "jobs"
        for i in range(count):
            shutil.copytree(IOTA, jobs / f"job-{i}")
            path = jobs / f"job-{i}" / "job.toml"
            path.write_text(path.read_text().replace('id = "iota-1102-20C"', f'id = "job-{i}"'))
        (jobs / "schedule.toml").write_text(f'[run]\nquiet_s = 0\n[[webhook]]\nurl = "http://localhost:{port}/"\n')
        changed = ended = 0
        for kill in range(kills):
            if kill % 4 == 3:
                changed += 1
                with (jobs / f"job-{kill % count}" / "job.toml").open("a") as file:
                    file.write(f"# change {kill}\n")
            run = start(jobs)
            time.sleep(dice.uniform(1.0, 12.0))
            ended += run.poll() is not None
            run.kill()
            run.wait()
        last = start(jobs).wait()
        again = start(jobs).wait()
        out = jobs / "reports"
        with open_records(out / "records.db") as records:
            state = RecordsState(records, out)
            reports = Counter(entry.data["results_sha256"] for entry in records.entries(kind="report"))
            sent = Counter(entry.data["key"] for entry in records.entries(kind="sent"))
            whole = sum(state.results(f"job-{i}") is not None for i in range(count))
            wrong = records.verify()
        keys = Counter(headers["Idempotency-Key"] for headers, _ in taken.requests)
        about = {json.loads(body)["about"] for _, body in taken.requests}
    print(f"kills {kills}, of which {ended} came after the end; changes {changed}; exit codes at last {last}, {again}")
    print(f"jobs {count}, with a whole recorded certificate {whole}, told {len(about)}")
    print(f"reports recorded {sum(reports.values())}, the same twice {sum(n > 1 for n in reports.values())}")
    again_sent, twice = sum(n - 1 for n in keys.values()), sum(n > 1 for n in sent.values())
    print(f"messages {len(keys)}, came again {again_sent}, recorded twice {twice}")
    print(f"sent and not recorded {len(set(keys) - set(sent))}; found by verify: {[one.problem for one in wrong]}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
