"""The one thread that writes, and those that listen: a session run until its operator ends it.

A folder that a machine's program drops results into: each file is read once, when its size and time of change are the same
at two looks :data:`STILL_S` apart. What was there before the session is read too, unless a session took it already.
"""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import TABLE_BYTES, content_of
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.output import interruption
from cmm_uq.base.values import dataclass, field
from cmm_uq.laboratory.live.conducting import Conductor
from cmm_uq.laboratory.live.instruments.source import SYSTEM, Clock, Event, Gap, LiveSource
from cmm_uq.laboratory.live.screen import SessionView
from cmm_uq.laboratory.live.story import Journals

STILL_S = 1.0  # for which a file must not change
_UNFINISHED = (".tmp", ".part", ".crdownload", ".swp", "~")
COMMIT_S = 0.04
"""Between two commits, and two pictures: what came is on the disk after 100 ms at the latest, and seen after 50."""

_LOOK_S = 0.5
_AT_ONCE = 2000  # events that are taken before the disk and the screen have their turn again


class DroppedFile(NamedTuple):
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
                if (content := self._content(path, state[0])) is not None:
                    still.append(DroppedFile(path, content, state[1]))
        return sorted(still, key=lambda file: (file.utc_ns, file.path.name))

    def again(self, path: Path) -> None:
        """A file could not be kept: read it again."""
        self._done.pop(path.name, None)

    def _files(self) -> list[Path]:
        try:
            paths = [path for path in self.folder.iterdir() if path.is_file()]
        except OSError as error:
            if self._readable:
                self.trouble.append(say("the folder {folder} cannot be read: {why}", folder=Verbatim(str(self.folder)),
                                        why=Verbatim(str(error.strerror))))  # fmt: skip
            self._readable = False
            return []
        self._readable = True
        return [path for path in paths if not path.name.startswith(".") and not path.name.endswith(_UNFINISHED)]

    def _content(self, path: Path, size: int) -> bytes | None:
        try:
            content = content_of(path, TABLE_BYTES, "Export it again")
        except CmmUqError as error:
            self.trouble.append(Verbatim(str(error)))
            return None
        if len(content) != size:  # it went on growing between the look and the reading
            self.again(path)
            return None
        return content


class Screen(Protocol):
    def tell(self, text: Text) -> None: ...
    def show(self, view: SessionView) -> None: ...


class OperatorLine(NamedTuple):
    """A line of the operator; the end of what is typed where it is ``None``."""

    text: str | None


@dataclass(frozen=True)
class Acquisition:
    """A session that is ready to be run: sources, each with a thread of its own, and the one thread that writes."""

    conductor: Conductor
    sources: Sequence[LiveSource]
    clock: Clock
    journals: Journals
    folder: Path  # of the job
    watched: WatchedFolder | None = None  # into which results are dropped
    dropped: Callable[[DroppedFile], None] = lambda file: None  # takes them
    items: queue.Queue[Event | OperatorLine] = field(default_factory=queue.Queue)  # what they and the operator say

    def run(self, screen: Screen) -> None:
        """Run it until the operator ends it; between events each thing is done in its own time."""
        with interruption.placing(self.folder):
            pass  # from here on a signal says that what was accepted is written
        stop = threading.Event()
        threads = [threading.Thread(target=self._listen, args=(source, stop), daemon=True) for source in self.sources]
        for thread in threads:
            thread.start()
        try:
            try:
                self._until_ended(screen)
            finally:
                stop.set()
                for thread in threads:
                    thread.join(timeout=2.0)
                for source in self.sources:
                    source.close()
            while not self.items.empty():
                self._take()
            self.conductor.finish()
            self._show(screen)
        finally:
            self.journals.close()

    def _until_ended(self, screen: Screen) -> None:
        committed = looked = drawn = self.clock.monotonic_ns()
        while not self.conductor.ended:
            self._take()
            now = self.clock.monotonic_ns()
            if self.watched is not None and now - looked >= _LOOK_S * 1e9:
                looked = now
                for file in self.watched.look():
                    self.dropped(file)
                while self.watched.trouble:
                    self.conductor.tell(self.watched.trouble.pop(0))
            if now - committed >= COMMIT_S * 1e9:
                committed = now
                for source in self.sources:
                    self.conductor.recorder.identified(source.identity())
                self.conductor.tick()
            if self.conductor.said or now - drawn >= COMMIT_S * 1e9:
                drawn = now
                self._show(screen)

    def _listen(self, source: LiveSource, stop: threading.Event) -> None:
        try:
            for event in source.events(stop):
                self.items.put(event)
                if stop.is_set():
                    break
        except Exception as error:  # whatever is wrong with a source, its silence is said
            why = say("the program's own part that listens to it failed: {what}", what=Verbatim(repr(error)))
            self.items.put(Gap(source.name, SYSTEM.utc_ns(), SYSTEM.monotonic_ns(), why))

    def _show(self, screen: Screen) -> None:
        while self.conductor.said:
            screen.tell(self.conductor.said.popleft())
        screen.show(self.conductor.view())

    def _take(self) -> None:
        """Everything that is there by now, or the first that comes."""
        with contextlib.suppress(queue.Empty):
            for number in range(_AT_ONCE):
                item = self.items.get_nowait() if number else self.items.get(timeout=COMMIT_S)
                if isinstance(item, OperatorLine):
                    self.conductor.line("quit" if item.text is None else item.text)
                else:
                    self.conductor.event(item)
