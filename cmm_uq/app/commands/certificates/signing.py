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
class SigningOptions:
    """Key (PKCS#12 file, or URI ``pkcs11:…`` on a token), level of PAdES, time stamp server, and trusted certificates.

    ``level`` is B-T with a time stamp server, else B-B, where it is ``None``.
    """

    key: str
    level: str | None = None
    server: str | None = None
    trust: tuple[Path, ...] = ()

    @property
    def stamping(self) -> Stamping | None:
        """What lifts a signature above B-B."""
        known = (level for level in LEVELS if (self.level or "").upper() in (level, level.removeprefix("B-")))
        level: Level | None = next(known, None) if self.level is not None else "B-T" if self.server else "B-B"
        if level is None:
            fix = f"One of {', '.join(LEVELS)}"
            raise CmmUqError(f"{self.level!r} is no level of a signature", where="--level", fix=fix)
        if level == "B-B":
            return None
        if not self.server:
            raise CmmUqError(f"level {level} needs a time stamp server", where="--level", fix="Add --time-server URL")
        return Stamping(self.server, level, trust_of(self.trust))


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


def signing(options: SigningOptions, asking: Asking) -> Signing:
    """Open the key, before anything is computed."""
    stamping = options.stamping
    at = signing_time()
    if options.key.startswith(SCHEME):
        signer = signer_of_token(options.key, secret("PIN of the token: ", asking))
    else:
        signer = signer_of_file(Path(options.key), secret("Passphrase of the key: ", asking))
    signer.check(at)
    return Signing(signer, at, stamping)


def secret(question: str, asking: Asking) -> str:
    """A passphrase or PIN: from the environment, from a file that it names, else from the keyboard."""
    if named := os.environ.get(PASSPHRASE_FILE, ""):
        return credentials.of_file(Path(named), PASSPHRASE_FILE)
    return os.environ.get(PASSPHRASE, "") or asking(question)
