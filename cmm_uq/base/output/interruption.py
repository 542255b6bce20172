"""What a signal finds: whether anything is staged, being put in place, or written.

A thread waits for SIGINT and SIGTERM, because the main thread may be far inside a library when they come, and libraries
swallow or print exceptions. It tells the truth about what was written, removes what was staged, and ends the process. From
the signal on no other thread begins to stage or to place anything: what it wrote after its stage was removed would stay.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from types import FrameType
from typing import Protocol, TypeVar

# how long to wait for files that are just being put in place: the process ends within two seconds of a signal
PATIENCE_S = 1.2
_LONGER_S = 5 * PATIENCE_S  # longer than the process has left


class Unplaced(Protocol):
    """Something on its way to its place."""

    def discard(self) -> None:
        """Remove it."""


Held = TypeVar("Held")
_placing = threading.Lock()
_stages: list[Unplaced] = []
_written: list[Path | str] = []
_going_in: list[Path | str] = []
_inside: list[tuple[Path | str, Unplaced | None]] = []
_changing: list[int] = []
_signalled: list[int] = []
_speaking: list[Callable[[], None]] = []
_keeping: list[Callable[[], str]] = []


@contextlib.contextmanager
def _held(those: list[Held], one: Held) -> Iterator[None]:
    those.append(one)
    try:
        yield
    finally:
        those.remove(one)


def staged(place: Unplaced) -> AbstractContextManager[None]:
    """While something is staged, a signal removes it."""
    return _held(_stages, place)


@contextlib.contextmanager
def changing() -> Iterator[None]:
    """While a thread writes to what is staged, a signal waits for it; after one, nobody begins to."""
    thread = threading.get_ident()
    _changing.append(thread)  # before one looks: a signal in between waits, or is seen here
    try:
        if _signalled:
            _changing.remove(thread)
            give_way()
            _changing.append(thread)
        yield
    finally:
        _changing.remove(thread)
        give_way()


@contextlib.contextmanager
def placing(where: Path | str, staged: Unplaced | None = None) -> Iterator[None]:
    """While files are put in place, a signal waits; afterwards it says that they were written."""
    give_way()  # of a thread that is not the one that a signal stops
    _going_in.append(where)  # before the lock: a signal in between must not stop whoever holds it
    try:
        _placing.acquire()
        while _signalled:  # a signal came while others had the lock: it is not for who waited
            _placing.release()
            give_way()
            _placing.acquire()
        _inside.append((where, staged))
        try:
            yield
            if not _keeping:  # or there may be a hundred thousand of them, and what is kept is said
                _written.append(where)
        finally:
            _inside.clear()
            _placing.release()
    finally:
        _going_in.remove(where)


def speaking(hush: Callable[[], None]) -> AbstractContextManager[None]:
    """While somebody writes to the terminal by itself, a signal calls ``hush`` before it says anything."""
    return _held(_speaking, hush)


def keeping(what: Callable[[], str]) -> AbstractContextManager[None]:
    """While a command keeps what it has on the disk already, a signal says so; ``what`` follows "interrupted; "."""
    return _held(_keeping, what)


def written() -> tuple[Path | str, ...]:
    """Folders whose files this process has put in place, and records to which it added."""
    return tuple(_written)


def watch() -> None:
    """From now on SIGINT and SIGTERM end the process within two seconds, with what is true of its files.

    For the command line; a program that uses the package as a library keeps its own handling, and an exception that it
    raises leaves no half-written file either.
    """
    reading, writing = os.pipe()
    # on Windows pipes always block, and a pipe of two bytes never fills
    with contextlib.suppress(AttributeError, OSError):
        os.set_blocking(writing, False)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _stand_still)
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    threading.Thread(target=_wait, args=(reading,), name="signals", daemon=True).start()


def give_way() -> None:
    """Where a signal came, it decides how the process ends."""
    if _signalled:
        time.sleep(_LONGER_S)


def done() -> None:
    """Before a normal end: from here on a signal changes nothing, not even while the interpreter shuts down."""
    give_way()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


def _stand_still(number: int, frame: FrameType | None) -> None:
    """The main thread starts nothing new while the other one ends the process, but completes what it puts in place."""
    _signalled.append(number)
    if not _going_in and threading.get_ident() not in _changing:
        give_way()


def _wait(reading: int) -> None:
    while True:
        number = os.read(reading, 1)[0]
        if number in (signal.SIGINT, signal.SIGTERM):
            _end(number)


def _end(number: int) -> None:
    try:
        _signalled.append(number)
        said = _removed()
        for hush in _speaking.copy():
            hush()
        with contextlib.suppress(OSError, ValueError, AttributeError):
            if sys.stderr.isatty():
                sys.stderr.write("\r\x1b[2K\x1b[?25h")  # a progress bar hides the cursor
            sys.stderr.write(f"cmm-uq: interrupted{said}\n")
            sys.stderr.flush()
    finally:
        os._exit(128 + number)


def _removed() -> str:
    """Remove what is staged, and say what is true of the rest."""
    deadline = time.monotonic() + PATIENCE_S
    alone = _placing.acquire(timeout=PATIENCE_S)
    inside = [] if alone else _inside.copy()
    while _changing and time.monotonic() < deadline:
        time.sleep(0.002)
    for place in _stages.copy():
        if all(place is not staged for _, staged in inside):
            place.discard()
    if _written:
        return f"; what was asked for is written in {', '.join(map(str, _written))}"
    if inside:
        where = ", ".join(str(place) for place, _ in inside)
        return f" while files were put in place; the next command in {where} completes it or takes it back"
    return f"; {_keeping[-1]() if _keeping else 'nothing was written'}"
