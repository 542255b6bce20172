"""Time and peak memory of the commands on recordings of any size: ``python -m benchmarks.sizes.study FOLDER [--only WORDS]``.

Every case is a process of its own; time is user and system time, memory the largest that the process held.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path

from benchmarks.sizes.recordings import CASES, write

COMMANDS = ("report", "diagnose")


def measured(command: str, job: Path, out: Path) -> tuple[float, float, int]:
    """Processor time in s, peak memory in MiB, and the exit code."""
    process = subprocess.Popen(
        [sys.executable, "-m", "cmm_uq", command, str(job), "--out", str(out), "--quiet", "--force"],
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    _, status, usage = os.wait4(process.pid, 0)
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024, os.waitstatus_to_exitcode(status)


def main() -> None:
    """Write what is missing, run, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="*", default=[], help="words of the cases' names")
    parser.add_argument("--commands", nargs="*", default=COMMANDS)
    chosen = parser.parse_args()
    print("| recording | command | s | MiB |\n| --- | --- | ---: | ---: |", flush=True)
    for name, made in CASES.items():
        if chosen.only and not any(word in name for word in chosen.only):
            continue
        job = chosen.folder / name.translate(str.maketrans({" ": "-", "×": "x", ",": None}))
        if not (job / "job.toml").exists():
            write(made(), job)
        for command in chosen.commands:
            seconds, memory, code = measured(command, job, chosen.folder / "out" / command / job.name)
            told = f"{seconds:.1f} | {memory:.0f}" if code == 0 else f"ended with code {code} after {seconds:.1f} s |"
            print(f"| {name} | {command} | {told} |", flush=True)


if __name__ == "__main__":
    main()
