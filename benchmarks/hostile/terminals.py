"""Pseudo-terminals that vanish, are silent or babble: instruments at one, and the operator's own."""

from __future__ import annotations

import contextlib
import os
import pty
import select
import signal
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from benchmarks.hostile.acquisitions import MISCHIEF, PLAN, Session, instrument, job, kept, misbehave, typed
from benchmarks.hostile.invariants import Outcome, problems
from benchmarks.hostile.warm import Warm

AFTER_S = 0.2
"""When an instrument begins to do wrong."""
PATIENCE_S = 30.0
BABBLE = bytes(sorted({*range(256)} - {3, 4, 26, 28}))
"""Every byte but those by which a terminal interrupts, ends, suspends or quits."""
Trial = Callable[[Path, Warm], tuple[Outcome, list[str]]]


def trials() -> dict[str, Trial]:
    """Every case, by its words."""
    found: dict[str, Trial] = {}
    for mischief in MISCHIEF:
        for verb in ("test", "watch"):
            for first in (True, False):
                when = "from the first" if first else "while it is listened to"
                found[f"instruments {verb}: it {mischief}, {when}"] = partial(_listened, verb, mischief, first)
        found[f"acquire: an instrument {mischief}, and the operator quits"] = partial(_acquired, mischief)
    return found | {
        f"acquire: the operator's terminal {mischief}{', of its session' if own else ''}": partial(_operated, mischief, own)
        for mischief in ("vanishes", "is silent", "babbles") for own in (True, False)
    }  # fmt: skip


def _listened(verb: str, mischief: str, first: bool, folder: Path, warm: Warm) -> tuple[Outcome, list[str]]:
    folder.mkdir(parents=True)
    with instrument(folder, mischief) as line:
        assert line is not None
        port = line.port
        if first:
            misbehave(line, mischief)
        later = threading.Timer(AFTER_S, misbehave, (line, mischief))
        if not first:
            later.start()
        outcome = warm.run(["instruments", verb, "line-logger", port, "--seconds", "0.8"], folder, limit=PATIENCE_S)
        if not first:
            later.join()
        if mischief == "vanishes":
            line.plug_in()  # to be closed
    found = problems(outcome, quiet=False)
    return outcome, found + ([f"exit code {outcome.code}"] if not found and outcome.code not in (0, 2) else [])


def _acquired(mischief: str, folder: Path, warm: Warm) -> tuple[Outcome, list[str]]:
    folder.mkdir(parents=True)
    with instrument(folder, mischief) as line:
        assert line is not None
        place = job(folder / "job", line.port)
        session = Session(warm, place, 1)
        session.type(*map(typed, PLAN[:4]))
        session.hear("^accepted: .*measurement 2, point 2")
        misbehave(line, mischief)
        session.type(*map(typed, PLAN[4:8]))
        session.hear("^accepted: .*measurement 4, point 2")
        session.type("quit\n", "quit\n")
        outcome = session.end()
        if mischief == "vanishes":
            line.plug_in()
    found = problems(outcome, quiet=False)
    said = session.accepted
    if said != PLAN[:8] or list(kept(place)) != said:
        found.append("an accepted point is lost, or is not accepted")
    if "vanishes" in mischief and not any(one.startswith("air") for one in session.told):
        found.append("it is not said that the instrument is gone")
    return outcome, found


def _operated(mischief: str, own: bool, folder: Path, warm: Warm) -> tuple[Outcome, list[str]]:
    """The screen on a terminal that goes, says nothing more, or sends every byte; points that it showed are kept."""
    folder.mkdir(parents=True)
    place, errors = job(folder / "job", None), folder / "errors"
    master, slave = pty.openpty()
    name = os.ttyname(slave)
    streams = (name, name, errors) if own else (f"/proc/{os.getpid()}/fd/{slave}",) * 2 + (errors,)
    process = warm.start(["acquire", str(place)], folder, streams=streams, environment={"TERM": "xterm"})
    _see(master, b"next: ")  # what is typed before the screen is there is not read
    os.write(master, "".join(map(typed, PLAN[:2])).encode().replace(b"\n", b"\r"))
    _see(master, b"measurement 1, point 2")
    _see(master, b"measurement 2")
    os.close(slave)
    if mischief == "babbles":
        with contextlib.suppress(OSError):
            os.write(master, BABBLE * 8 + b"\x1b[2J" * 100)
    began = time.monotonic()
    if mischief == "vanishes":
        os.close(master)
        ended = warm.ended(PATIENCE_S)
    else:
        time.sleep(AFTER_S)
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, signal.SIGTERM)
        ended = warm.ended(PATIENCE_S)
        os.close(master)
    if ended is None:
        os.killpg(process, signal.SIGKILL)
        warm.ended(PATIENCE_S)
    said = errors.read_text(encoding="utf-8", errors="replace")
    outcome = Outcome(ended[0] if ended else None, "", said, time.monotonic() - began)
    found = ["hangs"] if ended is None else ["a traceback"] if "Traceback" in said else []
    allowed = (0, 3, -signal.SIGHUP) if mischief == "vanishes" else (0, 143)  # babble may be a word that ends it
    if ended and ended[0] not in allowed:
        found.append(f"exit code {ended[0]}")
    return outcome, found + (["an accepted point is lost"] if not set(PLAN[:2]) <= set(kept(place)) else [])


def _see(master: int, wanted: bytes) -> None:
    """Read what a terminal shows until it has what is wanted, or for too long."""
    shown, until = b"", time.monotonic() + PATIENCE_S
    while wanted not in shown and time.monotonic() < until:
        if select.select([master], [], [], 0.1)[0]:
            shown += os.read(master, 65536)
