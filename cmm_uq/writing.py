"""Writes a set of files whole or not at all."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

from cmm_uq.errors import CmmUqError


@contextlib.contextmanager
def staging(folder: Path) -> Iterator[Path]:
    """A new folder beside ``folder`` to write into, gone afterwards; fails at once where nothing can be written.

    Raises
    ------
    CmmUqError : the place cannot be written to.
    """
    made = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    with _told(folder):
        if folder.exists() and not folder.is_dir():
            raise CmmUqError("is a file, not a folder", where=str(folder), fix="Choose another folder with --out")
        folder.mkdir(parents=True, exist_ok=True)
        place = Path(tempfile.mkdtemp(prefix=".unfinished-", dir=folder))
    try:
        yield place
    finally:
        shutil.rmtree(place, ignore_errors=True)
        for parent in made:
            with contextlib.suppress(OSError):
                parent.rmdir()


def write_whole(place: Path, folder: Path, contents: Mapping[str, bytes]) -> dict[str, Path]:
    """Write every file into the staging ``place``, and only then move all of them into ``folder``.

    Returns
    -------
    path of each file.

    Raises
    ------
    CmmUqError : the disk is full, or the place cannot be written to; what stood there before is untouched.
    """
    with _told(folder):
        for name, content in contents.items():
            with (place / name).open("wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
        for name in contents:
            (place / name).replace(folder / name)
    return {name: folder / name for name in contents}


@contextlib.contextmanager
def _told(folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise CmmUqError(f"cannot be written: {error.strerror or error}", where=str(folder),
                         fix="Free the disk, mend the permissions, or choose another --out") from error  # fmt: skip
