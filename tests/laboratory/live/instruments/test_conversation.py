"""Questions are asked in rounds, one at a time; a silent instrument is asked on; a late answer is not the next one's."""

from __future__ import annotations

from cmm_uq.laboratory.live.instruments.instrument import SECOND, Conversation
from cmm_uq.laboratory.live.instruments.profile import Poll, Send


def send(*questions: str, **keys: object) -> Send:
    return Send.model_validate({"poll": [Poll(send=text) for text in questions], **keys})


def test_a_round_asks_every_question_once_and_waits_for_each_answer() -> None:
    talk = Conversation(send("a", "b", every_s=1.0), 0)
    assert talk.question(0) == b"a"
    assert talk.question(10) is None
    talk.heard(20, answer=True)
    assert talk.question(20) == b"b"
    talk.heard(30, answer=True)
    assert talk.question(SECOND - 1) is None
    assert talk.question(SECOND) == b"a"


def test_rounds_keep_their_raster_and_missed_ones_are_not_made_up_for() -> None:
    talk = Conversation(send("a", every_s=1.0), 0)
    asked = []
    for now in (0, SECOND + 100, 2 * SECOND, 5 * SECOND, 5 * SECOND + 1, 6 * SECOND):
        if talk.question(now):
            asked.append(now)
            talk.heard(now, answer=True)
    assert asked == [0, SECOND + 100, 2 * SECOND, 5 * SECOND, 6 * SECOND]


def test_an_answer_that_does_not_come_is_said_once_and_a_silent_instrument_is_asked_every_second() -> None:
    talk = Conversation(send("a", every_s=10.0, answer_within_s=2.0), 0)
    assert talk.question(0) == b"a"
    assert not talk.overdue(2 * SECOND - 1)
    assert talk.overdue(2 * SECOND)
    assert not talk.overdue(2 * SECOND)
    talk.gap = True
    times = [now for now in range(2 * SECOND, 4 * SECOND, SECOND // 10) if talk.question(now)]
    assert times == [2 * SECOND, 3 * SECOND]


def test_after_an_answer_that_did_not_come_a_late_one_has_time_to_pass() -> None:
    talk = Conversation(send("a", "b", answer_within_s=1.0), 0)
    talk.question(0)
    assert talk.overdue(SECOND)
    assert talk.question(SECOND) is None
    assert not talk.waiting
    assert talk.question(SECOND + SECOND // 2) == b"b"


def test_an_instrument_that_speaks_by_itself_may_be_silent_for_as_long_as_is_said() -> None:
    talk = Conversation(Send(silent_after_s=5.0), 0)
    assert talk.question(0) is None
    assert not talk.overdue(4 * SECOND)
    talk.heard(4 * SECOND, answer=True)
    assert not talk.overdue(8 * SECOND)
    assert talk.overdue(9 * SECOND)
    assert not Conversation(Send(), 0).overdue(10**6 * SECOND)
