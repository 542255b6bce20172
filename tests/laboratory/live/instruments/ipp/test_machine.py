"""A CMM as a source: what its user picks, where it is, what is wrong with it, and its return within 2 s."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
from hypothesis import given, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.tables.plan import DeclaredSource
from cmm_uq.laboratory.live.instruments.instrument import open_source
from cmm_uq.laboratory.live.instruments.ipp import BadLineError, HeardLine, response_of
from cmm_uq.laboratory.live.instruments.ipp_machine import IppMachine
from cmm_uq.laboratory.live.instruments.source import Gap, Reading, Returned
from tests.laboratory.live.instruments.listening import listening
from tests.laboratory.live.instruments.mischief import UnreliableIppServer


@pytest.fixture
def machine() -> Iterator[UnreliableIppServer]:
    made = UnreliableIppServer()
    yield made
    made.close()


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
