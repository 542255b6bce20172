"""The client against a server that keeps to the specification, and against those that do not."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from cmm_uq.laboratory.live.instruments.ipp import Client, FaultError, NoAnswerError, terms_of
from cmm_uq.laboratory.live.instruments.source import SYSTEM, PortLostError, TcpPort
from tests.laboratory.live.instruments.mischief import UnreliableIppServer


@contextmanager
def session(machine: UnreliableIppServer, *, begin: bool = True) -> Iterator[Client]:
    port = TcpPort("127.0.0.1", machine.port, machine.url)
    client = Client(port, SYSTEM)
    try:
        if begin:
            client.start_session()
        yield client
    finally:
        port.close()


def said(client: Client, command: str) -> list[str]:
    return [heard.response.rest for heard in client.call(command) if heard.response is not None]


@pytest.fixture
def machine() -> Iterator[UnreliableIppServer]:
    made = UnreliableIppServer()
    yield made
    made.close()


def test_a_session_from_beginning_to_end(machine: UnreliableIppServer) -> None:
    with session(machine) as client:
        assert (client.version(), client.machine_class(), client.in_error()) == ("1.4.3", "CartCMM", False)
        assert said(client, "EnumTools()") == ['"RefTool"', '"NoTool"', '"Probe1"', '"Probe2"']
        client.call('ChangeTool("Probe1")')
        assert said(client, "GetProp(Tool.Name())") == ['Tool.Name("Probe1")']
        assert said(client, "GetProp(Part.Temperature())") == ["Part.Temperature(20.13)"]
        client.end_session()
        with pytest.raises(FaultError, match="Protocol error"):
            client.get()


def test_a_point_is_measured_where_the_surface_is(machine: UnreliableIppServer) -> None:
    """The surface lies 0.05 mm outside the nominal one along (3, 0, 4)/5: contact at nominal + 0.05·n."""
    machine.radial = 0.05
    with session(machine) as client:
        client.on_pt_meas_report("X", "Y", "Z", "IJK")
        (measured,) = said(client, "PtMeas(X(10), Y(20), Z(30), IJK(3, 0, 4))")
        found = terms_of(measured)
        assert [found[axis][0] for axis in "XYZ"] == pytest.approx([10.03, 20.0, 30.04], abs=1e-4)
        assert found["IJK"] == pytest.approx((0.6, 0.0, 0.8))


def test_an_error_stops_the_server_until_it_is_cleared(machine: UnreliableIppServer) -> None:
    """Section 6.2.5, with 2500 and 0514 of 8.2."""
    with session(machine) as client:
        with pytest.raises(FaultError) as error:
            client.call("GoTo(X(5000))")
        assert error.value.fault.number == 2500
        assert client.in_error()
        with pytest.raises(FaultError) as error:
            client.get()
        assert error.value.fault.number == 514
        client.clear_all_errors()
        client.get()


def test_reports_of_a_daemon_and_events_are_kept_beside_the_answers(machine: UnreliableIppServer) -> None:
    with session(machine) as client:
        client.on_move_report(0.1, 1.0, "X")
        client.call("GoTo(X(7))")
        assert [heard.raw for heard in client.unasked] == [b"E0001 # X(7.0000)\r\n"]
        client.call("StopDaemon(E0001)")
        with pytest.raises(FaultError, match="Daemon does not exist"):
            client.call("StopDaemon(E0001)")


def test_an_older_server_is_asked_no_more_than_it_knows() -> None:
    machine = UnreliableIppServer(version=None, part_c=None)
    try:
        with session(machine) as client:
            assert client.version() is None
            with pytest.raises(FaultError, match="Bad property"):
                client.call("GetProp(Part.Temperature())")
            client.clear_all_errors()
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
        client.within_s = 0.2
        with pytest.raises(NoAnswerError, match=told):
            client.call("Get(X())")


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
