"""A message as it goes out, and what a way of sending it has to be able to do."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, Protocol

from cmm_uq.laboratory.schedule.notices import Notice


class UndeliveredError(Exception):
    """A message did not go out; a later attempt may succeed. Its text holds no secret."""


@dataclass(frozen=True)
class Message:
    """What is sent of a notice; of texts only, so that it can wait in a file.

    Parameters
    ----------
    key : the same whenever the same is sent the same way, so that a receiver knows a repetition.
    event, about, title, text, where : see :class:`~cmm_uq.laboratory.schedule.notices.Notice`.
    at : moment at which it was found, UTC, ISO 8601.
    """

    key: str
    event: str
    about: str
    title: str
    text: str
    where: str
    at: str

    def as_data(self) -> dict[str, str]:
        """For a file, or a webhook."""
        return asdict(self)

    @classmethod
    def of(cls, notice: Notice, channel: str, at: str) -> Message:
        """A notice on its way through a channel."""
        key = hashlib.sha256(f"{channel}\0{notice.key}".encode()).hexdigest()[:32]
        return cls(key, notice.event, notice.about, str(notice.title), str(notice.text), notice.where, at)


class Channel(Protocol):
    """A way of sending messages."""

    @property
    def name(self) -> str:
        """What tells it from others, without a secret."""
        ...

    @property
    def events(self) -> frozenset[str]:
        """That it is told of."""
        ...

    def send(self, message: Message) -> str:
        """Send a message; what is to be remarked of it, as a rule nothing.

        Raises
        ------
        UndeliveredError : it did not go out.
        CmmUqError : a secret that it needs is not there, or open to others.
        """
        ...


def within(seconds: float, call: Callable[[], str], who: str) -> str:
    """What a call returns, or no answer after so long, whatever it hangs in: a name server, a handshake, one byte a minute.

    Parameters
    ----------
    seconds : altogether.
    call : is left alone in its thread when it takes longer.
    who : is to answer.

    Raises
    ------
    UndeliveredError : it takes longer.
    """
    found: list[Any] = []

    def attempt() -> None:
        try:
            found.append(call())
        except Exception as error:
            found.append(error)

    thread = threading.Thread(target=attempt, name="message", daemon=True)
    thread.start()
    thread.join(seconds)
    if not found:
        raise UndeliveredError(f"{who} did not answer within {seconds:g} s")
    if isinstance(found[0], Exception):
        raise found[0]
    return str(found[0])
