"""Where messages begin and end in what a line brings: the same messages, however the bytes were cut on their way."""

from __future__ import annotations

from dataclasses import dataclass

from cmm_uq.laboratory.live.instruments.control_codes import bytes_of
from cmm_uq.laboratory.live.instruments.profile import Frame


@dataclass(frozen=True)
class Framed:
    """Bytes that belong together.

    Parameters
    ----------
    raw : as received.
    body : without terminator, first and last byte.
    whole : whether it is a message; else bytes between messages, or a message without its end.
    """

    raw: bytes
    body: bytes
    whole: bool = True


class Framer:
    """Messages out of a stream of bytes; no byte is lost, none is in two messages."""

    def __init__(self, frame: Frame) -> None:
        self._terminator, self._start, self._stop = map(bytes_of, (frame.terminator, frame.start, frame.stop))
        self._length, self._longest = frame.length, frame.longest
        self._waiting = bytearray()
        self._looked = 0

    def feed(self, received: bytes) -> list[Framed]:
        """Messages that are complete with these bytes.

        Parameters
        ----------
        received : what came since.
        """
        self._waiting += received
        found = []
        while (one := self._next()) is not None:
            found.append(one)
        return found

    def rest(self) -> Framed | None:
        """What waits for its end and will not get it; afterwards nothing waits."""
        raw, self._waiting, self._looked = bytes(self._waiting), bytearray(), 0
        return Framed(raw, raw, whole=False) if raw else None

    @property
    def waiting(self) -> bool:
        """Whether a message has begun."""
        return bool(self._waiting)

    def _next(self) -> Framed | None:
        if self._start:
            place = self._waiting.find(self._start)
            if place:
                before = len(self._waiting) if place < 0 else place
                return self._taken(min(before, self._longest)) if place > 0 or before >= self._longest else None
        size = self._size()
        if size is None:
            return self._taken(self._longest) if len(self._waiting) >= self._longest else None
        if size > self._longest:
            return self._taken(self._longest)
        raw = bytes(self._waiting[:size])
        del self._waiting[:size]
        self._looked = 0
        return Framed(raw, raw[len(self._start) : len(raw) - len(self._terminator or self._stop)])

    def _size(self) -> int | None:
        """Bytes of the message that waits; ``None`` where its end has not come."""
        if self._length:
            return self._length if len(self._waiting) >= self._length else None
        end = self._terminator or self._stop
        place = self._waiting.find(end, max(self._looked, len(self._start)))
        if place < 0:
            # What was looked at once need not be looked at again, but an end may have begun in its last bytes.
            self._looked = max(0, len(self._waiting) - len(end) + 1)
            return None
        return place + len(end)

    def _taken(self, size: int) -> Framed:
        """Bytes that are no message."""
        raw = bytes(self._waiting[:size])
        del self._waiting[:size]
        self._looked = 0
        return Framed(raw, raw, whole=False)
