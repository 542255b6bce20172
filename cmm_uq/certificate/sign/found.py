"""What is found of a signature in a file, whom one trusts, and the extra ``cmm-uq[sign]``, imported when it is needed."""

from __future__ import annotations

import contextlib
import datetime as dt
import hashlib
import io
import logging
from collections.abc import Coroutine, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from cmm_uq.base.errors import CmmUqError, NotInstalledError
from cmm_uq.base.files.limits import KEY_BYTES, content_of
from cmm_uq.base.messages import Text, say
from cmm_uq.base.values import dataclass, field

if TYPE_CHECKING:
    from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter

_T = TypeVar("_T")
_SILENT = logging.NullHandler()


@contextlib.contextmanager
def installed() -> Iterator[None]:
    """Imports inside that may miss a package of the extra."""
    for name in ("pyhanko", "pyhanko_certvalidator", "signxml"):
        logging.getLogger(name).addHandler(_SILENT)  # what matters is said once, by what is found
    try:
        yield
    except ImportError as error:
        raise NotInstalledError(f"signatures need {(error.name or 'a package').partition('.')[0]}, which is not installed",
                                fix="Install it: pip install 'cmm-uq[sign]'") from None  # fmt: skip


def ran(coroutine: Coroutine[Any, Any, _T]) -> _T:
    """What a coroutine of the library returns, also where a loop runs already, as in a notebook."""
    import asyncio  # most who ask what was found of signatures run nothing

    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return asyncio.run(coroutine)
    with ThreadPoolExecutor(1) as other:
        return other.submit(asyncio.run, coroutine).result()


def appending(pdf: bytes) -> IncrementalPdfFileWriter:
    """A writer that appends a revision, and draws nothing at random."""
    with installed():
        from pyhanko.pdf_utils import generic
        from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter
        from pyhanko.pdf_utils.misc import PdfError

    class Appending(IncrementalPdfFileWriter):  # type: ignore[misc]
        def _update_meta(self) -> None:
            """Metadata stay: they are of the document, and PDF/A asks that both its copies agree."""

        @classmethod
        def _handle_id(cls, prev: Any) -> Any:
            drawn = generic.ByteStringObject(hashlib.sha256(pdf).digest()[:16])
            return generic.ArrayObject([prev.trailer["/ID"][0] if "/ID" in prev.trailer else drawn, drawn])

    try:
        writer = Appending(io.BytesIO(pdf))
        if writer.prev.encrypted:
            raise CmmUqError("is encrypted, which no PDF of cmm-uq is", fix="Name the PDF as cmm-uq wrote it")
        return writer
    except (PdfError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise CmmUqError(f"cannot be read as a PDF: {error}", fix="Name a PDF that is whole") from None


Revocation = Literal["good", "revoked", "not known"]
"""Of the signer's certificate, from what the file or the trust brings along: ``not known`` where neither says."""

_FILES = (".pem", ".crt", ".cer", ".der", ".crl")


@dataclass(frozen=True)
class Trust:
    """Whom one trusts: nobody by default, and never those of the system."""

    anchors: tuple[bytes, ...] = ()  # certificates, DER
    revocations: tuple[bytes, ...] = ()  # lists, DER, besides those in the file


WEAK = say("the signature is made with an algorithm that is weak or unknown")
BROKEN = say("the signature does not fit the file: one of them was changed")
STAMP_BROKEN = say("the time stamp does not fit the signature")
AFTER = "after entry {number} of the laboratory's records, SHA-256 {hash}"  # reason of a signature of a recorded certificate
NOBODY = say("nobody is trusted: name the certificates that you trust")


@dataclass(frozen=True)
class FileSignature:
    level: str  # ``PAdES B-B``, ``XAdES B-B``, …
    problems: tuple[Text, ...]  # why it does not count
    subject: str = ""  # whom the certificate names, whole
    name: str = ""  # its common name
    issuer: str = ""
    time: dt.datetime | None = None  # of signing
    time_proven: bool = False  # by a time stamp that is trusted; else the signer says so
    intact: bool = False  # what was signed is there, and the key of the certificate signed it
    covers_whole_file: bool = False  # but for time stamps, proofs of certificates, and further signatures
    trusted: bool = False  # a chain leads to somebody trusted, in date when it was signed
    revocation: Revocation = "not known"  # of the certificate
    test_key: bool = False  # for trying: TEST_NOTE is to be said
    reason: str = ""  # that the signature states, of a PDF
    beside: Mapping[str, dt.datetime | None] = field(
        default_factory=dict
    )  # what it does not cover, and the time that states
    content: bytes = field(default=b"", repr=False)  # verified: the signed revision of a PDF, or the XML without it

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
    content = content.removeprefix(b"\xef\xbb\xbf")  # as an editor of Windows begins a file
    found: dict[str, list[bytes]] = {"CERTIFICATE": [], "X509 CRL": []}
    try:
        whole: list[tuple[str, Any, bytes]] = [("X509 CRL" if path.suffix == ".crl" else "CERTIFICATE", {}, content)]
        for kind, _, data in pem.unarmor(content, multiple=True) if pem.detect(content) else whole:
            if kind == "PRIVATE KEY" or kind.endswith(" PRIVATE KEY"):
                raise CmmUqError("holds a private key", where=str(path), fix="Name a file of certificates only")
            (crl.CertificateList if kind == "X509 CRL" else x509.Certificate).load(data, strict=True).native  # noqa: B018
            found[kind].append(data)
    except (ValueError, KeyError, TypeError):
        raise CmmUqError("holds what is neither certificate nor revocation list", where=str(path),
                         fix="Name PEM or DER files of certificates") from None  # fmt: skip
    return found["CERTIFICATE"], found["X509 CRL"]
