"""Workbooks are ZIP archives: what one may hold before anything of it is unpacked."""

from __future__ import annotations

import io
import re
import zipfile
import zlib

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import UNPACKED
from cmm_uq.jobs.importing.encodings import head_text
from cmm_uq.jobs.importing.xml_files import HOSTILE_FIX

_PROLOG = 65_536
"""Bytes of a part in which its root begins."""

_ROOT = re.compile(r"<[A-Za-z]")
_MEMBERS = 2000
_FIX = "Save the sheet of the recording as a workbook of its own, or as CSV"
ZIP = b"PK\x03\x04"


def opened(content: bytes, where: str) -> zipfile.ZipFile:
    """A ZIP archive that can be read.

    Raises
    ------
    CmmUqError : it is damaged, encrypted, or would be too large unpacked.
    """
    try:
        archive = zipfile.ZipFile(io.BytesIO(content))
        members = archive.infolist()
    except (zipfile.BadZipFile, ValueError, NotImplementedError, OSError):
        raise CmmUqError("is a damaged workbook: the end of the file is missing or spoiled", where=where,
                         fix="Copy or export it again") from None  # fmt: skip
    size = sum(member.file_size for member in members)
    if size > UNPACKED.most or len(members) > _MEMBERS:
        raise CmmUqError(f"holds {size} bytes in {len(members)} parts once it is unpacked: {UNPACKED.most} are the most",
                         where=where, fix=_FIX)  # fmt: skip
    if any(member.flag_bits & 1 for member in members):
        raise CmmUqError("is encrypted", where=where, fix="Save it without a password")
    _refuse_entities(archive, where)
    return archive


def _refuse_entities(archive: zipfile.ZipFile, where: str) -> None:
    """Refuse XML that declares a document type, and with it entities, or whose root is not found where it must begin."""
    for name in archive.namelist():
        if not name.endswith((".xml", ".rels")):
            continue
        try:
            with archive.open(name) as member:
                head = head_text(member.read(_PROLOG))
        except (zipfile.BadZipFile, zlib.error, OSError, EOFError, NotImplementedError):
            raise CmmUqError(f"is a damaged workbook: its part {name!r} is spoiled", where=where,
                             fix="Copy or export it again") from None  # fmt: skip
        root = _ROOT.search(head)
        if "<!DOCTYPE" in head or (root is None and len(head) >= _PROLOG // 2):
            raise CmmUqError(f"declares entities or a document type (in {name!r})", where=where, fix=HOSTILE_FIX)


def has(content: bytes, *names: str) -> bool:
    """Whether the head of an archive names one of these members."""
    return content.startswith(ZIP) and any(name.encode() in content for name in names)
