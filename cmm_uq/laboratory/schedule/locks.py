"""One run at a job: a lock file for each, whose lock the system releases when its process ends, however it ends.

While a run is at the job its file says so, and says nothing afterwards: words in a file that nobody holds were left by a
run that ended in the middle.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from cmm_uq.base.errors import OutputError
from cmm_uq.base.output.staging import locked

_BEGUN = b"begun\n"
_ATTEMPTS = 20  # at a file that others lock and remove at the same time


@dataclass(eq=False)
class Turn:
    """The lock of a file, held."""

    path: Path
    descriptor: int
    resumed: bool  # whether a run ended before it was through with what the lock is of
    through: bool = True  # whether this one is, so that it may be forgotten

    def end(self) -> None:
        if self.through:
            try:
                self.path.unlink()
            except OSError:  # on Windows while it is open; empty it says the same
                with contextlib.suppress(OSError):
                    os.ftruncate(self.descriptor, 0)
        os.close(self.descriptor)


def turn_at(path: Path) -> Turn | None:
    """Take a lock without waiting; ``None`` where another process holds it."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        for _ in range(_ATTEMPTS):
            try:
                descriptor = locked(path, create=True)
            except FileExistsError:
                descriptor = locked(path, create=False)
            if descriptor is not None:
                break
            if path.exists():
                return None
        else:
            return None
        resumed = bool(os.read(descriptor, len(_BEGUN)))
        if not resumed:
            os.write(descriptor, _BEGUN)
    except OSError as error:
        fix = "Free the disk, or mend the permissions"
        raise OutputError(f"cannot be locked: {error.strerror}", where=str(path), fix=fix) from error
    return Turn(path, descriptor, resumed)


@contextlib.contextmanager
def turn(path: Path, *, patience_s: float = 0.0) -> Iterator[Turn | None]:
    """A lock while something is done; ``None`` where another process holds it for longer than ``patience_s`` seconds."""
    deadline = time.monotonic() + patience_s
    taken = turn_at(path)
    while taken is None and time.monotonic() < deadline:
        time.sleep(0.05)
        taken = turn_at(path)
    try:
        yield taken
    finally:
        if taken is not None:
            taken.end()


def was_left(path: Path) -> bool:
    """Whether a run that is no more ended at what a lock is of; one that is at it now looks the same."""
    try:
        return path.stat().st_size > 0
    except OSError:
        return False
