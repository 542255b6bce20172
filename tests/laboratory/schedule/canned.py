"""A process that answers jobs of a batch at once with what a report of them might say: it computes and imports nothing.

A job whose remarks say "refuse", "hang" or "kill PATH" is answered so; the last kills the process unless PATH is there.
"""

from __future__ import annotations

import hashlib
import json
import os
import signal
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from cmm_uq import __version__
from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.schedule.processes import serve


def begin(setting: tuple[int, bool]) -> Callable[[int, Any], dict[str, bytes]]:
    return lambda number, task: answer(task, *setting)


def answer(task: tuple[str, dict[str, bytes], Any], seed: int, results_only: bool) -> dict[str, bytes]:
    files = task[1]
    job = tomllib.loads(files["job.toml"].decode())["job"]
    match job.get("remarks", "").split():
        case ["refuse"]:
            raise CmmUqError("is refused", where="job.toml", fix="Mend it")
        case ["hang"]:
            time.sleep(600)
        case ["kill", path] if not Path(path).exists():
            Path(path).touch()
            os.kill(os.getpid(), signal.SIGKILL)
        case ["slow"]:
            time.sleep(0.3)
    contents = {"results.json": json.dumps(results(job, files, seed), indent=2).encode()}
    documents = {
        "certificate-simulated.html": b"<p>",
        "certificate-simulated.pdf": b"%",
        "certificate-simulated.xml": b"<a/>",
    }
    return contents if results_only else contents | documents


def results(job: dict[str, Any], files: dict[str, bytes], seed: int) -> dict[str, Any]:
    value = len(job["id"]) + 0.5
    return {
        "software": {"name": "cmm-uq", "version": __version__},
        "job": {
            "id": job["id"], "origin": "simulated", "date": job["date"].isoformat(), "machine": "M 1", "serial": "7",
            "inputs_sha256": {name: hashlib.sha256(content).hexdigest() for name, content in files.items()},
        },
        "estimates": {"scale_x": {"ppm": {"value": value, "u": 0.5, "interval95": [value - 1, value + 1]}}},
        "sampling": {"seed": seed},
        "conformity": [],
        "diagnosis": {"verdict": "mismatch" if job.get("remarks") == "mismatch" else "consistent"},
    }  # fmt: skip


if __name__ == "__main__":
    serve(begin)
