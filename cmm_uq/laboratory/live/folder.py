"""The folder of a recording that is taken live: its lock, its journals one a session, and what of it can be opened again."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.output.staging import locked
from cmm_uq.laboratory.live.instruments.source import Moment
from cmm_uq.laboratory.live.journal import Record, RecordingJournal, opened, refuse_damaged
from cmm_uq.laboratory.live.story import Story

FOLDER = "acquisition"  # inside the job's
LOCK = "lock"
EVENTS, STREAMS = "{:04d}-events.jsonl", "{:04d}-streams.jsonl"  # names of the two journals of a session, by its number
_EVENTS = re.compile(r"(\d{4})-events\.jsonl")


@dataclass
class Journals:
    folder: Path
    events: RecordingJournal  # of what happened: points, gaps, notes
    streams: RecordingJournal  # of the readings that come by themselves
    story: Story
    _lock: int

    def say(self, kind: str, data: Mapping[str, Any], moment: Moment) -> Record:
        """A record of what happened, kept by the next :meth:`commit`."""
        record = self.events.append(kind, data, moment)
        self.story.take(record)
        return record

    def commit(self) -> None:
        """Put both on the disk."""
        self.events.commit()
        self.streams.commit()

    def close(self) -> None:
        """Give files and lock back."""
        self.events.close()
        self.streams.close()
        with contextlib.suppress(OSError):
            os.close(self._lock)


def sessions_in(folder: Path) -> list[Path]:
    """Journals of events of all sessions, in order."""
    try:
        names = sorted(path.name for path in folder.iterdir() if _EVENTS.fullmatch(path.name))
    except OSError:
        return []
    return [folder / name for name in names]


def begin(folder: Path, said: Mapping[str, Any], moment: Moment, *, skip_damaged: bool = False) -> Journals:
    """Begin a session: take the lock, read what earlier ones left, cut what was never finished, and open new journals."""
    with contextlib.ExitStack() as failed:
        lock = _taken(folder)
        failed.callback(os.close, lock)
        story, following, torn, damaged = _read(folder, skip_damaged)
        known = {line for session in story.sessions for line in session.said.get("damaged", [])}
        number = 1 + max((int(path.name[:4]) for path in sessions_in(folder)), default=0)
        streams = folder / STREAMS.format(number - 1)
        torn += [(streams, tail)] if (tail := _torn_end(streams)) else []
        events = RecordingJournal(folder / EVENTS.format(number), first=following)
        journals = Journals(folder, events, RecordingJournal(folder / STREAMS.format(number)), story, lock)
        fresh = [line for line in damaged if line not in known]
        journals.say("session", {"session": number, **said, **({"damaged": fresh} if fresh else {})}, moment)
        for path, tail in torn:
            journals.say("cut", {"file": path.name, "bytes": len(tail), "text": tail.decode("latin-1")}, moment)
        journals.commit()  # before anything is cut, it is kept here
        for path, tail in torn:
            try:
                with path.open("rb+") as file:
                    file.truncate(path.stat().st_size - len(tail))
                    file.flush()
                    os.fsync(file.fileno())
            except OSError as error:
                raise _refused(path, error) from None
        failed.pop_all()
    return journals


def read_story(folder: Path, *, skip_damaged: bool = False) -> Story:
    """What all sessions in a folder come to; nothing is changed."""
    return _read(folder, skip_damaged)[0]


def _read(folder: Path, skip_damaged: bool) -> tuple[Story, int, list[tuple[Path, bytes]], list[str]]:
    """The story, the number of the next record, what was torn off which file, and damaged lines."""
    story, following, torn, damaged = Story(), 1, list[tuple[Path, bytes]](), list[str]()
    for path in sessions_in(folder):
        content = opened(path, first=following)
        if not skip_damaged:
            refuse_damaged(path, content)
        damaged += [f"{path.name} line {number}" for number in content.damaged]
        for record in content.records:
            story.take(record)
        following = max(following, *(record.number + 1 for record in content.records), 1)
        torn += [(path, content.torn)] if content.torn else []
    return story, following, torn, damaged


def _torn_end(path: Path) -> bytes:
    """What stands behind the last line feed of a file that may be large."""
    try:
        with path.open("rb") as file:
            size = file.seek(0, os.SEEK_END)
            step = 65536
            while True:
                start = max(0, size - step)
                file.seek(start)
                text = file.read(size - start)
                if b"\n" in text or start == 0:
                    return text[text.rfind(b"\n") + 1 :]
                step *= 2
    except OSError:
        return b""


def _taken(folder: Path) -> int:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / LOCK).open("ab"):
            pass
        lock = locked(folder / LOCK, create=False)
    except OSError as error:
        raise _refused(folder, error) from None
    if lock is None:
        fix = "End it there; a program that was killed holds no lock"
        raise CmmUqError("this job is being recorded by another program", where=str(folder), fix=fix)
    return lock


def _refused(path: Path, error: OSError) -> OutputError:
    return OutputError(f"cannot be written: {error.strerror}", where=str(path), fix="Mend its permissions")
