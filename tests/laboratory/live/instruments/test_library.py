"""A profile drafted from an example line reads that line, and lines like it."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.live.instruments.library import ProfileDraft, drafted, numbers_in, profile_of
from cmm_uq.laboratory.live.instruments.parsing import Framer, Parser
from cmm_uq.laboratory.live.instruments.profile import ProfileFile


def profile(line: str, quantities: dict[int, str], **keys: object) -> ProfileFile:
    wanted = ProfileDraft("a", "A", line, quantities, keys.pop("ranges", {}), **keys)  # type: ignore[arg-type]
    return profile_of(drafted(wanted), Path("a.toml"))


def read(made: ProfileFile, data: bytes) -> dict[str, float]:
    (message,) = Framer(made.frame).feed(data)
    return dict(Parser(made).read(message).values)


def test_a_line_like_the_example_is_read() -> None:
    made = profile("CH1= 20.13 C; CH2= 20.15 C<CR><LF>", {1: "temp1_c", 2: "temp2_c"}, ranges={"temp1_c": (0, 40)})
    assert read(made, b"CH1=  9.8 C; CH2=-1 C\r\n") == {"temp1_c": 9.8, "temp2_c": -1.0}
    assert read(made, b"CH1= 99 C; CH2= 1 C\r\n") == {"temp2_c": 1.0}


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
