"""What a browser asks, read and checked, and what it is answered: the only place that knows HTTP's words.

An address that cannot be read is refused in words, never guessed at. A dropped file is read through once, its SHA-256
taken, nothing of it kept on the disk. Its form has one field, so that its parts (RFC 7578) need no parser: the file is what
stands between the first empty line and the last boundary.

What goes wrong is a page in words.
"""

from __future__ import annotations

import datetime as dt
import hashlib
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from http import HTTPStatus
from pathlib import PurePosixPath
from typing import BinaryIO
from urllib.parse import parse_qsl, quote, urlsplit

from cmm_uq.app.serve.page import WebPage, address, page
from cmm_uq.base.errors import printable, shortened, suggestion
from cmm_uq.base.messages import NOTHING, Text, Verbatim, say
from cmm_uq.base.values import dataclass, field

DESK = "/desk"  # where the pages of a desk begin
ACCOUNT = "/account"
LONGEST_VALUE = 300  # characters of one value of a query: the longest serial or job id that the records take is shorter
MOST_VALUES = 20
MOST_FIELDS, LONGEST_FORM = 1000, 4_000_000  # of a form; job.toml has a million characters at most
LAST_PAGE = 10**6


class RefusedRequest(Exception):  # noqa: N818 - what it is, in the words of the answer
    """A request that is answered with a page in words instead of what it asked for; ``title``: where another says more."""

    def __init__(self, status: HTTPStatus, problem: Text, fix: Text = NOTHING, title: Text = NOTHING) -> None:
        self.status, self.problem, self.fix, self.title = status, problem, fix, title
        super().__init__(str(problem))


@dataclass(frozen=True)
class WebRequest:
    """Its path as it was sent, each name of the query once, headers by name in small letters, ``length`` bytes of body.

    ``peer``: address that it came from.
    """

    method: str
    path: str
    query: Mapping[str, str] = field(default_factory=dict)
    headers: Mapping[str, str] = field(default_factory=dict)
    body: BinaryIO | None = None
    length: int = 0
    peer: str = ""

    def only(self, known: Iterable[str]) -> None:
        names = tuple(known)
        for name in self.query:
            if name not in names:
                fix = Verbatim(suggestion(name, names)) if names else say("It takes none")
                raise bad(say("this page knows no {name!r} in its address", name=_short(name)), fix)

    def text(self, name: str) -> str:
        """A value, empty where it was not given."""
        return self.query.get(name, "").strip()

    def one_of(self, name: str, allowed: Collection[str]) -> str:
        """A value of a list, or nothing."""
        value = self.text(name)
        if value and value not in allowed:
            raise bad(say("{name} cannot be {value!r}", name=Verbatim(name), value=_short(value)),
                      Verbatim(suggestion(value, allowed)))  # fmt: skip
        return value

    def count(self, name: str, default: int = 1) -> int:
        """A whole number from 1."""
        value = self.text(name)
        if not value:
            return default
        if not (value.isascii() and value.isdigit()) or not 1 <= int(value[:9]) <= LAST_PAGE or len(value) > 9:
            problem = say("{name} is a whole number from 1, not {value!r}", name=Verbatim(name), value=_short(value))
            raise bad(problem)
        return int(value)

    def day(self, name: str) -> dt.date | None:
        """A date, or nothing."""
        value = self.text(name)
        if not value:
            return None
        try:
            return dt.date.fromisoformat(value)
        except ValueError:
            raise bad(
                say("{name} is a date such as 2026-03-31, not {value!r}", name=Verbatim(name), value=_short(value))
            ) from None


def read_address(target: str) -> tuple[str, dict[str, str]]:
    if not target.startswith("/") or not target.isascii() or not target.isprintable():
        raise bad(say("the address is no path of this page"))
    parts = urlsplit(target)
    try:
        pairs = parse_qsl(parts.query, keep_blank_values=True, strict_parsing=bool(parts.query), errors="strict",
                          max_num_fields=MOST_VALUES)  # fmt: skip
    except ValueError:
        raise bad(say("what follows the question mark in the address cannot be read")) from None
    query: dict[str, str] = {}
    for name, value in pairs:
        if name in query:
            raise bad(say("{name!r} stands twice in the address", name=_short(name)))
        if len(value) > LONGEST_VALUE or any(c in value for c in "\0\r\n"):
            raise bad(
                say("{name!r} in the address is longer than any name, or holds what no name holds", name=_short(name))
            )
        query[name] = value
    return parts.path, query


def bad(problem: Text, fix: Text = NOTHING) -> RefusedRequest:
    return RefusedRequest(HTTPStatus.BAD_REQUEST, problem, fix)


def _short(text: str) -> Verbatim:
    return Verbatim(printable(shortened(text, 60)))


SECURITY = {  # sent with every answer
    "X-Content-Type-Options": "nosniff", "X-Frame-Options": "DENY", "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin", "Permissions-Policy": "camera=(), geolocation=(), microphone=()",
    "Cache-Control": "no-store",
}  # fmt: skip

OWN = (
    "default-src 'none'; style-src 'self'; img-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
)
"""What a page of this site may load: its style sheet and its icon."""

RECORDED = (
    "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; frame-ancestors 'none'"
)
"""What a recorded file may: show itself, and nothing more."""


@dataclass(frozen=True)
class WebResponse:
    """What is sent.

    ``body``: its bytes; ``policy``: what a browser may do with it; ``referrer``: whom a browser tells where it comes
    from.
    """

    body: bytes
    media: str = "text/html; charset=utf-8"
    status: HTTPStatus = HTTPStatus.OK
    policy: str = OWN
    referrer: str = "no-referrer"
    headers: Mapping[str, str] = field(default_factory=dict)
    stream: Iterable[bytes] | None = None  # what follows the body as it comes about

    def all_headers(self) -> dict[str, str]:
        length = {} if self.stream is not None else {"Content-Length": str(len(self.body))}
        return {
            "Content-Type": self.media, **length, **SECURITY,
            "Content-Security-Policy": self.policy, "Referrer-Policy": self.referrer, **self.headers,
        }  # fmt: skip


# a browser's own viewer of PDF does not work in a sandbox
PDF = "default-src 'none'; object-src 'self'; style-src 'unsafe-inline'; base-uri 'none'; frame-ancestors 'none'"

MEDIA: Mapping[str, tuple[str, str]] = {  # what a browser may show, by the end of the name; all else it may only keep
    ".html": ("text/html; charset=utf-8", RECORDED), ".pdf": ("application/pdf", PDF),
    ".json": ("application/json", RECORDED), ".csv": ("text/plain; charset=utf-8", RECORDED),
    ".toml": ("text/plain; charset=utf-8", RECORDED), ".md": ("text/plain; charset=utf-8", RECORDED),
    ".txt": ("text/plain; charset=utf-8", RECORDED), ".svg": ("image/svg+xml", RECORDED),
}  # fmt: skip


def sent_file(name: str, content: bytes, *, keep: bool) -> WebResponse:
    """A file to be looked at in a sandbox, or to be kept."""
    ending = PurePosixPath(name).suffix.lower()
    media, policy = MEDIA.get(ending, ("application/octet-stream", RECORDED))
    how = "attachment" if keep or ending not in MEDIA else "inline"
    place = f"{how}; filename*=UTF-8''{quote(name.rpartition('/')[2], safe='')}"
    return WebResponse(content, media, policy=policy, headers={"Content-Disposition": place})


LARGEST = 256 * 2**20  # bytes of a file that is looked up; a certificate with its inputs has a hundredth
HELD = 16 * 2**20  # bytes of a file that is asked what it says it is
_HEAD = 8192
_BLOCK = 2**18
_BOUNDARY = re.compile(r'multipart/form-data;\s*boundary="?([0-9A-Za-z\'()+_,./:=? -]{1,70})"?', re.IGNORECASE)
_NAMED = re.compile(rb'filename="((?:[^"\\]|\\.)*)"')


@dataclass(frozen=True)
class UploadedFile:
    """A file that was dropped.

    ``name``: as the browser gives it, without folders; ``size``: bytes; ``content``: the bytes; ``None`` of a file
    larger than :data:`HELD`.
    """

    name: str
    size: int
    sha256: str
    content: bytes | None


def read_form(request: WebRequest) -> dict[str, str]:
    """Fields of a form that was sent, each once."""
    media = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if media != "application/x-www-form-urlencoded" or request.body is None:
        raise RefusedRequest(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, say("this page takes its own forms only"))
    if request.length > LONGEST_FORM:
        raise RefusedRequest(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, say("the form holds more than any job"))
    content = request.body.read(request.length)
    if len(content) < request.length:
        raise bad(say("the form did not come whole"), say("Send it again"))
    try:
        pairs = parse_qsl(content.decode("ascii"), keep_blank_values=True, errors="strict", max_num_fields=MOST_FIELDS)
    except ValueError:
        raise bad(say("the form cannot be read")) from None
    fields = {name: value.replace("\r\n", "\n") for name, value in pairs}
    if len(fields) < len(pairs) or any("\0" in value for value in fields.values()):
        raise bad(say("the form cannot be read"))
    return fields


def read_dropped(asked: WebRequest, into: BinaryIO | None = None, most: int = LARGEST) -> UploadedFile:
    """``into``: where the bytes are written as they come; ``most``: of them that are taken."""
    found = _BOUNDARY.fullmatch(asked.headers.get("content-type", "").strip())
    if found is None or asked.body is None:
        raise RefusedRequest(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, say("this page takes a file from its own form only"))
    if asked.length > most + _HEAD:
        fix = say("No certificate is; check that it is the right file")
        if into is not None:
            fix = say("Export the part that is needed")
        raise RefusedRequest(
            HTTPStatus.REQUEST_ENTITY_TOO_LARGE, say("the file is larger than {most} MB", most=most // 2**20), fix
        )
    held = bytearray()

    def keep(part: bytes) -> None:
        if into is not None:
            into.write(part)
        elif len(held) + len(part) <= HELD:
            held.extend(part)

    name, size, sha256 = _read(asked.body, asked.length, found[1].rstrip().encode(), keep)
    return UploadedFile(name, size, sha256, bytes(held) if len(held) == size else None)


def _read(body: BinaryIO, length: int, boundary: bytes, keep: Callable[[bytes], None]) -> tuple[str, int, str]:
    """Name, size and SHA-256 of the file, all of it but the end mark kept as it comes."""
    left = length

    def some() -> bytes:
        nonlocal left
        block = body.read(min(left, _BLOCK))
        if not block:
            raise bad(say("the file did not come whole"), say("Drop it again"))
        left -= len(block)
        return block

    end, pending = b"\r\n--" + boundary + b"--", b""
    while b"\r\n\r\n" not in pending and left and len(pending) < _HEAD:
        pending += some()
    head, parted, pending = pending.partition(b"\r\n\r\n")
    named = _NAMED.search(head)
    if not parted or len(head) > _HEAD or not head.startswith(b"--" + boundary + b"\r\n") or named is None:
        raise bad(say("the form that came with the file cannot be read"))
    name = re.split(r"[/\\]", named[1].decode("utf-8", "replace"))[-1]
    if not name:
        raise bad(say("no file was chosen"), say("Choose a file, or drop one on the field"))
    sha256, size = hashlib.sha256(), 0
    reserve = len(end) + 2  # the end mark may be cut by the end of a block

    def take(part: bytes) -> None:
        nonlocal size
        sha256.update(part)
        keep(part)
        size += len(part)

    while left:
        take(pending[:-reserve])
        pending = pending[-reserve:] + some()
    content, closed, rest = pending.rpartition(end)
    if not closed or rest not in (b"", b"\r\n"):
        raise bad(say("the file did not come whole"), say("Drop it again"))
    take(content)
    return name, size, sha256.hexdigest()


def to(path: str, **query: str) -> WebResponse:
    """After a form: a page to be got, so that reload sends nothing again."""
    return WebResponse(b"", status=HTTPStatus.SEE_OTHER, headers={"Location": address(path, **query)})


def refusal(refused: RefusedRequest) -> WebPage:
    """A page in words for a request that is answered with nothing else."""
    titles = {HTTPStatus.NOT_FOUND: say("Not found"), HTTPStatus.INTERNAL_SERVER_ERROR: say("A fault")}
    title = refused.title or titles.get(refused.status, say("This cannot be shown"))
    return page("refusal.html", "", title=title, problem=refused.problem, fix=refused.fix)._replace(
        status=refused.status
    )
