"""Worker processes for the mutations, each case with a hard limit of time; a worker that hangs is replaced."""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import queue
import select
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from benchmarks.hostile import every_command
from benchmarks.hostile.cases import case
from benchmarks.hostile.invariants import SECONDS

COMPUTES = 60.0
"""Seconds of computing after which a full run is stopped."""
CASES = 3000
"""After which a worker is replaced by a fresh one, so that none grows."""
TICKS = os.sysconf("SC_CLK_TCK")
WORKER = [sys.executable, "-m", "benchmarks.hostile.worker"]
ROOT = Path(__file__).parents[2]


class Worker:
    """One worker process and the pipe on which it replies."""

    def __init__(self, seed: int, root: Path, part: str = "mutations") -> None:
        reading, writing = os.pipe()
        command = [*WORKER, "--seed", str(seed), "--root", str(root), "--reply", str(writing), "--part", part]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, pass_fds=[writing], cwd=ROOT,
                                         stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # fmt: skip
        os.close(writing)
        self._replies = os.fdopen(reading, "rb", buffering=0)  # two replies may come at once, and both must wake select
        self.cases = 0

    def run(self, number: int) -> dict[str, object] | str:
        """The record of a case, or what became of the worker."""
        self.cases += 1
        assert self._process.stdin is not None
        self._process.stdin.write(f"{number}\n".encode())
        self._process.stdin.flush()
        limit, wall, cpu = SECONDS, time.monotonic(), self._cpu()
        while True:
            if select.select([self._replies], [], [], 0.5)[0]:
                line = self._replies.readline()
                if not line:
                    return f"the process died ({self._process.wait()})"
                message = json.loads(line)
                if "done" in message:
                    return dict(message["done"])
                limit, wall, cpu = COMPUTES, time.monotonic(), self._cpu()
            spent, passed = self._cpu() - cpu, time.monotonic() - wall
            if spent > limit or (passed > limit and spent < passed / 20) or passed > 10 * limit:
                return "hangs" if limit == SECONDS else f"computes more than {COMPUTES:g} s"

    def _cpu(self) -> float:
        try:
            fields = Path(f"/proc/{self._process.pid}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            return 0.0
        return (int(fields[11]) + int(fields[12])) / TICKS

    def end(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        self._process.kill()
        self._process.wait()
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.close()
        self._replies.close()


def run_all(
    numbers: Iterable[int], seed: int, workers: int, root: Path, part: str = "mutations"
) -> Iterator[dict[str, Any]]:
    """Records of all cases, as they come.

    Parameters
    ----------
    numbers : of the cases.
    seed : of the study.
    workers : processes at once.
    root : folder to work in, in memory where possible.
    part : mutated inputs, or every command.
    """
    if part != "mutations" and not Path(os.environ.get(every_command.HELD, "")).is_file():
        root.mkdir(parents=True, exist_ok=True)
        every_command.keep(root / "files.zip")
    waiting, lock = iter(numbers), threading.Lock()
    records: queue.Queue[dict[str, Any] | None] = queue.Queue()

    def work(place: int) -> None:
        worker = Worker(seed, root / f"worker-{place}", part)
        for _ in itertools.count():
            with lock:
                number = next(waiting, None)
            if number is None:
                break
            record = worker.run(number)
            if isinstance(record, str):
                this = (case if part == "mutations" else every_command.case)(seed, number)
                ran = this.command[0] if this.command else ""
                record = {"number": number, "target": this.target, "what": this.what, "code": None, "ran": ran,
                          "found": [record], "said": "", "seconds": 0.0}  # fmt: skip
                worker.cases = CASES
            records.put(record)
            if worker.cases >= CASES:
                worker.end()
                worker = Worker(seed, root / f"worker-{place}", part)
        worker.end()
        shutil.rmtree(root / f"worker-{place}", ignore_errors=True)
        records.put(None)

    threads = [threading.Thread(target=work, args=(place,), daemon=True) for place in range(workers)]
    for thread in threads:
        thread.start()
    for _ in threads:
        while (record := records.get()) is not None:
            yield record
