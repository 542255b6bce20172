"""What a browser asks, read and checked, and what it is answered: the only place that knows HTTP's words.

An address that cannot be read is refused in words (:class:`Refused`), never guessed at.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import BinaryIO
from urllib.parse import parse_qsl, urlsplit

from cmm_uq.base.errors import printable, shortened, suggestion
from cmm_uq.base.messages import NOTHING, Text, Verbatim, say

LONGEST_VALUE = 300
"""Characters of one value of a query: the longest serial or job id that the records take is shorter."""

MOST_VALUES = 20
LAST_PAGE = 10**6


class Refused(Exception):  # noqa: N818 - what it is, in the words of the answer
    """A request that is answered with a page in words instead of what it asked for.

    Parameters
    ----------
    status : of the answer.
    problem : what is wrong, a sentence.
    fix : what to do.
    """

    def __init__(self, status: HTTPStatus, problem: Text, fix: Text = NOTHING) -> None:
        self.status, self.problem, self.fix = status, problem, fix
        super().__init__(str(problem))


@dataclass(frozen=True)
class Asked:
    """A request.

    Parameters
    ----------
    method : GET, HEAD or POST.
    path : of the address, as it was sent.
    query : by name; each was given once.
    headers : by name in small letters.
    body : of a POST; ``length`` bytes of it.
    """

    method: str
    path: str
    query: Mapping[str, str] = field(default_factory=dict)
    headers: Mapping[str, str] = field(default_factory=dict)
    body: BinaryIO | None = None
    length: int = 0

    def only(self, known: Iterable[str]) -> None:
        """Refuse what this page does not know.

        Raises
        ------
        Refused : a name in the query is none of them.
        """
        names = tuple(known)
        for name in self.query:
            if name not in names:
                fix = Verbatim(suggestion(name, names)) if names else say("It takes none")
                raise bad(say("this page knows no {name!r} in its address", name=_short(name)), fix)

    def text(self, name: str) -> str:
        """A value, empty where it was not given."""
        return self.query.get(name, "").strip()

    def one_of(self, name: str, allowed: Collection[str]) -> str:
        """A value of a list, or nothing.

        Raises
        ------
        Refused : another one.
        """
        value = self.text(name)
        if value and value not in allowed:
            raise bad(say("{name} cannot be {value!r}", name=Verbatim(name), value=_short(value)),
                      Verbatim(suggestion(value, allowed)))  # fmt: skip
        return value

    def count(self, name: str, default: int = 1) -> int:
        """A whole number from 1.

        Raises
        ------
        Refused : something else.
        """
        value = self.text(name)
        if not value:
            return default
        if not (value.isascii() and value.isdigit()) or not 1 <= int(value[:9]) <= LAST_PAGE or len(value) > 9:
            problem = say("{name} is a whole number from 1, not {value!r}", name=Verbatim(name), value=_short(value))
            raise bad(problem)
        return int(value)

    def day(self, name: str) -> dt.date | None:
        """A date, or nothing.

        Raises
        ------
        Refused : something else.
        """
        value = self.text(name)
        if not value:
            return None
        try:
            return dt.date.fromisoformat(value)
        except ValueError:
            problem = say(
                "{name} is a date such as 2026-03-31, not {value!r}", name=Verbatim(name), value=_short(value)
            )
            raise bad(problem) from None


def read_address(target: str) -> tuple[str, dict[str, str]]:
    """Path and query of a request line.

    Raises
    ------
    Refused : it is no address of this page, or gives a name twice.
    """
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
            raise bad(say("{name!r} in the address is longer than any name, or holds what no name holds",
                          name=_short(name)))  # fmt: skip
        query[name] = value
    return parts.path, query


def bad(problem: Text, fix: Text = NOTHING) -> Refused:
    """A request that cannot be understood."""
    return Refused(HTTPStatus.BAD_REQUEST, problem, fix)


def _short(text: str) -> Verbatim:
    return Verbatim(printable(shortened(text, 60)))


SECURITY = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), geolocation=(), microphone=()",
    "Cache-Control": "no-store",
}
"""Sent with every answer."""

OWN = (
    "default-src 'none'; style-src 'self'; img-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
)
"""What a page of this site may load: its style sheet and its icon."""

RECORDED = (
    "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; frame-ancestors 'none'"
)
"""What a recorded file may: show itself, and nothing more."""


@dataclass(frozen=True)
class Answer:
    """What is sent.

    Parameters
    ----------
    body : its bytes.
    media : its type.
    status : of the answer.
    policy : what a browser may do with it.
    referrer : whom a browser tells where it comes from.
    headers : further ones.
    """

    body: bytes
    media: str = "text/html; charset=utf-8"
    status: HTTPStatus = HTTPStatus.OK
    policy: str = OWN
    referrer: str = "no-referrer"
    headers: Mapping[str, str] = field(default_factory=dict)

    def all_headers(self) -> dict[str, str]:
        """Every header but the connection's."""
        return {
            "Content-Type": self.media, "Content-Length": str(len(self.body)), **SECURITY,
            "Content-Security-Policy": self.policy, "Referrer-Policy": self.referrer, **self.headers,
        }  # fmt: skip
