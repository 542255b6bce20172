"""Numbers, dates and plurals as each language writes them: read back, they are what they were.

A message is said in a language with all that stands in it; units and verbatim words are the same in all.
"""

from __future__ import annotations

import datetime as dt
import pickle
import re
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from babel import Locale
from babel.dates import format_date
from babel.numbers import parse_decimal
from hypothesis import given, strategies as st

from cmm_uq.base.languages import translation as catalogues
from cmm_uq.base.languages.translation import LANGUAGES, Catalogue, Code, Translation, catalogue, code_of, translated
from cmm_uq.base.messages import (
    NOTHING,
    Message,
    Text,
    Verbatim,
    commas,
    day,
    in_a_row,
    lines,
    number,
    plural,
    say,
    sentences,
    signed,
)
from cmm_uq.base.units import unit
from cmm_uq.certificate.wording import probability

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


OWN = """\
msgid ""
msgstr "Content-Type: text/plain; charset=utf-8\\n"

msgid "Length {length:.2f} {unit} on {day}"
msgstr "Am {day}: {length:.2f} {unit} Länge"

msgid "{what:capital}."
msgstr "{what:capital}."

msgid "If it is {what:small}."
msgstr "Falls: {what}."

msgid "error"
msgstr "abweichung"

msgid "Error"
msgstr "Abweichung"

msgid "one length"
msgid_plural "{count} lengths"
msgstr[0] "eine Länge"
msgstr[1] "{count} Längen"

#, fuzzy
msgid "guessed"
msgstr "geraten"

msgid "{before}, {after}"
msgstr "{before}, {after}"

msgid "[{low}, {high}]"
msgstr "[{low}, {high}]"
"""


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Catalogue]:
    """A small catalogue in place of each of the languages'."""
    (tmp_path / "own.po").write_text(OWN, encoding="utf-8")
    monkeypatch.setattr(catalogues, "file_of", lambda code: tmp_path / "own.po")
    catalogue.cache_clear()
    yield catalogue("de")
    catalogue.cache_clear()


def lengths(count: int) -> Text:
    return plural(count, one=say("one length"), many=say("{count} lengths", count=count))


@pytest.mark.usefixtures("own")
def test_a_message_is_said_with_numbers_dates_and_units() -> None:
    text = say("Length {length:.2f} {unit} on {day}", length=-1234.5, unit=unit("µm"), day=day(dt.date(2026, 11, 2)))
    assert translated(text, "de") == "Am 02.11.2026: -1234,50 µm Länge"
    assert translated(text, "ja") == "Am 2026年11月2日: -1234.50 µm Länge"
    assert translated(text, "en") is text


@pytest.mark.usefixtures("own")
def test_capitals_are_those_of_the_said_word() -> None:
    assert translated(say("{what:capital}.", what=say("error")), "de") == "Abweichung."
    assert translated(say("{what:capital}.", what=say("error")), "ja") == "abweichung."
    assert translated(say("If it is {what:small}.", what=say("Error")), "de") == "Falls: Abweichung."


@pytest.mark.usefixtures("own")
def test_a_form_that_says_one_in_words_is_for_one_alone() -> None:
    """French has the singular of 0, but "eine Länge" is one length."""
    assert [translated(lengths(count), "fr") for count in (0, 1, 2)] == ["0 Längen", "eine Länge", "2 Längen"]
    assert [translated(lengths(count), "de") for count in (0, 1, 2)] == ["0 Längen", "eine Länge", "2 Längen"]


@pytest.mark.usefixtures("own")
def test_what_the_catalogue_lacks_or_only_guesses_stays_english_with_its_numbers() -> None:
    assert translated(say("{x:.1f} somewhere", x=0.5), "de") == "0,5 somewhere"
    assert translated(say("guessed"), "de") == "guessed"


@pytest.mark.usefixtures("own")
def test_figures_with_decimal_commas_are_parted_by_semicolons() -> None:
    figures = commas([number(1.5), number(2), number(-0.25)])
    assert translated(figures, "de") == "1,5; 2; -0,25"
    assert translated(figures, "fr") == "1,5\u202f; 2\u202f; -0,25"
    assert translated(figures, "ja") == "1.5, 2, -0.25"
    assert translated(commas([number(1), number(2)]), "de") == "1, 2"
    assert translated(commas([say("error"), number(2.5)]), "de") == "abweichung, 2,5"
    assert translated(say("[{low}, {high}]", low=number(0.5), high=number(1.5)), "de") == "[0,5; 1,5]"


@pytest.mark.usefixtures("own")
def test_verbatim_words_units_and_nothing_are_themselves() -> None:
    for text in (Verbatim("1.5 error"), unit("µm"), NOTHING):
        assert translated(text, "de") is text


@pytest.mark.usefixtures("own")
def test_what_was_said_keeps_its_source_is_not_said_again_and_survives_pickling() -> None:
    said = translated(say("error"), "de")
    assert isinstance(said, Translation)
    assert isinstance(said.source, Message)
    assert translated(said, "fr") is said
    assert pickle.loads(pickle.dumps(said)).source == "error"


def test_japanese_sentences_follow_each_other_without_a_space() -> None:
    text = translated(sentences([say("Warning"), say("Warnings")]), "ja")
    assert " " not in text
    assert translated(lines([say("Warning"), say("Warnings")]), "ja").count("\n") == 1


@pytest.mark.parametrize(("code", "said"), [
    ("en", "250, 0.5, −40"), ("de", "250; 0,5; −40"), ("fr", "250\u202f; 0,5\u202f; −40"), ("ja", "250, 0.5, −40"),
])  # fmt: skip
def test_figures_in_a_row_are_parted_by_one_sign_whether_they_have_decimals_or_not(code: Code, said: str) -> None:
    """And not by the comma of words, which in Japanese is another."""
    figures = in_a_row([number(250, "g"), number(0.5, "g"), signed(-40, "g")])
    assert translated(figures, code) == said


def test_a_probability_that_is_hardly_0_or_1_has_the_decimal_sign_of_the_language() -> None:
    assert translated(probability(1e-6), "de") == "<\u00a00,01\u00a0%"
    assert translated(probability(1 - 1e-6), "fr") == ">\u00a099,99\u00a0%"


@pytest.mark.parametrize("code", ["de", "fr", "ja"])
def test_a_catalogue_is_read_in_a_tenth_of_a_second(code: Code) -> None:
    best = 1.0
    for _ in range(3):
        catalogue.cache_clear()
        begun = time.process_time()
        catalogue(code)
        best = min(best, time.process_time() - begun)
    assert best < 0.1


def test_english_reads_no_catalogue() -> None:
    catalogue.cache_clear()
    assert translated(say("Warning"), "en") == "Warning"
    assert catalogue.cache_info().currsize == 0


def test_a_long_certificate_is_said_in_a_tenth_of_a_second() -> None:
    text = sentences([say("Length {length:.2f} {unit} on {day}", length=x, unit=unit("µm"), day=day(dt.date(2026, 1, 2)))
                      for x in range(2000)])  # fmt: skip
    catalogue("de")
    begun = time.process_time()
    translated(text, "de")
    assert time.process_time() - begun < 0.1
