"""Profiles: ready ones, new ones, and what they understand of messages."""

from __future__ import annotations

import itertools
import os
import struct
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.live.instruments.instrument import Introduction
from cmm_uq.laboratory.live.instruments.library import (
    ProfileDraft,
    drafted,
    numbers_in,
    profile_named,
    profile_of,
    ready,
)
from cmm_uq.laboratory.live.instruments.parsing import FramedMessage, Framer, Parser, Understood
from cmm_uq.laboratory.live.instruments.profile import MessageFrame, ProfileFile, bytes_of, shown
from cmm_uq.laboratory.live.instruments.simulated_line import SPEAKERS, SimulatedLine, Way
from cmm_uq.laboratory.live.instruments.source import Reading
from tests.laboratory.live.instruments.listening import hasty, listening, opened


def test_names_are_those_of_iso_646() -> None:
    assert bytes_of("<ESC>A0200<CR><LF>") == b"\x1bA0200\r\n"
    assert bytes_of("<STX><ETX><NAK><0xAA><DEL>") == b"\x02\x03\x15\xaa\x7f"
    assert bytes_of("a<b>") == b"a<b>"


@given(st.binary(max_size=30).filter(lambda data: b"<" not in data and b"\\" not in data))
def test_what_is_shown_is_read_back(data: bytes) -> None:
    assert bytes_of(shown(data)) == data
    assert shown(data).isprintable()


def test_what_is_no_byte_is_refused() -> None:
    with pytest.raises(ValueError, match="no single byte"):
        bytes_of("20 €")


WAYS: list[Way] = ["pty", "socket", "rfc2217"]
EACH = [(name, way) for name, way in zip(SPEAKERS, itertools.cycle(WAYS), strict=False)] + [("fluke-1529", "pty")]
SERIALS = {"vaisala-ptu300": "A1234567", "vaisala-ptb330": "A1234567", "fluke-1529": "A12345", "fluke-1502a": "A24680",
           "isotech-millik": "21-P2460", "mahr-millimar-c1202": "19051234"}  # fmt: skip

pytestmark = pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminals here")


def test_there_is_a_simulated_instrument_for_every_profile_of_messages() -> None:
    assert set(SPEAKERS) == {name for name in ready() if profile_named(name).protocol == "messages"}


@pytest.mark.long(but="a")
@pytest.mark.parametrize(("name", "way"), EACH)
def test_values_are_what_the_instrument_measures_and_raw_is_what_it_sent(name: str, way: Way, tmp_path: Path) -> None:
    speaker = SPEAKERS[name]()
    with SimulatedLine(speaker, way, tmp_path) as line, listening(opened(hasty(name), line.port)) as heard:
        heard.until(lambda one: len(one.good()) >= len(speaker.readings))
        rounds = heard.good()[: len(speaker.readings)]
        found = [value for reading in rounds for value in reading.values.values()][: len(speaker.readings)]
        assert found == pytest.approx(speaker.readings, abs=1e-12)
        assert heard.source.identity().serial == SERIALS.get(name)
        readings = [event for event in heard.events if isinstance(event, Reading)]
        assert [one.number for one in readings] == list(range(1, len(readings) + 1))
        assert not [one for one in readings if one.status]
        assert all(one.utc_ns > 1_700_000_000_000_000_000 for one in readings)
        speaker.ill = True
        heard.until(lambda one: any(isinstance(e, Reading) and e.status for e in one.events))
        told = next(event for event in heard.events if isinstance(event, Reading) and event.status)
        assert "20.11" not in told.status
        assert len(told.values) in (0, len(speaker.readings) - 1)


def profile(line: str, quantities: dict[int, str], **keys: object) -> ProfileFile:
    wanted = ProfileDraft("a", "A", line, quantities, keys.pop("ranges", {}), **keys)  # type: ignore[arg-type]
    return profile_of(drafted(wanted), Path("a.toml"))


def read_whole(made: ProfileFile, data: bytes) -> dict[str, float]:
    (message,) = Framer(made.frame).feed(data)
    return dict(Parser(made).read(message).values)


def test_a_line_like_the_example_is_read() -> None:
    made = profile("CH1= 20.13 C; CH2= 20.15 C<CR><LF>", {1: "temp1_c", 2: "temp2_c"}, ranges={"temp1_c": (0, 40)})
    assert read_whole(made, b"CH1=  9.8 C; CH2=-1 C\r\n") == {"temp1_c": 9.8, "temp2_c": -1.0}
    assert read_whole(made, b"CH1= 99 C; CH2= 1 C\r\n") == {"temp2_c": 1.0}


def test_it_holds_how_the_line_is_set_and_what_is_asked() -> None:
    made = profile("t 1.0\n", {1: "temp_c"}, ask="T?<CR>", every_s=0.5, settings={"baud": 2400, "parity": "even"})
    assert (made.connection.baud, made.connection.parity, made.frame.terminator) == (2400, "even", "<LF>")
    assert (made.send.poll[0].send, made.send.every_s) == ("T?<CR>", 0.5)


@pytest.mark.parametrize(
    ("name", "plain"), [("My gauge", "my-gauge"), ("a.b", "a.b"), ("Größe", "gr-e"), ("---", "instrument")]
)
def test_it_has_a_plain_name_whatever_its_file_is_called(name: str, plain: str) -> None:
    made = profile_of(drafted(ProfileDraft(name, "A", "1<CR>", {1: "x_mm"}, {})), Path("a.toml"))
    assert made.name == plain


NUMBERS = st.decimals(-999, 999, places=2, allow_nan=False).map(str)
WORDS = st.sampled_from(["T=", " mm;", "(", ") [", " ' ", "*.", "CH", " %", ",", "<STX>"])


@pytest.mark.long
@given(parts=st.lists(st.tuples(WORDS, NUMBERS), min_size=1, max_size=5))
def test_any_line_of_words_and_numbers_makes_a_profile_that_reads_it(parts: list[tuple[str, str]]) -> None:
    line = "".join(word + " " + number for word, number in parts) + "<CR><LF>"
    found = numbers_in(line)
    assert found == [number for _, number in parts]
    made = profile(line, {place: f"v{place}_mm" for place in range(1, len(found) + 1)})
    assert list(made.example[0].values.values()) == [float(number) for number in found]


@pytest.mark.parametrize(("quantities", "told"), [
    ({}, "no quantity is named"), ({3: "temp_c"}, "the line has 1 numbers, so none with the number 3"),
    ({1: "temp c"}, "cannot name a quantity"),
])  # fmt: skip
def test_what_cannot_be_drafted_is_refused(quantities: dict[int, str], told: str) -> None:
    with pytest.raises(CmmUqError, match=told):
        profile("T=20.1<CR>", quantities)


ONE = "[parse]\npattern = '(?P<x_mm>1)'\n"
HEAD = 'name = "a"\ntitle = "A"\n'


def read(profile: str, body: bytes, answers: int = 0) -> Understood:
    return Parser(profile_of((HEAD + profile).encode(), Path("a.toml"))).read(FramedMessage(body, body), answers)


@pytest.mark.parametrize(
    ("unit", "given", "celsius"), [("degF", "68", 20.0), ("kelvin", "293.15", 20.0), ("degC", "20", 20.0)]
)
def test_a_temperature_is_in_celsius_whatever_the_instrument_sends(unit: str, given: str, celsius: float) -> None:
    """68 °F = 20 °C exactly: (68 − 32)/1.8."""
    found = read(f"[parse]\npattern = '(?P<temp_c>[\\d.]+)'\n[quantities.temp_c]\nunit = '{unit}'", given.encode())
    assert found.values["temp_c"] == pytest.approx(celsius, abs=1e-9)


@pytest.mark.parametrize(("name", "unit", "given", "value"), [
    ("x_mm", "inch", "1", 25.4), ("pressure_hpa", "inHg", "29.92", 1013.2075), ("angle_arcsec", "degree", "1", 3600.0),
    ("x_um", "millimeter", "1", 1000.0),
])  # fmt: skip
def test_lengths_pressures_and_angles_are_in_the_unit_of_their_name(
    name: str, unit: str, given: str, value: float
) -> None:
    """1 inch = 25.4 mm by definition; 29.92 inHg = 1013.2 hPa, the standard atmosphere as aviation rounds it."""
    found = read(f"[parse]\npattern = '(?P<{name}>[\\d.]+)'\n[quantities.{name}]\nunit = '{unit}'", given.encode())
    assert found.values[name] == pytest.approx(value, rel=1e-5)


def test_one_bad_channel_leaves_the_others() -> None:
    found = read(
        "[parse]\nseparator = ','\nfields = ['temp1_c', '', 'temp2_c']\n[quantities.temp1_c]\nrange = [0, 40]",
        b"9999,x,20.5",
    )
    assert found.values == {"temp2_c": 20.5}
    assert found.status == "temp1_c is 9999, outside 0 to 40"


def test_binary_fields_are_numbers_with_their_factor() -> None:
    layout = "[parse]\nstruct = '<hf'\nfields = ['x_mm', 'temp_c']\n[quantities.x_mm]\nfactor = 0.001"
    assert read(layout, struct.pack("<hf", -1500, 20.5)).values == {"x_mm": -1.5, "temp_c": 20.5}
    assert read(layout, struct.pack("<hf", 1, float("nan"))).status == "temp_c is nan"
    assert "not understood" in str(read(layout, b"123").status)


def test_a_decimal_comma_is_read_where_it_is_said_and_a_point_then_is_none() -> None:
    profile = "[parse]\nseparator = ';'\nfields = ['x_mm', 'y_mm']\ndecimal = ','"
    assert read(profile, b"1,5; -2,25").values == {"x_mm": 1.5, "y_mm": -2.25}
    assert read(profile, b"1.5; 2").values == {"y_mm": 2.0}


@pytest.mark.parametrize("text", ["1_0", "nan", "inf", "", "1e999", "0x10"])
def test_what_is_no_finite_number_is_no_value(text: str) -> None:
    found = read("[parse]\nseparator = ','\nfields = ['x_mm']", text.encode())
    assert not found.values
    assert found.status


def test_fields_are_counted() -> None:
    assert "2 fields, not 1" in str(read("[parse]\nseparator = ','\nfields = ['x_mm']", b"1,2").status)


@pytest.mark.parametrize(("profile", "told"), [
    ("", "[parse]: is missing"),
    ("[parse]\npattern = '('", "is no regular expression: missing )"),
    ("[parse]\npattern = '(?P<x_mm>1)'\n[[example]]\nreceived = '1'\nvalues = {x_mm = 1}", "1 is 0 messages and a part"),
    (f"{ONE}[[example]]\nreceived = '1<CR><LF>'\nvalues = {{x_mm = 2}}", "is read as x_mm = 1.0, not as x_mm = 2.0"),
    ("[parse]\npattern = '(?P<x_mm>1)'\n[quantities.x_mm]\nunit = 'degC'", "the unit 'degC' cannot be used"),
    (f"{ONE}[quantities.y_mm]\n", "[quantities.y_mm]: is no group or field of a message. Did you mean 'x_mm'?"),
    ("[parse]\nstruct = '<hh'\nfields = ['x_mm']", "struct has 2 fields, and fields names 1"),
    ("[frame]\nlength = 3\n[parse]\nstruct = '3b'\nfields = ['', '', 'x_mm']", "for instruments that are asked"),
    ("[frame]\nterminator = '<CR>'\nlength = 3\n[parse]\npattern = '1'", "needs one of terminator, stop and length"),
    ("[send]\nstart = ['é€']\n[parse]\npattern = '1'", "'€' is no single byte"),
])  # fmt: skip
def test_a_wrong_profile_is_refused_with_what_is_wrong(profile: str, told: str) -> None:
    with pytest.raises(CmmUqError) as error:
        read(profile, b"")
    assert told in str(error.value)
    assert "a.toml" in str(error.value)


@pytest.mark.parametrize("name", ready())
def test_a_ready_profile_reads_its_examples_and_says_whence_it_is_known(name: str) -> None:
    """Examples are from the sources that each names; reading a profile refuses it where they are read otherwise."""
    profile = profile_named(name)
    assert profile.name == name
    assert profile.facts.sources or profile.facts.not_found
    assert "real" in profile.facts.tried or "simulated" in profile.facts.tried
    if profile.protocol == "messages":
        assert any(example.values for example in profile.example)


@pytest.mark.parametrize(("name", "raw", "told"), [
    ("fluke-1502a", b"t:  108.456 O\r", "temp_c comes in 'O'"), ("sylvac-rs232", b"ERR3\r", "outside the measuring range"),
    ("mitutoyo-digimatic", b"911\r", "no gauge"), ("vaisala-ptb330", b"P=******* hPa    ERR=100\r\n", "ERRS"),
    ("heidenhain-nd287", b"\x15\r\n", "NAK"), ("moeller-wedel-elcomat", b"2 103 1.0 2.0\r", "relative"),
    ("heidenhain-nd287", b"\x02-123456789\r\n", "not understood"),
])  # fmt: skip
def test_what_an_instrument_says_when_ill_is_no_value(name: str, raw: bytes, told: str) -> None:
    found = Parser(profile_named(name)).read(FramedMessage(raw, raw.rstrip(b"\r\n")))
    assert not found.values
    assert told in str(found.status)


@pytest.mark.parametrize(("raw", "answers"), [(b"ERR3", True), (b"+0001.000", True), (b"hello", False), (b"", False)])
def test_an_instrument_that_says_that_it_is_ill_has_answered(raw: bytes, answers: bool) -> None:
    """So its silence is no gap; noise is no answer."""
    assert Parser(profile_named("sylvac-rs232")).read(FramedMessage(raw, raw)).answers is answers


FRAMES = [
    MessageFrame(terminator="<CR><LF>", longest=12),
    MessageFrame(terminator="<CR>"),
    MessageFrame(start="<STX>", stop="<ETX>", longest=9),
    MessageFrame(start="<0xAA>", length=5, longest=7),
    MessageFrame(length=3),
]
BYTES = st.lists(st.sampled_from([b"\r", b"\n", b"\x02", b"\x03", b"\xaa", b"1", b"T=2", b"\r\n"]), max_size=40).map(
    b"".join
)
CUTS = st.lists(st.integers(0, 60), max_size=8)


def pieces(data: bytes, cuts: list[int]) -> list[bytes]:
    places = [0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]
    return [data[a:b] for a, b in pairwise(places)]


@pytest.mark.parametrize("frame", FRAMES, ids=range(len(FRAMES)))
@given(data=BYTES, cuts=CUTS)
def test_messages_do_not_depend_on_how_the_bytes_came(frame: MessageFrame, data: bytes, cuts: list[int]) -> None:
    at_once, in_parts = Framer(frame), Framer(frame)
    whole = at_once.feed(data)
    assert [one for part in pieces(data, cuts) for one in in_parts.feed(part)] == whole
    assert at_once.rest() == in_parts.rest()


@pytest.mark.parametrize("frame", FRAMES, ids=range(len(FRAMES)))
@given(data=BYTES)
def test_every_byte_is_in_one_message_in_its_place(frame: MessageFrame, data: bytes) -> None:
    framer = Framer(frame)
    rests = [one.raw for one in framer.feed(data)] + [rest.raw for rest in [framer.rest()] if rest]
    assert b"".join(rests) == data
    assert not framer.waiting


def test_a_message_is_what_stands_between_its_marks() -> None:
    bodies = [(one.body, one.whole) for one in Framer(FRAMES[2]).feed(b"x\x0212\x03\x02\x03")]
    assert bodies == [(b"x", False), (b"12", True), (b"", True)]
    assert [one.body for one in Framer(FRAMES[3]).feed(b"\xaa1234\xaa5678")] == [b"1234", b"5678"]
    assert [(one.body, one.whole) for one in Framer(FRAMES[0]).feed(b"0123456789\r\n0123456789a\r\n")] == [
        (b"0123456789", True), (b"0123456789a\r", False), (b"\n", False),
    ]  # fmt: skip


@pytest.mark.parametrize("frame", FRAMES[:2], ids=range(2))
@given(before=BYTES, line=st.binary(min_size=10, max_size=40).filter(lambda data: b"\r" not in data), cuts=CUTS)
def test_the_end_of_a_line_that_is_too_long_is_no_message_and_the_next_line_is(
    frame: MessageFrame, before: bytes, line: bytes, cuts: list[int]
) -> None:
    end = bytes_of(frame.terminator)
    framer = Framer(frame.model_copy(update={"longest": 9}))
    data = before + end + line + end + b"20.0" + end
    found = [one for part in pieces(data, cuts) for one in framer.feed(part)]
    assert found[-1] == FramedMessage(b"20.0" + end, b"20.0")
    cut, place = [], len(found) - 2
    while b"".join(cut) != line + end:
        cut.insert(0, found[place].raw)
        assert (found[place].whole, found[place].overlong) == (False, True)
        place -= 1


def test_a_line_that_is_too_long_is_said_to_be() -> None:
    line = "20.0 " * 1000
    framer, parser = Framer(profile_named("line-logger").frame), Parser(profile_named("line-logger"))
    told = [parser.read(one) for one in framer.feed(f"{line}\n20.5\n".encode())]
    assert [str(one.status)[:56] for one in told[:-1]] == [
        "a line of more than 4096 characters is dropped, to its e"
    ] * 2
    assert [dict(one.values) for one in told] == [{}, {}, {"value1": 20.5}]


@pytest.mark.parametrize("name", [name for name in ready() if profile_named(name).protocol == "messages"])
def test_a_long_line_of_blanks_ends_a_ready_parser_too(name: str) -> None:
    """Repeats that share their blanks took a time that grows with the cube of the line: minutes for these."""
    profile = profile_named(name)
    for body in (b" " * 3000 + b"#", b"X=" + b" " * 3000 + b"#", b"P=" + b" " * 3000 + b"#"):
        assert not Parser(profile).read(FramedMessage(body, body)).values
    if profile.identify is not None:
        heard = Introduction(profile.identify)
        for line in ("PTB330 / 1", "PTU300 / 1", *[" " * 30] * 100):
            heard.hear(FramedMessage(line.encode(), line.encode()))
        assert heard.found is None


@pytest.mark.parametrize("name", [name for name in ready() if profile_named(name).protocol == "messages"])
@given(
    data=st.one_of(
        st.binary(max_size=200), st.text("0123456789.+-eETCRHP=*?, \r\n\x02\x15", max_size=80).map(str.encode)
    )
)
def test_no_input_stops_a_ready_parser_and_what_it_understands_is_finite(name: str, data: bytes) -> None:
    profile = profile_named(name)
    parser, framer = Parser(profile), Framer(profile.frame)
    for message in framer.feed(data):
        for asked in range(max(len(profile.send.poll), 1)):
            found = parser.read(message, asked)
            assert all(abs(value) < float("inf") for value in found.values.values())
            assert set(found.values) <= profile.named()
