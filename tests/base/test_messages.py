"""A message is its English text and what it was made of; every pattern of the package is a literal that fits its arguments."""

from __future__ import annotations

import ast
import copy
import datetime as dt
import math
import pickle
import string
from collections.abc import Collection
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from cmm_uq.base.languages.translation import translated
from cmm_uq.base.messages import (
    NOTHING,
    Day,
    Message,
    Number,
    Plural,
    Text,
    Verbatim,
    after,
    commas,
    day,
    foreign,
    listed,
    number,
    plural,
    say,
    semicolons,
    sentences,
    signed,
)
from cmm_uq.base.units import unit
from cmm_uq.machine.physics.effect import BLANKS
from tests.conftest import ROOT
from tests.sources import calls_of

WORDS = [say("scale"), say("squareness"), say("pitch"), say("roll")]


def test_a_message_is_its_english_text_and_keeps_pattern_and_arguments() -> None:
    said = say("U = {U:.2g} µm of {what}", U=1.234, what=Verbatim("ball {7}"))
    assert said == "U = 1.2 µm of ball {7}"
    assert said.pattern == "U = {U:.2g} µm of {what}"
    assert said.arguments == {"U": 1.234, "what": "ball {7}"}


def test_the_first_letter_of_an_argument_alone_changes_its_size() -> None:
    assert say("{why:capital}.", why=say("the readings of Z")) == "The readings of Z."
    assert say("a {what:small}", what=say("Step gauge of DEA")) == "a step gauge of DEA"
    assert say("{why:capital}", why=NOTHING) == ""


@pytest.mark.parametrize("through", [lambda x: pickle.loads(pickle.dumps(x)), copy.copy, copy.deepcopy, str])
@pytest.mark.parametrize("text", [
    say("{n} of {all}", n=2, all=say("{count} lengths", count=number(3.14159, ".2f"))), number(2.5, "g"),
    plural(2, one=say("{n} length", n=2), many=say("{n} lengths", n=2)), day(dt.date(2026, 1, 2)), Verbatim("x"), unit("µm"),
])  # fmt: skip
def test_every_sort_of_text_survives_pickling_copying_and_str(text: Text, through: object) -> None:
    again = through(text)  # type: ignore[operator]
    assert (again, type(again), repr(again)) == (text, type(text), repr(text))
    for name in ("pattern", "arguments", "number", "one", "many", "dsi", "si"):
        assert getattr(again, name, None) == getattr(text, name, None)


@pytest.mark.parametrize(("count", "said"), [(0, "0 lengths"), (1, "1 length"), (2, "2 lengths")])
def test_a_plural_is_the_form_of_its_count_and_keeps_both(count: int, said: str) -> None:
    text = plural(count, one=say("{n} length", n=count), many=say("{n} lengths", n=count))
    assert text == said
    assert isinstance(text, Plural)
    assert (text.number, text.one.pattern, text.many.pattern) == (count, "{n} length", "{n} lengths")


def test_texts_are_joined_as_messages() -> None:
    assert listed(WORDS) == "scale, squareness, pitch and roll"
    assert listed(WORDS[:2]) == "scale and squareness"
    assert listed(WORDS[:1]) is WORDS[0]
    assert commas(WORDS) == "scale, squareness, pitch, roll"
    assert semicolons(WORDS) == "scale; squareness; pitch; roll"
    assert sentences([say("One."), say("Two.")]) == "One. Two."
    assert after(say("One."), NOTHING) == "One."
    assert listed([]) == commas([]) == ""
    assert isinstance(listed(WORDS), Message)


@given(st.lists(st.text(), max_size=60))
def test_a_long_list_reads_as_str_join_would_write_it_and_nests_no_deeper_than_its_logarithm(words: list[str]) -> None:
    joined = commas(Verbatim(word) for word in words)
    assert joined == ", ".join(words)
    assert depth(joined) <= 7


def depth(text: object) -> int:
    return 1 + max(map(depth, text.arguments.values()), default=0) if isinstance(text, Message) else 0


def test_a_number_and_a_day_are_printed_as_before() -> None:
    assert (number(-1.5, ".2f"), signed(-1.5, ".2f")) == ("-1.50", "−1.50")
    assert isinstance(signed(2.0, "g"), Number)
    assert day(dt.date(2004, 6, 1)) == "2004-06-01"
    assert isinstance(day(dt.date(2004, 6, 1)), Day)


@pytest.mark.parametrize(("value", "spec", "shown"), [
    (99.6, ".2g", "100"), (1170.0, ".3g", "1170"), (1e-5, ".1g", "1e-05"), (1.5e4, ".2e", "1.50e+04"), (-0.004, ".2f", "0.00"),
    (-0.0, "g", "0"), (-0.01, "+.1f", "0.0"), (-math.inf, ".2f", "-inf"), (-10.0, ".0f", "-10"),
])  # fmt: skip
def test_no_power_of_ten_is_printed_where_digits_do_and_no_zero_is_negative(
    value: float, spec: str, shown: str
) -> None:
    """In a table, and within a sentence of any language."""
    assert number(value, spec) == signed(value, spec).replace("−", "-") == shown
    within = Message(f"{{x:{spec}}}", {"x": value})
    assert within == shown
    assert translated(within, "de") == shown.replace(".", ",")
    assert say("{x}", x=Verbatim("-0")) == "-0"


def test_words_of_another_package_stay_a_message_or_stand_as_they_are() -> None:
    assert foreign(WORDS[0]) is WORDS[0]
    assert isinstance(foreign("Twist of the beam"), Verbatim)


def sayings(path: Path) -> list[ast.Call]:
    """Calls of the ``say`` of messages; the command line has one of its own, that prints."""
    if "cli" in path.parts:
        return []
    return [call for call in calls_of(path) if isinstance(call.func, ast.Name) and call.func.id == "say"]


def wrong(call: ast.Call, blanks: Collection[str] = ()) -> str:
    """What is wrong with a call of ``say``: no literal pattern, or placeholders that are neither keywords nor blanks."""
    first = call.args[0] if len(call.args) == 1 else None
    if not (isinstance(first, ast.Constant) and isinstance(first.value, str)):
        return "no literal"
    placeholders = {name for _, name, _, _ in string.Formatter().parse(first.value) if name is not None}
    keywords = {keyword.arg for keyword in call.keywords}
    fit = keywords <= placeholders <= {*keywords, *blanks}
    return "" if fit else f"{placeholders} in the pattern, {keywords} given"


def blanks_in(path: Path) -> Collection[str]:
    """What words of effects may leave open, to be filled in when they are said."""
    return BLANKS if path.parent.name == "effects" else ()


def test_every_pattern_is_a_literal_whose_placeholders_are_the_arguments() -> None:
    calls = [(path, call) for path in sorted((ROOT / "cmm_uq").rglob("*.py")) for call in sayings(path)]
    assert not {f"{path}:{call.lineno}": fault for path, call in calls if (fault := wrong(call, blanks_in(path)))}


@pytest.mark.parametrize(
    "source", ['say(f"{a} lengths")', "say(words)", 'say("{a} lengths")', 'say("lengths", a=1)', "say()"]
)
def test_a_pattern_that_no_catalogue_could_hold_would_be_found(source: str) -> None:
    (call,) = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call)]
    assert wrong(call)
