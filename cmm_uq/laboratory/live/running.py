"""The one thread that writes, and those that listen: a session run until its operator ends it.

A folder that a machine's program drops results into: each file is read once, when its size and time of change are the same
at two looks :data:`STILL_S` apart. What was there before the session is read too, unless a session took it already.
"""

from __future__ import annotations

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


@dataclass(frozen=True)
class DroppedFile:
    """A file that stands still."""

    path: Path
    content: bytes
    utc_ns: int


class WatchedFolder:
    def __init__(self, folder: Path, clock: Clock) -> None:
        if not folder.is_dir():
            raise CmmUqError("is no folder", where=str(folder), fix="Make it, or mend folder in [acquire] of job.toml")
        self.folder, self._clock = folder, clock
        self._seen: dict[str, tuple[int, int, int]] = {}
        self._done: dict[str, tuple[int, int]] = {}
        self._readable = True
        self.trouble: list[Text] = []

    def look(self) -> list[DroppedFile]:
        """Files that stand still since the last looks, oldest first."""
        now, found = self._clock.monotonic_ns(), list[DroppedFile]()
        for path in self._files():
            try:
                state = path.stat()
            except OSError:
                continue
            size, changed = state.st_size, state.st_mtime_ns
            if self._done.get(path.name) == (size, changed):
                continue
            before = self._seen.get(path.name)
            if before is None or before[:2] != (size, changed):
                self._seen[path.name] = (size, changed, now)
            elif now - before[2] >= STILL_S * 1e9:
                self._done[path.name] = (size, changed)
                found += self._content(path, size, changed)
        return sorted(found, key=lambda one: (one.utc_ns, one.path.name))

    def again(self, path: Path) -> None:
        """A file could not be kept: read it again."""
        self._done.pop(path.name, None)

    def _files(self) -> list[Path]:
        try:
            found = [
                path for path in self.folder.iterdir()
                if path.is_file() and not path.name.startswith(".") and not path.name.endswith(_UNFINISHED)
            ]  # fmt: skip
            self._readable = True
            return found
        except OSError as error:
            if self._readable:
                self.trouble.append(say("the folder {folder} cannot be read: {why}", folder=Verbatim(str(self.folder)),
                                        why=Verbatim(str(error.strerror))))  # fmt: skip
            self._readable = False
            return []

    def _content(self, path: Path, size: int, changed: int) -> list[DroppedFile]:
        try:
            content = content_of(path, TABLE_BYTES, "Export it again")
        except CmmUqError as error:
            self.trouble.append(Verbatim(str(error)))
            return []
        if len(content) != size:  # it went on growing between the look and the reading
            del self._done[path.name]
            return []
        return [DroppedFile(path, content, changed)]


COMMIT_S = 0.04
"""Between two commits, and two pictures: what came is on the disk after 100 ms at the latest, and seen after 50."""

_LOOK_S = 0.5
_AT_ONCE = 2000  # events that are taken before the disk and the screen have their turn again


class Screen(Protocol):
    """What shows a session."""

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
    """Run a session to its end."""
    turns = _Turns(conductor, screen, clock, watched, dropped)
    listening.start()
    try:
        while not conductor.ended:
            _taken(conductor, items)
            turns.turn(listening.sources)
    finally:
        listening.stop()
    while not items.empty():
        _taken(conductor, items)
    conductor.finish()
    turns.show()


class _Turns:
    """What is done between events, each in its own time."""

    def __init__(
        self, conductor: Conductor, screen: Screen, clock: Clock, watched: WatchedFolder | None,
        dropped: Callable[[DroppedFile], None] | None,
    ) -> None:  # fmt: skip
        self._conductor, self._screen, self._clock, self._watched, self._dropped = (
            conductor,
            screen,
            clock,
            watched,
            dropped,
        )
        self._kept = self._looked = self._drawn = clock.monotonic_ns()

    def turn(self, sources: Sequence[LiveSource]) -> None:
        now, wait = self._clock.monotonic_ns(), COMMIT_S * 1e9
        if now - self._looked >= _LOOK_S * 1e9:
            self._looked = now
            self._look()
        if now - self._kept >= wait:
            self._kept = now
            for source in sources:
                self._conductor.recorder.identified(source.identity())
            self._conductor.tick()
        if self._conductor.said or now - self._drawn >= wait:
            self._drawn = now
            self.show()

    def show(self) -> None:
        """Say what happened, and how it stands."""
        while self._conductor.said:
            self._screen.tell(self._conductor.said.popleft())
        self._screen.show(self._conductor.view())

    def _look(self) -> None:
        if self._watched is None or self._dropped is None:
            return
        for file in self._watched.look():
            self._dropped(file)
        while self._watched.trouble:
            self._conductor.tell(self._watched.trouble.pop(0))


def _taken(conductor: Conductor, items: queue.Queue[Item]) -> None:
    """Everything that is there by now, or the first that comes."""
    try:
        item: Item | None = items.get(timeout=COMMIT_S)
        for _ in range(_AT_ONCE):
            if item is None:
                break
            if not isinstance(item, OperatorLine):
                conductor.event(item)
            elif item.text is None:
                conductor.line("quit")
            else:
                conductor.line(item.text)
            item = None if items.empty() else items.get_nowait()
    except queue.Empty:
        return
