"""A dropped file as it comes from a form: read through once, its SHA-256 taken, nothing of it kept on the disk.

The form has one field, so that its parts (RFC 7578) need no parser: the file is what stands between the first empty line
and the last boundary. Only a file small enough to be a certificate is held in memory, to be asked what it says it is.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from http import HTTPStatus
from typing import BinaryIO

from cmm_uq.app.serve.exchange import Asked, Refused, bad
from cmm_uq.base.messages import say

LARGEST = 256 * 2**20
"""Bytes of a file that is looked up; a certificate with its inputs has a hundredth."""

HELD = 16 * 2**20
"""Bytes of a file that is asked what it says it is."""

_HEAD = 8192
_BLOCK = 2**18
_BOUNDARY = re.compile(r'multipart/form-data;\s*boundary="?([0-9A-Za-z\'()+_,./:=? -]{1,70})"?', re.IGNORECASE)
_NAMED = re.compile(rb'filename="((?:[^"\\]|\\.)*)"')


@dataclass(frozen=True)
class Dropped:
    """A file that was dropped.

    Parameters
    ----------
    name : as the browser gives it, without folders.
    size : bytes.
    sha256 : of all of them.
    content : the bytes; ``None`` of a file larger than :data:`HELD`.
    """

    name: str
    size: int
    sha256: str
    content: bytes | None


def read_dropped(asked: Asked) -> Dropped:
    """The file in the body of a form.

    Raises
    ------
    Refused : there is none, it is too large, or the form is not this site's.
    """
    found = _BOUNDARY.fullmatch(asked.headers.get("content-type", "").strip())
    if found is None or asked.body is None:
        raise Refused(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, say("this page takes a file from its own form only"))
    if asked.length > LARGEST + _HEAD:
        raise Refused(
            HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
            say("the file is larger than {most} MB", most=LARGEST // 2**20),
            say("No certificate is; check that it is the right file"),
        )
    return _read(asked.body, asked.length, found[1].rstrip().encode())


def _read(body: BinaryIO, length: int, boundary: bytes) -> Dropped:
    """Hash all but the end mark as it comes, and keep the beginning as far as it may be held."""
    end = b"\r\n--" + boundary + b"--"
    pending, left = b"", length
    while b"\r\n\r\n" not in pending and left and len(pending) < _HEAD:
        block = _some(body, min(left, _BLOCK))
        pending, left = pending + block, left - len(block)
    head, parted, pending = pending.partition(b"\r\n\r\n")
    named = _NAMED.search(head)
    if not parted or len(head) > _HEAD or not head.startswith(b"--" + boundary + b"\r\n") or named is None:
        raise bad(say("the form that came with the file cannot be read"))
    name = re.split(r"[/\\]", named[1].decode("utf-8", "replace"))[-1]
    if not name:
        raise bad(say("no file was chosen"), say("Choose a file, or drop one on the field"))
    sha256, size, held = hashlib.sha256(), 0, bytearray()
    reserve = len(end) + 2  # the end mark may be cut by the end of a block

    def take(part: bytes) -> None:
        nonlocal size
        sha256.update(part)
        if size + len(part) <= HELD:
            held.extend(part)
        size += len(part)

    while left:
        take(pending[:-reserve])
        pending = pending[-reserve:]
        block = _some(body, min(left, _BLOCK))
        pending, left = pending + block, left - len(block)
    content, closed, rest = pending.rpartition(end)
    if not closed or rest not in (b"", b"\r\n"):
        raise bad(say("the file did not come whole"), say("Drop it again"))
    take(content)
    return Dropped(name, size, sha256.hexdigest(), bytes(held) if len(held) == size else None)


def _some(body: BinaryIO, most: int) -> bytes:
    block = body.read(most)
    if not block:
        raise bad(say("the file did not come whole"), say("Drop it again"))
    return block
