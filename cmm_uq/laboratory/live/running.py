"""The one thread that writes, and those that listen: a session run until its operator ends it.

A folder that a machine's program drops results into: each file is read once, when its size and time of change are the same
at two looks :data:`STILL_S` apart. What was there before the session is read too, unless a session took it already.
"""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.content import content_of
from cmm_uq.base.files.limits import TABLE_BYTES
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.laboratory.live.conducting import Conductor
from cmm_uq.laboratory.live.instruments.source import SYSTEM, Clock, Event, Gap, LiveSource
from cmm_uq.laboratory.live.screen import SessionView

STILL_S = 1.0  # for which a file must not change
_UNFINISHED = (".tmp", ".part", ".crdownload", ".swp", "~")
COMMIT_S = 0.04
"""Between two commits, and two pictures: what came is on the disk after 100 ms at the latest, and seen after 50."""

_LOOK_S = 0.5
_AT_ONCE = 2000  # events that are taken before the disk and the screen have their turn again


@dataclass(frozen=True)
class DroppedFile:
    path: Path
    content: bytes
    utc_ns: int


class WatchedFolder:
    def __init__(self, folder: Path, clock: Clock) -> None:
        if not folder.is_dir():
            raise CmmUqError("is no folder", where=str(folder), fix="Make it, or mend folder in [acquire] of job.toml")
        self.folder, self._clock, self._readable = folder, clock, True
        self._seen: dict[str, tuple[int, int, int]] = {}  # size, time of change, and since when both are so
        self._done: dict[str, tuple[int, int]] = {}
        self.trouble: list[Text] = []

    def look(self) -> list[DroppedFile]:
        """Files that stand still since the last looks, oldest first."""
        now, still = self._clock.monotonic_ns(), list[DroppedFile]()
        for path in self._files():
            try:
                status = path.stat()
            except OSError:
                continue
            state = (status.st_size, status.st_mtime_ns)
            if self._done.get(path.name) == state:
                continue
            *before, since = self._seen.get(path.name, (-1, -1, now))
            if tuple(before) != state:
                self._seen[path.name] = (*state, now)
            elif now - since >= STILL_S * 1e9:
                self._done[path.name] = state
                still += self._content(path, *state)
        return sorted(still, key=lambda file: (file.utc_ns, file.path.name))

    def again(self, path: Path) -> None:
        """A file could not be kept: read it again."""
        self._done.pop(path.name, None)

    def _files(self) -> list[Path]:
        try:
            paths = [
                path for path in self.folder.iterdir()
                if path.is_file() and not path.name.startswith(".") and not path.name.endswith(_UNFINISHED)
            ]  # fmt: skip
        except OSError as error:
            if self._readable:
                self.trouble.append(say("the folder {folder} cannot be read: {why}", folder=Verbatim(str(self.folder)),
                                        why=Verbatim(str(error.strerror))))  # fmt: skip
            paths, self._readable = [], False
        else:
            self._readable = True
        return paths

    def _content(self, path: Path, size: int, changed: int) -> list[DroppedFile]:
        try:
            content = content_of(path, TABLE_BYTES, "Export it again")
        except CmmUqError as error:
            self.trouble.append(Verbatim(str(error)))
            return []
        if len(content) != size:  # it went on growing between the look and the reading
            self.again(path)
            return []
        return [DroppedFile(path, content, changed)]


class Screen(Protocol):
    def tell(self, text: Text) -> None: ...

    def show(self, view: SessionView) -> None: ...


@dataclass(frozen=True)
class OperatorLine:
    """A line of the operator; the end of what is typed where it is ``None``."""

    text: str | None


Item = Event | OperatorLine


class Listening:
    """Sources, each with a thread of its own."""

    def __init__(self, sources: Sequence[LiveSource], items: queue.Queue[Item]) -> None:
        self.sources, self._items, self._stop = tuple(sources), items, threading.Event()
        self._threads = [threading.Thread(target=self._listen, args=(source,), daemon=True) for source in sources]

    def start(self) -> None:
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """End it, and give the ports back."""
        self._stop.set()
        for thread in self._threads:
            thread.join(timeout=2.0)
        for source in self.sources:
            source.close()

    def _listen(self, source: LiveSource) -> None:
        try:
            for event in source.events(self._stop):
                self._items.put(event)
                if self._stop.is_set():
                    break
        except Exception as error:  # whatever is wrong with a source, its silence is said
            why = say("the program's own part that listens to it failed: {what}", what=Verbatim(repr(error)))
            self._items.put(Gap(source.name, SYSTEM.utc_ns(), SYSTEM.monotonic_ns(), why))


def run(
    conductor: Conductor, listening: Listening, items: queue.Queue[Item], screen: Screen, clock: Clock, *,
    watched: WatchedFolder | None = None, dropped: Callable[[DroppedFile], None] | None = None,
) -> None:  # fmt: skip
    """Run a session to its end; between events each thing is done in its own time."""
    kept = looked = drawn = clock.monotonic_ns()
    listening.start()
    try:
        while not conductor.ended:
            _take(conductor, items)
            now = clock.monotonic_ns()
            if watched is not None and dropped is not None and now - looked >= _LOOK_S * 1e9:
                looked = now
                for file in watched.look():
                    dropped(file)
                while watched.trouble:
                    conductor.tell(watched.trouble.pop(0))
            if now - kept >= COMMIT_S * 1e9:
                kept = now
                for source in listening.sources:
                    conductor.recorder.identified(source.identity())
                conductor.tick()
            if conductor.said or now - drawn >= COMMIT_S * 1e9:
                drawn = now
                _show(conductor, screen)
    finally:
        listening.stop()
    while not items.empty():
        _take(conductor, items)
    conductor.finish()
    _show(conductor, screen)


def _show(conductor: Conductor, screen: Screen) -> None:
    while conductor.said:
        screen.tell(conductor.said.popleft())
    screen.show(conductor.view())


def _take(conductor: Conductor, items: queue.Queue[Item]) -> None:
    """Everything that is there by now, or the first that comes."""
    with contextlib.suppress(queue.Empty):
        for number in range(_AT_ONCE):
            item = items.get_nowait() if number else items.get(timeout=COMMIT_S)
            if isinstance(item, OperatorLine):
                conductor.line("quit" if item.text is None else item.text)
            else:
                conductor.event(item)
