"""A channel that keeps what it is given, for tests of what is sent when."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from cmm_uq.base.messages import Verbatim
from cmm_uq.laboratory.schedule.notices import EVENTS, Event, Notice, OutgoingMessage, UndeliveredError

NOW = "2026-11-22T06:15:00Z"


@dataclass(eq=False)
class Kept:
    name: str = "kept"
    events: frozenset[str] = frozenset(EVENTS)
    failures: int = 0
    messages: list[OutgoingMessage] = field(default_factory=list)
    asked: int = 0

    def send(self, message: OutgoingMessage) -> str:
        self.asked += 1
        if self.failures > 0:
            self.failures -= 1
            raise UndeliveredError("the server did not answer within 1 s")
        self.messages.append(message)
        return ""

    @property
    def titles(self) -> list[str]:
        return [message.title for message in self.messages]


def notice(about: str, event: Event = "fail", state: str = "1") -> Notice:
    return Notice(event, about, Verbatim(f"{event}: {about}"), Verbatim(f"{about} in words."), state)


def notices(abouts: Iterable[str]) -> list[Notice]:
    return [notice(about) for about in abouts]
