"""I++ DME: lines of the protocol, the client, and a CMM as a source, against servers that keep to it or do not."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from hypothesis import given, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.tables.plan import DeclaredSource
from cmm_uq.laboratory.live.instruments.instrument import open_source
from cmm_uq.laboratory.live.instruments.ipp_client import (
    ACK,
    DATA,
    DONE,
    ERROR,
    BadLineError,
    Client,
    FaultError,
    HeardLine,
    NoAnswerError,
    Term,
    arguments_of,
    fault_of,
    number_text,
    response_of,
    terms_of,
)
from cmm_uq.laboratory.live.instruments.ipp_machine import IppMachine
from cmm_uq.laboratory.live.instruments.source import SYSTEM, Gap, PortLostError, Reading, Returned, TcpPort
from tests.laboratory.live.instruments.listening import listening
from tests.laboratory.live.instruments.mischief import UnreliableIppServer


@pytest.mark.parametrize(("line", "sign"), [
    (b"00001 &", ACK), (b"00001 %", DONE), (b"00005 # X(99.93), Y(17.148)", DATA),
    (b'E0000 ! Error(3, 0500, "HealthCheck", "Emergency stop")', ERROR),
])  # fmt: skip
def test_the_seventh_character_says_what_a_line_is(line: bytes, sign: str) -> None:
    """Section 6.2.2.2, with the transactions of 6.2.3.1 and 6.2.4.1."""
    found = response_of(line)
    assert (found.tag, found.sign) == (line[:5].decode(), sign)


@pytest.mark.parametrize("line", [
    b"20 &", b"00000 &", b"A4711 &", b"E20 &", b"00001&", b"00001  &", b"00001 $ X(1)", b"00001 #X(1)", b"\x0100001 &",
    b"", b"00001",
])  # fmt: skip
def test_tags_and_spaces_are_as_the_specification_has_them(line: bytes) -> None:
    """Section 6.2.1: 20 has two digits, 00000 is out of range, A4711 begins wrongly, E20 has three characters."""
    with pytest.raises(BadLineError):
        response_of(line)


def test_data_are_terms_with_numbers() -> None:
    """Sections 7.5 and 9.5.3."""
    assert terms_of("X(199.998),Y(250.123),Z(300.002),Tool.A(45)") == {
        "X": (199.998,), "Y": (250.123,), "Z": (300.002,), "Tool.A": (45.0,),
    }  # fmt: skip
    assert arguments_of("PtMeas(X( 1 ) ,Y(-2.), Z(.5E1), IJK(0, 0, 1))") == (
        Term("PtMeas", (Term("X", (1.0,)), Term("Y", (-2.0,)), Term("Z", (5.0,)), Term("IJK", (0.0, 0.0, 1.0)))),
    )
    assert arguments_of('"RefTool"') == ("RefTool",)
    assert arguments_of("GetMachineClass(CartCMM)") == (Term("GetMachineClass", ("CartCMM",)),)
    assert arguments_of("") == ()


@pytest.mark.parametrize(
    "text",
    ["X(1", "X)1(", "X(1,)", ",X(1)", "X(1) Y(2)", "X(1.2.3)", "X(+)", "1E1234", "12345678901234567", '"a', "(" * 40],
)
def test_what_breaks_the_syntax_is_refused(text: str) -> None:
    with pytest.raises(BadLineError):
        arguments_of(text)


@pytest.mark.parametrize("text", ["X(1), X(1)", "X(1), 2", '"X"'])
def test_data_that_could_be_read_in_two_ways_are_refused(text: str) -> None:
    with pytest.raises(BadLineError):
        terms_of(text)


@pytest.mark.parametrize("text", [
    'Error(3, 2500, GoTo, "Machine limit encountered [Move Out Of Limits]")',
    'Error(3, 2500, "GoTo", "Machine limit encountered [Move Out Of Limits]")',
])  # fmt: skip
def test_an_error_names_its_method_with_quotes_or_without(text: str) -> None:
    """The syntax of 6.1.4.2 has quotes, the example of 6.2.3.1 none."""
    fault = fault_of(text)
    assert (fault.severity, fault.number, fault.cause, fault.stops) == (3, 2500, "GoTo", True)
    assert str(fault) == "error 2500 of GoTo, severity 3: Machine limit encountered [Move Out Of Limits]"


def test_warnings_do_not_stop() -> None:
    assert not fault_of('Error(1, 0504, "SetProp", "Argument out of range")').stops


@given(st.binary(max_size=60))
def test_no_bytes_stop_the_parser(data: bytes) -> None:
    try:
        found = response_of(data)
        arguments_of(found.rest)
    except BadLineError:
        pass


@given(st.floats(-1e7, 1e7))
def test_a_number_as_it_is_sent_is_one_of_the_syntax_and_exact_to_a_picometre(value: float) -> None:
    text = number_text(value)
    assert len([c for c in text if c.isdigit()]) <= 16
    (found,) = arguments_of(text)
    assert isinstance(found, float)
    assert found == pytest.approx(value, rel=1e-11)


@contextmanager
def session(machine: UnreliableIppServer, *, drive: bool = True, begin: bool = True) -> Iterator[Client]:
    port = TcpPort("127.0.0.1", machine.port, machine.url)
    client = Client(port, SYSTEM, confirm=(lambda command: True) if drive else None)
    try:
        if begin:
            client.start_session()
        yield client
    finally:
        port.close()


@pytest.fixture
def machine() -> Iterator[UnreliableIppServer]:
    made = UnreliableIppServer()
    yield made
    made.close()


def test_a_session_from_beginning_to_end(machine: UnreliableIppServer) -> None:
    with session(machine) as client:
        assert (client.version(), client.machine_class(), client.in_error()) == ("1.4.3", "CartCMM", False)
        assert client.tools() == ["RefTool", "NoTool", "Probe1", "Probe2"]
        client.change_tool("Probe1")
        assert client.tool() == "Probe1"
        assert client.part_temperature() == 20.13
        client.end_session()
        with pytest.raises(FaultError, match="Protocol error"):
            client.get()


def test_a_point_is_measured_where_the_surface_is(machine: UnreliableIppServer) -> None:
    """The surface lies 0.05 mm outside the nominal one along (3, 0, 4)/5: contact at nominal + 0.05·n."""
    machine.radial = 0.05
    with session(machine) as client:
        client.on_pt_meas_report("X", "Y", "Z", "IJK")
        heard = client.pt_meas((10, 20, 30), (3, 0, 4))
        assert heard.response is not None
        found = terms_of(heard.response.rest)
        assert [found[axis][0] for axis in "XYZ"] == pytest.approx([10.03, 20.0, 30.04], abs=1e-4)
        assert found["IJK"] == pytest.approx((0.6, 0.0, 0.8))


@pytest.mark.parametrize("move", [
    lambda client: client.pt_meas((0, 0, 0)),
    lambda client: client.go_to((0, 0, 0)),
    lambda client: client.change_tool("Probe1"),
])  # fmt: skip
def test_nothing_moves_unless_it_was_allowed_and_confirmed(move, machine: UnreliableIppServer) -> None:
    with session(machine, drive=False) as client:
        with pytest.raises(CmmUqError, match="moves the machine, which was not allowed"):
            move(client)
        asked: list[str] = []
        client._confirm = lambda command: bool(asked.append(command))
        with pytest.raises(CmmUqError, match="was not confirmed"):
            move(client)
    assert len(asked) == 1
    assert not [line for line in machine.lines if "PtMeas(" in line or "GoTo" in line or "ChangeTool" in line]


def test_an_error_stops_the_server_until_it_is_cleared(machine: UnreliableIppServer) -> None:
    """Section 6.2.5, with 2500 and 0514 of 8.2."""
    with session(machine) as client:
        with pytest.raises(FaultError) as error:
            client.go_to((5000, 0, 0))
        assert error.value.fault.number == 2500
        assert client.in_error()
        with pytest.raises(FaultError) as error:
            client.get()
        assert error.value.fault.number == 514
        client.clear_all_errors()
        client.get()


def test_reports_of_a_daemon_and_events_are_kept_beside_the_answers(machine: UnreliableIppServer) -> None:
    with session(machine) as client:
        tag = client.on_move_report(0.1, 1.0, "X")
        client.go_to((7, 0, 0))
        assert [heard.raw for heard in client.unasked] == [f"{tag} # X(7.0000)\r\n".encode()]
        client.stop_daemon(tag)
        with pytest.raises(FaultError, match="Daemon does not exist"):
            client.stop_daemon(tag)


def test_an_older_server_is_asked_no_more_than_it_knows() -> None:
    machine = UnreliableIppServer(version=None, part_c=None)
    try:
        with session(machine) as client:
            assert client.version() is None
            assert client.part_temperature() is None
            assert client.scale_temperatures() == {}
            client.get()
    finally:
        machine.close()


def test_an_emergency_stop_is_no_unknown_command(machine: UnreliableIppServer) -> None:
    with session(machine) as client:
        machine.state.error = True
        with pytest.raises(FaultError, match="Use ClearAllErrors to continue"):
            client.version()
        assert machine.state.error


def test_a_session_of_another_is_not_taken_over_unless_it_was_ones_own(machine: UnreliableIppServer) -> None:
    machine.state.session = True
    with session(machine, begin=False) as client:
        with pytest.raises(FaultError, match="Protocol error"):
            client.start_session()
        client.start_session(take_over=True)


@pytest.mark.parametrize(("wrong", "told"), [
    ({"hangs": True}, "was not answered within"), ({"no_ack": True}, "before it was acknowledged"),
    ({"exchanged": True}, "before it was acknowledged"), ({"wrong_tag": True}, "was not answered within"),
])  # fmt: skip
def test_a_server_that_breaks_the_protocol_is_refused_in_words(wrong, told: str, machine: UnreliableIppServer) -> None:
    with session(machine) as client:
        for key, value in wrong.items():
            setattr(machine.mischief, key, value)
        with pytest.raises(NoAnswerError, match=told):
            client.call("Get(X())", within_s=0.2)


def test_half_a_line_of_data_is_no_position(machine: UnreliableIppServer) -> None:
    with session(machine) as client:
        machine.mischief.halves = True
        with pytest.raises(NoAnswerError):
            client.machine_class()


def test_a_connection_that_is_cut_is_lost(machine: UnreliableIppServer) -> None:
    with session(machine) as client:
        machine.close()
        with pytest.raises(PortLostError):
            client.get()
        machine.start()


def test_a_name_that_would_break_the_line_is_refused(machine: UnreliableIppServer) -> None:
    with session(machine) as client, pytest.raises(CmmUqError, match="can be no name of a tool"):
        client.change_tool('a") %')


def declared(machine: UnreliableIppServer, profile: str = "ipp") -> DeclaredSource:
    return DeclaredSource(name="cmm", profile=profile, port=machine.url)


def test_picked_points_keys_and_errors_are_readings(machine: UnreliableIppServer) -> None:
    with listening(open_source(declared(machine))) as heard:
        assert heard.source.identity().firmware == "I++ DME 1.4.3"
        assert machine.state.user
        machine.pick(1.5, -2.25, 3.0)
        machine.press("Done")
        machine.trip()
        heard.until(lambda one: len(one.of(Reading)) == 3)
        point, key, error = (event for event in heard.events if isinstance(event, Reading))
        assert (point.values, point.point, point.status) == ({"x_mm": 1.5, "y_mm": -2.25, "z_mm": 3.0}, "PtMeas", None)
        assert point.raw == b"E0000 # PtMeas(X(1.5000), Y(-2.2500), Z(3.0000))\r\n"
        assert (key.values, key.status) == ({}, None)
        assert error.status == "the machine says error 0500 of HealthCheck, severity 3: Emergency stop"
    assert not machine.state.session


@pytest.mark.long
def test_positions_are_asked_for_as_often_as_is_said(machine: UnreliableIppServer) -> None:
    machine.state.position = [4.0, 5.0, 6.0]
    with listening(open_source(declared(machine, "ipp-position"))) as heard:
        heard.until(lambda one: len(one.good()) >= 2)
        assert heard.good()[0].values == {"x_mm": 4.0, "y_mm": 5.0, "z_mm": 6.0}
        assert heard.good()[0].point is None
        assert not machine.state.user
        machine.trip()
        heard.until(
            lambda one: any("Use ClearAllErrors" in str(e.status) for e in one.of(Reading) if isinstance(e, Reading))
        )
        time.sleep(0.6)
        assert machine.state.error, "an emergency stop is cleared by nobody but the user"
        since = len(heard.events)
        heard.source.clear_errors()  # type: ignore[attr-defined]
        heard.until(lambda one: one.good(since))


@pytest.mark.long
@pytest.mark.parametrize("cut", ["closed", "hung"])
def test_a_machine_that_was_lost_is_heard_again_within_two_seconds(cut: str, machine: UnreliableIppServer) -> None:
    with listening(open_source(declared(machine))) as heard:
        heard.until(lambda one: any("OnPtMeasReport" in line for line in machine.lines))
        if cut == "closed":
            machine.close()
        machine.mischief.hangs = True
        heard.until(lambda one: one.of(Gap))
        time.sleep(0.3)
        at = time.monotonic()
        machine.mischief.hangs = False
        if cut == "closed":
            machine.start()
        heard.until(lambda one: one.of(Returned))
        assert heard.times[-1] - at < 2.0
        machine.pick(1, 2, 3)
        heard.until(lambda one: one.good())


def test_noise_between_lines_is_said_and_is_no_point(machine: UnreliableIppServer) -> None:
    with listening(open_source(declared(machine))) as heard:
        machine.mischief.noise = b"\xff\x00\r\n"
        machine.pick(1, 2, 3)
        heard.until(lambda one: one.good())
        machine.mischief.noise = b""
        bad = [event for event in heard.of(Reading) if isinstance(event, Reading) and event.status]
        assert bad
        assert all("no line of I++ DME" in str(event.status) and not event.values for event in bad)


def test_what_is_no_server_is_refused(machine: UnreliableIppServer) -> None:
    machine.mischief.exchanged = True
    with pytest.raises(CmmUqError, match=r"no I\+\+ DME server answers: .* before it was acknowledged"):
        open_source(declared(machine))
    with pytest.raises(CmmUqError, match="is reached over the network"):
        open_source(DeclaredSource(name="cmm", profile="ipp", port="/dev/ttyUSB0"))


LINES = st.one_of(
    st.binary(max_size=40),
    st.lists(
        st.sampled_from(
            ["E0000 ", "00001 ", "# ", "! ", "& ", "X(1)", "Y(", ")", ", ", "PtMeas(", "Z(2.5)", '"a"', "Error(3, 500, "]
        )
    ).map(lambda parts: "".join(parts).encode()),
)  # fmt: skip


def test_whatever_a_server_sends_is_told_and_no_place_is_invented(machine: UnreliableIppServer) -> None:
    source = open_source(declared(machine))
    assert isinstance(source, IppMachine)

    @given(LINES)
    def told(line: bytes) -> None:
        try:
            response = response_of(line)
        except BadLineError:
            response = None
        for event in source._told_by(HeardLine(line + b"\r\n", response, 0, 0)):
            assert isinstance(event, Reading)
            assert set(event.values) in (set(), {"x_mm", "y_mm", "z_mm"})
            assert not (event.values and event.status)

    told()
    source.close()
