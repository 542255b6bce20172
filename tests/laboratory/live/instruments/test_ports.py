"""Ports, and when which question is asked."""

from __future__ import annotations

import errno
import os
import socket
import threading
from pathlib import Path
from unittest import mock

import pytest
import serial

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.tables.plan import DeclaredSource
from cmm_uq.laboratory.live.instruments import source as ports
from cmm_uq.laboratory.live.instruments.instrument import SECOND, open_source
from cmm_uq.laboratory.live.instruments.library import Conversation, profile_named
from cmm_uq.laboratory.live.instruments.profile import Connection, Poll, Send
from cmm_uq.laboratory.live.instruments.simulated_line import Lines, SimulatedLine
from cmm_uq.laboratory.live.instruments.source import Gap, Reading, opener, serial_ports
from tests.laboratory.live.instruments.listening import opened

here = pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminals here")


def refusal(port: str) -> str:
    with pytest.raises(CmmUqError) as error:
        opener(port, Connection())()
    return str(error.value)


@here
def test_two_programs_cannot_have_one_port(tmp_path: Path) -> None:
    profile = profile_named("line-logger")
    with SimulatedLine(Lines(), "pty", tmp_path) as line:
        first = opened(profile, line.port)
        with pytest.raises(CmmUqError, match=r"the port is busy: another program has it. Close that program"):
            opened(profile, line.port)
        first.close()
        opened(profile, line.port).close()


@here
def test_a_port_that_is_not_there_is_answered_with_those_that_are(tmp_path: Path) -> None:
    assert "there is no such port. Check cable and power." in refusal(str(tmp_path / "ttyUSB7"))


@here
def test_a_file_is_no_port(tmp_path: Path) -> None:
    (tmp_path / "log").write_text("1")
    assert "is no serial port" in refusal(str(tmp_path / "log"))


def test_a_forbidden_port_says_how_it_is_allowed() -> None:
    """The error is pyserial's own, of a device file without permission; tests may run as root, who has every permission."""
    error = serial.SerialException(
        errno.EACCES, "could not open port /dev/ttyS0: [Errno 13] Permission denied: '/dev/ttyS0'"
    )
    with mock.patch.object(serial.Serial, "open", side_effect=error):
        assert "may not be opened by this user. Ask for the permission" in refusal("/dev/ttyS0")


def test_nobody_at_an_address_is_said() -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    for scheme in ("socket", "tcp", "rfc2217"):
        assert "nobody listens at this address" in refusal(f"{scheme}://127.0.0.1:{port}")


def test_an_address_that_does_not_answer_is_given_up_in_time() -> None:
    with mock.patch.object(ports.socket, "create_connection", side_effect=TimeoutError("timed out")):
        assert "no connection within 1 s" in refusal("tcp://192.0.2.1:4001")


@pytest.mark.parametrize(("port", "told"), [
    ("", "no port is named"), ("tcp://host", "is no address. Write it as socket://host:port"),
    ("tcp://host:99999", "is no address"), ("ftp://host:21", "ftp:// is no way to an instrument"),
    ("socket://no.such.host.invalid:1", "no computer of this name is known"),
])  # fmt: skip
def test_what_is_no_port_is_said(port: str, told: str) -> None:
    with mock.patch.object(
        ports.socket, "create_connection", side_effect=socket.gaierror(-2, "Name or service not known")
    ):
        assert told in refusal(port)


def test_an_address_may_leave_out_the_usual_port_number() -> None:
    with mock.patch.object(ports, "TcpPort") as made:
        opener("tcp://cmm", Connection(), tcp_port=1294)()
    made.assert_called_once_with("cmm", 1294, "tcp://cmm:1294")


@here
@pytest.mark.parametrize(("name", "settings"), [
    ("heidenhain-nd287", (9600, 7, "E", 2)), ("vaisala-ptb330", (4800, 7, "E", 1)), ("fluke-1502a", (2400, 8, "N", 1)),
])  # fmt: skip
def test_the_line_is_set_as_the_profile_says(name: str, settings: tuple[object, ...], tmp_path: Path) -> None:
    with SimulatedLine(Lines(), "pty", tmp_path) as line:
        port = opener(line.port, profile_named(name).connection)()
        try:
            open_line = port._serial  # type: ignore[attr-defined]
            assert (open_line.baudrate, open_line.bytesize, open_line.parity, open_line.stopbits) == settings
        finally:
            port.close()


@here
def test_a_device_server_is_told_the_settings_by_rfc_2217(tmp_path: Path) -> None:
    with SimulatedLine(Lines(), "rfc2217", tmp_path) as line:
        port = opener(line.port, profile_named("vaisala-ptb330").connection)()
        far = line._wire.line  # type: ignore[union-attr]
        assert (far.baudrate, far.bytesize, far.parity, far.stopbits) == (4800, 7, "E", 1)
        port.close()


def test_ports_are_listed_with_names() -> None:
    assert all(name for name, _ in serial_ports())


class FastClock:
    def __init__(self) -> None:
        self.now = 0

    def utc_ns(self) -> int:
        return 1_000 + self.now

    def monotonic_ns(self) -> int:
        return self.now

    def sleep(self, s: float) -> None:
        self.now += round(s * 1e9)


def events(port: str, profile: str, folder: Path, clock: FastClock) -> list[object]:
    source = open_source(DeclaredSource(name="a", profile=profile, port=port), clock=clock, folder=folder)
    try:
        return list(source.events(threading.Event()))
    finally:
        source.close()


def test_a_file_is_read_to_its_end_at_its_pace(tmp_path: Path) -> None:
    (tmp_path / "log.txt").write_bytes(b"1,2\n3,4\nhalf")
    *readings, end = events("file:log.txt?every_s=0.5", "line-logger", tmp_path, FastClock())
    found = [one for one in readings if isinstance(one, Reading)]
    assert [one.values for one in found] == [{"value1": 1, "value2": 2}, {"value1": 3, "value2": 4}, {}]
    assert [one.monotonic_ns for one in found] == [500_000_000, 1_000_000_000, 1_500_000_000]
    assert (found[2].raw, found[2].status) == (b"half", "part of a message, or noise: half")
    assert isinstance(end, Gap)
    assert end.why == "the file is at its end"


def test_answers_to_several_questions_go_to_their_channels_in_turn(tmp_path: Path) -> None:
    (tmp_path / "log").write_bytes(b"20.1\r\n20.2\r\n20.3\r\n20.4\r\n21.1\r\n")
    found = [one.values for one in events("file:log", "fluke-1529", tmp_path, FastClock()) if isinstance(one, Reading)]
    assert found == [{"temp1_c": 20.1}, {"temp2_c": 20.2}, {"temp3_c": 20.3}, {"temp4_c": 20.4}, {"temp1_c": 21.1}]


@pytest.mark.parametrize(("port", "told"), [("file:none", "(?i)no such file"), ("file:log?every_s=x", "says no pace")])
def test_a_file_or_a_pace_that_is_none_is_refused(port: str, told: str, tmp_path: Path) -> None:
    (tmp_path / "log").write_bytes(b"")
    with pytest.raises(CmmUqError, match=told):
        events(port, "line-logger", tmp_path, FastClock())


def test_a_profile_beside_the_job_is_found(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text("name = 'own'\ntitle = 'Own'\n[parse]\npattern = '(?P<x_mm>\\d+)'\n")
    (tmp_path / "log").write_bytes(b"7\r\n")
    assert events("file:log", "own.toml", tmp_path, FastClock())[0].values == {"x_mm": 7.0}  # type: ignore[attr-defined]


def send(*questions: str, **keys: object) -> Send:
    return Send.model_validate({"poll": [Poll(send=text) for text in questions], **keys})


def test_a_round_asks_every_question_once_and_waits_for_each_answer() -> None:
    talk = Conversation(send("a", "b", every_s=1.0), 0)
    assert talk.question(0) == b"a"
    assert talk.question(10) is None
    assert talk.answered(20) is None
    assert talk.question(20) == b"b"
    assert talk.answered(30) is None
    assert talk.question(SECOND - 1) is None
    assert talk.question(SECOND) == b"a"


def test_rounds_keep_their_raster_and_missed_ones_are_not_made_up_for() -> None:
    talk = Conversation(send("a", every_s=1.0), 0)
    asked = []
    for now in (0, SECOND + 100, 2 * SECOND, 5 * SECOND, 5 * SECOND + 1, 6 * SECOND):
        if talk.question(now):
            asked.append(now)
            assert talk.answered(now) is None
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


def test_an_answer_is_that_of_a_question_only_where_no_other_is_open() -> None:
    talk = Conversation(send("a", "b", answer_within_s=1.0), 0)
    assert talk.answered(0) == "nobody had asked"
    assert talk.question(SECOND // 2) == b"a"
    assert talk.overdue(2 * SECOND)
    assert talk.question(3 * SECOND) == b"b"
    assert talk.answered(3 * SECOND) == "2 questions have no answer yet, and it may be that of any"
    assert talk.answered(3 * SECOND + 1) == "nobody had asked"
    assert talk.question(3 * SECOND + SECOND // 2) is None  # the second one may still come
    assert talk.question(4 * SECOND) == b"b"
    assert talk.answered(4 * SECOND) is None


def test_an_answer_that_comes_too_late_is_none_and_the_next_question_has_its_own() -> None:
    talk = Conversation(send("a", "b", answer_within_s=1.0), 0)
    assert talk.question(0) == b"a"
    assert talk.overdue(SECOND)
    assert talk.answered(SECOND + 1) == "it comes too late"
    assert talk.question(2 * SECOND) == b"b"
    assert talk.answered(2 * SECOND) is None


def test_an_instrument_that_speaks_by_itself_may_be_silent_for_as_long_as_is_said() -> None:
    talk = Conversation(Send(silent_after_s=5.0), 0)
    assert talk.question(0) is None
    assert not talk.overdue(4 * SECOND)
    talk.heard(4 * SECOND)
    assert talk.answered(4 * SECOND) is None
    assert not talk.overdue(8 * SECOND)
    assert talk.overdue(9 * SECOND)
    assert not Conversation(Send(), 0).overdue(10**6 * SECOND)
