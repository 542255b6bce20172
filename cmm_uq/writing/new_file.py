"""One new file, whole or not at all, and over nothing."""

from __future__ import annotations

import contextlib
import os
import tempfile
from pathlib import Path

from cmm_uq.errors import OutputError


def write_new(out: Path, content: bytes) -> None:
    """Write a file that is not there yet.

    Parameters
    ----------
    out : its path.
    content : its bytes.

    Raises
    ------
    OutputError : something is there, or it cannot be written.
    """
    temporary = ""
    try:
        with tempfile.NamedTemporaryFile(dir=out.parent, prefix=".unfinished-", delete=False) as file:
            temporary = file.name
            file.write(content)
        os.link(temporary, out)
    except FileExistsError:
        raise OutputError("is there already", where=str(out), fix="Name another file; nothing is overwritten") from None
    except OSError as error:
        raise OutputError(
            f"cannot be written: {error.strerror}", where=str(out), fix="Name a folder that exists"
        ) from error
    finally:
        with contextlib.suppress(OSError):
            os.unlink(temporary)  # noqa: PTH108 - may be empty
