"""One new file, whole or not at all, and over nothing; what the system refuses to write, in words."""

from __future__ import annotations

import contextlib
import errno
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from cmm_uq.base.errors import OutputError
from cmm_uq.base.output import interruption
from cmm_uq.base.output.manifest import free_name


@contextlib.contextmanager
def writing_to(path: Path, fix: str) -> Iterator[None]:
    try:
        yield
    except (OSError, ValueError) as error:
        what = error.strerror or error if isinstance(error, OSError) else error
        raise OutputError(f"cannot be written: {what}", where=str(path), fix=fix) from error


_TAKEN, _FOLDER = "Name another file; nothing is overwritten", "Name a folder that exists"
_MENDED = "Free the disk, mend the permissions, or name another file"


def write_new(out: Path, content: bytes) -> None:
    """Write a file that is not there yet."""
    with new_file(out) as path:
        path.write_bytes(content)


def refuse_taken(out: Path) -> None:
    """Make sure, before there is anything to write, that a new file could be there."""
    if os.path.lexists(out):
        raise OutputError("is there already", where=str(out), fix=_TAKEN)
    if not out.parent.is_dir():
        raise OutputError("cannot be written: no such folder", where=str(out), fix=_FOLDER)


@contextlib.contextmanager
def new_file(out: Path, *, force: bool = False) -> Iterator[Path]:
    """Where a file is to be written that then takes its place; where that fails, nothing is left, after a signal neither."""
    unfinished = _Unfinished()
    with interruption.staged(unfinished):
        try:
            with tempfile.NamedTemporaryFile(dir=out.parent, prefix=".unfinished-", delete=False) as file:
                unfinished.name = file.name
            yield Path(unfinished.name)
            if force and os.path.lexists(out):
                out.rename(out.parent / free_name(out.parent, out.name))
            os.link(unfinished.name, out)
        except FileExistsError:
            raise OutputError("is there already", where=str(out), fix=_TAKEN) from None
        except OSError as error:
            fix = _FOLDER if error.errno in (errno.ENOENT, errno.ENOTDIR) else _MENDED
            raise OutputError(f"cannot be written: {error.strerror}", where=str(out), fix=fix) from error
        finally:
            unfinished.discard()


class _Unfinished:
    """The file before it takes its place."""

    name = ""

    def discard(self) -> None:
        with contextlib.suppress(OSError):
            os.unlink(self.name)  # noqa: PTH108 - may be empty
