"""Secrets: from a variable of the environment, or from a file that nobody else may read. None stands in schedule.toml."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.content import content_of, text_of
from cmm_uq.base.files.limits import SECRET_BYTES


def of_variable(name: str, key: str) -> str:
    """A secret in the environment.

    Parameters
    ----------
    name : of the variable.
    key : that names it, for messages.

    Raises
    ------
    CmmUqError : the variable is not set, or empty.
    """
    secret = os.environ.get(name, "")
    if not secret:
        raise CmmUqError(f"the variable {name} is not set", where=key,
                         fix="Set it where the run is started, as in EnvironmentFile= of systemd")  # fmt: skip
    return secret


def of_file(path: Path, key: str) -> str:
    """A secret in a file, without the end of its line.

    Parameters
    ----------
    path : of the file.
    key : that names it, for messages.

    Raises
    ------
    CmmUqError : it is missing, empty, or others may read it; Windows has other rights, which are not looked at.
    """
    content = content_of(path, SECRET_BYTES, f"Write the secret into it, or mend {key}")
    if os.name != "nt" and path.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise CmmUqError("others may read it", where=str(path), fix=f"chmod 600 {path}")
    secret = text_of(content, str(path)).strip("\r\n")
    if not secret:
        raise CmmUqError("is empty", where=str(path), fix="Write the secret into it")
    return secret
