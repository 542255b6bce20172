"""Who signs what a command writes, and how: from options and the environment to signed bytes; secrets stay where they are."""

from __future__ import annotations

import datetime as dt
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim
from cmm_uq.certificate.sign import (
    LEVELS,
    Level,
    Signer,
    Stamping,
    sign_pdf,
    sign_xml,
    signer_of_file,
    signing_time,
    trust_of,
)
from cmm_uq.certificate.sign.signer import SCHEME, signer_of_token
from cmm_uq.laboratory.schedule import channels as credentials

PASSPHRASE, PASSPHRASE_FILE = "CMM_UQ_SIGN_PASSPHRASE", "CMM_UQ_SIGN_PASSPHRASE_FILE"
Asking = Callable[[str], str]  # asks whoever is at the keyboard for a secret; a :class:`CmmUqError` where nobody is


@dataclass(frozen=True)
class Wanted:
    """How it is to be signed.

    ``key`` PKCS#12 file, or URI ``pkcs11:…`` of a key on a token; ``level`` of PAdES; ``None`` for B-T with a time
    stamp server, else B-B; ``server`` address of a time stamp server; ``trust`` files or folders of certificates that
    chains must lead to.
    """

    key: str
    level: str | None = None
    server: str | None = None
    trust: tuple[Path, ...] = ()


@dataclass(frozen=True)
class Signing:
    """A signer at work on the files of one command, all at one time.

    ``signer`` who signs; ``at`` time of signing; ``stamping`` level above B-B; ``None`` for B-B.
    """

    signer: Signer
    at: dt.datetime
    stamping: Stamping | None = None

    def finished(
        self, laboratory: Mapping[str, Any], *, language: str = "en", said: Callable[[Text], Text] | None = None
    ) -> Callable[[str, bytes], bytes]:  # fmt: skip
        """Signs a document by its name: PDF and XML; others stay as they are."""

        def signed(name: str, data: bytes) -> bytes:
            if name.endswith(".xml"):
                return sign_xml(data, self.signer, at=self.at, where=name)
            if not name.endswith(".pdf"):
                return data
            from cmm_uq.certificate.render.pdf import same, seal

            told = (Verbatim(str(laboratory.get(key) or "")) for key in ("name", "accreditation"))
            seen = seal(self.signer, self.at, *told, language=language, said=said or same)
            return sign_pdf(data, self.signer, seal=seen, at=self.at, stamping=self.stamping)

        return signed


def signing(wanted: Wanted, asking: Asking) -> Signing:
    """Open the key, before anything is computed."""
    stamping = _stamping(wanted)
    at = signing_time()
    if wanted.key.startswith(SCHEME):
        signer = signer_of_token(wanted.key, secret("PIN of the token: ", asking))
    else:
        signer = signer_of_file(Path(wanted.key), secret("Passphrase of the key: ", asking))
    signer.check(at)
    return Signing(signer, at, stamping)


def secret(question: str, asking: Asking) -> str:
    """A passphrase or PIN: from the environment, from a file that it names, else from the keyboard."""
    if named := os.environ.get(PASSPHRASE_FILE, ""):
        return credentials.of_file(Path(named), PASSPHRASE_FILE)
    return os.environ.get(PASSPHRASE, "") or asking(question)


def _stamping(wanted: Wanted) -> Stamping | None:
    level: Level = _level(wanted.level, server=bool(wanted.server))
    if level == "B-B":
        return None
    if not wanted.server:
        raise CmmUqError(f"level {level} needs a time stamp server", where="--level", fix="Add --time-server URL")
    return Stamping(wanted.server, level, trust_of(wanted.trust))


def _level(asked: str | None, *, server: bool) -> Level:
    if asked is None:
        return "B-T" if server else "B-B"
    for level in LEVELS:
        if asked.upper() in (level, level.removeprefix("B-")):
            return level
    raise CmmUqError(f"{asked!r} is no level of a signature", where="--level", fix=f"One of {', '.join(LEVELS)}")
