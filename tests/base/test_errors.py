"""A refusal is one line that a terminal shows as it is written, whatever the input holds."""

from __future__ import annotations

import math
import unicodedata
import warnings

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy import linalg

from cmm_uq.base.errors import LONGEST_MESSAGE, CmmUqError, Gathered, printable, shortened, suggestion
from cmm_uq.base.overflow import must_be_finite, refusing_overflow
from cmm_uq.machine.physics.catalogue import EVERY

ANY = st.text(st.characters(), max_size=2000)
VISIBLE = st.text(st.characters(categories=["L", "N", "P", "S"]), max_size=80)


@given(ANY, st.none() | ANY, st.none() | ANY)
def test_a_message_is_one_printable_line_of_limited_length(problem: str, where: str | None, fix: str | None) -> None:
    message = str(CmmUqError(problem, where=where, fix=fix))
    assert len(message) <= LONGEST_MESSAGE
    assert len(message.splitlines()) <= 1
    assert not any(unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp") for c in message)
    message.encode("utf-8")


@given(VISIBLE, VISIBLE, VISIBLE)
def test_a_short_message_is_put_together_to_the_letter(problem: str, where: str, fix: str) -> None:
    expected = (f"{where}: " if where else "") + problem + (f". {fix}" if fix else "")
    assert str(CmmUqError(problem, where=where, fix=fix)) == expected


def test_file_line_and_key_survive_every_shortening() -> None:
    where = f"/data/{'deep/' * 1000}job.toml line 12: [recording] u_coordinate_um"
    message = str(CmmUqError("x" * 100_000, where=where, fix="y" * 100_000))
    assert "/job.toml line 12: [recording] u_coordinate_um: x" in message
    assert message.startswith("/data/")
    assert message.count("…") == 3
    assert message.endswith("y")


def test_breaks_steering_and_reversed_text_are_written_as_escapes() -> None:
    assert printable("a\nb\x1b[31m\u202ec\u2028d\ud800 µ″") == r"a\nb\x1b[31m\u202ec\u2028d\ud800 µ″"


def test_a_short_part_keeps_its_whole_length_beside_a_long_one() -> None:
    message = str(CmmUqError("p" * 1000, where="ballbar.csv line 3", fix="Mend it"))
    assert len(message) == LONGEST_MESSAGE
    assert message.startswith("ballbar.csv line 3: p")
    assert message.endswith("p. Mend it")


@given(st.text(max_size=300), st.integers(2, 100))
def test_shortening_keeps_both_ends(text: str, most: int) -> None:
    short = shortened(text, most)
    assert len(short) == min(len(text), most)
    if len(text) > most:
        head, tail = short.split("…")[0] if "…" not in text else short[: most // 2 - 1], short[-1] if most > 3 else ""
        assert text.startswith(head)
        assert text.endswith(tail if tail != "…" else "")


def test_a_list_of_known_names_never_exceeds_what_fits() -> None:
    names = [f"effect_number_{i:03d}" for i in range(500)]
    answer = suggestion("zzz", names)
    assert len(answer) < 250
    listed, _, more = answer.removeprefix("Known: ").rpartition(" and ")
    assert len(listed.split(", ")) + int(more.split()[0]) == 500
    assert set(listed.split(", ")) < set(names)


def test_short_lists_and_near_names_are_told_as_before() -> None:
    assert suggestion("zzz", ["b", "a"]) == "Known: a, b"
    assert suggestion("lenght_mm", ["length_mm", "u_um"]) == "Did you mean 'length_mm'?"
    assert suggestion("ISO 10360-2", ["ISO 10360-12:2016", "ISO 10360-2:2009"]) == "Did you mean 'ISO 10360-2:2009'?"
    assert suggestion("k" * 100_000, ["length_mm"]) == "Known: length_mm"


def test_a_name_without_its_axis_is_answered_with_all_that_have_one() -> None:
    assert suggestion("scale", EVERY) == "Did you mean 'scale_x', 'scale_y', 'scale_z'?"
    assert suggestion("squareness", EVERY) == "Did you mean 'squareness_xy', 'squareness_yz', 'squareness_zx'?"
    assert suggestion("rotation", EVERY).count("rotation_") == 9
    assert suggestion("scale_xx", EVERY) == "Did you mean 'scale_x'?"


def test_the_first_of_several_problems_is_raised_with_the_others_in_it() -> None:
    wrong = Gathered()
    wrong.refuse()  # nothing is wrong yet
    with wrong.going_on():
        inner = Gathered()
        inner.add(CmmUqError("one"))
        inner.add(CmmUqError("two"))
        inner.refuse()
    with wrong.going_on():
        raise CmmUqError("three")
    with pytest.raises(CmmUqError, match="one") as told:
        wrong.refuse()
    assert [str(error) for error in told.value.also] == ["two", "three"]


def overflowing() -> None:
    math.exp(1000.0)


def warned_and_overflowing() -> None:
    warnings.warn("overflow encountered", RuntimeWarning, stacklevel=1)
    overflowing()


def divided() -> None:
    _ = 1.0 / math.ldexp(0.0, 1)


def singular() -> None:
    np.linalg.inv(np.zeros((2, 2)))


def not_finite() -> None:
    linalg.svd(np.full((2, 2), np.inf))


@pytest.mark.parametrize("computation", [overflowing, divided, singular, not_finite])
def test_an_overflow_is_an_error_of_the_input(computation) -> None:
    says = r"bar\.csv: the figures leave the range of numbers.*Mend it"
    with pytest.raises(CmmUqError, match=says), refusing_overflow("bar.csv", "Mend it"):
        computation()


def test_warnings_are_dropped_with_a_refusal_and_kept_with_a_result() -> None:
    with warnings.catch_warnings(record=True) as shown:
        warnings.simplefilter("always")
        with pytest.raises(CmmUqError), refusing_overflow("a", "b"):
            warned_and_overflowing()
        assert not shown
        with refusing_overflow("a", "b"):
            warnings.warn("worth knowing", RuntimeWarning, stacklevel=1)
    assert [str(w.message) for w in shown] == ["worth knowing"]


def test_other_errors_pass() -> None:
    with pytest.raises(ValueError, match="of the program"), refusing_overflow("a", "b"):
        raise ValueError("of the program")


@pytest.mark.parametrize("figure", [math.nan, math.inf, -math.inf])
def test_a_figure_that_is_not_finite_is_no_result(figure: float) -> None:
    must_be_finite([1.0, 0.0], "a", "b")
    with pytest.raises(CmmUqError):
        must_be_finite([1.0, figure], "a", "b")
