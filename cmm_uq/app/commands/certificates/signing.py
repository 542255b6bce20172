"""Who signs what a command writes, certificates signed afterwards, and test keys; secrets stay where they are."""

from __future__ import annotations

import contextlib
import datetime as dt
import io
import os
import tomllib
from collections.abc import Callable, Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

from cmm_uq.app.commands.files import opened
from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.files.limits import SIGNED_BYTES, check_file, content_of
from cmm_uq.base.messages import Text, Verbatim
from cmm_uq.base.output import Owner, finish_interrupted, read_manifest, staged
from cmm_uq.base.values import dataclass, replace
from cmm_uq.certificate import sign
from cmm_uq.certificate.sign.signer import SCHEME, signer_of_token
from cmm_uq.laboratory.schedule import settings as credentials

PASSPHRASE, PASSPHRASE_FILE = "CMM_UQ_SIGN_PASSPHRASE", "CMM_UQ_SIGN_PASSPHRASE_FILE"
Asking = Callable[[str], str]  # asks whoever is at the keyboard for a secret; a :class:`CmmUqError` where nobody is


def stamping_of(named: str | None, server: str | None, trust: Sequence[Path]) -> sign.Stamping | None:
    """What lifts a signature above level B-B; a level that is not named is B-T with a time stamp server, else B-B."""
    known = (level for level in sign.LEVELS if (named or "").upper() in (level, level.removeprefix("B-")))
    level: sign.Level | None = next(known, None) if named is not None else "B-T" if server else "B-B"
    if level is None:
        fix = f"One of {', '.join(sign.LEVELS)}"
        raise CmmUqError(f"{named!r} is no level of a signature", where="--level", fix=fix)
    if level == "B-B":
        return None
    if not server:
        raise CmmUqError(f"level {level} needs a time stamp server", where="--level", fix="Add --time-server URL")
    return sign.Stamping(server, level, sign.trust_of(tuple(trust)))


@dataclass(frozen=True)
class Signing:
    """A signer at work on the files of one command, all at one time.

    ``signer`` who signs; ``at`` time of signing; ``stamping`` level above B-B, ``None`` for B-B; ``reason`` that a PDF states.
    """

    signer: sign.Signer
    at: dt.datetime
    stamping: sign.Stamping | None = None
    reason: str = ""

    def finished(
        self, laboratory: Mapping[str, Any], *, language: str = "en", said: Callable[[Text], Text] | None = None
    ) -> Callable[[str, bytes], bytes]:
        """Signs a document by its name: PDF and XML; others stay as they are."""

        def signed(name: str, data: bytes) -> bytes:
            if name.endswith(".xml"):
                return sign.sign_xml(data, self.signer, at=self.at, where=name)
            if not name.endswith(".pdf"):
                return data
            from cmm_uq.certificate.render import seal

            told = (Verbatim(str(laboratory.get(key) or "")) for key in ("name", "accreditation"))
            seen = seal(self.signer, self.at, *told, language=language, said=said)
            return sign.sign_pdf(data, self.signer, seal=seen, at=self.at, stamping=self.stamping, reason=self.reason)

        return signed


def signing(key: str, stamping: sign.Stamping | None, asking: Asking) -> Signing:
    """Open the key, a PKCS#12 file or the URI ``pkcs11:…`` of a token, before anything is computed."""
    at = sign.signing_time()
    if key.startswith(SCHEME):
        signer = signer_of_token(key, secret("PIN of the token: ", asking))
    else:
        signer = sign.signer_of_file(Path(key), secret("Passphrase of the key: ", asking))
    signer.check(at)
    return Signing(signer, at, stamping)


def secret(question: str, asking: Asking) -> str:
    """A passphrase or PIN: from the environment, from a file that it names, else from the keyboard."""
    if named := os.environ.get(PASSPHRASE_FILE, ""):
        return credentials.of_file(Path(named), PASSPHRASE_FILE)
    return os.environ.get(PASSPHRASE, "") or asking(question)


RESULTS, SUFFIXES = "results.json", (".pdf", ".xml")


def sign_files(
    paths: Sequence[Path], signing: Signing, *, out: Path | None = None, records: str | Path | None = None
) -> tuple[list[Path], str]:
    """Sign PDF and XML files of one folder in the set that they are of, or copies of them in the folder ``out``.

    Gives the files that have a signature now, and the records that know of it, as they are shown; empty where none do.
    ``records`` that are told of it where the certificate is recorded in them: file, URL, ``none``, or ``None`` for those
    of the environment, else ``reports/records.db``.
    """
    folder = _folder_of(paths)
    if out is not None:
        with staged(out, Owner("sign", folder.name), inputs=paths, expected=[path.name for path in paths]) as place:
            written = place.write({path.name: _signed(path, signing) for path in paths})
        return [written[path.name] for path in paths], ""
    finish_interrupted(folder)
    manifest = read_manifest(folder)
    for path in paths:
        if manifest is None or path.name not in manifest.files:
            check_file(path, "Name a certificate that was written")
            raise CmmUqError("is of no set that cmm-uq wrote", where=str(path), fix="Give --out DIR for a signed copy")
    assert manifest is not None  # noqa: S101 - there is at least one path
    with opened(records, folder, make=False, create=False) as history:
        contents = {}
        for name, digest in manifest.files.items():
            file = folder / name
            contents[name] = content_of(file, SIGNED_BYTES, "Only a set as it was written is signed")
            if file.is_symlink() or sha256(contents[name]).hexdigest() != digest:
                raise CmmUqError("was altered after it was written", where=str(file),
                                 fix="Write it anew, or give --out DIR for a signed copy")  # fmt: skip
        ledger, where, digest = None, "", sha256(contents.get(RESULTS, b"")).hexdigest()
        entry = None if history is None else history.has_results(digest)
        if history is not None and entry is not None:
            number, head = history.head()
            signing = replace(signing, reason=sign.AFTER.format(number=number, hash=head))
        signed = {path.name: _signed(path, signing, contents[path.name]) for path in paths}
        if history is not None and entry is not None:
            files = {name: sha256(data).hexdigest() for name, data in signed.items()}
            by = {"by": signing.signer.name, "test_key": signing.signer.test_key}
            ledger, where = history.ledger("signed", {"certificate": entry, **by, "files": files}), history.shown
        with staged(folder, manifest.owner, expected=[*manifest.files]) as place:
            place.write({**contents, **signed}, ledger=ledger)
    return list(paths), where


def _folder_of(paths: Sequence[Path]) -> Path:
    for path in paths:
        if path.suffix.lower() not in SUFFIXES:
            raise CmmUqError("is neither PDF nor XML", where=str(path), fix="Name certificate.pdf or certificate.xml")
    folders = list(dict.fromkeys(path.parent for path in paths))
    if len(folders) > 1:
        raise CmmUqError("is in another folder than the first file", where=str(folders[1]),
                         fix="Sign the files of one certificate at a time")  # fmt: skip
    if len({path.name for path in paths}) < len(paths):
        raise CmmUqError("is named twice", where=str(paths[-1]), fix="Name each file once")
    return folders[0]


def _signed(path: Path, signing: Signing, content: bytes | None = None) -> bytes:
    if content is None:
        content = content_of(path, SIGNED_BYTES, "Name a certificate that was written")
    name = path.name.lower()
    laboratory = _laboratory(content) if name.endswith(".pdf") else {}
    try:
        return signing.finished(laboratory)(name, content)
    except CmmUqError as error:
        raise error if error.where else CmmUqError(error.problem, where=str(path), fix=error.fix) from None


def _laboratory(pdf: bytes) -> Mapping[str, Any]:
    """Name and accreditation as the job inside a PDF has them; nothing where there is none."""
    from pypdf import PdfReader
    from pypdf.errors import PyPdfError

    try:
        attached = PdfReader(io.BytesIO(pdf)).attachments.get("job.toml", [b""])[0]
        laboratory = tomllib.loads(attached.decode()).get("laboratory", {})
    except (PyPdfError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return {}
    return laboratory if isinstance(laboratory, Mapping) else {}


PRIVATE, PUBLIC = 0o600, 0o644


def new_test_key(path: Path, name: str, asking: Asking) -> tuple[Path, dt.date]:
    """Make a test key: the PEM file of its certificate, and the last day of that. A file that is there is not written over."""
    beside = path.with_suffix(".pem")
    if beside == path:
        raise CmmUqError("is the name of its certificate", where=str(path), fix="Name the key .p12")
    for one in (path, beside):
        if os.path.lexists(one):
            raise CmmUqError("is there already", where=str(one), fix="Choose another name: no key is written over")
    made = sign.trial_key(name, secret("Passphrase of the new key: ", asking), sign.signing_time())
    _write(path, made.key, PRIVATE)
    try:
        _write(beside, made.certificate, PUBLIC)
    except BaseException:
        with contextlib.suppress(OSError):
            path.unlink()
        raise
    return beside, made.until


def _write(path: Path, content: bytes, mode: int) -> None:
    """A new file that others may read, or not, from its first byte on."""
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), mode)
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
    except OSError as error:
        problem = f"cannot be written: {error.strerror}"
        raise OutputError(problem, where=str(path), fix="Choose another folder") from None
