"""A new key for trying, in a file that only its owner may read, and its certificate."""

from __future__ import annotations

import contextlib
import datetime as dt
import os
from dataclasses import dataclass
from pathlib import Path

from cmm_uq.app.commands.certificates.signing import Asking, secret
from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.certificate.sign import signing_time, trial_key

PRIVATE, PUBLIC = 0o600, 0o644


@dataclass(frozen=True)
class KeyFiles:
    """PKCS#12 file, PEM file of its certificate, and the last day of that."""

    key: Path
    certificate: Path
    until: dt.date


def new_test_key(path: Path, name: str, asking: Asking) -> KeyFiles:
    """Make a test key; a file that is there is not written over."""
    beside = path.with_suffix(".pem")
    if beside == path:
        raise CmmUqError("is the name of its certificate", where=str(path), fix="Name the key .p12")
    for one in (path, beside):
        if os.path.lexists(one):
            raise CmmUqError("is there already", where=str(one), fix="Choose another name: no key is written over")
    made = trial_key(name, secret("Passphrase of the new key: ", asking), signing_time())
    _write(path, made.key, PRIVATE)
    try:
        _write(beside, made.certificate, PUBLIC)
    except BaseException:
        with contextlib.suppress(OSError):
            path.unlink()
        raise
    return KeyFiles(path, beside, made.until)


def _write(path: Path, content: bytes, mode: int) -> None:
    """A new file that others may read, or not, from its first byte on."""
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), mode)
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
    except OSError as error:
        raise OutputError(
            f"cannot be written: {error.strerror}", where=str(path), fix="Choose another folder"
        ) from None
