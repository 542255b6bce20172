"""Lines by the syntax of I++ DME 1.4.3: the examples of the specification, and that nothing stops the parser."""

from __future__ import annotations

import pytest
from hypothesis import given, strategies as st

from cmm_uq.laboratory.live.instruments.ipp import (
    ACK,
    DATA,
    DONE,
    ERROR,
    BadLineError,
    Term,
    arguments_of,
    fault_of,
    number_text,
    response_of,
    terms_of,
)


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
