"""Messages that are to go out: each waits in a file of its own until it was sent, whatever happens in between.

A message is written before its job counts as done, and removed after its having been sent is remembered. A crash between
the server's answer and that moment sends it a second time under the same key: a warning that comes twice does no harm,
one that never comes does.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.base.output.new_file import writing_to
from cmm_uq.base.output.staging import synced
from cmm_uq.laboratory.schedule.locks import turn
from cmm_uq.laboratory.schedule.notices import Channel, Notice, OutgoingMessage, UndeliveredError
from cmm_uq.laboratory.schedule.state import PRIVATE, State

_MENDED = "Free the disk, or mend the permissions"
MOST = 20  # messages that one run sends one by one through a channel; what is beyond goes in one
LISTED = 200  # titles in a message of several
_WAITING, _SENT, _UNFINISHED = ".json", ".sent", ".unfinished-"
_ABANDONED_S = 3600.0  # age at which nobody writes a file any more that takes milliseconds


@dataclass(frozen=True)
class Delivery:
    """What came of a message."""

    message: OutgoingMessage
    channel: str
    problem: str = ""  # why it did not go out; empty where it did
    remark: str = ""  # on one that went out


@dataclass(frozen=True)
class Outbox:
    """Messages of one folder of reports."""

    out: Path
    channels: Sequence[Channel]
    state: State
    now: Callable[[], str]

    @property
    def folder(self) -> Path:
        return self.out / PRIVATE / "outbox"

    def _messages(self, notice: Notice) -> list[tuple[Channel, OutgoingMessage]]:
        return [(channel, OutgoingMessage.of(notice, channel.name, self.now()))
                for channel in self.channels if notice.event in channel.events]  # fmt: skip

    def add(self, notices: Iterable[Notice]) -> list[Notice]:
        """Let notices go out that have not yet; those of them that were new to any channel."""
        added = []
        for notice in notices:
            new = [self._wait(message, channel.name) for channel, message in self._messages(notice)]
            added += [notice] if any(new) else []
        return added

    def sent_at_once(self, notices: Iterable[Notice]) -> list[Delivery]:
        """Send notices that cannot wait in a file; nothing of it is remembered."""
        return [
            Delivery(message, channel.name, *_attempt(channel, message))
            for notice in notices
            for channel, message in self._messages(notice)
        ]

    def waiting(self) -> int:
        """How many messages have not gone out."""
        return sum(1 for _ in self.folder.glob(f"*{_WAITING}")) if self.folder.is_dir() else 0

    def deliver(self, patience_s: float) -> list[Delivery]:
        """Send what waits, each channel until its first failure; nothing where another run is at it for longer."""
        if not self.folder.is_dir():
            return []
        with turn(self.out / PRIVATE / "messages.lock", patience_s=patience_s) as mine:
            if mine is None:
                return []
            for path in self.folder.glob(f"{_UNFINISHED}*"):  # of a run that was killed while it wrote a message
                with contextlib.suppress(OSError):
                    if time.time() - path.stat().st_mtime > _ABANDONED_S:
                        path.unlink()
            self._remember()
            done = self._send_all()
            self._remember()
            return done

    def _send_all(self) -> list[Delivery]:
        known, done = {channel.name: channel for channel in self.channels}, list[Delivery]()
        by_channel: dict[str, list[tuple[OutgoingMessage, Path]]] = {}
        for path in self.folder.glob(f"*{_WAITING}"):
            if (read := _read(path)) is not None:
                by_channel.setdefault(read[1], []).append((read[0], path))
        for name, waiting in by_channel.items():
            waiting.sort(key=lambda one: (one[0].at, one[0].key))
            if name not in known:
                why = "schedule.toml names it no longer: not sent"
                done += [Delivery(message, name, why) for message, _ in waiting]
                for _, path in waiting:
                    _drop(path)
                continue
            problem = ""
            for message, paths in _collected(waiting):
                if not problem:
                    problem, remark = _attempt(known[name], message)
                done.append(Delivery(message, name, problem, "" if problem else remark))
                for path in () if problem else paths:
                    with writing_to(path, _MENDED):
                        path.rename(path.with_suffix(_SENT))
        return done

    def _remember(self) -> None:
        """Have it in the state which messages went out; what cannot be remembered now stays for the next run."""
        for path in sorted(self.folder.glob(f"*{_SENT}")):
            read = _read(path)
            if read is None:
                continue
            message, name = read
            try:
                if not self.state.sent(message.key):
                    self.state.add_sent(message.key, {**message.as_data(), "channel": name})
            except CmmUqError:
                return
            _drop(path)

    def _wait(self, message: OutgoingMessage, channel: str) -> bool:
        place = self.folder / f"{message.key}{_WAITING}"
        if self.state.sent(message.key) or place.exists() or place.with_suffix(_SENT).exists():
            return False
        with writing_to(place, _MENDED):
            self.folder.mkdir(parents=True, exist_ok=True)
            content = json.dumps({"channel": channel, "message": message.as_data()}, ensure_ascii=False)
            with tempfile.NamedTemporaryFile("wb", dir=self.folder, prefix=_UNFINISHED, delete=False) as file:
                try:
                    file.write(content.encode())
                    file.flush()
                    os.fsync(file.fileno())
                except OSError:
                    os.unlink(file.name)  # noqa: PTH108
                    raise
            os.replace(file.name, place)  # noqa: PTH105
            synced(self.folder)
        return True


def _read(path: Path) -> tuple[OutgoingMessage, str] | None:
    """A message and its channel; ``None`` of a file that is gone, or that somebody else put there."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        return OutgoingMessage(**{key: str(value) for key, value in data["message"].items()}), str(data["channel"])
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return None


def _collected(waiting: Sequence[tuple[OutgoingMessage, Path]]) -> list[tuple[OutgoingMessage, list[Path]]]:
    """Messages one by one with their files; of many the last is all the others together."""
    if len(waiting) <= MOST:
        return [(message, [path]) for message, path in waiting]
    alone, rest = waiting[: MOST - 1], waiting[MOST - 1 :]
    key = hashlib.sha256("".join(message.key for message, _ in rest).encode()).hexdigest()[:32]
    titles = [message.title for message, _ in rest]
    listed = "\n".join([*titles[:LISTED], *([f"and {len(titles) - LISTED} more"] if len(titles) > LISTED else [])])
    first, title = rest[0][0], str(say("{count} more messages", count=len(rest)))
    together = OutgoingMessage(key, first.event, "", title, listed, "", first.at)
    return [*((message, [path]) for message, path in alone), (together, [path for _, path in rest])]


def _attempt(channel: Channel, message: OutgoingMessage) -> tuple[str, str]:
    """Why a message did not go out, and what is to be remarked of one that did; either may be empty."""
    try:
        return "", channel.send(message)
    except (UndeliveredError, CmmUqError) as error:
        return str(error), ""


def _drop(path: Path) -> None:
    with contextlib.suppress(OSError):
        path.unlink()
