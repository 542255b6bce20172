"""Parts of the study whose cases are processes of the command, one at a time: files, recordings, kills, terminals."""

from __future__ import annotations

import shutil
import signal
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.hostile import acquisitions as recording, every_command, kills, processes, terminals as lines
from benchmarks.hostile.cases import Case
from benchmarks.hostile.invariants import Outcome
from benchmarks.hostile.warm import Warm
from benchmarks.hostile.worker import run_of_command

STARTED = 10
"""Every so many-th case is a process that imports everything itself; the others are forked from one that has."""
SERVES_S = 2.0
"""For which the page of the records is served before it is ended."""


def altered(seed: int, root: Path, numbers: Sequence[int]) -> Iterator[dict[str, Any]]:
    """Cases of :mod:`benchmarks.hostile.every_command`, each a process."""
    with Warm() as warm:
        for number in numbers:
            this = every_command.case(seed, number)
            yield run_of_command(this, partial(_process, this, warm, root / "case"), root / "case", lambda: None)


def _process(this: Case, warm: Warm, root: Path, arguments: tuple[str, ...]) -> Outcome:
    run: Callable[..., Outcome] = processes.run if this.number % STARTED == 0 else warm.run
    return run(arguments, root, kill=(signal.SIGTERM, SERVES_S) if this.target in ("serve", "desk") else None)


def acquisitions(seed: int, root: Path, numbers: Sequence[int]) -> Iterator[dict[str, Any]]:
    """Kills of sessions; ``accepted`` counts the points that were said to be."""
    with Warm() as warm:
        for number in numbers:
            outcome, found, accepted = recording.strike(seed, number, root / f"{number}", warm)
            shutil.rmtree(root / f"{number}")
            what = recording.what(seed, number)
            yield _record(number, what.split()[0], what, outcome, found) | {"accepted": accepted}


def calls(seed: int, root: Path, numbers: Sequence[int]) -> Iterator[dict[str, Any]]:
    """Kills at system calls that change the disk."""
    with Warm() as warm:
        for number in numbers:
            forked = None if number % STARTED == 0 else warm
            kill = kills.chosen(seed, number, forked)
            outcome, found = kills.strike(kill, root / f"{number}", forked)
            shutil.rmtree(root / f"{number}")
            yield _record(number, f"{kill.command}, {kill.signal}", f"{kill.command}, {kill.what}", outcome, found)


def terminals(root: Path, numbers: Sequence[int]) -> Iterator[dict[str, Any]]:
    """Cases of :mod:`benchmarks.hostile.terminals`."""
    trials = list(lines.trials().items())
    with Warm() as warm:
        for number in numbers:
            what, trial = trials[number]
            yield _record(number, what.partition(":")[0], what, *trial(root / f"{number}", warm))


def _record(number: int, target: str, what: str, outcome: Outcome, found: list[str]) -> dict[str, Any]:
    return {"number": number, "target": target, "what": what, "code": outcome.code, "ran": "", "found": found,
            "said": outcome.stderr[-1500:] if found else "", "seconds": outcome.seconds}  # fmt: skip
