"""The client against a server that keeps to the specification, and against those that do not."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.live.instruments.ipp.client import Client
from cmm_uq.laboratory.live.instruments.ipp.protocol import FaultError, NoAnswerError, terms_of
from cmm_uq.laboratory.live.instruments.ipp.server import SimulatedIppServer
from cmm_uq.laboratory.live.instruments.ports import TcpPort
from cmm_uq.laboratory.live.instruments.source import SYSTEM, PortLostError


@contextmanager
def session(machine: SimulatedIppServer, *, drive: bool = True, begin: bool = True) -> Iterator[Client]:
    port = TcpPort("127.0.0.1", machine.port, machine.url)
    client = Client(port, SYSTEM, confirm=(lambda command: True) if drive else None)
    try:
        if begin:
            client.start_session()
        yield client
    finally:
        port.close()


@pytest.fixture
def machine() -> Iterator[SimulatedIppServer]:
    made = SimulatedIppServer()
    yield made
    made.close()


def test_a_session_from_beginning_to_end(machine: SimulatedIppServer) -> None:
    with session(machine) as client:
        assert (client.version(), client.machine_class(), client.in_error()) == ("1.4.3", "CartCMM", False)
        assert client.tools() == ["RefTool", "NoTool", "Probe1", "Probe2"]
        client.change_tool("Probe1")
        assert client.tool() == "Probe1"
        assert client.part_temperature() == 20.13
        client.end_session()
        with pytest.raises(FaultError, match="Protocol error"):
            client.get()


def test_a_point_is_measured_where_the_surface_is(machine: SimulatedIppServer) -> None:
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
def test_nothing_moves_unless_it_was_allowed_and_confirmed(move, machine: SimulatedIppServer) -> None:
    with session(machine, drive=False) as client:
        with pytest.raises(CmmUqError, match="moves the machine, which was not allowed"):
            move(client)
        asked: list[str] = []
        client._confirm = lambda command: bool(asked.append(command))
        with pytest.raises(CmmUqError, match="was not confirmed"):
            move(client)
    assert len(asked) == 1
    assert not [line for line in machine.lines if "PtMeas(" in line or "GoTo" in line or "ChangeTool" in line]


def test_an_error_stops_the_server_until_it_is_cleared(machine: SimulatedIppServer) -> None:
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


def test_reports_of_a_daemon_and_events_are_kept_beside_the_answers(machine: SimulatedIppServer) -> None:
    with session(machine) as client:
        tag = client.on_move_report(0.1, 1.0, "X")
        client.go_to((7, 0, 0))
        assert [heard.raw for heard in client.unasked] == [f"{tag} # X(7.0000)\r\n".encode()]
        client.stop_daemon(tag)
        with pytest.raises(FaultError, match="Daemon does not exist"):
            client.stop_daemon(tag)


def test_an_older_server_is_asked_no_more_than_it_knows() -> None:
    machine = SimulatedIppServer(version=None, part_c=None)
    try:
        with session(machine) as client:
            assert client.version() is None
            assert client.part_temperature() is None
            assert client.scale_temperatures() == {}
            client.get()
    finally:
        machine.close()


def test_an_emergency_stop_is_no_unknown_command(machine: SimulatedIppServer) -> None:
    with session(machine) as client:
        machine.state.error = True
        with pytest.raises(FaultError, match="Use ClearAllErrors to continue"):
            client.version()
        assert machine.state.error


def test_a_session_of_another_is_not_taken_over_unless_it_was_ones_own(machine: SimulatedIppServer) -> None:
    machine.state.session = True
    with session(machine, begin=False) as client:
        with pytest.raises(FaultError, match="Protocol error"):
            client.start_session()
        client.start_session(take_over=True)


@pytest.mark.parametrize(("wrong", "told"), [
    ({"hangs": True}, "was not answered within"), ({"no_ack": True}, "before it was acknowledged"),
    ({"exchanged": True}, "before it was acknowledged"), ({"wrong_tag": True}, "was not answered within"),
])  # fmt: skip
def test_a_server_that_breaks_the_protocol_is_refused_in_words(wrong, told: str, machine: SimulatedIppServer) -> None:
    with session(machine) as client:
        for key, value in wrong.items():
            setattr(machine.mischief, key, value)
        with pytest.raises(NoAnswerError, match=told):
            client.call("Get(X())", within_s=0.2)


def test_half_a_line_of_data_is_no_position(machine: SimulatedIppServer) -> None:
    with session(machine) as client:
        machine.mischief.halves = True
        with pytest.raises(NoAnswerError):
            client.machine_class()


def test_a_connection_that_is_cut_is_lost(machine: SimulatedIppServer) -> None:
    with session(machine) as client:
        machine.close()
        with pytest.raises(PortLostError):
            client.get()
        machine.start()


def test_a_name_that_would_break_the_line_is_refused(machine: SimulatedIppServer) -> None:
    with session(machine) as client, pytest.raises(CmmUqError, match="can be no name of a tool"):
        client.change_tool('a") %')
