"""What lines and instruments do wrong: nothing is invented, nothing that came is lost, a return is noticed within 2 s."""

from __future__ import annotations

import os
import threading
import time
from itertools import islice
from pathlib import Path

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.tables.plan import DeclaredSource
from cmm_uq.laboratory.live.instruments.instrument import LiveInstrument, open_source
from cmm_uq.laboratory.live.instruments.library import profile_of, profile_of_source, unsaid_units
from cmm_uq.laboratory.live.instruments.parsing import Framer, Parser
from cmm_uq.laboratory.live.instruments.profile import ProfileFile
from cmm_uq.laboratory.live.instruments.simulated_line import SPEAKERS, Readout1502, Speaker, Thermocouples, Way
from cmm_uq.laboratory.live.instruments.source import Gap, Identity, Reading, Returned
from tests.laboratory.live.instruments.listening import Listener, hasty, listening, opened
from tests.laboratory.live.instruments.mischief import UnreliableLine
from tests.laboratory.live.session import FakeClock

WITHIN_S = 2.0
"""From the instrument's return to its first reading: the requirement."""

pytestmark = pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminals here")


def returned(heard: Listener, since: int, at: float) -> float:
    heard.until(lambda one: one.of(Returned, since) and one.good(since))
    place = next(i for i, event in enumerate(heard.events) if i >= since and isinstance(event, Returned))
    return heard.times[place] - at


@pytest.mark.long
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


@pytest.mark.long(but="socket")
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


@pytest.mark.long
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


class Generous(Speaker):
    """It answers each question with the number of it, and may go on with something else at once."""

    def __init__(self) -> None:
        super().__init__()
        self.further, self.number = b"", 0

    def answer(self, command: str) -> bytes:
        self.number += 1
        return f"T={self.number}\r\n".encode() + self.further


ASKED = """name = "generous"
title = "An instrument that is asked"
[send]
poll = [{ send = '?<CR>'%s }]
every_s = %g
answer_within_s = %g
%s
[parse]
pattern = '^(?:T=)?(?P<temp_c>\\d+)$'
"""


def asked_profile(poll: str = "", send: str = "", every_s: float = 0.1, within_s: float = 0.4) -> ProfileFile:
    return profile_of((ASKED % (poll, every_s, within_s, send)).encode(), Path("generous.toml"))


def unasked(heard: Listener) -> list[Reading]:
    return [one for one in heard.of(Reading) if isinstance(one, Reading) and one.unasked]


@pytest.mark.long(but="pty")
@pytest.mark.parametrize("way", ["pty", "socket", "rfc2217"])
def test_a_second_answer_to_one_question_is_named_and_never_a_value(way: Way, tmp_path: Path) -> None:
    speaker = Generous()
    speaker.further = b"T=777\r\n"
    with UnreliableLine(speaker, way, tmp_path) as line, listening(opened(asked_profile(), line.port)) as heard:
        heard.until(lambda one: len(one.good()) >= 5 and len(unasked(one)) >= 4)
        assert 777.0 not in [one.values["temp_c"] for one in heard.good()]
        first = unasked(heard)[0]
        assert (first.values, first.raw) == ({}, b"T=777\r\n")
        assert first.status == "temp_c = 777 answers no question, and is not used: nobody had asked"
        assert not heard.of(Gap)


@pytest.mark.parametrize(("poll", "send"), [(", messages = 2", ""), ("", "unasked = true")])
def test_a_profile_says_that_there_are_more_messages_than_questions(poll: str, send: str, tmp_path: Path) -> None:
    speaker = Generous()
    speaker.further = b"T=777\r\n"
    profile = asked_profile(poll, send)
    with UnreliableLine(speaker, "pty", tmp_path) as line, listening(opened(profile, line.port)) as heard:
        heard.until(lambda one: len(one.good()) >= 8)
        assert [one.values["temp_c"] for one in heard.good()[:8]] == [1, 777, 2, 777, 3, 777, 4, 777]
        assert not unasked(heard)


@pytest.mark.long
def test_what_came_before_a_question_is_none_of_its_answers(tmp_path: Path) -> None:
    """A value that is sent by a key, whole or begun, while the line is quiet between two questions."""
    profile = asked_profile(every_s=0.6)
    with UnreliableLine(Generous(), "pty", tmp_path) as line, listening(opened(profile, line.port)) as heard:
        heard.until(lambda one: len(one.good()) >= 1)
        line._wire.send(b"T=888\r\nT=8")  # type: ignore[union-attr]
        heard.until(lambda one: len(unasked(one)) >= 1)
        since = len(heard.events)
        heard.until(lambda one: len(one.good(since)) >= 3)
        assert (unasked(heard)[0].raw, unasked(heard)[0].values) == (b"T=888\r\n", {})
        assert all(one.values["temp_c"] < 100 for one in heard.good())


class Buffered:
    """A port in whose buffer a value waits before anything was asked; each question has its answer at once."""

    def __init__(self) -> None:
        self.buffer, self.clock = b"T=5\r\n", FakeClock()

    def read(self, *, wait: bool = True) -> bytes:
        self.clock.go(0.05 * wait)
        received, self.buffer = self.buffer, b""
        return received

    def write(self, data: bytes) -> None:
        self.buffer += b"T=6\r\n"

    def close(self) -> None: ...


def test_what_waits_in_the_buffer_is_drained_before_a_question() -> None:
    port = Buffered()
    source = LiveInstrument(Identity("a"), asked_profile(), lambda: port, port.clock)
    first, second = (one for one in islice(source.events(threading.Event()), 2) if isinstance(one, Reading))
    assert (first.unasked, first.values, first.raw) == (True, {}, b"T=5\r\n")
    assert (second.unasked, second.values) == (False, {"temp_c": 6.0})


class Begun(Generous):
    """Its key was pressed just before it was asked: the rest of that value comes after the question, before the answer."""

    def answer(self, command: str) -> bytes:
        return b"88\r\n" + super().answer(command) if self.number == 2 else super().answer(command)


@pytest.mark.long
@pytest.mark.parametrize(("within_s", "told", "raw"), [
    (3.0, "it began before the question", b"T=888\r\n"), (0.3, "it may be the rest of the message before", b"88\r\n"),
])  # fmt: skip
def test_a_value_that_began_before_the_question_is_none_of_its_answers(
    within_s: float, told: str, raw: bytes, tmp_path: Path
) -> None:
    profile = asked_profile(every_s=0.6, within_s=within_s)
    with UnreliableLine(Begun(), "pty", tmp_path) as line, listening(opened(profile, line.port)) as heard:
        heard.until(lambda one: len(one.good()) >= 2)
        line._wire.send(b"T=8")  # type: ignore[union-attr]
        heard.until(lambda one: len(one.good()) >= 4)
        (odd,) = unasked(heard)
        assert odd.raw == raw
        assert str(odd.status).endswith(told)
        assert [one.values["temp_c"] for one in heard.good()[:4]] == [1, 2, 3, 4]


@pytest.mark.long
def test_an_answer_that_may_be_that_of_several_questions_is_no_value_and_it_is_asked_anew(tmp_path: Path) -> None:
    with UnreliableLine(Generous(), "pty", tmp_path) as line, listening(opened(asked_profile(), line.port)) as heard:
        heard.until(lambda one: len(one.good()) >= 2)
        line.mischief.hangs = True
        heard.until(lambda one: one.of(Gap))
        time.sleep(0.6)  # asked again meanwhile
        line.mischief.hangs, since = False, len(heard.events)
        heard.until(lambda one: one.of(Returned, since) and one.good(since))
        first = unasked(heard)[0]
        assert "questions have no answer yet, and it may be that of any" in str(first.status)
        assert heard.events.index(heard.good(since)[0]) > heard.events.index(first)


class Streaming(Generous):
    """It was set to send by itself, 20 times a second, and is asked besides."""

    every_s = 0.05

    def says(self) -> bytes:
        return b"T=999\r\n"


@pytest.mark.long
def test_what_streams_is_no_answer_and_it_is_said_that_nothing_can_be_asked(tmp_path: Path) -> None:
    with UnreliableLine(Streaming(), "pty", tmp_path) as line, listening(opened(asked_profile(), line.port)) as heard:
        heard.until(lambda one: one.of(Gap) and len(unasked(one)) >= 20)
        told = {str(gap.why) for gap in heard.of(Gap)}  # type: ignore[union-attr]
        assert told <= {"it sends without being asked, so that nothing can be asked", "no answer within 0.4 s"}
        since = len(heard.events)
        line.speaker.every_s = 0.0  # as after its start commands
        heard.until(lambda one: len(one.good(since)) >= 2)
        assert all(one.values["temp_c"] < 900 for one in heard.good(since))


class Babbling(Speaker):
    """As at a wrong baud rate: bytes without an end."""

    every_s = 0.01

    def says(self) -> bytes:
        return b"\xff\xfe"


def test_bytes_without_an_end_do_not_keep_it_from_being_asked(tmp_path: Path) -> None:
    with UnreliableLine(Babbling(), "pty", tmp_path) as line, listening(opened(asked_profile(), line.port)) as heard:
        heard.until(lambda one: one.of(Gap))
        assert str(heard.of(Gap)[0].why) == "no answer within 0.4 s"  # type: ignore[union-attr]


def test_several_questions_cannot_go_with_values_that_come_unasked() -> None:
    with pytest.raises(CmmUqError, match="unasked is for an instrument with one question"):
        asked_profile("}, { send = '!'", "unasked = true")


INCHES = DeclaredSource(name="gauge", profile="mitutoyo-digimatic", units={"length_mm": "inch"})
MILLIMETRES = DeclaredSource(name="gauge", profile="mitutoyo-digimatic")


def read_by(source: DeclaredSource, line: bytes) -> dict[str, float]:
    profile = profile_of_source(source, Path())
    (message,) = Framer(profile.frame).feed(line)
    return dict(Parser(profile).read(message).values)


@pytest.mark.parametrize(
    ("line", "mm"), [(b"01A-001.2340\r", -1.234), (b"01A+0000.123\r", 0.123), (b"01A+00.12345\r", 0.12345)]
)
def test_the_unit_of_a_gauge_is_what_is_stated_whatever_its_decimals(line: bytes, mm: float) -> None:
    """1 inch = 25.4 mm by definition."""
    assert read_by(MILLIMETRES, line) == {"length_mm": mm}
    assert read_by(INCHES, line)["length_mm"] == pytest.approx(25.4 * mm, rel=1e-14)


def test_it_is_said_what_unit_is_assumed_and_who_states_it(tmp_path: Path) -> None:
    assert unsaid_units(profile_of_source(MILLIMETRES, Path()), MILLIMETRES) == {"length_mm": "mm"}
    thermometer = DeclaredSource(name="t", profile="fluke-1502a")  # which says its unit
    assert unsaid_units(profile_of_source(thermometer, Path()), thermometer) == {}
    with UnreliableLine(SPEAKERS["mitutoyo-digimatic"](), "pty", tmp_path) as line:
        source = open_source(INCHES.model_copy(update={"port": line.port}))
        assert (source.identity().units, source.identity().units_stated) == ({"length_mm": "inch"}, ["length_mm"])
        source.close()


@pytest.mark.parametrize(("profile", "units", "told"), [
    ("mitutoyo-digimatic", {"lenght_mm": "inch"}, "the instrument gives no 'lenght_mm'"),
    ("mitutoyo-digimatic", {"length_mm": "degC"}, "the unit 'degC' cannot be used"),
    ("fluke-1502a", {"temp_c": "degF"}, "the instrument says itself in which unit temp_c is"),
    ("ipp", {"x_mm": "inch"}, "the instrument says itself"),
])  # fmt: skip
def test_units_that_cannot_be_are_refused_where_they_stand(profile: str, units: dict[str, str], told: str) -> None:
    with pytest.raises(CmmUqError, match=told) as error:
        profile_of_source(DeclaredSource(name="a", profile=profile, units=units), Path())
    assert "[[acquire.source]] a: units" in str(error.value)
