"""A Dask scheduler and workers of one thread each on this machine, processes as a laboratory starts them."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def local_cluster(workers: int) -> Iterator[str]:
    """Address of its scheduler."""
    begun: list[subprocess.Popen[bytes]] = []

    def begin(what: str, *options: str) -> None:
        command = [sys.executable, "-m", f"distributed.cli.dask_{what}", "--no-dashboard", *options]
        begun.append(subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))

    with tempfile.TemporaryDirectory() as folder:
        said = Path(folder) / "scheduler.json"
        try:
            begin("scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(said))
            while not said.exists() or not said.read_text().endswith("}"):
                time.sleep(0.1)
            address = json.loads(said.read_text())["address"]
            for _ in range(workers):
                begin("worker", address, "--nthreads", "1", "--local-directory", folder)
            from distributed import Client

            with Client(address, set_as_default=False) as client:
                client.wait_for_workers(workers, timeout=300)
            yield address
        finally:
            for process in begun[::-1]:
                process.terminate()
            for process in begun:
                process.wait()
