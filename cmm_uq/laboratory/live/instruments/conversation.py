"""When which question is asked, which message answers it, and which instrument says it is there."""

from __future__ import annotations

import re

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.live.instruments.parsing import FramedMessage
from cmm_uq.laboratory.live.instruments.profile import Identify, Send, bytes_of
from cmm_uq.laboratory.live.instruments.source import Identity

SECOND = 1_000_000_000  # ns

PAUSE = SECOND // 2
"""After an answer that did not come: where several questions are asked, a late one would be taken for the next one's."""


class Conversation:
    """Questions to one instrument, one after the other, a round every so often; moments are of the monotonic clock, ns.

    A silent instrument (``gap``) is asked without regard to the rounds, so that its return is noticed.
    """

    def __init__(self, send: Send, now: int, *, replayed: bool = False) -> None:
        self._polls = [bytes_of(poll.send) for poll in send.poll]
        self._every, self._patience = round(send.every_s * SECOND), round(send.answer_within_s * SECOND)
        silent = send.silent_after_s
        self._silence = None if self._polls or silent is None or replayed else round(silent * SECOND)
        self._replayed = replayed
        self._due = self._since = self._asked_at = self._heard_at = self._pause = now
        self.asked = 0 if replayed else -1
        self.waiting = self.gap = False

    @property
    def several(self) -> bool:
        """Whether an answer may belong to one of several questions."""
        return len(self._polls) > 1 and not self._replayed

    def question(self, now: int) -> bytes | None:
        """What to send now; ``None``: nothing yet."""
        if not self._polls or self._replayed:
            return None
        if self.waiting:
            if not self.gap or self.several or now - self._asked_at < min(self._patience, SECOND):
                return None
            self._asked_at = now
            return self._polls[self.asked]
        following = (self.asked + 1) % len(self._polls)
        if now < self._pause or (following == 0 and now < self._due and not self.gap):
            return None
        if following == 0:
            self._due += self._every * max(1, 1 + (now - self._due) // self._every)
        self.asked, self.waiting = following, True
        self._since = self._asked_at = now
        return self._polls[following]

    def heard(self, now: int, *, answer: bool) -> None:
        self._heard_at = now
        if answer:
            self.waiting = self.gap = False
            if self._replayed and self._polls:
                self.asked = (self.asked + 1) % len(self._polls)

    def overdue(self, now: int) -> bool:
        """Whether an answer did not come in time, or an instrument that speaks by itself is silent; said once each time."""
        if self.waiting and now - self._since >= self._patience:
            self.waiting = False
            self._pause = now + PAUSE if self.several else now
            return True
        if self._silence is not None:
            allowed = min(self._silence, SECOND) if self.gap else self._silence
            if now - self._heard_at >= allowed:
                self._heard_at = now
                return True
        return False


class Introduction:
    def __init__(self, wanted: Identify) -> None:
        self._pattern = re.compile(wanted.pattern)
        self._lines: list[str] = []
        self._span = (0, 0)
        self.found: Identity | None = None  # what it said; ``None`` until it did

    def hear(self, message: FramedMessage) -> None:
        self._lines.append(message.body.decode("latin-1").strip("\r\n"))
        whole = "\n".join(self._lines)
        found = self._pattern.search(whole)
        if found is not None and self.found is None:
            known = ("maker", "model", "serial", "firmware")
            self.found = Identity(
                "", **{key: text.strip() for key, text in found.groupdict().items() if key in known and text}
            )
            self._span = whole.count("\n", 0, found.start()), whole.count("\n", 0, max(found.start(), found.end() - 1))

    def tells(self, place: int) -> bool:
        """Whether a message is part of the introduction, counted from 0."""
        return self.found is not None and self._span[0] <= place <= self._span[1]


def another(known: Identity, found: Identity, declared: Identity) -> CmmUqError | None:
    """What is wrong where the serial number is another than that of the job, or of the instrument that was there before."""
    for expected, whose in ((declared.serial, "the job names"), (known.serial, "before it was")):
        if expected and found.serial and expected.casefold() != found.serial.casefold():
            problem = f"another instrument answers: it says serial number {found.serial!r}, {whose} {expected!r}"
            return CmmUqError(problem, where=declared.name, fix="Connect the right one, or correct its serial number")
    return None
