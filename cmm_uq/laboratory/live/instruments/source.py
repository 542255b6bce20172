"""What a live source is: an instrument that says who it is, what it reads, and when it was lost and came back."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

from cmm_uq.base.messages import Text
from cmm_uq.laboratory.live.instruments.reading import Reading


@dataclass(frozen=True)
class Identity:
    """Which instrument it is: what it says itself, and what the job says of it; ``None`` where nobody does."""

    name: str
    maker: str | None = None
    model: str | None = None
    serial: str | None = None
    firmware: str | None = None
    certificate: str | None = None


@dataclass(frozen=True)
class Gap:
    """A source went silent or was lost.

    Parameters
    ----------
    source : its name.
    utc_ns, monotonic_ns : when that was noticed.
    why : in words.
    """

    source: str
    utc_ns: int
    monotonic_ns: int
    why: Text


@dataclass(frozen=True)
class Returned:
    """A source that was lost is there again.

    Parameters
    ----------
    source : its name.
    utc_ns, monotonic_ns : when that was noticed.
    after_s : since the gap was noticed.
    """

    source: str
    utc_ns: int
    monotonic_ns: int
    after_s: float


Event = Reading | Gap | Returned


class Source(Protocol):
    """An instrument, live."""

    name: str

    def identity(self) -> Identity:
        """Which instrument it is, as far as is known by now."""
        ...

    def events(self, stop: threading.Event) -> Iterator[Event]:
        """What happens, as it happens; ends when ``stop`` is set.

        It blocks in between, reconnects by itself within 2 s of the instrument's return, and never raises for what the
        line does.
        """
        ...

    def close(self) -> None:
        """Give the port back."""
        ...


class Clock(Protocol):
    """Time, as the system tells it or as a test does."""

    def utc_ns(self) -> int:
        """Wall clock, ns since 1970."""
        ...

    def monotonic_ns(self) -> int:
        """A clock that nobody sets, ns."""
        ...

    def sleep(self, s: float) -> None:
        """Wait."""
        ...


class SystemClock:
    """The system's clocks."""

    def utc_ns(self) -> int:
        """See :meth:`Clock.utc_ns`."""
        return time.time_ns()

    def monotonic_ns(self) -> int:
        """See :meth:`Clock.monotonic_ns`."""
        return time.monotonic_ns()

    def sleep(self, s: float) -> None:
        """See :meth:`Clock.sleep`."""
        time.sleep(s)


SYSTEM: Clock = SystemClock()
