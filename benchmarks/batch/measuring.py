"""What a run costs while it runs: memory of this process and of its children, and the time that workers stand idle."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import Self
from unittest import mock

from cmm_uq.laboratory.schedule.processes import WorkerProcess

PAGE_MB = os.sysconf("SC_PAGE_SIZE") / 2**20 if hasattr(os, "sysconf") else 4096 / 2**20


def memory_mb(pid: int | str = "self") -> float:
    """Resident memory of a process, MiB; 0 where it is no more."""
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * PAGE_MB
    except (OSError, ValueError, IndexError):
        return 0.0


def children() -> list[int]:
    """Processes that this one began."""
    found: list[int] = []
    for task in Path("/proc/self/task").iterdir():
        with contextlib.suppress(OSError):  # a thread that just ended
            found += map(int, (task / "children").read_text().split())
    return found


class Watch:
    """Memory every few seconds, processor time of this process, and how long each process was at work."""

    def __init__(self, every_s: float = 2.0) -> None:
        self.every_s, self.memory, self.busy_s = every_s, list[tuple[float, float, float]](), 0.0
        self._over, self._lock = threading.Event(), threading.Lock()
        self._thread = threading.Thread(target=self._look, daemon=True)

    def __enter__(self) -> Self:
        ask = WorkerProcess.ask

        def timed(talk: WorkerProcess, number: int, task: object) -> object:
            began = time.monotonic()
            try:
                return ask(talk, number, task)
            finally:
                with self._lock:
                    self.busy_s += time.monotonic() - began

        self._timed = mock.patch.object(WorkerProcess, "ask", timed)
        self._timed.start()
        self.began, self.cpu_s = time.monotonic(), time.process_time()
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.seconds, self.cpu_s = time.monotonic() - self.began, time.process_time() - self.cpu_s
        self._over.set()
        self._thread.join()
        self._timed.stop()

    def _look(self) -> None:
        while not self._over.wait(self.every_s):
            self.memory.append(
                (time.monotonic() - self.began, memory_mb(), max((memory_mb(pid) for pid in children()), default=0.0))
            )

    def curve(self, points: int = 6) -> str:
        """Memory at some moments: of this process, and of the largest of its children."""
        if not self.memory:
            return "too short to look at"
        steps = [round(i * (len(self.memory) - 1) / (points - 1)) for i in range(points)]
        return "; ".join(f"{t:.0f} s: {own:.0f} + {child:.0f}" for t, own, child in (self.memory[i] for i in steps))
