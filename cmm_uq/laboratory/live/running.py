"""The one thread that writes, and those that listen: a session run until its operator ends it."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.laboratory.live.conducting import Conductor
from cmm_uq.laboratory.live.dropped import Dropped, Watched
from cmm_uq.laboratory.live.instruments.source import SYSTEM, Clock, Event, Gap, Source
from cmm_uq.laboratory.live.view import View

COMMIT_S = 0.04
"""Between two commits, and two pictures: what came is on the disk after 100 ms at the latest, and seen after 50."""

_LOOK_S = 0.5
_AT_ONCE = 2000
"""Events that are taken before the disk and the screen have their turn again."""


class Screen(Protocol):
    """What shows a session."""

    def tell(self, text: Text) -> None:
        """Something happened."""
        ...

    def show(self, view: View) -> None:
        """How it stands."""
        ...


@dataclass(frozen=True)
class Line:
    """A line of the operator; the end of what is typed where it is ``None``."""

    text: str | None


Item = Event | Line


class Listening:
    """Sources, each with a thread of its own.

    Parameters
    ----------
    sources : that are open.
    items : where their events go.
    """

    def __init__(self, sources: Sequence[Source], items: queue.Queue[Item]) -> None:
        self.sources, self._items, self._stop = tuple(sources), items, threading.Event()
        self._threads = [threading.Thread(target=self._listen, args=(source,), daemon=True) for source in sources]

    def start(self) -> None:
        """Begin to listen."""
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """End it, and give the ports back."""
        self._stop.set()
        for thread in self._threads:
            thread.join(timeout=2.0)
        for source in self.sources:
            source.close()

    def _listen(self, source: Source) -> None:
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
    watched: Watched | None = None, dropped: Callable[[Dropped], None] | None = None,
) -> None:  # fmt: skip
    """Run a session to its end.

    Parameters
    ----------
    conductor : takes everything.
    listening : to the instruments.
    items : what they say, and what the operator types.
    screen : shows it.
    clock : for the time between commits.
    watched, dropped : a folder, and what takes the files in it.

    Raises
    ------
    OutputError : the disk fails.
    """
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
        self, conductor: Conductor, screen: Screen, clock: Clock, watched: Watched | None,
        dropped: Callable[[Dropped], None] | None,
    ) -> None:  # fmt: skip
        self._conductor, self._screen, self._clock, self._watched, self._dropped = (
            conductor,
            screen,
            clock,
            watched,
            dropped,
        )
        self._kept = self._looked = self._drawn = clock.monotonic_ns()

    def turn(self, sources: Sequence[Source]) -> None:
        """Everything that is due."""
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
            if not isinstance(item, Line):
                conductor.event(item)
            elif item.text is None:
                conductor.line("quit")
            else:
                conductor.line(item.text)
            item = None if items.empty() else items.get_nowait()
    except queue.Empty:
        return
