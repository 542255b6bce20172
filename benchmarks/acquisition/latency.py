"""From a machine's point to the operator's screen: ``python -m benchmarks.acquisition.latency [POINTS]``.

A simulated I++ DME server at a real socket picks points at random moments while three loggers at real sockets send ten lines a
second; the session writes to a real disk and draws its screen on a real pseudo-terminal. The time to
the screen is from the stamp of the reading, when its last byte was there, until the terminal has its coordinates: it holds the
disk and the drawing.
"""

from __future__ import annotations

import os
import pty
import random
import select
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from cmm_uq.laboratory.live.instruments.ipp_server import SimulatedIppServer
from cmm_uq.laboratory.live.instruments.simulated_line import Lines, SimulatedLine
from cmm_uq.laboratory.live.story import read_story
from tests.laboratory.live.session import job_folder

TERMINAL = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "110", "LINES": "45"}


def main(points: int) -> None:
    machine, dice = SimulatedIppServer(), random.Random(0)
    with ExitStack() as stack, tempfile.TemporaryDirectory() as folder:
        loggers = [stack.enter_context(SimulatedLine(Lines(), "socket")) for _ in range(3)]
        more = f'[[acquire.source]]\nname = "cmm"\nprofile = "ipp"\nport = "{machine.url}"\n'
        for i, logger in enumerate(loggers):
            more += f'[[acquire.source]]\nname = "l{i}"\nprofile = "line-logger"\nport = "{logger.port}"\n'
            more += f'values = {{ value1 = "temp_{i}_c", value2 = "humid_{i}", value3 = "dew_{i}" }}\n'
        rows = [f"{m},{p},1,{100 if p == 1 else 600},100,-300,0" for m in range(1, points + 1) for p in (1, 2)]
        job = job_folder(
            Path(folder) / "job", more, "measurement,point,repeat,x_mm,y_mm,z_mm,time_s\n" + "\n".join(rows) + "\n"
        )
        master, slave = pty.openpty()
        with subprocess.Popen([sys.executable, "-m", "cmm_uq", "acquire", str(job)], stdin=slave, stdout=slave, stderr=slave,
                              env=TERMINAL) as process:  # fmt: skip
            until(master, b"next:", 60)
            time.sleep(2)
            sent, seen = list[int](), list[int]()
            for i in range(points):
                x, y = (100.0, 600.0)[i % 2] + i / 1000, 100 + i / 100
                drain(master, dice.uniform(0.2, 0.5))
                sent.append(time.time_ns())
                machine.pick(x, y, -300.0)
                until(master, f"{x:.4f}, {y:.4f}".encode(), 20)
                seen.append(time.time_ns())
            os.write(master, b"quit\r")
            drain(master, 2)
            process.wait(20)
        came = [point.moment.utc_ns for point in read_story(job / "acquisition").points.values()]
    machine.close()
    told("from the reading to the screen", np.array(seen) - came)
    told("from the machine to the reading", np.array(came) - sent)
    print(f"{points} points; load of the computer {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")


def told(what: str, ns: np.ndarray) -> None:
    low, middle, high, most = np.percentile(ns / 1e6, [0, 50, 95, 100])
    print(f"{what}: {middle:.1f} ms in the middle, {high:.1f} ms for 95 %, {low:.1f} to {most:.1f} ms")


def until(master: int, wanted: bytes, patience_s: float) -> None:
    seen, deadline = b"", time.monotonic() + patience_s
    while wanted not in seen:
        assert time.monotonic() < deadline, seen[-500:]
        if select.select([master], [], [], 0.1)[0]:
            seen += os.read(master, 1 << 16)


def drain(master: int, s: float) -> None:
    deadline = time.monotonic() + s
    while (left := deadline - time.monotonic()) > 0:
        if select.select([master], [], [], left)[0]:
            try:
                os.read(master, 1 << 16)
            except OSError:
                return


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 60)
