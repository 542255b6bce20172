"""Messages are the same however the bytes were cut on their way, no byte is lost, and no input stops a parser."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cmm_uq.laboratory.live.instruments.library import profile_named, ready
from cmm_uq.laboratory.live.instruments.parsing import Framer, Parser
from cmm_uq.laboratory.live.instruments.profile import MessageFrame

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
    ][:2]  # fmt: skip


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
