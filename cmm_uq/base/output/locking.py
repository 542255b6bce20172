"""Locks that the system releases when their process ends, however it ends."""

from __future__ import annotations

import os
from pathlib import Path


def locked(path: Path, *, create: bool) -> int | None:
    """Take the lock of a file without waiting.

    Parameters
    ----------
    path : of the lock file.
    create : make it, and fail where it is there already; otherwise it must be there.

    Returns
    -------
    descriptor that holds the lock until it is closed; ``None`` where another process holds it, or the file is gone.
    """
    try:
        descriptor = os.open(path, os.O_RDWR | (os.O_CREAT | os.O_EXCL if create else 0), 0o600)
    except (FileNotFoundError, FileExistsError):
        if create:
            raise
        return None
    if _lock(descriptor) and _still(path, descriptor):
        return descriptor
    os.close(descriptor)
    return None


def _lock(descriptor: int) -> bool:
    try:
        if os.name == "nt":
            import msvcrt

            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
        else:
            import fcntl

            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _still(path: Path, descriptor: int) -> bool:
    """Whether the path names the file that was locked: another process may have removed it in between."""
    try:
        return os.path.samestat(path.stat(), os.fstat(descriptor))
    except OSError:
        return False
