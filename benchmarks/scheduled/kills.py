"""Kills and crowds: ``python -m benchmarks.scheduled.kills [KILLS] [SEED] [SCHEDULERS]``.

Kills: a run over job folders is killed with SIGKILL after a random while, again and again, until it has been killed so often;
whenever all jobs are through, new ones come. Then a last run is left alone. Every job must have one whole certificate, each
that is no pass its message, and a message that came twice must have come under one key.

Crowd: several runs over the same folders at once. Every job must be reported once, by one of them, and each message sent once.
"""

from __future__ import annotations

import json
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from benchmarks.scheduled.scheduler import JOB, begin
from cmm_uq.laboratory.schedule.state import FolderState
from tests.laboratory.schedule.servers import Taken, web_server

PAUSE_S = 0.004


def start(root: Path, port: int) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", "benchmarks.scheduled.scheduler", root, str(port), str(PAUSE_S)], stdout=subprocess.PIPE
    )


def begun(run: subprocess.Popen[bytes]) -> None:
    """Wait until it is at its work: imports are no place to be killed in."""
    assert run.stdout is not None
    run.stdout.readline()


def judged(root: Path, taken: Taken) -> dict[str, int]:
    """What is there in the end."""
    state, jobs = FolderState(root / "reports"), sorted((root / "jobs").iterdir())
    whole = [job.name for job in jobs if state.results(job.name) is not None]
    failing = {job.name for job in jobs if (job / "points.csv").read_text() == "fail"}
    keys = Counter(headers["Idempotency-Key"] for headers, _ in taken.requests)
    reported = Counter((root / "begun").read_text().split())
    left = [path for path in (root / "reports").rglob("*") if ".unfinished-" in path.name or path.name == ".placing"]
    told = Counter(name for _, body in taken.requests for name in told_in(json.loads(body)))
    return {
        "jobs": len(jobs),
        "with one whole certificate": len(whole),
        "reported more than once": sum(n > 1 for n in reported.values()),
        "no pass": len(failing),
        "no pass and told": len(failing & set(told)),
        "told more than once": sum(n > 1 for n in told.values()),
        "messages": len(taken.requests),
        "messages that came again under their key": sum(n - 1 for n in keys.values()),
        "unfinished files left": len(left),
        "locks left": len(list((root / "reports" / ".scheduled" / "locks").iterdir())),
    }


def told_in(message: dict[str, str]) -> list[str]:
    """Jobs that a message is about: one, or a list of several."""
    return [message["about"]] if message["about"] else re.findall(r"fail: job (\S+)", message["text"])


def kills(count: int, seed: int) -> dict[str, int]:
    """Killed so often, then left alone."""
    dice, taken = random.Random(seed), Taken()
    with tempfile.TemporaryDirectory() as folder, web_server(taken) as port:
        root = Path(folder)
        begin(root, 200, 3)
        killed = more = 0
        while killed < count:
            run = start(root, port)
            begun(run)
            time.sleep(dice.expovariate(2.0))
            if run.poll() is None:
                run.kill()
                killed += 1
            elif run.wait() not in (0, 1):
                raise SystemExit(f"ended with {run.returncode}")
            elif len(list((root / "jobs").iterdir())) == len(list((root / "reports").glob("*-*"))):
                more += 1
                for i in range(100):
                    new = root / "jobs" / f"more-{more:03}-{i:03}"
                    new.mkdir()
                    (new / "points.csv").write_text("fail" if i % 3 == 0 else "pass")
                    (new / "job.toml").write_text(JOB.format(id=new.name))
            run.wait()
        if start(root, port).wait() not in (0, 1):
            raise SystemExit("the last run failed")
        return {"kills": killed, **judged(root, taken)}


def crowd(schedulers: int) -> dict[str, int]:
    """All at once over the same folders."""
    taken = Taken()
    with tempfile.TemporaryDirectory() as folder, web_server(taken) as port:
        root = Path(folder)
        begin(root, 400, 3)
        runs = [start(root, port) for _ in range(schedulers)]
        codes = [run.wait() for run in runs]
        if max(codes) > 1:
            raise SystemExit(f"ended with {codes}")
        found = judged(root, taken)
        shutil.rmtree(root / "jobs")
        return {"schedulers": schedulers, **found}


def main(count: int = 200, seed: int = 1, schedulers: int = 8) -> None:
    for title, found in (("kills", kills(count, seed)), ("crowd", crowd(schedulers))):
        print(title, *(f"  {what}: {number}" for what, number in found.items()), sep="\n")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
