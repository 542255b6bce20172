"""Append-only files of records, a line each with a checksum, that open whatever happened while they were written.

A line is the CRC-32 of its text, a blank, the text (JSON on one line, ASCII only), and a line feed. Records are numbered, so
that one that is missing shows. A record counts as kept once :meth:`RecordingJournal.commit` has returned: it is then on disk.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.files.limits import check_file
from cmm_uq.base.output.staging import synced
from cmm_uq.base.values import dataclass
from cmm_uq.laboratory.live.instruments.source import Moment

_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
_CHECKSUM = 8  # hexadecimal digits of it
MOST_WAITING = 64 * 2**20  # bytes that wait in memory for room on the disk: twenty minutes of six instruments at 100 Hz


@dataclass(frozen=True)
class Record:
    number: int  # ascending by one in a file
    kind: str
    moment: Moment  # when it was written down
    data: Mapping[str, Any]  # what it says, plain data


def line_of(record: Record) -> bytes:
    parts = [record.number, record.kind, record.moment.utc_ns, record.moment.monotonic_ns, record.data]
    text = json.dumps(parts, separators=(",", ":"), allow_nan=False).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def record_of(line: bytes) -> Record | None:
    """The record of a line without its line feed; ``None`` where it is none that was written whole."""
    checksum, text = line[:_CHECKSUM], line[_CHECKSUM + 1 :]
    if len(checksum) < _CHECKSUM or line[_CHECKSUM : _CHECKSUM + 1] != b" " or b"%08x" % zlib.crc32(text) != checksum:
        return None
    try:
        number, kind, utc_ns, monotonic_ns, data = json.loads(text)
    except (ValueError, TypeError):
        return None
    return Record(number, kind, Moment(utc_ns, monotonic_ns), data)


class JournalLine(NamedTuple):
    number: int  # in the file, from 1
    text: bytes  # only the last may lack its line feed
    record: Record | None  # ``None`` where it is damaged, or was never finished


def lines_in(path: Path) -> Iterator[JournalLine]:
    check_file(path, "Put a copy of the file in its place")
    with path.open("rb") as file:
        for number, line in enumerate(file, 1):
            yield JournalLine(number, line, record_of(line[:-1]) if line.endswith(b"\n") else None)


@dataclass(frozen=True)
class JournalContent:
    records: tuple[Record, ...]  # all that are sound, in order
    torn: bytes  # bytes behind the last whole line, which nobody was told were kept
    damaged: tuple[int, ...]  # lines, from 1, whose checksum does not fit, or behind which a record is missing


def opened(path: Path, *, first: int | None = None) -> JournalContent:
    """Read a journal; nothing of it is changed."""
    records, damaged, torn, expected = list[Record](), list[int](), b"", first
    for number, text, record in lines_in(path):
        if not text.endswith(b"\n"):
            torn = text
            continue
        if record is None or (expected is not None and record.number != expected):
            damaged.append(number)
        if record is not None:
            records.append(record)
            expected = record.number
        expected = None if expected is None else expected + 1
    return JournalContent(tuple(records), torn, tuple(damaged))


def refuse_damaged(path: Path, found: JournalContent) -> None:
    """Refuse to go on behind a damaged line: what it said, an undone point perhaps, would be forgotten."""
    if found.damaged:
        others = f", and {len(found.damaged) - 1} more" if len(found.damaged) > 1 else ""
        raise CmmUqError(
            f"the line is damaged{others}: its checksum, or its number, does not fit",
            where=f"{path} line {found.damaged[0]}",
            fix="Put a copy of the file in its place, or go on without it: --skip-damaged, which the recording then says",
        )


class NoRoomError(OutputError):
    """The disk takes nothing more; what was to be written waits in memory."""


class RecordingJournal:
    """A journal that is written, from record ``first`` on, in a file that does not exist yet."""

    def __init__(self, path: Path, *, first: int = 1) -> None:
        self.path, self.next, self.written, self._bytes = path, first, 0, 0
        self._waiting: list[bytes] = []
        try:
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
            synced(path.parent)
        except OSError as error:
            raise refused("cannot be made", error, path) from None

    def append(self, kind: str, data: Mapping[str, Any], moment: Moment) -> Record:
        """A record that will be kept by the next :meth:`commit`."""
        record = Record(self.next, kind, moment, data)
        line = line_of(record)
        if self._bytes + len(line) > MOST_WAITING:
            raise OutputError(
                f"the disk has been full for so long that {self._bytes} bytes wait in memory",
                where=str(self.path),
                fix="Make room, then go on; what was shown as accepted is kept",
            )
        self.next += 1
        self._waiting.append(line)
        self._bytes += len(line)
        return record

    def commit(self) -> None:
        if not self._waiting:
            return
        text = b"".join(self._waiting)
        try:
            left = memoryview(text)
            while left:
                left = left[os.write(self._file, left) :]
            os.fsync(self._file)
        except OSError as error:
            with contextlib.suppress(OSError):
                os.ftruncate(self._file, self.written)
            if error.errno not in _NO_ROOM:
                raise refused("cannot be written", error, self.path) from None
            raise NoRoomError(
                f"there is no room on the disk ({error.strerror}): {len(self._waiting)} records wait in memory, not accepted",
                where=str(self.path),
                fix="Make room; they are written as soon as there is some",
            ) from None
        self.written += len(text)
        self._waiting.clear()
        self._bytes = 0

    def close(self) -> None:
        """Give the file back; what still waits is lost."""
        with contextlib.suppress(OSError):
            os.close(self._file)


def refused(
    what: str, error: OSError, path: Path, fix: str = "Make room, or mend the folder's permissions"
) -> OutputError:
    return OutputError(f"{what}: {error.strerror}", where=str(path), fix=fix)


def made_folder(folder: Path) -> None:
    """Make a folder, and those above it, that may be there already."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot be made: {error.strerror}", where=str(folder), fix="Name another folder") from None
