"""Certificates that were written before, signed: the set in their folder written anew with signatures, all or none."""

from __future__ import annotations

import contextlib
import io
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmm_uq.app.commands.certificates.signing import Signing
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.content import content_of
from cmm_uq.base.files.limits import SIGNED_BYTES
from cmm_uq.base.output import Owner, finish_interrupted, read_manifest, staged
from cmm_uq.laboratory.records.place import beside, place_of

if TYPE_CHECKING:
    from cmm_uq.laboratory.records.store import Records

RESULTS, SUFFIXES = "results.json", (".pdf", ".xml")


@dataclass(frozen=True)
class Signed:
    """Files that have a signature now, and the records that know of it, as they are shown; empty where none do."""

    files: tuple[Path, ...]
    records: str = ""


def sign_files(
    paths: Sequence[Path], signing: Signing, *, out: Path | None = None, records: str | Path | None = None
) -> Signed:  # fmt: skip
    """Sign PDF and XML files of one folder in the set that they are of, or copies of them in the folder ``out``.

    ``records`` that are told of it where the certificate is recorded in them: file, URL, ``none``, or ``None`` for those
    of the environment, else beside the folder.
    """
    folder = _folder_of(paths)
    if out is not None:
        with staged(out, Owner("sign", folder.name), inputs=paths, expected=[path.name for path in paths]) as place:
            written = place.write({path.name: _signed(path, signing) for path in paths})
        return Signed(tuple(written[path.name] for path in paths))
    finish_interrupted(folder)
    manifest = read_manifest(folder)
    for path in paths:
        if manifest is None or path.name not in manifest.files:
            raise CmmUqError("is of no set that cmm-uq wrote", where=str(path),
                             fix="Give --out DIR for a signed copy")  # fmt: skip
    assert manifest is not None  # noqa: S101 - there is at least one path
    with _opened(records, folder) as history:
        contents = {}
        for name, digest in manifest.files.items():
            file = folder / name
            contents[name] = content_of(file, SIGNED_BYTES, "Only a set as it was written is signed")
            if file.is_symlink() or sha256(contents[name]).hexdigest() != digest:
                raise CmmUqError("was altered after it was written", where=str(file),
                                 fix="Write it anew, or give --out DIR for a signed copy")  # fmt: skip
        signed = {path.name: _signed(path, signing, contents[path.name]) for path in paths}
        results, ledger, where = contents.get(RESULTS), None, ""
        if history is not None and results is not None:
            entry = history.has_results(sha256(results).hexdigest())
            if entry is not None:
                files = {name: sha256(data).hexdigest() for name, data in signed.items()}
                by = {"by": signing.signer.name, "test_key": signing.signer.test_key}
                ledger, where = history.ledger("signed", {"certificate": entry, **by, "files": files}), history.shown
        with staged(folder, manifest.owner, expected=[*manifest.files]) as place:
            place.write({**contents, **signed}, ledger=ledger)
    return Signed(tuple(paths), where)


def _folder_of(paths: Sequence[Path]) -> Path:
    """The folder of all files."""
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


@contextlib.contextmanager
def _opened(where: str | Path | None, folder: Path) -> Iterator[Records | None]:
    """The records, where there are any."""
    place = place_of(where, beside(folder.absolute()))
    if place is None or (isinstance(place, Path) and not place.exists()):
        yield None
        return
    from cmm_uq.laboratory.records.opening import open_records

    with open_records(place) as records:
        yield records
