"""Which question is asked of an instrument when, and to which one an answer belongs."""

from __future__ import annotations

from cmm_uq.base.messages import Text, say
from cmm_uq.laboratory.live.instruments.profile import Send, bytes_of
from cmm_uq.laboratory.live.instruments.source import SECOND

PAUSE = SECOND // 2  # after an answer that did not come, or that is no question's: a late one is then that of none


class Conversation:
    """Questions to one instrument, one after the other, a round every so often; moments are of the monotonic clock, ns.

    An answer belongs to a question only where that is the one that is open: a further one is that of none, and where several
    are open, of any. Then nothing is asked for a while, what still comes is that of none, and the question is asked anew.
    A silent instrument (``gap``) is asked without regard to the rounds, so that its return is noticed.
    """

    def __init__(self, send: Send, now: int, *, replayed: bool = False) -> None:
        self._polls = [(bytes_of(poll.send), poll.messages) for poll in send.poll]
        self._every, self._patience = round(send.every_s * SECOND), round(send.answer_within_s * SECOND)
        silent = send.silent_after_s
        self._silence = None if self._polls or silent is None or replayed else round(silent * SECOND)
        self._replayed, self._by_itself = replayed, replayed or send.unasked or not self._polls
        self._due = self._since = self._asked_at = self._heard_at = self._pause = now
        self._open = self._left = 0  # questions without their answer; messages that the last one's still lacks
        self.kept_since: int | None = None  # since when answers to nothing keep a due question from being asked
        self.asked = 0 if replayed else -1
        self.waiting = self.gap = False

    @property
    def expects(self) -> bool:
        """Whether a message with values may come now; else it comes before a question."""
        return self.waiting or self._by_itself

    def question(self, now: int) -> bytes | None:
        """What to send now; ``None``: nothing yet."""
        if not self._polls or self._replayed:
            return None
        if self.waiting:
            if not self.gap or len(self._polls) > 1 or now - self._asked_at < min(self._patience, SECOND):
                return None
            return self._sent(now)
        following = (self.asked + 1) % len(self._polls)
        if following == 0 and now < self._due and not self.gap:
            return None
        if now < self._pause:
            self.kept_since = now if self.kept_since is None else self.kept_since
            return None
        if following == 0:
            self._due += self._every * max(1, 1 + (now - self._due) // self._every)
        self.asked, self.waiting, self._since = following, True, now
        return self._sent(now)

    def _sent(self, now: int) -> bytes:
        question, self._left = self._polls[self.asked]
        self._asked_at, self.kept_since = now, None
        self._open += 1
        return question

    def heard(self, now: int) -> None:
        self._heard_at = now

    def answered(self, now: int) -> Text | None:
        """Take note of an answer; why it is that of no question, ``None`` where it is, or where none is needed."""
        if self._by_itself or (self.waiting and self._open == 1):
            self._left -= 1
            if self._by_itself or not self._left:
                self._open, self.waiting = 0, False
            self.gap = False
            if self._replayed and self._polls:
                self.asked = (self.asked + 1) % len(self._polls)
            return None
        questions, self._pause = self._open, now + PAUSE
        if not self.waiting:
            self._open = max(0, questions - 1)
            return say("it comes too late") if questions else say("nobody had asked")
        self._open, self.waiting, self.gap = 0, False, False
        self.asked, self._due = self.asked - 1, min(self._due, self._pause)
        return say("{count} questions have no answer yet, and it may be that of any", count=questions)

    def overdue(self, now: int) -> bool:
        """Whether an answer did not come in time, or an instrument that speaks by itself is silent; said once each time."""
        if self.waiting and now - self._since >= self._patience:
            self.waiting = False
            self._pause = now + PAUSE if len(self._polls) > 1 else now
            return True
        if self.kept_since is not None and now - self.kept_since >= self._patience + PAUSE:
            self.kept_since = now
            return True
        if self._silence is not None:
            allowed = min(self._silence, SECOND) if self.gap else self._silence
            if now - self._heard_at >= allowed:
                self._heard_at = now
                return True
        return False
