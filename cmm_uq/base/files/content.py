"""Files read whole: regular ones only, without waiting for a pipe or a device, and never more than their limit."""

from __future__ import annotations

import os
import stat
import tomllib
from pathlib import Path
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import Limit

_KINDS = (
    (stat.S_ISDIR, "is a folder, not a file"),
    (stat.S_ISFIFO, "is a pipe, not a file"),
    (stat.S_ISSOCK, "is a socket, not a file"),
    (stat.S_ISCHR, "is a device, not a file"),
    (stat.S_ISBLK, "is a device, not a file"),
)
_OPEN = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0) | getattr(os, "O_BINARY", 0)


def content_of(path: Path, limit: Limit, fix: str) -> bytes:
    where = str(path)
    try:
        descriptor = os.open(path, _OPEN)
        try:
            _refuse_other_than_a_file(os.fstat(descriptor).st_mode, where, fix)
            with os.fdopen(descriptor, "rb", closefd=False) as file:
                content = file.read(limit.most + 1)
        finally:
            os.close(descriptor)
    except FileNotFoundError:
        raise CmmUqError("no such file", where=where, fix=fix) from None
    except IsADirectoryError:
        raise CmmUqError("is a folder, not a file", where=where, fix=fix) from None
    except OSError as error:
        raise CmmUqError(f"cannot be read: {error.strerror}", where=where, fix=fix) from error
    except ValueError as error:  # a name with a zero character
        raise CmmUqError(f"cannot be read: {error}", where=where, fix=fix) from error
    if len(content) > limit.most:
        raise CmmUqError(
            f"is larger than the {limit.most} {limit.unit} that are read of such a file", where=where,
            fix="Check that it is the right file",
        )  # fmt: skip
    return content


def check_file(path: Path, fix: str) -> None:
    """Refuse what is no regular file, for a file that is too large to be read whole."""
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError) as error:
        what = error.strerror if isinstance(error, OSError) else str(error)
        raise CmmUqError(f"cannot be read: {what}", where=str(path), fix=fix) from None
    _refuse_other_than_a_file(mode, str(path), fix)


def text_of(content: bytes, where: str, fix: str = "Save it as UTF-8") -> str:
    """Text of a file's bytes, UTF-8 with or without a byte-order mark."""
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise CmmUqError("is not UTF-8 text", where=f"{where} line {line}", fix=fix) from None
    if "\0" in text:
        raise CmmUqError("contains zero bytes: it is no text file", where=where, fix=fix)
    return text


def value_of(text: str) -> Any:
    """A value as TOML has it; a text without quotes as it is."""
    try:
        return tomllib.loads(f"x = {text}")["x"]
    except tomllib.TOMLDecodeError:
        return text


def _refuse_other_than_a_file(mode: int, where: str, fix: str) -> None:
    for is_kind, problem in _KINDS:
        if is_kind(mode):
            raise CmmUqError(problem, where=where, fix=fix)
