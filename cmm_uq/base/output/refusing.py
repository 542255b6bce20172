"""What the system refuses to write, in words."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from cmm_uq.base.errors import OutputError


@contextlib.contextmanager
def writing_to(path: Path, fix: str) -> Iterator[None]:
    """While something is written there.

    Parameters
    ----------
    path : of a file or folder.
    fix : what is to be done about a refusal.

    Raises
    ------
    OutputError : the disk is full, or the place cannot be written to.
    """
    try:
        yield
    except (OSError, ValueError) as error:
        what = error.strerror or error if isinstance(error, OSError) else error
        raise OutputError(f"cannot be written: {what}", where=str(path), fix=fix) from error
