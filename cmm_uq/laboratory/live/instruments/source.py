"""What a live source is: its port, its readings by two clocks, and when it was lost and came back."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol

from cmm_uq.base.messages import Text


@dataclass(frozen=True)
class Moment:
    """A moment by both clocks, ns: the wall clock since 1970, which is set at times, and the monotonic one, which never is."""

    utc_ns: int
    monotonic_ns: int

    @classmethod
    def now(cls, clock: Clock) -> Moment:
        return cls(clock.utc_ns(), clock.monotonic_ns())


@dataclass(frozen=True)
class Reading:
    """One message of an instrument, as received and as understood; values by the quantity's name with its unit."""

    source: str  # the name in the job, unique
    number: int  # counts the messages of this source since it was opened, from 1
    utc_ns: int  # wall clock when its last byte arrived, ns since 1970
    monotonic_ns: int  # monotonic clock at the same moment, ns
    raw: bytes  # bytes as received, framing included
    values: Mapping[str, float]
    status: Text | None = None
    point: str | None = None  # for a CMM what was measured (``PtMeas``), else ``None``


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
    source: str
    utc_ns: int
    monotonic_ns: int
    why: Text


@dataclass(frozen=True)
class Returned:
    source: str
    utc_ns: int
    monotonic_ns: int
    after_s: float


Event = Reading | Gap | Returned


class LiveSource(Protocol):
    """An instrument, live."""

    name: str

    def identity(self) -> Identity:
        """Which instrument it is, as far as is known by now."""
        ...

    def events(self, stop: threading.Event) -> Iterator[Event]:
        """What happens, as it happens; it reconnects within 2 s and never raises for what the line does."""
        ...

    def close(self) -> None: ...


class Clock(Protocol):
    """Time, as the system tells it or as a test does."""

    def utc_ns(self) -> int: ...

    def monotonic_ns(self) -> int: ...

    def sleep(self, s: float) -> None: ...


class SystemClock:
    def utc_ns(self) -> int:
        return time.time_ns()

    def monotonic_ns(self) -> int:
        return time.monotonic_ns()

    def sleep(self, s: float) -> None:
        time.sleep(s)


SYSTEM: Clock = SystemClock()


TICK_S = 0.05  # longest wait for bytes; whoever waits longer looks at the clock in between


class PortLostError(Exception):
    """The port is gone: unplugged, closed by the other side, or switched off."""


class Port(Protocol):
    """An open port."""

    def read(self) -> bytes:
        """What came, as soon as anything comes; empty where nothing did within :data:`TICK_S`."""
        ...

    def write(self, data: bytes) -> None: ...

    def close(self) -> None: ...
