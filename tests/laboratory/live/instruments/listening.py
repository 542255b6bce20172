"""A source listened to for as long as a test needs."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Self

from cmm_uq.laboratory.live.instruments.instrument import instrument
from cmm_uq.laboratory.live.instruments.library import profile_named
from cmm_uq.laboratory.live.instruments.profile import ProfileFile
from cmm_uq.laboratory.live.instruments.source import SYSTEM, Event, Gap, Identity, LiveSource, Reading, Returned

PATIENCE_S = 30.0
"""Until a test gives up waiting, on a busy machine."""


class Listener:
    def __init__(self, source: LiveSource) -> None:
        self.source, self.events, self.times = source, [], []
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def _listen(self) -> None:
        for event in self.source.events(self._stop):
            self.times.append(time.monotonic())
            self.events.append(event)

    def until(self, enough: Callable[[Self], bool]) -> None:
        end = time.monotonic() + PATIENCE_S
        while not enough(self):
            assert time.monotonic() < end, self.events[-5:]
            time.sleep(0.01)

    def of(self, sort: type[Event], since: int = 0) -> list[Event]:
        return [event for event in self.events[since:] if isinstance(event, sort)]

    def good(self, since: int = 0) -> list[Reading]:
        return [
            event for event in self.events[since:] if isinstance(event, Reading) and event.values and not event.status
        ]

    def end(self) -> None:
        self._stop.set()
        self._thread.join(PATIENCE_S)
        assert not self._thread.is_alive()
        self.source.close()


@contextmanager
def listening(source: LiveSource) -> Iterator[Listener]:
    listener = Listener(source)
    try:
        yield listener
    finally:
        listener.end()


def hasty(name: str, **send: object) -> ProfileFile:
    profile = profile_named(name)
    faster = profile.send.model_copy(update={"every_s": 0.05, **send})
    return profile.model_copy(update={"send": faster})


def opened(profile: ProfileFile, port: str, name: str = "a", serial: str | None = None) -> LiveSource:
    return instrument(Identity(name, serial=serial), profile, port, SYSTEM, Path())


__all__ = ["Gap", "Returned"]
