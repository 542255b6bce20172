"""What is found of a signature in a file, and whom one trusts to have signed."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.content import content_of
from cmm_uq.base.files.limits import KEY_BYTES
from cmm_uq.base.messages import Text
from cmm_uq.certificate.sign.extra import installed

Revocation = Literal["good", "revoked", "not known"]
"""Of the signer's certificate, from what the file or the trust brings along: ``not known`` where neither says."""

_FILES = (".pem", ".crt", ".cer", ".der", ".crl")


@dataclass(frozen=True)
class Trust:
    """Whom one trusts: nobody by default, and never those of the system.

    ``anchors`` certificates, DER; ``revocations`` revocation lists, DER, besides those in the file.
    """

    anchors: tuple[bytes, ...] = ()
    revocations: tuple[bytes, ...] = ()


NOBODY = Trust()


@dataclass(frozen=True)
class FileSignature:
    """One signature, and what holds of it.

    ``subject`` whom the certificate names, whole; ``name`` the same, its common name; ``issuer`` who issued the
    certificate; ``level`` of the signature: ``PAdES B-B``, ``XAdES B-B``, …; ``time`` of signing; ``time_proven``
    whether a time stamp that is trusted says so; else it is what the signer says; ``intact`` whether what was signed is
    what is there, and the key of the certificate signed it; ``covers_whole_file`` whether nothing stands in the file
    that it does not cover, but for time stamps, what proves certificates, and further signatures; ``trusted`` whether a
    chain leads to somebody trusted, in date when it was signed; ``revocation`` of the certificate; ``test_key`` whether
    the key is one for trying; what is to be said then is :data:`~cmm_uq.certificate.sign.signer.TEST_NOTE`;
    ``problems`` why it does not count; ``content`` what was verified: of a PDF the signed revision, of XML the
    canonical form of the root without the signature.
    """

    subject: str
    name: str
    issuer: str
    level: str
    time: dt.datetime | None
    time_proven: bool
    intact: bool
    covers_whole_file: bool
    trusted: bool
    revocation: Revocation
    test_key: bool
    problems: tuple[Text, ...]
    content: bytes = field(default=b"", repr=False)

    @property
    def good(self) -> bool:
        """Whether it holds, of somebody trusted and with a key that is not for trying, over the whole file."""
        return self.intact and self.covers_whole_file and self.trusted and not self.test_key and not self.problems


def trust_of(paths: Sequence[Path]) -> Trust:
    """Certificates and revocation lists in files, or in all such files of a folder."""
    anchors: list[bytes] = []
    revocations: list[bytes] = []
    for path in paths:
        files = sorted(file for file in path.iterdir() if file.suffix in _FILES) if path.is_dir() else [path]
        if not files:
            raise CmmUqError("holds no certificates", where=str(path), fix=f"Put files {', '.join(_FILES)} into it")
        for file in files:
            certificates, lists = _read(file)
            anchors += certificates
            revocations += lists
    return Trust(tuple(dict.fromkeys(anchors)), tuple(dict.fromkeys(revocations)))


def _read(path: Path) -> tuple[list[bytes], list[bytes]]:
    """Certificates and revocation lists of a file, DER."""
    with installed():
        from asn1crypto import crl, pem, x509
    content = content_of(path, KEY_BYTES, "Name a PEM file of the certificates that you trust")
    found: dict[str, list[bytes]] = {"CERTIFICATE": [], "X509 CRL": []}
    try:
        parts = (
            [(kind, data) for kind, _, data in pem.unarmor(content, multiple=True)]
            if pem.detect(content)
            else [("X509 CRL" if path.suffix == ".crl" else "CERTIFICATE", content)]
        )
        for kind, data in parts:
            if kind == "PRIVATE KEY" or kind.endswith(" PRIVATE KEY"):
                raise CmmUqError("holds a private key", where=str(path), fix="Name a file of certificates only")
            (crl.CertificateList if kind == "X509 CRL" else x509.Certificate).load(data, strict=True).native  # noqa: B018
            found[kind].append(data)
    except (ValueError, KeyError, TypeError):
        raise CmmUqError("holds what is neither certificate nor revocation list", where=str(path),
                         fix="Name PEM or DER files of certificates") from None  # fmt: skip
    return found["CERTIFICATE"], found["X509 CRL"]
