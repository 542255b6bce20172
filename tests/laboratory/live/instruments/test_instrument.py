"""What lines and instruments do wrong: nothing is invented, nothing that came is lost, a return is noticed within 2 s."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.live.instruments.simulated_line import (
    SPEAKERS,
    Readout1502,
    Speaker,
    Thermocouples,
    Way,
)
from cmm_uq.laboratory.live.instruments.source import Gap, Reading, Returned
from tests.laboratory.live.instruments.listening import Listener, hasty, listening, opened
from tests.laboratory.live.instruments.mischief import UnreliableLine

WITHIN_S = 2.0
"""From the instrument's return to its first reading: the requirement."""

pytestmark = pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminals here")


def returned(heard: Listener, since: int, at: float) -> float:
    heard.until(lambda one: one.of(Returned, since) and one.good(since))
    place = next(i for i, event in enumerate(heard.events) if i >= since and isinstance(event, Returned))
    return heard.times[place] - at


@pytest.mark.parametrize("way", ["pty", "socket", "rfc2217"])
def test_an_instrument_that_was_unplugged_is_read_again_within_two_seconds(way: Way, tmp_path: Path) -> None:
    with (
        UnreliableLine(Thermocouples(), way, tmp_path) as line,
        listening(opened(hasty("thermocouple-logger-11"), line.port)) as heard,
    ):
        heard.until(lambda one: len(one.good()) >= 2)
        line.unplug()
        heard.until(lambda one: one.of(Gap))
        time.sleep(0.6)
        since = len(heard.events)
        assert not heard.good(since)
        line.plug_in()
        assert returned(heard, since, time.monotonic()) < WITHIN_S
        assert len(heard.of(Gap)) == len(heard.of(Returned)) == 1
        (back,) = heard.of(Returned)
        assert isinstance(back, Returned)
        assert back.after_s > 0.5


@pytest.mark.parametrize(("name", "way"), [("sylvac-rs232", "pty"), ("sylvac-rs232", "socket"), ("fluke-1529", "pty")])
def test_an_instrument_that_hung_is_read_again_within_two_seconds(name: str, way: Way, tmp_path: Path) -> None:
    profile = hasty(name, answer_within_s=0.5)
    with UnreliableLine(SPEAKERS[name](), way, tmp_path) as line, listening(opened(profile, line.port)) as heard:
        heard.until(lambda one: len(one.good()) >= 4)
        line.mischief.hangs = True
        heard.until(lambda one: one.of(Gap))
        assert "no answer" in str(heard.of(Gap)[0].why) or "lost" in str(heard.of(Gap)[0].why)  # type: ignore[union-attr]
        time.sleep(0.7)
        since = len(heard.events)
        line.mischief.hangs = False
        assert returned(heard, since, time.monotonic()) < WITHIN_S


def test_one_that_was_switched_off_is_told_again_what_it_forgot(tmp_path: Path) -> None:
    """The station speaks in its own FORM after a restart, which the profile does not read: it is set again."""
    profile = hasty("vaisala-ptb330", answer_within_s=0.4)
    with (
        UnreliableLine(SPEAKERS["vaisala-ptb330"](), "pty", tmp_path) as line,
        listening(opened(profile, line.port)) as heard,
    ):
        heard.until(lambda one: len(one.good()) >= 2)
        since = len(heard.events)
        line.restart()
        assert returned(heard, since, time.monotonic()) < WITHIN_S


@pytest.mark.parametrize(
    ("keys", "told"), [({"halves": True}, ""), ({"noise": b"\x00\xff#"}, "not understood"), ({"garbled": True}, "")]
)
def test_half_lines_noise_and_a_wrong_baud_rate_give_words_and_no_value(
    keys: dict[str, object], told: str, tmp_path: Path
) -> None:
    profile = hasty("moeller-wedel-elcomat", answer_within_s=0.3)
    with (
        UnreliableLine(SPEAKERS["moeller-wedel-elcomat"](), "pty", tmp_path) as line,
        listening(opened(profile, line.port)) as heard,
    ):
        heard.until(lambda one: len(one.good()) >= 2)
        for key, value in keys.items():
            setattr(line.mischief, key, value)
        before = len(heard.events)
        heard.until(lambda one: any(event.status for event in one.of(Reading, before)))  # type: ignore[union-attr]
        since = len(heard.events)
        heard.until(lambda one: len(one.of(Reading, since)) >= 2)
        bad = [event for event in heard.of(Reading, since) if isinstance(event, Reading)]
        assert all(not event.values and event.status and event.raw for event in bad)
        assert told in str(bad[0].status)


def test_bytes_one_at_a_time_make_the_same_readings(tmp_path: Path) -> None:
    with (
        UnreliableLine(Thermocouples(), "pty", tmp_path) as line,
        listening(opened(hasty("thermocouple-logger-11"), line.port)) as heard,
    ):
        line.mischief.a_byte_at_a_time = True
        heard.until(lambda one: len(one.good()) >= 5)
        assert {tuple(one.values.values()) for one in heard.good()} == {Thermocouples.usual}


class Counting(Speaker):
    every_s = 0.01

    def says(self) -> bytes:
        self.readings[0] += 1
        return f"{self.readings[0]:.0f}\n".encode()


def test_at_a_hundred_readings_a_second_none_is_lost_or_twice(tmp_path: Path) -> None:
    with (
        UnreliableLine(Counting(), "pty", tmp_path) as line,
        listening(opened(hasty("line-logger"), line.port)) as heard,
    ):
        heard.until(lambda one: len(one.good()) >= 150)
        numbers = [one.values["value1"] for one in heard.good()]
        assert numbers == list(range(int(numbers[0]), int(numbers[0]) + len(numbers)))


def test_another_instrument_than_the_declared_one_is_refused(tmp_path: Path) -> None:
    with UnreliableLine(SPEAKERS["fluke-1502a"](), "pty", tmp_path) as line, pytest.raises(CmmUqError) as error:
        opened(hasty("fluke-1502a"), line.port, serial="B99")
    assert "it says serial number 'A24680', the job names 'B99'" in str(error.value)


class Other(Readout1502):
    def answer(self, command: str) -> bytes:
        return super().answer(command).replace(b"A24680", b"A99999")


def test_another_instrument_that_comes_back_is_not_read(tmp_path: Path) -> None:
    with (
        UnreliableLine(SPEAKERS["fluke-1502a"](), "pty", tmp_path) as line,
        listening(opened(hasty("fluke-1502a"), line.port)) as heard,
    ):
        heard.until(lambda one: one.good())
        line.unplug()
        heard.until(lambda one: one.of(Gap))
        line.speaker = Other()
        since = len(heard.events)
        line.plug_in()
        heard.until(lambda one: any("another instrument" in str(gap.why) for gap in one.of(Gap, since)))  # type: ignore[union-attr]
        assert not heard.good(since)


def test_another_instrument_that_is_put_at_the_same_line_while_it_is_silent_is_not_read(tmp_path: Path) -> None:
    """As behind a device server, where no port is lost."""
    profile = hasty("fluke-1502a", answer_within_s=0.3)
    with (
        UnreliableLine(SPEAKERS["fluke-1502a"](), "pty", tmp_path) as line,
        listening(opened(profile, line.port)) as heard,
    ):
        heard.until(lambda one: one.good())
        line.mischief.hangs = True
        heard.until(lambda one: one.of(Gap))
        since = len(heard.events)
        line.speaker = Other()
        line.mischief.hangs = False
        heard.until(lambda one: any("another instrument" in str(gap.why) for gap in one.of(Gap, since)))  # type: ignore[union-attr]
        time.sleep(0.5)
        assert not heard.good(since)


def test_a_late_answer_is_no_value_where_it_could_be_that_of_another_channel(tmp_path: Path) -> None:
    profile = hasty("fluke-1529", answer_within_s=0.2)
    late = UnreliableLine(SPEAKERS["fluke-1529"](), "pty", tmp_path)
    try:
        with listening(opened(profile, late.port)) as heard:
            heard.until(lambda one: len(one.good()) >= 4)
            late.mischief.hangs = True
            heard.until(lambda one: one.of(Gap))
            since = len(heard.events)
            os.write(late._wire._master, b"20.0132\r\n")  # type: ignore[union-attr]
            heard.until(lambda one: one.of(Reading, since))
            (event, *_) = heard.of(Reading, since)
            assert isinstance(event, Reading)
            assert not event.values
            assert "answers no question" in str(event.status)
    finally:
        late.close()
