"""Numbers, dates and plurals as each language writes them: read back, they are what they were."""

from __future__ import annotations

import datetime as dt
import re

import pytest
from babel import Locale
from babel.dates import format_date
from babel.numbers import parse_decimal
from hypothesis import given
from hypothesis import strategies as st

from cmm_uq.base.languages.translation import LANGUAGES, Code, code_of, translated
from cmm_uq.base.messages import day, number, signed

CODES: list[Code] = ["en", "de", "fr", "ja"]
SPECS = st.sampled_from(["", "g", ".3g", ".1f", ".4f", ".2e", ".10g"])


@pytest.mark.parametrize("code", CODES)
@given(st.floats(allow_nan=False, allow_infinity=False), SPECS)
def test_a_number_reads_back_the_same_in_every_language(code: Code, value: float, spec: str) -> None:
    english, said = number(value, spec), translated(number(value, spec), code)
    mantissa, *power = said.split("e")
    assert float(parse_decimal(mantissa, locale=code)) == float(english.split("e")[0])
    assert power == english.split("e")[1:]


@given(st.floats(-1e6, 1e6))
def test_the_minus_of_print_and_all_other_signs_stay(value: float) -> None:
    said = translated(signed(value, ".3f"), "de")
    assert said.replace(",", ".") == signed(value, ".3f")


@pytest.mark.parametrize(("english", "german"), [
    ("1.20×10⁻⁶", "1,20×10⁻⁶"), ("10⁻⁶", "10⁻⁶"), ("[0.1]", "[0,1]"), ("1.5e-3", "1,5e-3"), (".", "."), ("3.", "3."),
    ("<0.01 %", "<0,01 %"),
])  # fmt: skip
def test_only_a_point_between_digits_is_a_decimal_sign(english: str, german: str) -> None:
    assert LANGUAGES["de"].number(english) == german
    assert LANGUAGES["ja"].number(english) == english


@pytest.mark.parametrize(("code", "pattern"), [("de", "dd.MM.y"), ("fr", "dd/MM/y"), ("ja", "y年M月d日")])
@given(date=st.dates(dt.date(1900, 1, 1), dt.date(2199, 12, 31)))
def test_a_date_is_what_babel_makes_of_it(code: Code, pattern: str, date: dt.date) -> None:
    assert translated(day(date), code) == format_date(date, pattern, locale=code)
    assert [int(part) for part in re.findall(r"\d+", translated(day(date), "ja"))] == [date.year, date.month, date.day]


@pytest.mark.parametrize("code", CODES)
@given(st.integers(0, 10_000))
def test_the_singular_is_that_of_unicode_s_plural_rules(code: Code, count: int) -> None:
    singular = LANGUAGES[code].singular
    assert (singular is not None and singular(count)) == (Locale(code).plural_form(count) == "one")


@pytest.mark.parametrize(
    ("tag", "code"), [("de-AT", "de"), ("en", "en"), ("FR", "fr"), ("ja", "ja"), ("it", "en"), ("", "en")]
)
def test_a_tag_names_its_language(tag: str, code: Code) -> None:
    assert code_of(tag) == code
