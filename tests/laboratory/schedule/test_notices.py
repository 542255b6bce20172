"""What a person must hear of, and the messages that wait until they were sent."""

from __future__ import annotations

import datetime as dt
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_args

import pytest

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.certificate.document import Outcome
from cmm_uq.laboratory.schedule.notices import (
    EVENTS,
    MOST,
    Channel,
    Notice,
    Outbox,
    OutgoingMessage,
    of_error,
    of_results,
)
from cmm_uq.laboratory.schedule.state import Dispatch, FolderState, turn
from tests.laboratory.schedule.told import NOW, Kept, notice, notices

AT = dt.datetime.fromisoformat(NOW)

OF_DECISION = {
    "pass": None, "conditional pass": "undecided", "incomplete": "incomplete", "undecided": "undecided",
    "conditional fail": "fail", "remeasure": "undecided", "fail": "fail", "a word of a later version": "undecided",
}  # fmt: skip


def results(*decisions: str, verdict: str | None = "consistent") -> dict[str, Any]:
    return {
        "job": {"id": "a-1", "machine": "CMM 3", "inputs_sha256": {}},
        "conformity": [
            {"standard": "ISO 10360-2:2009", "characteristic": "E0", "decision": word} for word in decisions
        ],
        "diagnosis": {"verdict": verdict},
    }


def told(data: dict[str, Any]) -> list[Notice]:
    return of_results(data, "0" * 64, "/reports/a-1")


def test_every_decision_that_there_is_has_its_event() -> None:
    assert set(get_args(Outcome)) < set(OF_DECISION)
    for word, event in OF_DECISION.items():
        assert [notice.event for notice in told(results(word))] == ([] if event is None else [event]), word


@pytest.mark.parametrize("verdict", ["explained", "partial", "unexplained", "a word of a later version"])
def test_every_verdict_but_consistent_is_a_mismatch(verdict: str) -> None:
    (notice,) = told(results("pass", verdict=verdict))
    assert notice.event == "mismatch"
    assert notice.text.startswith("CMM 3 (job a-1): the recording contradicts its model")


def test_a_certificate_without_decision_or_diagnosis_says_nothing() -> None:
    assert told({"job": {"id": "a"}, "conformity": [], "diagnosis": None}) == []
    assert told(results(verdict=None)) == []


def test_statements_of_one_event_are_one_notice() -> None:
    fail, undecided = told(results("fail", "undecided", "conditional fail"))
    assert fail.text == "CMM 3 (job a-1): ISO 10360-2:2009 E0: fail, ISO 10360-2:2009 E0: conditional fail."
    assert fail.title == "fail: CMM 3 (job a-1)"
    assert undecided.event == "undecided"
    assert {notice.event for notice in (fail, undecided)} < set(EVENTS)


def test_the_same_is_the_same_notice_and_what_changed_is_another() -> None:
    data = results("fail")
    keys = {of_results(data, inputs, where)[0].key for inputs in ("a", "b") for where in ("x", "y")}
    assert len(keys) == 2
    error = CmmUqError("no such file", where="a/points.csv")
    assert of_error(error, "a", "monday").key == of_error(error, "a", "monday").key
    assert len({of_error(error, about, since).key for about in "ab" for since in ("monday", "friday")}) == 4


def outbox(out: Path, *channels: Channel) -> Outbox:
    return Outbox(out, channels, FolderState(out), lambda: NOW)


def test_what_another_run_sent_between_two_looks_is_not_sent_again(tmp_path: Path) -> None:
    """One looked before the other had sent it, and wrote its message after that."""
    kept = Kept()
    box = outbox(tmp_path, kept)
    box.add([notice("a")])
    (waiting,) = box.folder.iterdir()
    content = waiting.read_bytes()
    box.deliver(0.0)
    waiting.write_bytes(content)
    assert outbox(tmp_path, kept).deliver(0.0) == []
    assert kept.titles == ["fail: a"]
    assert box.waiting() == 0


def test_what_is_found_again_and_again_goes_out_once(tmp_path: Path) -> None:
    kept = Kept()
    for _ in range(3):
        box = outbox(tmp_path, kept)
        box.add([notice("a")])
        box.add([notice("a")])
        box.deliver(0.0)
    assert kept.titles == ["fail: a"]
    assert outbox(tmp_path, kept).waiting() == 0


def test_another_state_of_the_same_goes_out_too(tmp_path: Path) -> None:
    kept = Kept()
    box = outbox(tmp_path, kept)
    for state in ("1", "2"):
        box.add([notice("a", state=state)])
        box.deliver(0.0)
    assert len(kept.messages) == 2


def test_each_channel_is_told_of_its_events_alone(tmp_path: Path) -> None:
    due, all_ = Kept("due", frozenset({"due"})), Kept("all")
    box = outbox(tmp_path, due, all_)
    assert box.add([notice("a"), notice("b", "due")]) == [notice("a"), notice("b", "due")]
    box.deliver(0.0)
    assert due.titles == ["due: b"]
    assert sorted(all_.titles) == ["due: b", "fail: a"]


def test_what_did_not_go_out_waits_and_the_other_channels_go_on(tmp_path: Path) -> None:
    hanging, sound = Kept("hanging", failures=1), Kept("sound")
    box = outbox(tmp_path, hanging, sound)
    box.add(notices("abc"))
    failed = [one for one in box.deliver(0.0) if one.problem]
    assert [one.channel for one in failed] == ["hanging"] * 3
    assert hanging.asked == 1  # a server that hangs is not asked three times
    assert len(sound.messages) == 3
    assert box.waiting() == 3
    box.deliver(0.0)
    assert len(hanging.messages) == len(sound.messages) == 3
    assert box.waiting() == 0


def test_a_crash_before_it_is_remembered_repeats_the_message_under_its_key(tmp_path: Path) -> None:
    """The moment between the server's answer and the file's new name: here the rename never happens."""
    kept = Kept()
    box = outbox(tmp_path, kept)
    box.add([notice("a")])
    rename, Path.rename = Path.rename, _crash  # type: ignore[assignment,method-assign]
    try:
        with pytest.raises(KeyboardInterrupt):
            box.deliver(0.0)
    finally:
        Path.rename = rename  # type: ignore[method-assign]
    outbox(tmp_path, kept).deliver(0.0)
    first, second = kept.messages
    assert first.key == second.key


def _crash(self: Path, target: Path) -> Path:
    raise KeyboardInterrupt


@dataclass(eq=False)
class Locked:
    failures: int
    keys: set[str] = field(default_factory=set)

    def released(self, job: str) -> bool:
        return False

    def sent(self, key: str) -> Dispatch | None:
        return Dispatch(AT, AT) if key in self.keys else None

    def add_sent(self, key: str, content: Mapping[str, Any]) -> None:
        if self.failures:
            self.failures -= 1
            raise OutputError("the records are locked")
        self.keys.add(key)


def test_what_went_out_is_not_sent_again_while_the_records_are_locked(tmp_path: Path) -> None:
    kept, state = Kept(), Locked(failures=3)
    box = Outbox(tmp_path, [kept], state, lambda: NOW)
    for _ in range(3):
        box.add([notice("a")])
        box.deliver(0.0)
    assert len(kept.messages) == 1
    assert len(state.keys) == 1
    assert list(box.folder.iterdir()) == []


@pytest.mark.long
def test_many_messages_go_one_by_one_up_to_a_number_and_the_rest_in_one(tmp_path: Path) -> None:
    kept = Kept()
    box = outbox(tmp_path, kept)
    box.add(notices(f"job-{i:03}" for i in range(250)))
    box.deliver(0.0)
    assert len(kept.messages) == MOST
    last = kept.messages[-1]
    assert last.title == f"{250 - MOST + 1} more messages"
    alone = {message.title for message in kept.messages[:-1]}
    listed = set(last.text.splitlines())
    assert "and 31 more" in listed
    assert not alone & listed
    assert len(alone | listed) == MOST - 1 + 200 + 1
    assert box.waiting() == 0
    box.add(notices(f"job-{i:03}" for i in range(250)))
    assert box.waiting() == 0


def test_nothing_is_sent_while_another_run_sends(tmp_path: Path) -> None:
    kept = Kept()
    box = outbox(tmp_path, kept)
    box.add([notice("a")])
    with turn(tmp_path / ".scheduled" / "messages.lock"):
        assert box.deliver(0.0) == []
    assert box.waiting() == 1


def test_a_message_of_a_channel_that_is_named_no_longer_is_dropped_and_told(tmp_path: Path) -> None:
    outbox(tmp_path, Kept("old")).add([notice("a")])
    (one,) = outbox(tmp_path, Kept("new")).deliver(0.0)
    assert "names it no longer" in one.problem
    assert outbox(tmp_path).waiting() == 0


def test_what_somebody_else_put_into_the_folder_is_left_alone(tmp_path: Path) -> None:
    kept = Kept()
    box = outbox(tmp_path, kept)
    box.add([notice("a")])
    for name, text in {"x.json": "{}", "y.json": "[", "z.sent": "no"}.items():
        (box.folder / name).write_text(text)
    box.deliver(0.0)
    assert kept.titles == ["fail: a"]
    assert sorted(path.name for path in box.folder.iterdir()) == ["x.json", "y.json", "z.sent"]


def test_where_it_cannot_wait_it_is_told_and_can_be_sent_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    kept = Kept()
    box = outbox(tmp_path, kept)
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match="No space left on device"):
        box.add([notice("a")])
    assert list(box.folder.iterdir()) == []
    box.sent_at_once([notice("a")])
    assert kept.titles == ["fail: a"]


def test_a_key_tells_channel_event_what_it_is_about_and_its_state_apart() -> None:
    keys = {
        OutgoingMessage.of(notice(about, event, state), channel, NOW).key
        for about in "ab" for event in ("fail", "due") for state in "12" for channel in ("x", "y")
    }  # fmt: skip
    assert len(keys) == 16
    assert (
        OutgoingMessage.of(notice("a"), "x", NOW).key
        == OutgoingMessage.of(notice("a"), "x", "2027-01-01T00:00:00Z").key
    )


def test_what_a_kill_left_of_a_message_is_removed_once_nobody_can_be_writing_it(tmp_path: Path) -> None:
    box = outbox(tmp_path, Kept())
    box.add([notice("a")])
    for name, age in {".unfinished-old": 7200, ".unfinished-new": 0}.items():
        path = box.folder / name
        path.write_text("")
        os.utime(path, (time.time() - age,) * 2)
    box.deliver(0.0)
    assert [path.name for path in box.folder.iterdir()] == [".unfinished-new"]
