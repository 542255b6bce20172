"""Entries and their chain: each carries the hash of the one before, so that none can be altered, deleted or exchanged unseen.

A chain shows what was changed inside it. Whether entries are missing at its end, or the whole was written anew, only a hash
filed elsewhere can show (``cmm-uq records head``, ``cmm-uq records verify --head``).
"""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

from cmm_uq.base.errors import CmmUqError

KINDS = (
    "machine", "artefact", "report", "release", "withdrawal", "replacement", "adjustment", "check", "imported",
    "retained", "sent", "signed",
)  # fmt: skip
"""What an entry may be of."""

CERTIFIED = frozenset({"report", "check", "imported"})
"""Kinds whose content is that of a certificate or of an interim check."""

BEGINNING = "0" * 64  # what the first entry carries in place of a hash before it


@dataclass(frozen=True, slots=True)
class Entry:
    """One entry."""

    number: int  # 1, 2, … without a gap
    at: str  # moment of recording, UTC, ISO 8601
    kind: str
    content: str  # canonical JSON
    previous: str  # hash of the entry before, hexadecimal
    hash: str

    @property
    def data(self) -> dict[str, Any]:
        found: dict[str, Any] = json.loads(self.content)
        return found

    @property
    def true(self) -> bool:
        """Whether the hash is that of the entry; SQLite lets somebody put bytes where a text is to be, which none has."""
        if not all(isinstance(part, str) for part in (self.previous, self.at, self.kind, self.content)):
            return False
        return self.hash == hash_of(self.previous, self.number, self.at, self.kind, self.content)


def canonical(content: Mapping[str, Any]) -> str:
    """The one way in which a content is written: keys sorted, no blanks, finite numbers in their shortest form."""
    try:
        text = json.dumps(content, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
        text.encode()
    except (TypeError, ValueError) as error:
        raise CmmUqError(f"cannot be recorded: {error}", where="records") from error
    if "\\u0000" in text:  # PostgreSQL has no such character
        raise CmmUqError("cannot be recorded: a text holds the character NUL", where="records")
    return text


def hash_of(previous: str, number: int, at: str, kind: str, content: str) -> str:
    """SHA-256 of an entry, as the JSON list of its parts: no two entries have the same text."""
    parts = json.dumps([previous, number, at, kind, content], separators=(",", ":"), ensure_ascii=False)
    return sha256(parts.encode()).hexdigest()


def following(previous: str, number: int, at: dt.datetime, kind: str, content: Mapping[str, Any]) -> Entry:
    """The entry after one of the hash ``previous``."""
    if kind not in KINDS:
        raise CmmUqError(f"{kind!r} is no kind of entry", where="records", fix=f"Known: {', '.join(KINDS)}")
    text, moment = canonical(content), moment_of(at)
    return Entry(number, moment, kind, text, previous, hash_of(previous, number, moment, kind, text))


def moment_of(at: dt.datetime) -> str:
    """A moment as entries have it: UTC with microseconds and Z; one without a zone is UTC already."""
    utc = at.replace(tzinfo=dt.UTC) if at.tzinfo is None else at.astimezone(dt.UTC)
    return utc.replace(tzinfo=None).isoformat(timespec="microseconds") + "Z"


def now() -> dt.datetime:
    """The present moment, UTC."""
    return dt.datetime.now(dt.UTC)
